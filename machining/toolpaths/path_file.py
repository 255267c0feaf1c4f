"""Tool paths from CSV, every bad row reported."""

from __future__ import annotations

import csv
import io
from collections import Counter
from pathlib import Path

import numpy as np

from machining.magnitudes import FARTHEST, FASTEST, FEEDS, PLACES, SLOWEST
from machining.task import REPEATED, ToolPath
from robots import InputError
from robots.arrays import Array
from robots.errors import listed
from robots.faults import Faults
from robots.files.reading import read_text

POINT = ("x_mm", "y_mm", "z_mm")
NORMAL = ("nx", "ny", "nz")
AXIS = ("tx", "ty", "tz")
FEED = "feed_mm_per_min"
# Components of directions: shorter ones have no direction, longer ones are none.
SHORTEST, _LONGEST = 1e-9, 1e9
_ANY = ((-_LONGEST, _LONGEST), "a finite number")
_RANGES = {
    **dict.fromkeys(POINT, ((-FARTHEST * 1e3, FARTHEST * 1e3), PLACES)),
    FEED: ((SLOWEST * 6e4, FASTEST * 6e4), f"more than 0 ({FEEDS}), or empty"),
}
REMEDY = (
    f"name the columns {','.join(POINT + NORMAL)}[,{','.join(AXIS)}][,{FEED}], comma or semicolon between them, "
    "a point in numbers"
)


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
    columns = _columns(path, header)
    faults = Faults(path.name)
    values = [_numbers(line, row, columns, len(header), faults) for line, row in rows]
    last: Array | None = None
    for (line, _), value in zip(rows, values, strict=True):
        # The tool may turn on the spot. NaN compares false: a bad row is reported for what is bad about it only.
        point = np.array([value.get(name, np.nan) for name in (*POINT, *(AXIS if AXIS[0] in columns else ()))])
        if last is not None and np.abs(point - last).max() < REPEATED * 1e3:
            faults.add(
                line,
                "the point of the row before once more",
                value=str(point[:3].tolist()),
                allowed="neighbouring points at different places",
                remedy="remove one of the two",
            )
        last = point
    faults.raise_if_any("tool path")
    table = {name: np.array([value[name] for value in values]) for name in columns}
    points = np.stack([table[name] for name in POINT], axis=1) * 1e-3
    normals = np.stack([table[name] for name in NORMAL], axis=1)
    axes = np.stack([table[name] for name in AXIS], axis=1) if AXIS[0] in columns else normals
    feed = table[FEED] * (1e-3 / 60.0) if FEED in columns else np.full(len(points), np.nan)
    return ToolPath(points, normals, axes, feed)


def _rows(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    text = read_text(path, "tool path file")
    head = text.split("\n", 1)[0]
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";" if ";" in head and "," not in head else ",")
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise InputError(f"tool path {path}, row {reader.line_num} ({error})", remedy=REMEDY) from error
    rows = [(line, row) for line, row in rows if any(row)]
    if len(rows) < 2:
        raise InputError(f"tool path {path} has no points", remedy=REMEDY)
    return rows[0][1], rows[1:]


def _columns(path: Path, header: list[str]) -> dict[str, int]:
    known = (*POINT, *NORMAL, *AXIS, FEED)
    doubled = [name for name, count in Counter(header).items() if count > 1]
    unknown = [name for name in header if name not in known]
    wanted = (*POINT, *NORMAL, *(AXIS if any(name in header for name in AXIS) else ()))
    missing = [name for name in wanted if name not in header]
    for words, names in (("twice", doubled), ("unknown", unknown), ("missing", missing)):
        if names:
            raise InputError(
                f"{path.name}, columns {words}", value=listed(names), allowed=", ".join(known), remedy=REMEDY
            )
    return {name: index for index, name in enumerate(header)}


def _numbers(line: int, row: list[str], columns: dict[str, int], width: int, faults: Faults) -> dict[str, float]:
    """Numbers of one row by column; what is bad about it is added to ``faults`` and left out."""
    if len(row) != width:
        faults.add(line, "number of cells", value=str(len(row)), allowed=str(width), remedy=REMEDY)
        return {}
    out: dict[str, float] = {}
    for name, index in columns.items():
        cell = row[index]
        try:
            value = np.nan if name == FEED and not cell else float(cell)
        except ValueError:
            value = np.inf
        (least, most), allowed = _RANGES.get(name, _ANY)
        if least <= value <= most or (np.isnan(value) and name == FEED and not cell):
            out[name] = value
        else:
            faults.add(line, f"column {name}", value=cell, allowed=allowed, remedy="correct the cell")
    for group, what in ((NORMAL, "normal"), (AXIS, "tool axis")):
        given = [out[name] for name in group if name in out]
        if len(given) == len(group) and max(map(abs, given)) < SHORTEST:
            faults.add(
                line,
                f"columns {', '.join(group)}: {what} of length zero",
                value=", ".join(f"{v:g}" for v in given),
                allowed="a direction",
                remedy="give one",
            )
    return out
