"""What a program format is: all that is known of one stands in its own file under :mod:`machining.programs.languages`.

A format owns its name and title, the coordinates and files that it writes, its reader, its templates, its options, the
words that names must avoid, and its limits. To add one, add a module there with a ``FORMAT``, and its templates.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from machining.cell import Cell
from machining.cell.schema import CommandsTable, Strict
from machining.programs.actions import FIGURES
from machining.programs.happenings import Undefined
from machining.programs.job import Kind
from machining.programs.program import JointProgram, frame_distance
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.files.written import written_whole

BOTH: tuple[Kind, ...] = ("cartesian", "joint")
# Share by which a speed may differ: it is written to seven digits, and single precision on some controllers.
SAME_PACE = 1e-4


@dataclass(frozen=True, eq=False)
class ProgramFile:
    """A file of a program: ``name``, and ``pieces``, called for its text each time it is needed."""

    name: str
    pieces: Callable[[], Iterator[str]]

    def text(self) -> str:
        """The whole text."""
        return "".join(self.pieces())

    def write(self, path: Path) -> None:
        """Write it piece by piece, whole or not at all."""
        with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
            file.writelines(self.pieces())


def digest(text: str) -> str:
    """SHA-256 of a file's text."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


@dataclass(frozen=True, eq=False)
class Written:
    """A program's files, the main one first, and ``notes``: what a user has to know before it runs.

    ``undefined``: commands of the tool path that stand as comments, because cell or language know no way for them.
    """

    files: tuple[ProgramFile, ...]
    notes: tuple[str, ...]
    undefined: tuple[Undefined, ...] = ()

    def save(self, path_of: Callable[[str], Path]) -> None:
        """Write all files; ``path_of`` gives the place of a name (as ``OutputFolder.path`` does)."""
        for file in self.files:
            file.write(path_of(file.name))

    def texts(self) -> dict[str, str]:
        """All texts by name."""
        return {file.name: file.text() for file in self.files}


@dataclass(frozen=True, eq=False)
class RoundTrip:
    """What a written program, read back, differs by from the tool path, the largest of all moves.

    ``tip`` m and ``turned`` rad of the tool frames (joint programs by forward kinematics); ``travel`` m of linear
    axes, ``table`` rad; ``pace``: speed or time of a move as a share of it; ``same_moves``: joint moves are where
    they were asked for; ``same_sides``: the arm's configuration is that of the joint angles, where it decides;
    ``commands``: what differs first among the commands between moves, None where nothing does.
    """

    tip: float
    turned: float
    travel: float
    table: float
    pace: float
    same_moves: bool
    same_sides: bool = True
    commands: InputError | None = None

    def within(self, tolerance: float = 1e-6) -> bool:
        """Whether nothing differs, and tool frames and axes by less than so many m and rad."""
        return self.difference(tolerance) is None

    def difference(self, tolerance: float = 1e-6) -> InputError | None:
        """What differs first, as the error that it is; None where nothing does."""
        off = max(self.tip, self.turned, self.travel, self.table)
        template = "write it as the bundled template does"
        if not self.same_moves:
            return InputError(
                "joint moves and straight ones", code="Q001", value="exchanged", allowed="as asked", remedy=template
            )
        if not off < tolerance:
            return InputError(
                "off the tool path",
                code="Q001",
                value=f"{max(self.tip, self.travel) * 1e6:.3g} um, {max(self.turned, self.table) * 1e6:.3g} urad",
                allowed=f"{tolerance * 1e6:g} um, {tolerance * 1e6:g} urad",
                remedy="set more decimals in the file of --options; own templates write coordinates as bundled ones do",
            )
        if not self.same_sides:
            return InputError(
                "configuration of the arm", code="Q001", value="another", allowed="the path's", remedy=template
            )
        if not self.pace < SAME_PACE:
            value, allowed = f"by {100.0 * self.pace:.3g} %", f"{100.0 * SAME_PACE:g} %"
            return InputError(
                "speeds differ from the tool path's", code="Q001", value=value, allowed=allowed, remedy=template
            )
        return self.commands


