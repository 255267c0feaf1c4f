"""A writing job: the program with the controller's angles, frames and axes, and what else it is told.

That is speeds, kinds of moves and times, and what happens between moves; and moves as formatted text.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from machining.cell.cell import Tool
from machining.programs.convention import Convention
from machining.programs.happenings import NOTHING, Between, Happening
from machining.programs.program import JointProgram, frame_distance
from machining.programs.source_text import SourceText
from machining.programs.write_options import WriteOptions
from machining.tooling import tools_of
from machining.toolpaths.motions import Motions
from robots import InputError
from robots.arrays import Array, Bools
from robots.constants import MM, MM_MIN
from robots.frames import framed
from robots.kinematics import stretched_length

Kind = Literal["cartesian", "joint"]
# Shortest time of a move (s): an inverse time must stay a number that a controller reads.
SHORTEST = 1e-4
# Changes of the tip (m) and of angles (rad) below these are rounding: they give no time to a move.
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Commands:
    """For n moves: tip ``speed`` (n,) m/s, ``joint`` (n,) joint moves, ``duration`` (n,) s, NaN of the first.

    A move takes the time of its tip, or longer if the tool would turn faster than ``rotation_deg_s``. Where neither tip
    nor tool moves in the part frame, the axes take the time that those speeds give them.
    """

    speed: Array
    joint: Bools
    duration: Array


def commands(program: JointProgram, options: WriteOptions) -> Commands:
    """Speeds, kinds and times of all moves.

    Raises
    ------
    InputError
        Moves at feed without a feed, and no default.
    """
    speed = _speed(program.motions, options)
    joint = np.full(program.n, False)
    if options.rapid == "joint":
        joint |= program.motions.rapid
    # The routine of the tool changer may end anywhere; every controller finds the way to a joint target.
    joint |= program.loose
    joint[:1] = True
    return Commands(speed, joint, _durations(program, speed, np.radians(options.rotation_deg_s), options))


def _speed(motions: Motions, options: WriteOptions) -> Array:
    rapid = motions.rapid.copy()
    rapid[:1] = True
    speed = np.where(rapid, options.rapid_mm_s * MM, motions.feed)
    unknown = np.isnan(speed)
    if unknown.any():
        if options.default_feed_mm_min is None:
            first = int(motions.line[np.argmax(unknown)])
            raise InputError(
                f"feed of {int(unknown.sum())} moves, the first of source line {first}",
                code="Q007",
                allowed="known for all moves that are not rapid",
                remedy="set default_feed_mm_min in the file of --options",
            )
        speed[unknown] = options.default_feed_mm_min * MM_MIN
    return np.asarray(speed)


def _durations(program: JointProgram, speed: Array, turning: float, options: WriteOptions) -> Array:
    away, turned = frame_distance(program.T_part_tool[1:], program.T_part_tool[:-1])
    time = np.maximum(away / speed[1:], turned / turning)
    still = (away < STILL) & (turned < STILL)
    angles = np.diff(np.column_stack([program.q, program.table]), axis=0)
    axes = np.abs(angles).max(axis=1) / turning
    if program.travel.shape[1]:
        travel = np.linalg.norm(np.diff(program.travel, axis=0), axis=1)
        axes = np.maximum(axes, travel / (options.rapid_mm_s * MM))
    time = np.where(still, axes, time)
    # Joint moves far from the straight line need the time of their joints.
    time = np.where(program.at_home[1:] | program.at_home[:-1], np.maximum(time, axes), time)
    return np.concatenate([np.full(min(1, program.n), np.nan), np.maximum(time, SHORTEST)])


@dataclass(slots=True)
class Move:
    """One move as templates see it; all numbers are text already.

    ``number`` from 1; ``line`` of the source, ``new_line`` where it differs from the move before; ``rapid``;
    ``joint``: a joint move; ``stop``: no blending at its end; ``words``: coordinates; ``external``: axes beyond the
    arm; ``configuration``; ``feed``: where it changes, else None; ``before``: happenings;
    ``place``: index from 0 within arrays of data; ``tool``: name of the tool's data; ``named``: all
    coordinates with the names that the language has for them.
    """

    number: int
    place: int
    line: int
    new_line: bool
    rapid: bool
    joint: bool
    stop: bool
    words: tuple[str, ...]
    external: tuple[str, ...]
    configuration: Sequence[object]
    feed: str | None
    before: Sequence[Happening]
    tool: str
    named: str


@dataclass(frozen=True, eq=False)
class FlangeLoad:
    """A weight on the flange as a controller takes it: ``mass`` kg, ``inertia`` (3,) kg m^2 about the axes of ``T``.

    ``T`` (4, 4) m: a frame in its centre, in the controller's flange frame.
    """

    mass: float
    T: Array
    inertia: Array


@dataclass(frozen=True, eq=False)
class ToolData:
    """A tool as a controller has it: ``name``, ``load``, frame ``T`` (4, 4) m in the controller's flange frame."""

    name: str
    T: Array
    load: FlangeLoad | None = None

    @property
    def weight(self) -> str:
        """Its mass (kg), centre (mm) and moments of inertia (kg m^2) for a comment; "" where they are not known."""
        if self.load is None:
            return ""
        rows = np.round(self.load.T[:3, 3] * 1e3, 3) + 0.0, self.load.inertia
        centre, inertia = (" ".join(f"{v:.6g}" for v in row) for row in rows)
        return f"M {self.load.mass:.6g} CM {centre} J {inertia}"


