"""Tool paths, and motions of them, from CSV, every bad row reported; motions are written too."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from doe.tables.columns import RawTable
from doe.tables.schema import Cells, Column, Need
from machining import magnitudes as limits
from machining.task import REPEATED, ToolPath
from machining.toolpaths.motions import Event, Motions, Note, Tool, clean
from machining.toolpaths.source import content
from robots import InputError
from robots.arrays import Array
from robots.constants import RPM
from robots.faults import Faults
from robots.files.csv_text import as_read, write_rows
from robots.files.reading import read_text
from robots.files.written import written_whole

POINT = ("x_mm", "y_mm", "z_mm")
NORMAL = ("nx", "ny", "nz")
AXIS = ("tx", "ty", "tz")
FEED = "feed_mm_per_min"
PATH = (*POINT, *NORMAL, *AXIS, FEED)
MOTIONS = (*POINT, *AXIS, "rapid", FEED, "line", "tool", "spindle_rpm", "dwell_s", "operation")
# Components of directions: shorter ones have no direction, longer ones are none.
SHORTEST, _LONGEST = 1e-9, 1e9
_FEEDS = f"more than 0 ({limits.FEEDS}), or empty"
_NUMBERS = f"a whole number from 0 to {limits.LARGEST_NUMBER:g}"
_TURNS = limits.FASTEST_TURN * 9.5
_WHOLE = ("line", "tool", "operation")
COLUMNS = tuple(
    column._replace(code="P008")
    for column in (
        *(
            Column(name, least=-limits.FARTHEST * 1e3, most=limits.FARTHEST * 1e3, allowed=limits.PLACES)
            for name in POINT
        ),
        *(Column(name, least=-_LONGEST, most=_LONGEST, allowed="a finite number") for name in (*NORMAL, *AXIS)),
        Column(FEED, "not given", least=limits.SLOWEST * 6e4, most=limits.FASTEST * 6e4, allowed=_FEEDS),
        Column("rapid", least=0.0, most=1.0, whole=True, allowed="0 or 1"),
        *(Column(name, least=0.0, most=limits.LARGEST_NUMBER, whole=True, allowed=_NUMBERS) for name in _WHOLE),
        Column("spindle_rpm", "none", least=-_TURNS, most=_TURNS, allowed=f"{-_TURNS:g} to {_TURNS:g}, or empty"),
        Column("dwell_s", least=0.0, most=limits.LONGEST_REST, allowed=f"0 to {limits.LONGEST_REST:g} s"),
    )
)
REMEDY = (
    f"name the columns {','.join(POINT + NORMAL)}[,{','.join(AXIS)}][,{FEED}], comma or semicolon between them, "
    "a point in numbers"
)
# Of motions: the first line, and what lines of tools and operations begin with.
# Moves that are read at once, so that a long file takes little memory.
BLOCK = 65536
MARK = "# stiffarm motions 1"
TOOL = "#tool"
OPERATION = "#operation"
# An event: source line, move it comes before, kind, value, word, text. Of the spindle the value is in rpm.
EVENT = "#event"
REWRITE = "write it with write_motions"


def read_path(path: str | Path) -> ToolPath:
    """Read a tool path from a CSV file (UTF-8, header in line 1, in the part frame).

    ``x_mm, y_mm, z_mm, nx, ny, nz`` are required. ``tx, ty, tz`` is the tool axis from the tip into the holder, the
    normal if the columns are missing. An empty ``feed_mm_per_min`` is "not given". Blank lines are skipped.

    Raises
    ------
    InputError
        The file or its header cannot be read.
    InputErrors
        Bad rows, all of them: cells that are no numbers, directions of length zero, feeds that are not positive,
        points that repeat the one before.
    """
    path = Path(path)
    table = _rows(path)
    axes = AXIS if {*AXIS} & {*table.header} else ()
    faults = Faults(path.name)
    needed = Need((*POINT, *NORMAL, *axes), "no column {}", ", ".join(PATH), REMEDY, code="P008")
    header = Cells.of(table, [column for column in COLUMNS if column.name in PATH], (needed,), faults, code="P008")
    header.refuse_unknown(code="P008", remedy=REMEDY)
    faults.raise_if_any("tool path")
    cells = header.whole_rows("P008")
    points = cells.numbers(*POINT)
    normals = _directions(cells, NORMAL, "normal")
    tools = _directions(cells, axes, "tool axis") if axes else normals
    feed = cells.numbers(FEED)[:, 0] * (1e-3 / 60.0)
    # The tool may turn on the spot. NaN compares false: a bad row is reported for what is bad about it only.
    places = np.hstack([1e3 * points, tools] if axes else [1e3 * points])
    repeated = np.abs(np.diff(places, axis=0)).max(axis=1, initial=0.0) < REPEATED * 1e3
    neighbours = np.diff(np.searchsorted(table.lines, cells.table.lines)) == 1
    cells.check(
        np.concatenate([np.zeros(min(len(places), 1), dtype=np.bool_), repeated & neighbours]),
        "the point of the row before once more",
        code="P008",
        value=lambda i: str((1e3 * points[i]).tolist()),
        allowed="neighbouring points at different places",
        remedy="remove one of the two",
    )
    faults.raise_if_any("tool path")
    return ToolPath(points, normals, tools, feed)


def _directions(cells: Cells, names: Sequence[str], what: str) -> Array:
    """Columns (n, 3) of a direction, none of length zero."""
    values = cells.numbers(*names)
    cells.check(
        np.abs(values).max(axis=1) < SHORTEST,
        f"columns {', '.join(names)}: {what} of length zero",
        code="P008",
        value=lambda i: ", ".join(f"{v:g}" for v in values[i]),
        allowed="a direction",
        remedy="give one",
    )
    return values


def _rows(path: Path) -> RawTable:
    text = read_text(path, "tool path file")
    head = text.split("\n", 1)[0]
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";" if ";" in head and "," not in head else ",")
    try:
        rows = [(reader.line_num, tuple(map(str.strip, row))) for row in reader]
    except csv.Error as error:
        raise InputError(f"tool path {path}, row {reader.line_num} ({error})", code="P008", remedy=REMEDY) from error
    rows = [(line, row) for line, row in rows if any(row)]
    if len(rows) < 2:
        raise InputError(f"tool path {path} has no points", code="P002", remedy=REMEDY)
    lines, body = zip(*rows[1:], strict=True)
    return RawTable(path.name, "", rows[0][1], body, lines, ())


def write_motions(path: str | Path, motions: Motions) -> None:
    """Write moves, tools, operations and events; notes are not written.

    Every number has the digits that make it come back within a rounding error (coordinates within 1e-9 m and better).
    """
    with written_whole(Path(path)) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        head: list[list[object]] = [[MARK]]
        for tool in motions.tools:
            sizes = [v * 1e3 for v in (tool.diameter, tool.corner_radius, tool.length)]
            head.append([TOOL, tool.number, tool.name, *sizes])
        head += [[OPERATION, name] for name in motions.operations]
        write_rows(file, [*head, *map(_event_row, motions.events), MOTIONS], "\r\n")
        columns = (
            *(motions.points * 1e3).T,
            *motions.axes.T,
            motions.rapid.astype(int),
            motions.feed * 6e4,
            motions.line,
            motions.tool,
            motions.spindle / RPM,
            motions.dwell,
            motions.operation,
        )
        for start in range(0, motions.n, 4096):
            rows = zip(*(column[start : start + 4096].tolist() for column in columns), strict=True)
            write_rows(file, rows, "\r\n")


def _event_row(event: Event) -> list[object]:
    value = event.value / RPM if event.kind == "spindle" else event.value
    return [EVENT, event.line, event.move, event.kind, value, event.word, event.text]


def _event(row: list[str]) -> Event:
    if len(row) != 7:
        raise ValueError(f"an event with {len(row)} cells, not 7")
    for cell in row[1:3]:
        if not (cell.isascii() and cell.isdecimal() and len(cell) < 11):
            raise ValueError(f"{cell[:40]!r} of an event is no whole number of up to ten digits")
    value = float(row[4]) if row[4] else math.nan
    return Event(int(row[1]), int(row[2]), row[5], row[6], row[3], value * RPM if row[3] == "spindle" else value)


def read_motions(path: str | Path, max_bytes: int = 256 * 2**20) -> Motions:
    """Read what :func:`write_motions` wrote.

    Raises
    ------
    InputError
        Another file, or one too large.
    InputErrors
        Bad rows, at most twenty of them and the number of the rest.
    """
    path = Path(path)
    tools: list[Tool] = []
    operations: list[str] = []
    events: list[Event] = []
    table: list[Array] = []
    rows: list[tuple[str, ...]] = []
    numbers: list[int] = []
    faults = Faults(path.name)
    data = io.BytesIO(content(path, max_bytes))
    with io.TextIOWrapper(data, encoding="utf-8", errors="replace", newline="") as file:
        reader = csv.reader(file)
        try:
            if next(reader, None) != [MARK]:
                raise InputError(f"{path.name}, line 1", code="P008", allowed=MARK, remedy=REWRITE)
            headed = False
            for row in filter(None, reader):
                if headed:
                    rows.append(tuple(map(str.strip, row)))
                    numbers.append(reader.line_num)
                    if len(rows) == BLOCK:
                        table.append(_moves(rows, numbers, faults))
                        rows, numbers = [], []
                elif row[0] in (TOOL, EVENT):
                    try:
                        cells = list(map(as_read, row))
                        if row[0] == TOOL:
                            tools.append(_tool(cells))
                        else:
                            events.append(_event(cells))
                    except ValueError as error:
                        faults.say(reader.line_num, f"{path.name}, line {reader.line_num}: {error}", code="P008")
                elif row[0] == OPERATION and len(row) == 2:
                    operations.append(as_read(row[1]))
                elif tuple(row) == MOTIONS:
                    headed = True
                else:
                    allowed = f"{TOOL}, {OPERATION}, {EVENT} or the columns"
                    faults.add(
                        reader.line_num, "first cell", code="P008", value=clean(row[0]), allowed=allowed, remedy=REWRITE
                    )
        except csv.Error as error:
            raise InputError(f"{path.name}, line {reader.line_num} ({error})", code="P008") from error
    table.append(_moves(rows, numbers, faults))
    if not faults and not sum(map(len, table)):
        raise InputError(f"{path.name} has no moves", code="P002", allowed=",".join(MOTIONS))
    faults.raise_if_any("motions")
    return _motions(np.concatenate(table), tools, operations, events, path.name)


def _moves(rows: Sequence[tuple[str, ...]], numbers: Sequence[int], faults: Faults) -> Array:
    """Some of the moves, by column (n, 13)."""
    table = RawTable(faults.file, "", MOTIONS, tuple(rows), tuple(numbers), ())
    cells = Cells.of(table, COLUMNS, (), faults, code="P008").whole_rows("P008")
    _directions(cells, AXIS, "tool axis")
    return cells.numbers(*MOTIONS, si=False)


def _tool(row: list[str]) -> Tool:
    if len(row) != 6:
        raise ValueError(f"a tool with {len(row)} cells, not 6")
    if row[1] and not (row[1].isascii() and row[1].isdecimal() and len(row[1]) < 11):
        raise ValueError(f"tool number {row[1][:40]!r} is no whole number of up to ten digits")
    sizes = [float(cell) * 1e-3 if cell else math.nan for cell in row[3:]]
    if not all(0.0 <= size <= limits.FARTHEST for cell, size in zip(row[3:], sizes, strict=True) if cell):
        raise ValueError(f"sizes of a tool {', '.join(row[3:])[:80]!r} are none")
    return Tool(int(row[1]) if row[1] else None, row[2], *sizes)


def _motions(table: Array, tools: list[Tool], operations: list[str], events: list[Event], source: str) -> Motions:
    columns = dict(zip(MOTIONS, table.T, strict=True))
    axes = np.stack([columns[name] for name in AXIS], axis=1)
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    off = int((np.abs(length - 1.0) > 1e-3).sum())
    return Motions(
        points=np.stack([columns[name] for name in POINT], axis=1) * 1e-3,
        axes=axes / length,
        rapid=columns["rapid"] != 0.0,
        feed=columns[FEED] / 6e4,
        line=columns["line"].astype(np.int64),
        tool=columns["tool"].astype(np.int64),
        spindle=columns["spindle_rpm"] * RPM,
        dwell=columns["dwell_s"].copy(),
        operation=columns["operation"].astype(np.int64),
        tools=tuple(tools) or (Tool(),),
        operations=tuple(operations) or ("",),
        events=tuple(events),
        notes=(Note(0, f"tool axes of {off} moves are made unit vectors"),) if off else (),
        source=source,
    )
