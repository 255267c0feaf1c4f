"""Controllers' own programs as they would run: moves and commands of their files, with the joints that they lead to.

A file says one thing only, joints or frames. So it is held against the neutral program that was written with it, where
there is one; without that, what it does is checked, and not whether it is what the tool path asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from machining.cell import Cell
from machining.cell.schema import CommandsTable
from machining.programs.actions import ON_OFF, Action, run_up
from machining.programs.controller import Controller
from machining.programs.convention import Convention
from machining.programs.job import Kind
from machining.programs.program import REPLAYED, Fault, JointProgram, tool_in_part
from machining.programs.read_back import ReadMoves, collected
from machining.programs.write_options import WriteOptions
from machining.toolpaths.motions import Event, Motions, Tool
from robots import InputError, Robot, inverse_kinematics
from robots.arrays import Array, Bools, Integers
from robots.constants import MM, RPM
from robots.frames import framed
from robots.inverse.spherical_wrist import why_not_spherical

# Share of the rapid speed within which a move is a rapid one, and what a program may be off its neutral twin, m, rad.
SAME_SPEED, SAME_PLACE = 1e-4, 1e-6
# Motion of the tip (m) below this is rounding.
STILL = 1e-9
# Digits of a degree to which an angle is on the border between two words of a configuration.
BORDER_DIGITS = 6
# Turns of a joint that the words of a configuration are tried with.
TURNS = np.array([0.0, -1.0, 1.0]) * 2.0 * np.pi


def replayed(
    language: Controller, files: Mapping[str, str], robot: Robot, cell: Cell, options: WriteOptions, source: str
) -> JointProgram:
    """A controller's program, main file first, for the robot, cell and options that it was written for.

    Rapid moves are those at the options' rapid speed, and joint moves of programs that have straight ones too. Where
    the cell says how a start of the spindle is waited for, ``faults`` has the starts that are not.

    Raises
    ------
    InputError
        What the readers refuse; other axes than the cell has; a frame that no posture of that configuration reaches.
    """
    found = collected(language.read(files, cell, options))
    axes = len(cell.linear_axes) + (cell.turntable is not None)
    if found.external.shape[1] != axes:
        raise InputError(
            f"{source}, external axes", code="Q005", value=found.external.shape[1], allowed=f"{axes}, as the cell has"
        )
    convention, n = language.convention(robot, axes, options), len(found.words)
    external, k = convention.external_back(found.external), len(cell.linear_axes)
    travel = external[:, :k] * MM
    table = np.radians(external[:, k]) if cell.turntable is not None else np.zeros(n)
    tool, tools = _tools(found, cell)
    by_tool = np.stack([one.T_flange_tool for one in (cell.tools or (cell.tool,))])[tool]
    T_flange_tool = by_tool if len(cell.tools) > 1 else by_tool[0]
    if found.kind == "joint":
        q = convention.radians(found.words)
        T = tool_in_part(robot, cell, q, travel, table, T_flange_tool)
    else:
        T = framed(language.orientation.read(found.words[:, 3:]), found.words[:, :3] * MM)
        q = _joints(language, found, robot, cell.T_base_part(travel, table) @ T, T_flange_tool, convention)
    way = np.append(0.0, np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.where(np.isfinite(found.speed), found.speed, way / found.duration)
    # A move in which the tool stands has no speed of its own.
    speed = np.where(way > STILL, speed, np.nan)
    rapid = np.abs(speed / (options.rapid_mm_s * MM) - 1.0) < SAME_SPEED
    rapid |= ~np.isfinite(speed) | (found.joint & ~found.joint.all())
    rapid[:1] = True
    events, spindle = _events(found, cell.commands, tools)
    zeros = np.zeros(n, dtype=np.int64)
    motions = Motions(
        np.ascontiguousarray(T[:, :3, 3]),
        -T[:, :3, 2],
        rapid,
        np.where(rapid, np.nan, speed),
        np.arange(1, n + 1),
        tool,
        spindle,
        np.zeros(n),
        zeros,
        tools=tools,
        events=events,
        source=source,
    )
    faults = tuple(
        Fault(move, "a cut begins and nothing waits for the spindle's speed")
        for move in _not_waited(found.actions, cell.commands, motions.cutting)
    )
    return JointProgram(
        robot, cell, motions, T, q, travel, table, np.zeros(n), zeros, (REPLAYED,), zeros > 0, faults=faults
    )


def held_against(
    program: JointProgram, written: JointProgram, language: Controller, files: Mapping[str, str], options: WriteOptions
) -> JointProgram:
    """The neutral program ``written`` with the joints of the controller's, and what differs first as a fault.

    Raises
    ------
    InputError
        Another number of moves.
    """
    if program.n != written.n:
        raise InputError(
            f"{program.motions.source} beside {written.motions.source}",
            code="Q005",
            value=f"{program.n} moves",
            allowed=f"{written.n}, as in the neutral program",
            remedy="give the neutral program of the same run",
        )
    found = collected(language.read(files, written.cell, options))
    kind: Kind = "joint" if found.kind == "joint" else "cartesian"
    wrong = language.round_trip(written, files, kind, options).difference(SAME_PLACE)
    faults = program.faults
    if wrong is not None:
        away = np.linalg.norm(program.T_part_tool[:, :3, 3] - written.T_part_tool[:, :3, 3], axis=1)
        move = int(np.argmax(away)) if "command" not in wrong.what else _move_of(wrong.what, found.where)
        said = f"{wrong.what}: {wrong.value}; allowed: {wrong.allowed}"
        faults = (
            *faults,
            Fault(move, f"differs from the neutral program: {said}", place=bool(away[move] > SAME_PLACE)),
        )
    return replace(
        written, q=program.q, travel=program.travel, table=program.table, file_lines=program.file_lines, faults=faults
    )


def _tools(found: ReadMoves, cell: Cell) -> tuple[Integers, tuple[Tool, ...]]:
    """Index (n,) into the cell's tools, and these as a tool path names them; changes are those that are called."""
    if not cell.tools:
        return np.zeros(len(found.words), dtype=np.int64), (Tool(),)
    numbers = [str(tool.number) for tool in cell.tools]
    out = np.zeros(len(found.words), dtype=np.int64)
    for move, action in found.actions:
        change = action.kind == "tool" or (action.kind == "call" and action.name == cell.commands.tool_change)
        if change and action.value not in numbers:
            raise InputError("tool of a program", code="Q005", value=action.value, allowed=", ".join(numbers))
        if change:
            out[move:] = numbers.index(action.value)
    return out, tuple(Tool(tool.number, tool.name) for tool in cell.tools)