# Name of a tool's data by the tool's number and its place among those used.
Naming = Callable[[int, int], str]


def tools_of_job(
    program: JointProgram, convention: Convention, options: WriteOptions, naming: Naming
) -> tuple[ToolData, ...]:
    """Of each of the path's tools its data; one for all where all have one frame, else as ``naming`` calls them.

    Tools without a move share that of the first that is used.
    """
    back, tools = np.linalg.inv(convention.T_flange), tools_of(program.cell, program.motions)
    used = np.unique(program.motions.tool).tolist()

    def data(name: str, tool: Tool) -> ToolData:
        known = tool.load
        if known is None:
            return ToolData(name, back @ tool.T_flange_tool)
        inertia = np.zeros(3) if known.inertia is None else known.inertia
        return ToolData(
            name, back @ tool.T_flange_tool, FlangeLoad(known.mass, back @ framed(np.eye(3), known.centre), inertia)
        )

    if len({id(tools[i]) for i in used}) == 1:
        return (data(options.tool_name, tools[used[0]]),) * len(tools)
    made: dict[int, ToolData] = {}
    for place, i in enumerate(used):
        number, name = program.motions.tools[i].number, ""
        name = naming(i + 1 if number is None else number, place)
        taken = name in [one.name for one in made.values()]
        made[i] = data(f"{name}_{i + 1}" if taken else name, tools[i])
    return tuple(made.get(i, made[used[0]]) for i in range(len(tools)))


@dataclass(frozen=True, eq=False)
class Job:
    """What the writers share.

    ``T_base``: part frame in the controller's robot frame, None where the program cannot state it; ``tools``: those of
    the path, in the order of its table.
    """

    program: JointProgram
    kind: Kind
    options: WriteOptions
    convention: Convention
    commands: Commands
    between: Between
    T_base: Array | None
    tools: tuple[ToolData, ...]

    @property
    def n(self) -> int:
        """Number of moves."""
        return self.program.n

    @property
    def first_tool(self) -> ToolData:
        """The tool of the first move."""
        return self.tools[int(self.program.motions.tool[0])]

    @property
    def used(self) -> tuple[ToolData, ...]:
        """The tools that move, each once, in the order of the path's table."""
        return tuple(dict.fromkeys(self.tools))

    def angles(self, part: slice) -> Array:
        """Controller's joint angles (m, dof) deg."""
        return self.convention.controller_deg(self.program.q[part])

    def externals(self, part: slice) -> Array:
        """Controller's external axes (m, k): linear ones in mm, then the turntable in deg."""
        return self.convention.external(external_axes(self.program, part))

    @property
    def external_decimals(self) -> tuple[int, ...]:
        """Digits of each external axis."""
        linear = (self.options.decimals.length,) * len(self.program.cell.linear_axes)
        return linear + (self.options.decimals.angle,) * (self.program.cell.turntable is not None)

    @cached_property
    def stops(self) -> Bools:
        """Moves (n,) that end in an exact stop: the last, those before a command, or a change of tool or spindle.

        Controllers run ahead of a move that is blended: what follows it would be done too early. In Cartesian programs
        those between joint and straight moves too, which controllers blend each in its own way; not those before mere
        words: a stop in the cut would leave a mark. Without a zone for blending all.
        """
        stops = np.full(self.n, self.options.blend_mm == 0.0)
        found = self.between.happenings.items()
        changes = [m - 1 for m, all_ in found if any(h.actions or h.kind in ("tool", "spindle") for h in all_)]
        stops[[m for m in changes if m >= 0]] = True
        if self.kind == "cartesian":
            stops[:-1] |= np.diff(self.commands.joint)
        stops[-1] = True
        return stops

    def parts(self) -> list[tuple[int, int]]:
        """First and last (not with it) move of each file."""
        step = self.options.moves_per_file
        return [(start, min(start + step, self.n)) for start in range(0, self.n, step)]

    @property
    def head(self) -> list[str]:
        """Lines for the head of a program; they hold texts from files."""
        program = self.program
        axes = [f"{axis.name}, mm" for axis in program.cell.linear_axes]
        axes += ["turntable, deg"] * (program.cell.turntable is not None)
        lines = [
            "written by stiffarm",
            f"tool path: {program.motions.source}",
            f"robot {program.robot.name}, cell {program.cell.name}, {self.kind} coordinates, {self.n} moves",
        ]
        lines += [f"E{i}: {name}" for i, name in enumerate(axes, 1)]
        lines += [
            f"payload {tool.name} {tool.weight}" if tool.weight else f"payload of {tool.name} is not known"
            for tool in self.used
        ]
        return lines

    @property
    def external_units(self) -> tuple[str, ...]:
        """Units of each external axis."""
        return ("mm",) * len(self.program.cell.linear_axes) + ("deg",) * (self.program.cell.turntable is not None)

    def context(self) -> dict[str, object]:
        """What every template knows: ``head`` lines, ``count`` of moves, those ``after`` them, figures.

        Lines of the head, too, hold texts from files.
        """
        o = self.options
        return {
            "head": [SourceText(line) for line in self.head],
            "count": self.n,
            "cartesian": self.kind == "cartesian",
            "after": self.between.happenings.get(self.n, ()),
            "blend_mm": plain(o.blend_mm),
            "joint_percent": plain(o.joint_percent),
            "rotation_deg_s": plain(o.rotation_deg_s),
            "first_speed": plain(float(self.commands.speed[0]) * 1e3),
        }


