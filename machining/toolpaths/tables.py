"""Tool paths, and motions of them, from CSV, every bad row reported; motions are written too."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machining import magnitudes as limits
from machining.task import REPEATED, ToolPath
from machining.toolpaths.motions import Event, Motions, Note, Tool, clean
from machining.toolpaths.source import content
from robots import InputError
from robots.arrays import Array
from robots.constants import RPM
from robots.errors import listed
from robots.faults import Faults
from robots.files.csv_text import as_read, write_rows
from robots.files.reading import read_text
from robots.files.written import written_whole


@dataclass(frozen=True)
class Column:
    """What a cell may hold: a number from ``least`` to ``most``, a ``whole`` one, or nothing (``empty``)."""

    least: float
    most: float
    allowed: str
    whole: bool = False
    empty: bool = False


def _whole(most: float) -> Column:
    return Column(0.0, most, f"a whole number from 0 to {most:g}", whole=True)


POINT = ("x_mm", "y_mm", "z_mm")
NORMAL = ("nx", "ny", "nz")
AXIS = ("tx", "ty", "tz")
FEED = "feed_mm_per_min"
MOTIONS = (*POINT, *AXIS, "rapid", FEED, "line", "tool", "spindle_rpm", "dwell_s", "operation")
# Components of directions: shorter ones have no direction, longer ones are none.
SHORTEST, _LONGEST = 1e-9, 1e9
_FEEDS = f"more than 0 ({limits.FEEDS}), or empty"
_TURNS = limits.FASTEST_TURN * 9.5
COLUMNS = {
    **dict.fromkeys(POINT, Column(-limits.FARTHEST * 1e3, limits.FARTHEST * 1e3, limits.PLACES)),
    **dict.fromkeys((*NORMAL, *AXIS), Column(-_LONGEST, _LONGEST, "a finite number")),
    FEED: Column(limits.SLOWEST * 6e4, limits.FASTEST * 6e4, _FEEDS, empty=True),
    "rapid": _whole(1.0),
    **dict.fromkeys(("line", "tool", "operation"), _whole(float(limits.LARGEST_NUMBER))),
    "spindle_rpm": Column(-_TURNS, _TURNS, f"a number from {-_TURNS:g} to {_TURNS:g}, or empty", empty=True),
    "dwell_s": Column(0.0, limits.LONGEST_REST, f"0 to {limits.LONGEST_REST:g} s"),
}
REMEDY = (
    f"name the columns {','.join(POINT + NORMAL)}[,{','.join(AXIS)}][,{FEED}], comma or semicolon between them, "
    "a point in numbers"
)
# Of motions: the first line, and what lines of tools and operations begin with.
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
    header, rows = _rows(path)
    _check_header(path, header)
    faults = Faults(path.name)
    table = _plain_table(header, rows)
    if table is None:
        table = _checked_table(header, rows, faults)
    points = np.stack([table[name] for name in POINT], axis=1) * 1e-3
    normals = np.stack([table[name] for name in NORMAL], axis=1)
    axes = np.stack([table[name] for name in AXIS], axis=1) if AXIS[0] in header else normals
    feed = table[FEED] * (1e-3 / 60.0) if FEED in header else np.full(len(points), np.nan)
    return ToolPath(points, normals, axes, feed)


def _plain_table(header: list[str], rows: list[tuple[int, list[str]]]) -> dict[str, Array] | None:
    """Columns (n,) of a table without a fault; None where a look at each row has to say what is wrong."""
    if any(len(row) != len(header) for _, row in rows) or any("_" in cell for _, row in rows for cell in row):
        return None
    try:
        values = np.array([[cell or "nan" for cell in row] for _, row in rows], dtype=np.float64)
    except ValueError:
        return None
    table = dict(zip(header, values.T.copy(), strict=True))
    for place, (name, values_of) in enumerate(table.items()):
        column = COLUMNS[name]
        good = (values_of >= column.least) & (values_of <= column.most)
        if column.empty:
            good |= np.array([not row[place] for _, row in rows])
        if not good.all():
            return None
    groups = [group for group in (NORMAL, AXIS) if group[0] in header]
    if any((np.max([np.abs(table[name]) for name in group], axis=0) < SHORTEST).any() for group in groups):
        return None
    places = np.stack([table[name] for name in (*POINT, *(AXIS if AXIS[0] in header else ()))], axis=1)
    repeated = np.abs(np.diff(places, axis=0)).max(axis=1, initial=0.0) < REPEATED * 1e3
    return None if repeated.any() else table


def _checked_table(header: list[str], rows: list[tuple[int, list[str]]], faults: Faults) -> dict[str, Array]:
    """Columns (n,), row by row; raises InputErrors for all bad rows."""
    values = [_numbers(line, row, header, faults, REMEDY) for line, row in rows]
    last: Array | None = None
    for (line, _), value in zip(rows, values, strict=True):
        # The tool may turn on the spot. NaN compares false: a bad row is reported for what is bad about it only.
        point = np.array([value.get(name, np.nan) for name in (*POINT, *(AXIS if AXIS[0] in header else ()))])
        if last is not None and np.abs(point - last).max() < REPEATED * 1e3:
            faults.add(
                line,
                "the point of the row before once more",
                code="P008",
                value=str(point[:3].tolist()),
                allowed="neighbouring points at different places",
                remedy="remove one of the two",
            )
        last = point
    faults.raise_if_any("tool path")
    return {name: np.array([value[name] for value in values]) for name in header}


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    text = read_text(path, "tool path file")
    head = text.split("\n", 1)[0]
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";" if ";" in head and "," not in head else ",")
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise InputError(f"tool path {path}, row {reader.line_num} ({error})", code="P008", remedy=REMEDY) from error
    rows = [(line, row) for line, row in rows if any(row)]
    if len(rows) < 2:
        raise InputError(f"tool path {path} has no points", code="P002", remedy=REMEDY)
    return rows[0][1], rows[1:]


def _check_header(path: Path, header: list[str]) -> None:
    known = (*POINT, *NORMAL, *AXIS, FEED)
    doubled = [name for name, count in Counter(header).items() if count > 1]
    unknown = [name for name in header if name not in known]
    wanted = (*POINT, *NORMAL, *(AXIS if any(name in header for name in AXIS) else ()))
    missing = [name for name in wanted if name not in header]
    for words, names in (("twice", doubled), ("unknown", unknown), ("missing", missing)):
        if names:
            raise InputError(
                f"{path.name}, columns {words}",
                code="P008",
                value=listed(names),
                allowed=", ".join(known),
                remedy=REMEDY,
            )


def _numbers(line: int, row: list[str], names: Sequence[str], faults: Faults, remedy: str) -> dict[str, float]:
    """Numbers of one row by column; what is bad about it is added to ``faults`` and left out."""
    if len(row) != len(names):
        faults.add(line, "number of cells", code="P008", value=str(len(row)), allowed=str(len(names)), remedy=remedy)
        return {}
    out: dict[str, float] = {}
    for name, cell in zip(names, row, strict=True):
        column, value = COLUMNS[name], np.nan
        with suppress(ValueError):
            value = np.nan if "_" in cell else float(cell)
        good = column.least <= value <= column.most and not (column.whole and value != int(value))
        if good or (column.empty and not cell):
            out[name] = value
        else:
            faults.add(
                line,
                f"column {name}",
                code="P008",
                value=clean(cell),
                allowed=column.allowed,
                remedy="correct the cell",
            )
    for group, what in ((NORMAL, "normal"), (AXIS, "tool axis")):
        given = [out[name] for name in group if name in out]
        if len(given) == len(group) and max(map(abs, given)) < SHORTEST:
            faults.add(
                line,
                f"columns {', '.join(group)}: {what} of length zero",
                code="P008",
                value=", ".join(f"{v:g}" for v in given),
                allowed="a direction",
                remedy="give one",
            )
    return out


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
    table = {name: array("d") for name in MOTIONS}
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
                    values = _numbers(reader.line_num, row, MOTIONS, faults, REWRITE)
                    if len(values) == len(table):
                        for name, value in values.items():
                            table[name].append(value)
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
    if not faults and not len(table["line"]):
        raise InputError(f"{path.name} has no moves", code="P002", allowed=",".join(MOTIONS))
    faults.raise_if_any("motions")
    return _motions(table, tools, operations, events, path.name)


def _tool(row: list[str]) -> Tool:
    if len(row) != 6:
        raise ValueError(f"a tool with {len(row)} cells, not 6")
    if row[1] and not (row[1].isascii() and row[1].isdecimal() and len(row[1]) < 11):
        raise ValueError(f"tool number {row[1][:40]!r} is no whole number of up to ten digits")
    sizes = [float(cell) * 1e-3 if cell else math.nan for cell in row[3:]]
    if not all(0.0 <= size <= limits.FARTHEST for cell, size in zip(row[3:], sizes, strict=True) if cell):
        raise ValueError(f"sizes of a tool {', '.join(row[3:])[:80]!r} are none")
    return Tool(int(row[1]) if row[1] else None, row[2], *sizes)


def _motions(
    table: dict[str, array[float]], tools: list[Tool], operations: list[str], events: list[Event], source: str
) -> Motions:
    columns = {name: np.frombuffer(column) for name, column in table.items()}
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
