"""Neutral programs as CSV: the columns of moves, for tables and scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from machining.cell import Cell
from machining.programs.format import Neutral
from machining.programs.neutral import csv_pieces
from machining.programs.neutral_reading import program_from_csv
from machining.programs.program import JointProgram
from robots import Robot


class Csv(Neutral):
    """Schema ``stiffarm-program/1`` (:mod:`machining.programs.neutral`), without tables, events and notes."""

    name, title = "csv", "CSV"

    def pieces(self, program: JointProgram) -> Iterator[str]:
        """See :class:`Neutral`."""
        return csv_pieces(program)

    def program(self, text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
        """See :class:`Neutral`."""
        return program_from_csv(text, robot, cell, where)

    def lines(self, text: str, n: int) -> Iterable[int] | None:
        """See :class:`Neutral`: the line of the schema and that of the names come first."""
        return range(3, 3 + n)


FORMAT = Csv()