def external_axes(program: JointProgram, part: slice) -> Array:
    """Travels in mm and, with a turntable, its angle in deg, (m, k)."""
    columns = [program.travel[part] * 1e3]
    if program.cell.turntable is not None:
        columns.append(np.degrees(program.table[part])[:, None])
    return np.concatenate(columns, axis=1)


def external_count(program: JointProgram) -> int:
    """Number of external axes."""
    return len(program.cell.linear_axes) + (program.cell.turntable is not None)


def formatted(values: Array, decimals: Sequence[int]) -> list[tuple[str, ...]]:
    """Numbers (m, k) as text with the decimals of each column; never "-0.00".

    Raises
    ------
    InputError
        A number that is not finite.
    """
    if not np.isfinite(values).all():
        raise InputError("coordinate of a program", code="Q007", value="not a finite number", allowed="finite numbers")
    if values.shape[1] == 0:
        return [()] * len(values)
    # Adding 0 turns -0 into 0.
    rounded = np.stack([np.round(c, d) for c, d in zip(values.T, decimals, strict=True)], axis=1) + 0.0
    pattern = " ".join(f"%.{d}f" for d in decimals)
    return [tuple((pattern % tuple(row)).split(" ")) for row in rounded.tolist()]


def job_of(
    program: JointProgram,
    kind: Kind,
    options: WriteOptions,
    convention: Convention,
    tools: tuple[ToolData, ...],
    between: Between = NOTHING,
) -> Job:
    """Collect what a writer needs. Raises InputError for an empty program, or feeds that are not known."""
    if program.n == 0:
        raise InputError("program", code="Q007", value="no moves", allowed="one move or more")
    T_base = part_in_base(program, convention)
    return Job(program, kind, options, convention, commands(program, options), between, T_base, tools)


def part_in_base(program: JointProgram, convention: Convention) -> Array | None:
    """The part frame (4, 4) m in the controller's robot frame; None where a program cannot state it."""
    # A part that turns has no fixed frame: the controller couples it to the turntable.
    if convention.T_base is None or program.cell.turntable is not None:
        return None
    T_base = program.cell.T_world_base0 @ convention.T_base
    return np.asarray(np.linalg.inv(T_base) @ program.cell.T_world_part0)


def farthest(program: JointProgram) -> float:
    """Farthest (m) that the tip can be from any joint axis."""
    tools = tools_of(program.cell, program.motions)
    tips = (tools[i].T_flange_tool[:3, 3] for i in np.unique(program.motions.tool).tolist())
    return max(stretched_length(program.robot, tip) for tip in tips)


def plain(value: float, digits: int = 7) -> str:
    """A positive number to so many digits, without exponent: controllers differ in what they read."""
    decimals = max(0, digits - 1 - int(np.floor(np.log10(value)))) if value > 0.0 else 0
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
