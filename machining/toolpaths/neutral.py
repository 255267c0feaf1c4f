"""Motions as CSV and back, for exchange and for tests."""

from __future__ import annotations

import csv
import io
import math
from array import array
from pathlib import Path

import numpy as np

from machining import magnitudes as limits
from machining.toolpaths.motions import Motions, Note, Tool
from machining.toolpaths.source import content
from robots import InputError
from robots.faults import Faults
from robots.files.csv_text import as_read, write_rows
from robots.files.written import written_whole

MARK = "# stiffarm motions 1"
COLUMNS = (
    "x_mm", "y_mm", "z_mm", "tx", "ty", "tz", "rapid", "feed_mm_per_min", "line", "tool", "spindle_rpm", "dwell_s",
    "operation",
)  # fmt: skip
TOOL = "#tool"
OPERATION = "#operation"
RANGES = {
    **dict.fromkeys(COLUMNS[:3], (-limits.FARTHEST * 1e3, limits.FARTHEST * 1e3)),
    "rapid": (0.0, 1.0),
    "feed_mm_per_min": (limits.SLOWEST * 6e4, limits.FASTEST * 6e4),
    **dict.fromkeys(("line", "tool", "operation"), (0.0, float(limits.LARGEST_NUMBER))),
    "spindle_rpm": (-limits.FASTEST_TURN * 9.5, limits.FASTEST_TURN * 9.5),
    "dwell_s": (0.0, limits.LONGEST_REST),
}
_RPM = 2.0 * math.pi / 60.0


def write_motions(path: str | Path, motions: Motions) -> None:
    """Write moves, tools and operations; events and notes are not written.

    Every number has the digits that make it come back within a rounding error (coordinates within 1e-9 m and better).
    """
    with written_whole(Path(path)) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        head: list[list[object]] = [[MARK]]
        for tool in motions.tools:
            sizes = [v * 1e3 for v in (tool.diameter, tool.corner_radius, tool.length)]
            head.append([TOOL, tool.number, tool.name, *sizes])
        write_rows(file, [*head, *([OPERATION, name] for name in motions.operations), COLUMNS], "\r\n")
        columns = (
            *(motions.points * 1e3).T,
            *motions.axes.T,
            motions.rapid.astype(int),
            motions.feed * 6e4,
            motions.line,
            motions.tool,
            motions.spindle / _RPM,
            motions.dwell,
            motions.operation,
        )
        for start in range(0, motions.n, 4096):
            rows = zip(*(column[start : start + 4096].tolist() for column in columns), strict=True)
            write_rows(file, rows, "\r\n")


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
    table = [array("d") for _ in COLUMNS]
    faults = Faults(path.name)
    data = io.BytesIO(content(path, max_bytes))
    with io.TextIOWrapper(data, encoding="utf-8", errors="replace", newline="") as file:
        reader = csv.reader(file)
        try:
            if next(reader, None) != [MARK]:
                raise InputError(f"{path.name}, line 1", allowed=MARK, remedy="write it with write_motions")
            headed = False
            for row in reader:
                if not row:
                    continue
                try:
                    if headed:
                        _row(row, table)
                    elif row[0] == TOOL:
                        tools.append(_tool(list(map(as_read, row))))
                    elif row[0] == OPERATION and len(row) == 2:
                        operations.append(as_read(row[1]))
                    elif tuple(row) == COLUMNS:
                        headed = True
                    else:
                        _refuse_line()
                except ValueError as error:
                    faults.say(reader.line_num, f"{path.name}, line {reader.line_num}: {error}")
        except csv.Error as error:
            raise InputError(f"{path.name}, line {reader.line_num} ({error})") from error
    if not faults and not len(table[0]):
        raise InputError(f"{path.name} has no moves", allowed=",".join(COLUMNS))
    faults.raise_if_any("motions")
    return _motions(table, tools, operations, path.name)


def _refuse_line() -> None:
    raise ValueError(f"expected {TOOL}, {OPERATION} or the columns")


def _row(row: list[str], table: list[array[float]]) -> None:
    if len(row) != len(COLUMNS):
        raise ValueError(f"{len(row)} cells, not {len(COLUMNS)}")
    values = [float(cell) if cell else math.nan for cell in row]
    for name, cell, value in zip(COLUMNS, row, values, strict=True):
        empty = not cell and name in ("feed_mm_per_min", "spindle_rpm")
        if "_" in cell or not (math.isfinite(value) or empty):
            raise ValueError(f"column {name}: {cell[:40]!r} is no finite number")
        least, most = RANGES.get(name, (-math.inf, math.inf))
        if not (least <= value <= most or empty):
            raise ValueError(f"column {name}: {cell[:40]!r} is not from {least:g} to {most:g}")
        if name in ("rapid", "line", "tool", "operation") and value != int(value):
            raise ValueError(f"column {name}: {cell[:40]!r} is no whole number")
    if not 1e-9 < math.hypot(*values[3:6]) < 1e9:
        raise ValueError("tool axis without a direction: of length zero, or endless")
    for column, value in zip(table, values, strict=True):
        column.append(value)


def _tool(row: list[str]) -> Tool:
    if len(row) != 6:
        raise ValueError(f"a tool with {len(row)} cells, not 6")
    if row[1] and not (row[1].isascii() and row[1].isdecimal() and len(row[1]) < 11):
        raise ValueError(f"tool number {row[1][:40]!r} is no whole number of up to ten digits")
    sizes = [float(cell) * 1e-3 if cell else math.nan for cell in row[3:]]
    if not all(0.0 <= size <= limits.FARTHEST for cell, size in zip(row[3:], sizes, strict=True) if cell):
        raise ValueError(f"sizes of a tool {', '.join(row[3:])[:80]!r} are none")
    return Tool(int(row[1]) if row[1] else None, row[2], *sizes)


def _motions(table: list[array[float]], tools: list[Tool], operations: list[str], source: str) -> Motions:
    columns = {name: np.frombuffer(column) for name, column in zip(COLUMNS, table, strict=True)}
    axes = np.stack([columns[name] for name in ("tx", "ty", "tz")], axis=1)
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    off = int((np.abs(length - 1.0) > 1e-3).sum())
    return Motions(
        points=np.stack([columns[name] for name in ("x_mm", "y_mm", "z_mm")], axis=1) * 1e-3,
        axes=axes / length,
        rapid=columns["rapid"] != 0.0,
        feed=columns["feed_mm_per_min"] / 6e4,
        line=columns["line"].astype(np.int64),
        tool=columns["tool"].astype(np.int64),
        spindle=columns["spindle_rpm"] * _RPM,
        dwell=columns["dwell_s"].copy(),
        operation=columns["operation"].astype(np.int64),
        tools=tuple(tools) or (Tool(),),
        operations=tuple(operations) or ("",),
        notes=(Note(0, f"tool axes of {off} moves are made unit vectors"),) if off else (),
        source=source,
    )
