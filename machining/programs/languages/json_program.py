"""Neutral programs as JSON: everything of a program, and what a verification reads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from machining.cell import Cell
from machining.programs.format import Neutral
from machining.programs.neutral import json_pieces
from machining.programs.neutral_reading import program_from_json
from machining.programs.program import JointProgram
from robots import Robot


class Json(Neutral):
    """Schema ``stiffarm-program/1`` (:mod:`machining.programs.neutral`)."""

    name, title = "json", "JSON"

    def pieces(self, program: JointProgram) -> Iterator[str]:
        """See :class:`Neutral`."""
        return json_pieces(program)

    def program(self, text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
        """See :class:`Neutral`."""
        return program_from_json(text, robot, cell, where)

    def lines(self, text: str, n: int) -> Iterable[int] | None:
        """See :class:`Neutral`: where each row of moves stands in a line of its own."""
        lines = text.splitlines()
        first = next((i for i, line in enumerate(lines) if '"moves"' in line), None)
        if first is None:
            return None
        rows = [line.strip() for line in lines[first + 1 : first + 1 + n]]
        alone = len(rows) == n and all(row.startswith("[") and row.rstrip(",").endswith("]") for row in rows)
        return range(first + 2, first + 2 + n) if alone else None


FORMAT = Json()
