"""What a program format is: all that is known of one stands in its own file under :mod:`machining.programs.languages`.

A format owns its name and title, the coordinates and files that it writes, its reader, its templates, its options, the
words that names must avoid, and its limits. To add one, add a module there with a ``FORMAT``, and its templates.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from machining.cell import Cell
from machining.cell.schema import Strict
from machining.programs.job import Kind
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.round_trip import RoundTrip
from machining.programs.write_options import WriteOptions
from machining.programs.written import ProgramFile, Written
from robots import InputError, Robot

BOTH: tuple[Kind, ...] = ("cartesian", "joint")


class Format(ABC):
    """A format of programs.

    ``name`` and ``title``; ``kinds`` that it writes; ``neutral``: without a controller's joint convention, and with
    both kinds of coordinates in one file. ``table``: key and model of the options of this format alone. ``words``: that
    mean something in it, so that no program, tool or frame may be called so. ``external_axes``: whether it can
    move them, hold them, or has none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    kinds: ClassVar[tuple[Kind, ...]] = BOTH
    neutral: ClassVar[bool] = False
    table: ClassVar[tuple[str, type[Strict]] | None] = None
    words: ClassVar[frozenset[str]] = frozenset()
    external_axes: ClassVar[Literal["moving", "still", "none"]] = "moving"

    def folder(self, kind: Kind) -> str:
        """Where the files of a kind go."""
        return self.name if self.neutral else f"{self.name}_{kind}"

    def check_kind(self, kind: str) -> None:
        """Raise InputError for a kind that it does not write."""
        if kind not in self.kinds:
            raise InputError(f"kind of a {self.name} program", value=kind, allowed=" or ".join(self.kinds))

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """Refuse, before any work, an arm or options that it cannot write."""
        for key in ("name", "tool_name", "frame_name"):
            if getattr(options, key).lower() in self.words:
                raise InputError(f"{key} of a {self.name} program", value=getattr(options, key),
                                 allowed="no word of the language", remedy="choose another name")  # fmt: skip

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
        """The program of a text, for the robot and cell that it was written for."""

    @abstractmethod
    def lines(self, text: str, n: int) -> Iterable[int] | None:
        """Line of the text that each of its n moves stands in; None where not known."""

    def write(self, program: JointProgram, kind: Kind, options: WriteOptions, templates: Path | None) -> Written:
        """See :class:`Format`."""
        return Written((ProgramFile(f"{options.name}.{self.name}", lambda: self.pieces(program)),), ())

    def round_trip(
        self, program: JointProgram, files: Mapping[str, str], kind: Kind, options: WriteOptions
    ) -> RoundTrip:
        """See :class:`Format`."""
        robot, cell = program.robot, program.cell
        back = self.program(next(iter(files.values())), robot, cell)
        if back.n != program.n:
            raise InputError(f"{self.name} program", value=f"{back.n} moves", allowed=f"{program.n}, as written")
        by_frames = frame_distance(back.T_part_tool, program.T_part_tool)
        by_joints = frame_distance(tool_in_part(robot, cell, back.q, back.travel, back.table), program.T_part_tool)
        feed, wanted = back.motions.feed, program.motions.feed
        known = np.isfinite(wanted)
        return RoundTrip(
            tip=float(max(by_frames[0].max(), by_joints[0].max())),
            turned=float(max(by_frames[1].max(), by_joints[1].max())),
            travel=float(np.abs(back.travel - program.travel).max(initial=0.0)),
            table=float(np.abs(back.table - program.table).max()),
            pace=float(np.abs(feed[known] / wanted[known] - 1.0).max(initial=0.0)),
            same_moves=bool((back.motions.rapid == program.motions.rapid).all() and (np.isfinite(feed) == known).all()),
        )
