"""Neutral programs: everything of a :class:`JointProgram` as JSON, and as CSV; written without templates.

Schema ``stiffarm-program/1``. Each move has its source line; joint angles are the project's own (no controller's sign
or zero); lengths in mm, angles in deg, feeds in mm/min, speeds in rpm. Numbers have all their digits.

JSON is one object: ``schema``, ``source``, ``robot``, ``cell``, ``joints``, ``linear_axes``, ``turntable``,
``branches``, ``tools``, ``operations``, ``events``, ``notes``, ``columns``, and ``moves``, a list of rows, one a line.
In it everything comes back. CSV has ``# stiffarm-program/1`` first, then a line of names, then the same columns with
tool and operation spelled out; tables, events and notes are not in it. What is not known is null, or an empty field.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import numpy as np

from machining.programs.orientation import quaternions
from machining.programs.program import JointProgram
from machining.programs.source_text import comment
from robots.arrays import Array
from robots.constants import MM_MIN, RPM
from robots.files.csv_text import rows_text

SCHEMA = "stiffarm-program/1"
BLOCK = 2000
# Columns between the fixed ones in front and the frame behind: q1_deg ..., e1_mm ..., table_deg.
FRONT = (
    "line", "inserted", "rapid", "feed_mm_min", "tool", "spindle_rpm", "dwell_s", "operation", "branch", "gamma_deg",
)  # fmt: skip
FRAME = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")


def columns(dof: int, linear: int) -> list[str]:
    """Names of the columns of moves."""
    joints, axes = [f"q{i + 1}_deg" for i in range(dof)], [f"e{i + 1}_mm" for i in range(linear)]
    return [*FRONT, *joints, *axes, "table_deg", *FRAME]


def rows(program: JointProgram, first: int, last: int) -> Iterator[list[object]]:
    """Rows of moves ``first`` to ``last`` (not with it); None where something is not known."""
    m, part = program.motions, slice(first, last)
    T = program.T_part_tool[part]
    data = (
        m.line[part],
        program.inserted[part],
        m.rapid[part],
        _nullable(m.feed[part] / MM_MIN),
        m.tool[part],
        _nullable(m.spindle[part] / RPM),
        m.dwell[part],
        m.operation[part],
        program.branch[part],
        np.degrees(program.gamma[part]),
        *np.degrees(program.q[part]).T,
        *(program.travel[part] * 1e3).T,
        np.degrees(program.table[part]),
        *(T[:, :3, 3] * 1e3).T,
        *quaternions(T[:, :3, :3]).T,
    )
    yield from map(list, zip(*(c if isinstance(c, list) else c.tolist() for c in data), strict=True))


def _nullable(column: Array) -> list[float | None]:
    return [v if math.isfinite(v) else None for v in column.tolist()]


def json_pieces(program: JointProgram) -> Iterator[str]:
    """The JSON text, a block of moves at a time."""
    m, robot, cell = program.motions, program.robot, program.cell
    head = {
        "schema": SCHEMA,
        "source": m.source,
        "robot": robot.name,
        "cell": cell.name,
        "joints": robot.dof,
        "linear_axes": [axis.name for axis in cell.linear_axes],
        "turntable": cell.turntable is not None,
        "branches": list(program.names),
        "tools": [
            {
                "number": tool.number,
                "name": tool.name,
                "diameter_mm": _known(tool.diameter * 1e3),
                "corner_radius_mm": _known(tool.corner_radius * 1e3),
                "length_mm": _known(tool.length * 1e3),
            }
            for tool in m.tools
        ],
        "operations": list(m.operations),
        "events": [{"line": e.line, "before_move": e.move, "word": e.word, "text": e.text} for e in m.events],
        "notes": [{"line": note.line, "text": note.text, "count": note.count} for note in m.notes],
        "columns": columns(robot.dof, len(cell.linear_axes)),
    }
    yield json.dumps(head, indent=1, allow_nan=False)[:-2] + ',\n "moves": [\n'
    for first in range(0, program.n, BLOCK):
        last = min(first + BLOCK, program.n)
        text = ",\n".join(json.dumps(row, allow_nan=False) for row in rows(program, first, last))
        yield text + ("\n" if last == program.n else ",\n")
    yield " ]\n}\n"


def csv_pieces(program: JointProgram) -> Iterator[str]:
    """The CSV text, a block of moves at a time.

    Names of tools and operations are made harmless as in comments.
    """
    names = columns(program.robot.dof, len(program.cell.linear_axes))
    tool, operation, branch = (names.index(name) for name in ("tool", "operation", "branch"))
    inserted, rapid = names.index("inserted"), names.index("rapid")
    tools = [comment(f"{'' if t.number is None else t.number} {t.name}") for t in program.motions.tools]
    operations = [comment(name) for name in program.motions.operations]
    yield f"# {SCHEMA}\r\n"
    yield ",".join(names) + "\r\n"
    for first in range(0, program.n, BLOCK):
        cells = []
        for row in rows(program, first, min(first + BLOCK, program.n)):
            row[tool], row[operation] = tools[_index(row[tool])], operations[_index(row[operation])]
            row[branch] = comment(program.names[_index(row[branch])]) if program.names else ""
            row[inserted], row[rapid] = int(row[inserted] is True), int(row[rapid] is True)
            cells.append(row)
        yield rows_text(cells, "\r\n")


def _index(value: object) -> int:
    return int(str(value))


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
