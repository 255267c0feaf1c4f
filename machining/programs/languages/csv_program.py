"""Neutral programs as CSV: the columns of moves, for tables and scripts.

``# stiffarm-program/2`` first, then a line of names, then the columns with tool and operation spelled out; tables,
events and notes are not in it.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator

import numpy as np

from machining.cell import Cell
from machining.programs.format import Neutral
from machining.programs.neutral import BLOCK, SCHEMA, columns, joints_of, program_of, rows, table_of
from machining.programs.program import JointProgram
from machining.programs.source_text import comment
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Tool
from robots import InputError, Robot
from robots.arrays import Integers
from robots.files.csv_text import rows_text
from robots.inverse.branches import BRANCH_NAMES
from robots.inverse.singularities import branch_of
from robots.inverse.spherical_wrist import why_not_spherical

# Columns in words; of these only tools are read back.
WORDS = ("tool", "operation", "branch")


class Csv(Neutral):
    """Schema ``stiffarm-program/2`` (:mod:`machining.programs.neutral`), without tables, events and notes."""

    name, title = "csv", "CSV"

    def pieces(self, program: JointProgram) -> Iterator[str]:
        """See :class:`Neutral`; names of tools and operations are made harmless as in comments."""
        names = columns(program.robot, program.cell)
        tool, operation, branch = (names.index(name) for name in ("tool", "operation", "branch"))
        inserted, rapid = names.index("inserted"), names.index("rapid")
        tools = [comment(f"{'' if t.number is None else t.number} {t.name}") for t in program.motions.tools]
        operations = [comment(name) for name in program.motions.operations]
        yield f"# {SCHEMA}\r\n"
        yield ",".join(names) + "\r\n"
        for first in range(0, program.n, BLOCK):
            cells = []
            for row in rows(program, first, min(first + BLOCK, program.n)):
                row[tool], row[operation] = tools[int(str(row[tool]))], operations[int(str(row[operation]))]
                row[branch] = comment(program.names[int(str(row[branch]))]) if program.names else ""
                row[inserted], row[rapid] = int(row[inserted] is True), int(row[rapid] is True)
                cells.append(row)
            yield rows_text(cells, "\r\n")

    def left_out(self, program: JointProgram) -> tuple[str, ...]:
        """See :class:`Neutral`."""
        count = sum(bool(event.kind) for event in ordered(program.motions))
        said = f"the CSV program holds none of {count} commands to spindle, coolant and tool changer; JSON does"
        return (said,) if count else ()

    def program(self, text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
        """See :class:`Neutral`; branches are told from the joints.

        Raises
        ------
        InputError
            Another schema or other columns, a row of another length, a field that is no finite number.
        """
        head, *body = text.splitlines() or [""]
        if head.strip() != f"# {SCHEMA}":
            raise InputError(f"{where}, first line", code="Q005", value=head[:80], allowed=f"# {SCHEMA}")
        try:
            records = list(csv.reader(body))
        except csv.Error as error:
            raise InputError(
                f"{where} is not valid CSV ({error})", code="Q005", remedy="write the program again"
            ) from error
        wanted = columns(robot, cell)
        if not records or records[0] != wanted:
            raise InputError(f"{where}, names of columns", code="Q005", allowed=",".join(wanted))
        kept = [i for i, name in enumerate(wanted) if name not in WORDS]
        values = []
        for i, record in enumerate(records[1:], 3):
            if len(record) != len(wanted):
                raise InputError(
                    f"{where}, line {i}", code="Q005", value=f"{len(record)} fields", allowed=f"{len(wanted)}"
                )
            try:
                values.append([float(record[k] or "nan") for k in kept])
            except ValueError as error:
                raise InputError(f"{where}, line {i}: {error}", code="Q005", allowed="numbers") from error
        table = table_of([wanted[i] for i in kept], values, where)
        none = np.zeros(len(values), dtype=np.int64)
        told = why_not_spherical(robot) is None
        branch = branch_of(robot, joints_of(robot, table)) if told else none
        names = BRANCH_NAMES if told else ()
        # The line of the schema and that of the names come first.
        lines = np.arange(3, 3 + len(values))
        tools, tool = _tools([record[wanted.index("tool")] for record in records[1:]])
        return program_of(
            robot,
            cell,
            table,
            where,
            lines,
            tools=tools,
            tool=tool,
            operation=none,
            source=where,
            branch=branch,
            names=names,
        )


def _tools(words: list[str]) -> tuple[tuple[Tool, ...], Integers]:
    """Tools of a column of words, each a number and a name or one of them, and the place of each row's."""
    places = {word: i for i, word in enumerate(dict.fromkeys(words))}
    return tuple(map(_tool, places)) or (Tool(),), np.array([places[word] for word in words], dtype=np.int64)


def _tool(word: str) -> Tool:
    number, _, name = word.strip().partition(" ")
    return Tool(int(number), name.strip()) if number.isdecimal() and len(number) < 10 else Tool(None, word.strip())


FORMAT = Csv()
