"""Neutral programs as JSON: everything of a program, and what a verification reads.

One object: ``schema``, ``source``, ``robot``, ``cell``, ``joints``, ``linear_axes``, ``turntable``, ``branches``,
``tools``, ``operations``, ``events``, ``notes``, ``columns``, and ``moves``, a list of rows, one a line. In it
everything comes back. ``events`` has all that comes between moves in order: ``before_move`` says where, ``kind`` what
the machine is told ("": nothing), ``spindle_rpm``, ``dwell_s``, ``tool``, ``operation``, ``on`` how much or which.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from machining.cell import Cell
from machining.programs.format import Neutral
from machining.programs.neutral import BLOCK, SCHEMA, columns, integers, program_of, rows, table_of
from machining.programs.program import JointProgram
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Event, Note, Tool
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.constants import RPM
from robots.files.reading import parse_json

# Key of a command's value, and what one of it is in SI.
VALUES = {
    "operation": ("operation", 1.0),
    "tool": ("tool", 1.0),
    "spindle": ("spindle_rpm", RPM),
    "dwell": ("dwell_s", 1.0),
    "probe": ("on", 1.0),
}
# Characters of moves that are read at once, and where they begin if each has a line of its own.
CHARACTERS = 2**20
_MOVES = re.compile(r',\s*"moves":[ \t]*\[[ \t]*\r?\n')
SIZES = ("diameter_mm", "corner_radius_mm", "length_mm")


class Json(Neutral):
    """Schema ``stiffarm-program/2`` (:mod:`machining.programs.neutral`)."""

    name, title = "json", "JSON"

    def pieces(self, program: JointProgram) -> Iterator[str]:
        """See :class:`Neutral`."""
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
            "events": [_event(event) for event in ordered(m)],
            "notes": [{"line": note.line, "text": note.text, "count": note.count} for note in m.notes],
            "columns": columns(robot, cell),
        }
        encode = json.JSONEncoder(allow_nan=False).encode
        yield json.dumps(head, indent=1, allow_nan=False)[:-2] + ',\n "moves": [\n'
        for first in range(0, program.n, BLOCK):
            last = min(first + BLOCK, program.n)
            text = ",\n".join(map(encode, rows(program, first, last)))
            yield text + ("\n" if last == program.n else ",\n")
        yield " ]\n}\n"

    def program(self, text: str, robot: Robot, cell: Cell, where: str = "program") -> JointProgram:
        """See :class:`Neutral`.

        Raises
        ------
        InputError
            No JSON, another schema, another robot, other axes; a missing key or column, a value of the wrong kind.
        """
        data, lines = _parsed(text, where)
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            found = data.get("schema") if isinstance(data, dict) else type(data).__name__
            raise InputError(f"{where}, schema", code="Q005", value=str(found)[:80], allowed=SCHEMA)
        for key, value, wanted in (
            ("robot", _get(data, "robot", where), robot.name),
            ("joints", _get(data, "joints", where), robot.dof),
            ("linear_axes", len(_list(data, "linear_axes", where)), len(cell.linear_axes)),
            ("turntable", _get(data, "turntable", where), cell.turntable is not None),
        ):
            if value != wanted:
                raise InputError(f"{where}, {key}", code="Q005", value=str(value)[:80], allowed=str(wanted))
        table = _table(data, columns(robot, cell), where)
        try:
            return program_of(robot, cell, table, where, lines, **_others(data, table, where))
        except InputError:
            raise
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            raise InputError(
                f"{where}: {type(error).__name__}: {error}", code="Q005", remedy="write the file again"
            ) from error

    def told(self, program: JointProgram, back: JointProgram) -> InputError | None:
        """See :class:`Neutral`: every event, its value within rounding."""
        for wanted, found in itertools.zip_longest(ordered(program.motions), ordered(back.motions)):
            same = wanted is not None and found is not None and wanted.same(found)
            if not same:
                event = wanted or found
                return InputError(
                    f"event {event.kind or event.word} of line {event.line}",
                    code="Q001",
                    value="missing" if found is None else "not in the tool path" if wanted is None else "another",
                    allowed="the events of the tool path, in their order",
                )
        return None


def _parsed(text: str, where: str) -> tuple[Any, Integers | None]:
    """What the file says, with ``moves`` (n, m) where each stands in a line of its own, and then their lines.

    Of a long program the moves as Python's numbers would be four times as large as its text.
    """
    start, stop = _MOVES.search(text), text.rfind("]")
    if start is not None and text[stop + 1 :].strip() == "}":
        head = text[: start.start()] + "}"
        try:
            data = parse_json(head, where)
            blocks = [_rows(block, where) for block in _blocks(text, start.end(), stop)]
        except (InputError, ValueError):
            # It is laid out in another way, or something is wrong, which the whole of it tells with its place.
            blocks = []
        if blocks and "moves" not in data:
            moves, first = np.concatenate(blocks), text.count("\n", 0, start.end()) + 1
            return data | {"moves": moves}, np.arange(first, first + len(moves))
    return parse_json(text, where, remedy="write the file again"), None


def _blocks(text: str, start: int, stop: int) -> Iterator[str]:
    """Whole lines of a part of a text, some thousand at a time; without the white space at its end."""
    while start < stop:
        end = text.find("\n", start + CHARACTERS, stop)
        end = stop if end < 0 else end + 1
        block = text[start:end].rstrip()
        if block:
            yield block
        start = end


def _rows(block: str, where: str) -> Array:
    """Moves (k, m) of lines with one each. Raises ValueError or InputError where they are not that."""
    rows = parse_json(f"[{block.removesuffix(',')}]", where)
    lines = [line.strip() for line in block.split("\n")]
    if not (len(rows) == len(lines) and all(line.startswith("[") and line.rstrip(",").endswith("]") for line in lines)):
        raise ValueError("not one move a line")
    return _numbers(rows, len(rows[0]), where)


def _event(event: Event) -> dict[str, Any]:
    """An event as the file has it; the value of a command by a key with its unit."""
    out = {"line": event.line, "before_move": event.move, "word": event.word, "text": event.text, "kind": event.kind}
    if event.kind in VALUES:
        key, factor = VALUES[event.kind]
        out[key] = _known(event.value / factor)
    return out


def _event_of(data: Mapping[str, Any]) -> Event:
    kind, value = str(data["kind"]), math.nan
    if kind in VALUES:
        key, factor = VALUES[kind]
        value = math.nan if data[key] is None else float(data[key]) * factor
    return Event(int(data["line"]), int(data["before_move"]), str(data["word"]), str(data["text"]), kind, value)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _get(data: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in data:
        raise InputError(f"{where}: no {key}", code="Q005", remedy="write the file again")
    return data[key]


def _list(data: Mapping[str, Any], key: str, where: str) -> list[Any]:
    value = _get(data, key, where)
    if not isinstance(value, list):
        raise InputError(f"{where}, {key}", code="Q005", value=type(value).__name__, allowed="a list")
    return value


def _table(data: dict[str, Any], wanted: list[str], where: str) -> dict[str, Array]:
    if _list(data, "columns", where) != wanted:
        raise InputError(f"{where}, columns", code="Q005", allowed=", ".join(wanted))
    if not isinstance(data.get("moves"), np.ndarray):
        moves = _numbers(_list(data, "moves", where), len(wanted), where)
    # Taken out, so that it does not stand beside the table made of it.
    elif (moves := data.pop("moves")).shape[1] != len(wanted):
        raise InputError(
            f"{where}, moves", code="Q005", value=f"{moves.shape[1]} values each", allowed=f"{len(wanted)} values"
        )
    return table_of(wanted, moves, where)


def _numbers(rows: Any, count: int, where: str) -> Array:
    """Moves (k, count) of rows of that many numbers, null as NaN. Raises InputError for anything else."""
    known = {int, float, bool, type(None)}
    for i, row in enumerate(rows):
        if type(row) is not list or len(row) != count:
            raise InputError(f"{where}, move {i + 1}", code="Q005", allowed=f"a list of {count} values")
        if not known.issuperset(map(type, row)):
            raise InputError(f"{where}, move {i + 1}", code="Q005", allowed="numbers, true, false or null")
    return np.array(rows, dtype=np.float64)


def _others(data: Mapping[str, Any], table: Mapping[str, Array], where: str) -> dict[str, Any]:
    """Fields of a program and its motions that are no columns of numbers."""
    tools = (
        Tool(
            None if tool["number"] is None else int(tool["number"]),
            str(tool["name"]),
            *(np.nan if tool[key] is None else float(tool[key]) * 1e-3 for key in SIZES),
        )
        for tool in _list(data, "tools", where)
    )
    return {
        "tools": tuple(tools),
        "events": tuple(_event_of(e) for e in _list(data, "events", where)),
        "notes": tuple(Note(int(n["line"]), str(n["text"]), int(n["count"])) for n in _list(data, "notes", where)),
        "tool": integers(table["tool"]),
        "operation": integers(table["operation"]),
        "operations": tuple(str(name) for name in _list(data, "operations", where)),
        "source": str(_get(data, "source", where)),
        "branch": integers(table["branch"]),
        "names": tuple(str(name) for name in _list(data, "branches", where)),
    }


FORMAT = Json()
