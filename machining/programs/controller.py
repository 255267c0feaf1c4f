"""Programs for a robot's controller: its joint convention, its templates, what it is told, and reading it back."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from machining.cell import Cell
from machining.cell.schema import CommandsTable
from machining.programs.actions import Action, Pattern, Reader, by_table, difference, names_of, run_up
from machining.programs.convention import Convention, convention_for
from machining.programs.format import Format, ProgramFile, RoundTrip, Written
from machining.programs.happenings import Between, between
from machining.programs.job import (
    Commands,
    Job,
    Kind,
    Move,
    ToolData,
    commands,
    external_axes,
    external_count,
    farthest,
    formatted,
    job_of,
    part_in_base,
    plain,
    tools_of_job,
)
from machining.programs.orientation import ABC, Orientation
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.read_back import Grammar, ReadMove, ReadMoves, Scan, collected, number
from machining.programs.rendering import environment, rendered
from machining.programs.write_options import WriteOptions
from machining.toolpaths.motions import Event, Motions
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.frames import framed

# Joints of every arm that these controllers drive.
ARM = 6
# Moves formatted at a time: what is in memory as text at once.
BLOCK = 1000
# Weight in a comment of the head.
_WEIGHT = re.compile(r"payload (\S+) (M [-+.0-9e]+ CM [-+.0-9e ]+ J [-+.0-9e ]+)")
NO_WEIGHT = "mass_kg and centre_mm are not in the cell file for"
# What a program may differ from the tool path by its decimals, m and rad.
WANTED = 1e-6


class Controller(Format):
    """A controller's language.

    ``main``: names of the files that a program has once, the main one first, and their templates; ``part``: name of
    the files that its moves go into by ``moves.j2``, "" where those of ``main`` have them. In names ``{name}`` stands
    for the program's, ``{NAME}`` for that in capitals, ``{number}`` for the part's. ``orientation`` of Cartesian
    programs; ``speed_unit``: m/s in the unit of speeds, None where none are written.

    ``grammar``: how its lines are read; ``speed``: the line that sets one, with the groups ``value`` and, where there
    are several, ``name``. ``scaled``: analog outputs take a share of full scale; ``own_stop``: a stop needs no input.
    ``actions``, ``asks``: how actions, and the question before an optional stop, are written. ``tool_frame``: whether
    a program sets the tool's frame by figures, names it in every motion, or leaves it to the control; ``weighs``:
    whether it states the payload, which else stands in a comment; ``moves_twice``: whether the template of moves goes
    through them more than once.
    """

    main: ClassVar[tuple[tuple[str, str], ...]]
    part: ClassVar[str] = ""
    orientation: ClassVar[Orientation] = ABC
    speed_unit: ClassVar[float | None] = None
    terminals: ClassVar[tuple[int, int] | Literal["names", "any"]] = "names"
    scaled: ClassVar[bool] = True
    own_stop: ClassVar[bool] = True
    grammar: ClassVar[Grammar]
    speed: ClassVar[re.Pattern[str] | None] = None
    actions: ClassVar[tuple[Pattern, ...]] = ()
    asks: ClassVar[re.Pattern[str] | None] = None
    tool_frame: ClassVar[Literal["figures", "name", "none"]] = "none"
    weighs: ClassVar[bool] = True
    moves_twice: ClassVar[bool] = False

    def read(self, files: Mapping[str, str], cell: Cell, options: WriteOptions) -> Iterator[ReadMove | Action]:
        """Moves and actions of a program's files, main file first, written for the cell and options given.

        Lines that are neither motion, nor an action, nor a speed are passed over: they are the shop's own.

        Raises
        ------
        InputError
            Motion that the reader does not know, a number that is none, a sub-program that is not there.
        """
        scan = Scan(self.data(files))
        yield from self.declared(files, scan)
        for line in self.grammar.lines(files, self.reader(cell)):
            action = line.action or self.remembered(line.where, line.code, scan, options)
            if action is not None:
                yield action
            elif line.move is not None:
                tool = line.move.groupdict().get("tool") or scan.tool
                if tool != scan.tool:
                    scan.tool = tool
                    yield Action("tool_frame", tool)
                yield self.moved(line.where, line.move, scan, cell, options)
            elif self.speed is not None and (said := self.speed.match(line.code)) is not None:
                where = f"{line.where}, {line.code.partition('=')[0].strip(' :')}"
                value = number(where, said["value"]) * (self.speed_unit or 1.0)
                scan.speeds[said.groupdict().get("name") or ""] = value

    @abstractmethod
    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """A move of the grammar. Raises InputError for coordinates that are none."""

    def data(self, files: Mapping[str, str]) -> Mapping[str, Mapping[int, Mapping[str, str]]]:
        """What stands apart from the lines of motion: by name and number, words by key."""
        return {}

    def declared(self, files: Mapping[str, str], scan: Scan) -> Iterator[Action]:
        """Frames and weight declared apart from the lines of motion; here weight, as comments of the head say it."""
        main = next(iter(files.values()), "")
        said = () if self.weighs else _WEIGHT.finditer(main)
        return (Action("payload", found[1], found[2].strip()) for found in said)

    def remembered(self, where: str, code: str, scan: Scan, options: WriteOptions) -> Action | None:
        """Keep what a line sets that later ones need; the action that it completes, if any."""
        return None

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> np.ndarray | None:
        """Configurations (n, k) of a Cartesian program at q (n, dof) rad, also given in the controller's deg.

        None: the language has no words for them.
        """
        return None

    def means(self, event: Event, motions: Motions, table: CommandsTable) -> tuple[tuple[Action, ...], str]:
        """Actions of a command, and what of it is not defined ("": nothing). Errors as :func:`by_table`."""
        return by_table(event, motions, table, scaled=self.scaled, stops=self.own_stop)

    def between(self, program: JointProgram, options: WriteOptions) -> Between:
        """What comes between the moves, with its actions in this language; with several tools their frames too."""
        table, frames = program.cell.commands, self.frames_of_changes(program, options)

        def means(event: Event, motions: Motions) -> tuple[tuple[Action, ...], str]:
            actions, missing = self.means(event, motions, table)
            # What the changer's routine leaves behind is not relied on: the frame comes after it.
            return (*actions, *frames[int(event.value)]) if event.kind == "tool" and frames else actions, missing

        return between(program.motions, means)

    def heading(self, program: JointProgram, options: WriteOptions) -> list[tuple[int, Action]]:
        """What the head states of frames and weight: of the first tool, or of each where tools have names."""
        tools, moves = self.tools(program, options), program.motions.tool
        named = self.tool_frame != "figures"
        stated = dict.fromkeys(tools[i] for i in (np.unique(moves).tolist() if named else moves[:1].tolist()))
        T_base = part_in_base(program, self.convention(program.robot, external_count(program), options))
        out = (
            [] if T_base is None or not self.weighs else [Action("base_frame", value=self.base_value(T_base, options))]
        )
        for tool in stated:
            name = tool.name if named else ""
            frame = self.tool_value(tool.T, options) if self.tool_frame == "figures" else ""
            out += [Action("tool_frame", name, frame), Action("payload", name, self.load_value(tool, options))]
        return [(0, action) for action in out if action.value]

    def load_value(self, tool: ToolData, options: WriteOptions) -> str:
        """A tool's weight as the language states it, or its comment; "" where it is not known."""
        return tool.weight

    def base_value(self, T: Array, options: WriteOptions) -> str:
        """The part frame (4, 4) m in the controller's robot frame as the language states it; "": it does not."""
        return ""

    def frames_of_changes(self, program: JointProgram, options: WriteOptions) -> tuple[tuple[Action, ...], ...]:
        """Of each of the path's tools how its frame is chosen; none where there is one tool, or no such words."""
        if self.tool_frame == "none" or len(np.unique(program.motions.tool)) < 2:
            return ()
        tools = self.tools(program, options)
        if len(set(tools)) < 2:
            return ()
        if self.tool_frame == "name":
            return tuple((Action("tool_frame", tool.name),) for tool in tools)
        pairs = (
            (
                Action("tool_frame", value=self.tool_value(tool.T, options)),
                Action("payload", value=self.load_value(tool, options)),
            )
            for tool in tools
        )
        return tuple(tuple(action for action in pair if action.value) for pair in pairs)

    def tools(self, program: JointProgram, options: WriteOptions) -> tuple[ToolData, ...]:
        """Of each of the path's tools its data on the controller."""
        convention = self.convention(program.robot, external_count(program), options)
        return tools_of_job(program, convention, options, lambda number, place: self.tool_name(options, number, place))

    def tool_name(self, options: WriteOptions, number: int, place: int) -> str:
        """Name of the data of one tool of several."""
        return f"{options.tool_name}_{number}"

    def tool_value(self, T: Array, options: WriteOptions) -> str:
        """A tool's frame (4, 4) m as the language sets it."""
        raise NotImplementedError

    def reader(self, cell: Cell) -> Reader:
        """Reads the actions of this language by the names of the cell."""
        table = cell.commands
        return Reader(self.actions, self.asks, names_of(table), str(table.spindle_ready))

    def finished(self, pieces: Iterator[str]) -> Iterator[str]:
        """The text of a file, a piece at a time, as it came from its template."""
        return pieces

    def own_context(self, job: Job) -> dict[str, object]:
        """What the templates of this language know beyond others. Raises InputError for what it cannot hold."""
        return {}

    def pattern(self, job: Job) -> str:
        """Coordinates of a move with their names, ``%s`` for each: words, configuration, axes beyond the arm; or ""."""
        return ""

    def coordinates(self, job: Job, part: slice) -> tuple[Array, Sequence[int]]:
        """Coordinates (m, k) of moves, joint angles or tool frames, and the decimals of each."""
        if job.kind == "cartesian":
            return self._placed(job.options, job.program.T_part_tool[part])
        angles = job.angles(part)
        return angles, (job.options.decimals.angle,) * angles.shape[1]

    def configurations(self, job: Job, part: slice) -> Sequence[Sequence[object]]:
        """Words of each move's configuration; none in joint programs."""
        q = job.program.q[part]
        found = None if job.kind == "joint" else self.configuration(job.program.robot, q, job.angles(part))
        return [()] * len(q) if found is None else found.tolist()

    def joint_moves(self, wanted: Commands, kind: Kind) -> Bools:
        """Which moves (n,) are joint moves: all of a joint program."""
        return wanted.joint if kind == "cartesian" else np.full(len(wanted.joint), True)

    def pace(self, found: ReadMoves, wanted: Commands, options: WriteOptions) -> float:
        """Largest difference of a move's speed, or time, from what was wanted, as a share of it."""
        return self.off(found.speed, wanted.speed)

    def off(self, said: Array, wanted: Array) -> float:
        """Largest difference of speeds or times (n,) said from those wanted, as a share.

        Raises
        ------
        InputError
            One that a program does not say.
        """
        unsaid = np.isnan(said) & ~np.isnan(wanted)
        if unsaid.any():
            number = int(np.argmax(unsaid)) + 1
            raise InputError(
                f"{self.name} program, move {number}", code="Q001", value="no speed", allowed="a speed before each move"
            )
        return float(np.nanmax(np.abs(said / wanted - 1.0), initial=0.0))

    def notes(self, job: Job) -> list[str]:
        """What a user has to know before the program runs."""
        out = self._precision_notes(job)
        heavy = [tool.name for tool in job.used if tool.load is None]
        if heavy:
            out.append(f"{NO_WEIGHT} {', '.join(heavy)}: the payload is not set, and what the controller holds acts")
        if not job.program.at_home[:1].all():
            out.append(
                "the first move is a joint move from wherever the arm stands: the cell file has no home in [moves]"
            )
        table = job.program.cell.commands
        starts = (table.spindle_clockwise, table.spindle_counterclockwise)
        if any(way is not None for way in starts) and not run_up(table):
            said = "a start of the spindle is not waited for"
            out.append(f"the cell file has no spindle_ready and no spindle_dwell_s: {said}")
        points = [tool.name for tool in job.used if tool.load is not None and not tool.load.inertia.any()]
        if points:
            out.append(f"inertia_kg_m2 of {', '.join(points)} is not in the cell file: written as 0, a point mass")
        if job.kind == "cartesian":
            if job.program.cell.turntable is not None:
                out.append("the part frame turns with the turntable: couple it to the turntable on the controller")
            elif job.T_base is None:
                out.append("the controller's robot frame is not known: set the part frame on the robot")
        return out

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """See :class:`Format`: an arm whose convention on that controller is not known."""
        super().check(robot, externals, options)
        self.convention(robot, externals, options)

    def convention(self, robot: Robot, externals: int, options: WriteOptions) -> Convention:
        """How the controller counts the joints of an arm. Errors as :func:`convention_for`."""
        return convention_for(robot, externals, self.name, options.arm)

    def write(self, program: JointProgram, kind: Kind, options: WriteOptions, templates: Path | None) -> Written:
        """See :class:`Format`."""
        self.check_commands(program.cell.commands)
        convention = self.convention(program.robot, external_count(program), options)
        job = job_of(program, kind, options, convention, self.tools(program, options), self.between(program, options))
        files = self._files(job, templates)
        joint_rapid = int((program.motions.rapid & job.commands.joint)[1:].sum())
        notes = self.notes(job)
        if joint_rapid:
            notes.append(f"{joint_rapid} rapid moves are joint moves: between their ends they leave the straight line")
        for one in job.between.undefined:
            notes.append(one.sentence)
        return Written(tuple(files), tuple(notes), job.between.undefined)

    def frame(self, job: Job, T: Array | None) -> tuple[str, ...] | None:
        """A frame (4, 4) m as text; None stays None."""
        return None if T is None else self.frame_words(T, job.options)

    def frame_words(self, T: Array, options: WriteOptions) -> tuple[str, ...]:
        """A frame (4, 4) m as text."""
        return formatted(*self._placed(options, T[None]))[0]

    def _placed(self, options: WriteOptions, T: Array) -> tuple[Array, Sequence[int]]:
        """Positions mm and orientations of frames (m, 4, 4) m, and the decimals of each."""
        decimals, turned = options.decimals, self.orientation.write(T[:, :3, :3])
        digits = getattr(decimals, self.orientation.decimals)
        return np.column_stack([T[:, :3, 3] * 1e3, turned]), (decimals.length,) * 3 + (digits,) * turned.shape[1]

    def _speeds(self, job: Job, part: slice) -> list[str]:
        """Speeds as text, to seven digits and never with an exponent."""
        speed = job.commands.speed[part]
        return [""] * len(speed) if self.speed_unit is None else [plain(v) for v in (speed / self.speed_unit).tolist()]

    def _files(self, job: Job, templates: Path | None) -> list[ProgramFile]:
        """The files of a job, the main one first; their texts are made when they are asked for."""
        made, o = environment(templates), job.options
        names = {"name": o.name, "NAME": o.name.upper()}
        ranges = job.parts() if self.part else []
        parts = [self.part.format(number=i, **names) for i in range(1, len(ranges) + 1)]
        own = {} if self.table is None else {self.table[0]: o.own(self.table[1]).model_dump()}
        shared = {
            **job.context(),
            "o": o.model_dump() | own,
            "parts": [Path(part).stem for part in parts],
            **self.own_context(job),
        }

        def pieces(file: str, template: str, first: int, last: int) -> Iterator[str]:
            moves = self._moves(job, first, last)
            here = {
                "part": Path(file).stem,
                "first": first + 1,
                "last": last,
                "moves": list(moves) if self.moves_twice and template == "moves.j2" else moves,
                "after": shared["after"] if last == job.n else [],
            }
            return self.finished(rendered(made, f"{self.name}/{template}", {**shared, **here}))

        rows = [(file.format(**names), template, 0, job.n) for file, template in self.main]
        rows += [(file, "moves.j2", *ends) for file, ends in zip(parts, ranges, strict=True)]
        return [ProgramFile(row[0], partial(pieces, *row)) for row in rows]

    def _moves(self, job: Job, first: int, last: int) -> Iterator[Move]:
        """Moves ``first`` to ``last`` (not with it), a block at a time."""
        said: str | None = None
        pattern = self.pattern(job)
        motions, joint = job.program.motions, job.commands.joint
        for start in range(first, last, BLOCK):
            part = slice(start, min(start + BLOCK, last))
            before = motions.line[start - 1] if start else -1
            rows = zip(
                range(part.start, part.stop),
                motions.line[part].tolist(),
                (np.diff(motions.line[part], prepend=before) != 0).tolist(),
                motions.rapid[part].tolist(),
                joint[part].tolist(),
                job.stops[part].tolist(),
                formatted(*self.coordinates(job, part)),
                formatted(job.externals(part), job.external_decimals),
                self.configurations(job, part),
                self._speeds(job, part),
                motions.tool[part].tolist(),
                strict=True,
            )
            for i, line, new, rapid, jointly, stop, words, axes, sides, speed, tool in rows:
                changed = speed if speed != said else None
                said = speed
                here = job.between.happenings.get(i, ())
                named = pattern % (*words, *sides, *axes) if pattern else ""
                yield Move(
                    i + 1,
                    i,
                    line,
                    new,
                    rapid,
                    jointly,
                    stop,
                    words,
                    axes,
                    sides,
                    changed,
                    here,
                    job.tools[tool].name,
                    named,
                )

    def _precision_notes(self, job: Job) -> list[str]:
        """Say where the decimals alone move the tool by more than ``WANTED``."""
        decimals, program = job.options.decimals, job.program
        half_mm, half_deg = 0.5 * 10.0**-decimals.length, 0.5 * 10.0**-decimals.angle
        reach = farthest(program)
        linear = program.travel.shape[1] * half_mm * 1e-3
        turning = np.radians(half_deg) * program.robot.dof
        tip, turned = turning * reach + linear, turning
        if program.cell.turntable is not None:
            lever = float(np.abs(program.T_part_tool[:, :3, 3]).max()) + reach
            tip, turned = tip + np.radians(half_deg) * lever, turned + np.radians(half_deg)
        if job.kind == "cartesian":
            digits = getattr(decimals, self.orientation.decimals)
            tip, turned = np.sqrt(3.0) * half_mm * 1e-3, 3.0 * 0.5 * 10.0**-digits * self.orientation.unit
        notes = []
        if tip > WANTED:
            notes.append(
                f"decimals: rounding alone can move the tip by {tip * 1e6:.2g} um, more than {WANTED * 1e6:g} um"
            )
        if turned > WANTED:
            notes.append(f"decimals: rounding alone can turn the tool by {turned:.2g} rad, more than {WANTED:g} rad")
        return notes

    def round_trip(
        self, program: JointProgram, files: Mapping[str, str], kind: Kind, options: WriteOptions
    ) -> RoundTrip:
        """See :class:`Format`."""
        found, wanted = collected(self.read(files, program.cell, options)), commands(program, options)
        self._check_same(found, program, kind)
        convention = self.convention(program.robot, external_count(program), options)
        linear = len(program.cell.linear_axes)
        external = convention.external_back(found.external)
        if kind == "joint":
            travel = external[:, :linear] * 1e-3
            table = np.radians(external[:, linear]) if program.cell.turntable is not None else np.zeros(program.n)
            T = tool_in_part(
                program.robot, program.cell, convention.radians(found.words), travel, table, program.T_flange_tool
            )
        else:
            T = framed(self.orientation.read(found.words[:, 3:]), found.words[:, :3] * 1e-3)
        away, turned = frame_distance(T, program.T_part_tool)
        away_axes = np.abs(external - external_axes(program, slice(None)))
        return RoundTrip(
            tip=float(away.max()),
            turned=float(turned.max()),
            travel=float(away_axes[:, :linear].max(initial=0.0)) * 1e-3,
            table=float(np.radians(away_axes[:, linear:].max(initial=0.0))),
            pace=self.pace(found, wanted, options),
            same_moves=bool((found.joint == self.joint_moves(wanted, kind)).all()),
            same_sides=kind == "joint" or self._same_sides(found, program, convention),
            commands=difference(
                [*self.heading(program, options), *self.between(program, options).actions], found.actions, found.where
            ),
        )

    def _check_same(self, found: ReadMoves, program: JointProgram, kind: Kind) -> None:
        """Raise InputError for another number of moves, another kind or other axes than were written."""
        axes = external_count(program)
        for is_same, value, allowed in (
            (len(found.words) == program.n, f"{len(found.words)} moves", f"{program.n}, as written"),
            (found.kind == kind, f"{found.kind} coordinates", kind),
            (found.external.shape[1] == axes, f"{found.external.shape[1]} external axes", f"{axes}, as the cell has"),
        ):
            if not is_same:
                raise InputError(f"{self.name} program", code="Q001", value=value, allowed=allowed)

    def _same_sides(self, found: ReadMoves, program: JointProgram, convention: Convention) -> bool:
        """Whether configurations are those of the joint angles; straight moves may do without, their start decides."""
        wanted = self.configuration(program.robot, program.q, convention.controller_deg(program.q))
        if wanted is None:
            return True
        rows = zip(found.configuration, wanted, found.joint.tolist(), strict=True)
        return all(list(map(str, row)) == list(map(str, right)) if row else not joint for row, right, joint in rows)