class Format(ABC):
    """A format of programs.

    ``name`` and ``title``; ``kinds`` that it writes; ``neutral``: without a controller's joint convention, and with
    both kinds of coordinates in one file. ``table``: key and model of the options of this format alone. ``words``: that
    mean something in it, so that no program, tool or frame may be called so. ``external_axes``: whether it can
    move them, hold them, or has none. ``terminals``: what outputs and inputs of the cell's ``[commands]`` are: numbers,
    from the first to the last, names, or whatever they like where none are written.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    kinds: ClassVar[tuple[Kind, ...]] = BOTH
    neutral: ClassVar[bool] = False
    table: ClassVar[tuple[str, type[Strict]] | None] = None
    words: ClassVar[frozenset[str]] = frozenset()
    external_axes: ClassVar[Literal["moving", "still", "none"]] = "moving"
    terminals: ClassVar[tuple[int, int] | Literal["names", "any"]] = "any"

    def folder(self, kind: Kind) -> str:
        """Where the files of a kind go."""
        return self.name if self.neutral else f"{self.name}_{kind}"

    def check_kind(self, kind: str) -> None:
        """Raise InputError for a kind that it does not write."""
        if kind not in self.kinds:
            raise InputError(f"kind of a {self.name} program", code="Q002", value=kind, allowed=" or ".join(self.kinds))

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """Refuse, before any work, an arm or options that it cannot write."""
        for key in ("name", "tool_name", "frame_name"):
            if getattr(options, key).lower() in self.words:
                raise InputError(
                    f"{key} of a {self.name} program",
                    code="Q004",
                    value=getattr(options, key),
                    allowed="no word of the language",
                    remedy="choose another name",
                )

    def check_commands(self, table: CommandsTable) -> None:
        """Refuse outputs, inputs and routines of a cell file that this controller does not have."""
        for key, given in table.model_dump(exclude={*FIGURES, "tool_change"}).items():
            if given is None or self.terminals == "any":
                continue
            fits, allowed = isinstance(given, str), "a name"
            if isinstance(self.terminals, tuple):
                first, last = self.terminals
                fits, allowed = isinstance(given, int) and first <= given <= last, f"a number from {first} to {last}"
            if not fits:
                raise InputError(
                    f"cell file, [commands] {key} for {self.title}",
                    code="Q004",
                    value=given,
                    allowed=allowed,
                    remedy="correct it, or leave it out",
                )
        if table.tool_change is not None and table.tool_change.lower() in self.words:
            raise InputError(
                f"cell file, [commands] tool_change for {self.title}",
                code="Q004",
                value=table.tool_change,
                allowed="no word of the language",
                remedy="choose another name",
            )

    @abstractmethod
    def write(self, program: JointProgram, kind: Kind, options: WriteOptions, templates: Path | None) -> Written:
        """Write a program; the texts are made when the files are written. Errors as :func:`write_program`."""

    @abstractmethod
    def round_trip(
        self, program: JointProgram, files: Mapping[str, str], kind: Kind, options: WriteOptions
    ) -> RoundTrip:
        """Read a program, main file first, and compare it with what it was written from."""


class Neutral(Format):
    """A format for other programs: joint and Cartesian coordinates at once, the project's own angles."""

    neutral: ClassVar[bool] = True

    @abstractmethod
    def pieces(self, program: JointProgram) -> Iterator[str]:
        """The text, a piece at a time."""

    @abstractmethod
    def program(self, text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
        """The program of a text, for the robot and cell that it was written for, with the lines of its moves."""

    def write(self, program: JointProgram, kind: Kind, options: WriteOptions, templates: Path | None) -> Written:
        """See :class:`Format`."""
        file = ProgramFile(f"{options.name}.{self.name}", lambda: self.pieces(program))
        return Written((file,), self.left_out(program))

    def left_out(self, program: JointProgram) -> tuple[str, ...]:
        """What a program has and this format does not hold, in words."""
        return ()

    def round_trip(
        self, program: JointProgram, files: Mapping[str, str], kind: Kind, options: WriteOptions
    ) -> RoundTrip:
        """See :class:`Format`."""
        robot, cell = program.robot, program.cell
        back = self.program(next(iter(files.values())), robot, cell)
        if back.n != program.n:
            raise InputError(
                f"{self.name} program", code="Q001", value=f"{back.n} moves", allowed=f"{program.n}, as written"
            )
        by_frames = frame_distance(back.T_part_tool, program.T_part_tool)
        by_joints = frame_distance(back.reached(), program.T_part_tool)
        feed, wanted = back.motions.feed, program.motions.feed
        known = np.isfinite(wanted)
        return RoundTrip(
            tip=float(max(by_frames[0].max(), by_joints[0].max())),
            turned=float(max(by_frames[1].max(), by_joints[1].max())),
            travel=float(np.abs(back.travel - program.travel).max(initial=0.0)),
            table=float(np.abs(back.table - program.table).max()),
            pace=float(np.abs(feed[known] / wanted[known] - 1.0).max(initial=0.0)),
            same_moves=bool((back.motions.rapid == program.motions.rapid).all() and (np.isfinite(feed) == known).all()),
            commands=self.told(program, back),
        )

    def told(self, program: JointProgram, back: JointProgram) -> InputError | None:
        """What differs first between the events of a program and what was read back; None where nothing does."""
        return None
