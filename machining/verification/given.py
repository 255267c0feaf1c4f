"""A neutral program as a file gives it: the program, and where in the file each of its moves stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from machining.cell import Cell
from machining.programs.formats import NEUTRAL
from machining.programs.neutral import SCHEMA
from machining.programs.program import JointProgram
from robots import InputError, Robot
from robots.files.reading import read_text


@dataclass(frozen=True, eq=False)
class GivenProgram:
    """A program read from a file, and the line of the file that each move stands in, None where not known."""

    program: JointProgram
    lines: tuple[int, ...] | None


def read_program(path: Path, robot: Robot, cell: Cell) -> GivenProgram:
    """A neutral program for the robot and cell that it was written for.

    Raises
    ------
    InputError
        Another kind of file, and what the readers refuse.
    """
    kind = path.suffix.lower()
    if kind not in NEUTRAL:
        raise InputError(
            f"program {path.name}",
            value=kind or "no ending",
            allowed=f"{' or '.join(NEUTRAL)}, {SCHEMA}",
            remedy="write the program with `stiffarm post` in one of these formats; controllers' own are not replayed",
        )
    text = read_text(path, "program")
    program = NEUTRAL[kind].program(text, robot, cell, path.name)
    lines = NEUTRAL[kind].lines(text, program.n)
    return GivenProgram(program, None if lines is None else tuple(lines))