def _joints(
    language: Controller,
    found: ReadMoves,
    robot: Robot,
    T_base_tool: Array,
    T_flange_tool: Array,
    convention: Convention,
) -> Array:
    """Joint angles (n, dof) rad of frames: the configuration says them at joint moves, between them the nearest are."""
    why = why_not_spherical(robot)
    if why is not None:
        raise InputError(
            f"frames of {robot.name}: {why}",
            code="Q005",
            allowed="its joint program",
            remedy="verify the joint program",
        )
    solved, out = inverse_kinematics(robot, T_base_tool, T_flange_tool=T_flange_tool), []
    before = np.zeros(robot.dof) if robot.limits is None else robot.limits.mean(axis=1)
    for i, said in enumerate(found.configuration):
        # Limits are for a verification to find.
        candidates = solved.q[i][np.isfinite(solved.q[i]).all(axis=1)]
        candidates = candidates - 2.0 * np.pi * np.round((candidates - before) / (2.0 * np.pi))
        if found.joint[i] and len(said):
            turned = (candidates[:, None] + _every_turn(robot.dof)).reshape(-1, robot.dof)
            candidates = turned[_configured(language, robot, turned, convention.controller_deg(turned), said)]
        if not len(candidates):
            raise InputError(
                f"{found.where[i]}: frame",
                code="Q005",
                value=", ".join(map(str, said)) or "no configuration",
                allowed="one that the arm reaches in that configuration",
            )
        before = candidates[int(np.argmin(np.abs(candidates - before).max(axis=1)))]
        out.append(before)
    return np.array(out)


def _configured(language: Controller, robot: Robot, q: Array, deg: Array, said: Sequence[object]) -> Bools:
    """Postures (k,) of a configuration; an angle on the border between two of its words has either."""
    wanted, out = list(map(str, said)), np.zeros(len(q), dtype=np.bool_)
    even = np.round(deg, BORDER_DIGITS) + 0.0
    for near in (deg, even, even - 10.0**-BORDER_DIGITS, even + 10.0**-BORDER_DIGITS):
        words = language.configuration(robot, q, near)
        out |= np.array(
            [words is None or list(map(str, row)) == wanted for row in (q if words is None else words).tolist()],
            dtype=np.bool_,
        )
    return out


def _every_turn(dof: int) -> Array:
    """Whole turns (k, dof) rad of the axes that can have more than one: 1, 4 and 6."""
    turns = np.stack(np.meshgrid(TURNS, TURNS, TURNS), axis=-1).reshape(-1, 3)
    out = np.zeros((len(turns), dof))
    out[:, [0, 3, dof - 1]] = turns
    return out


def _events(found: ReadMoves, table: CommandsTable, tools: Sequence[Tool]) -> tuple[tuple[Event, ...], Array]:
    """Commands of a program as events, and the spindle's speed (n,) rad/s at its moves."""
    out, spindle = [], np.zeros(len(found.words))
    speed, numbers = np.nan, [str(tool.number) for tool in tools]
    ways = {str(table.spindle_clockwise): 1.0, str(table.spindle_counterclockwise): -1.0}
    turning: dict[str, float] = {}

    def add(move: int, kind: str, value: float = np.nan, text: str = "") -> None:
        out.append(Event(min(move + 1, len(found.words)), move, "", text, kind, value))

    for move, action in found.actions:
        if action.kind == "analog" and action.name == str(table.spindle_speed):
            speed = float(action.value)
        elif action.kind == "spindle" or (action.kind == "output" and action.name in ways):
            name = action.name if action.kind == "output" else "master"
            sense = ways.get(name, -1.0 if action.name == "ccw" else 1.0)
            on = action.on if action.kind == "output" else action.name != "off"
            turning = {name: sense} if on else {key: way for key, way in turning.items() if key != name}
            way = next(iter(turning.values()), 0.0)
            rpm = float(action.value) if action.kind == "spindle" and action.value else _rpm(speed, table)
            value = way * rpm * RPM if way else 0.0
            add(move, "spindle", value, "" if np.isfinite(value) else "CLW" if way > 0.0 else "CCLW")
            spindle[move:] = value
        elif action.kind in ON_OFF and action.name in (named := _coolants(table)):
            add(move, "coolant", text=named[action.name] if action.on else "off")
        elif action.kind in ("tool", "call") and action.value in numbers:
            add(move, "tool", float(numbers.index(action.value)))
    return tuple(out), spindle


def _rpm(value: float, table: CommandsTable) -> float:
    """Speed of an analog output: a share of full scale, or the speed itself where it is above 1."""
    return value * table.spindle_full_rpm if table.spindle_full_rpm is not None and value <= 1.0 else value


def _coolants(table: CommandsTable) -> dict[str, str]:
    named = {kind: getattr(table, f"coolant_{kind}") for kind in ("flood", "mist", "through")}
    return {"flood": "flood", "mist": "mist"} | {str(name): kind for kind, name in named.items() if name is not None}


def _not_waited(actions: Sequence[tuple[int, Action]], table: CommandsTable, cutting: Bools) -> list[int]:
    """Moves at feed before which the spindle was started and nothing waits for it, as the cell says it must."""
    wanted, out, started = run_up(table), [], -1
    starts = {str(table.spindle_clockwise), str(table.spindle_counterclockwise)}
    for move, action in (*actions, (len(cutting), Action("end"))):
        cut = np.flatnonzero(cutting[started:move]) if started >= 0 else cutting[:0]
        if len(cut):
            out.append(started + int(cut[0]))
            started = -1
        by_output = action.kind == "output" and action.on and action.name in starts
        if by_output or (action.kind == "spindle" and action.name != "off"):
            started = move
        if any(action.kind == one.kind and (action.same(one) or _longer(action, one)) for one in wanted):
            started = -1
    return out if wanted else []


def _longer(action: Action, wanted: Action) -> bool:
    return action.kind == "wait" and float(action.value) >= float(wanted.value)


def _move_of(what: str, where: Sequence[str]) -> int:
    """The move that a command stands before, by its place in the message; the last where it names none."""
    return next((i for i, place in enumerate(where) if what.endswith(place)), len(where) - 1)
