"""Tool paths from CSV, every bad row reported."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from machining.task import REPEATED, Array, ToolPath
from robots import InputError, InputErrors
from robots.files import read_text

POINT = ("x_mm", "y_mm", "z_mm")
NORMAL = ("nx", "ny", "nz")
AXIS = ("tx", "ty", "tz")
FEED = "feed_mm_per_min"
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
    errors: list[InputError] = []
    values = [_numbers(f"{path.name}, row {line}", row, columns, len(header), errors) for line, row in rows]
    last: Array | None = None
    for (line, _), value in zip(rows, values, strict=True):
        # The tool may turn on the spot. NaN compares false: a bad row is reported for what is bad about it only.
        point = np.array([value.get(name, np.nan) for name in (*POINT, *(AXIS if AXIS[0] in columns else ()))])
        if last is not None and np.abs(point - last).max() < REPEATED * 1e3:
            errors.append(
                InputError(
                    f"{path.name}, row {line}: the point of the row before once more",
                    value=point[:3].tolist(),
                    allowed="neighbouring points at different places",
                    remedy="remove one of the two",
                )
            )
        last = point
    if errors:
        raise InputErrors(f"tool path {path.name}", errors)
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
    doubled = sorted({name for name in header if header.count(name) > 1})
    unknown = [name for name in header if name not in known]
    wanted = (*POINT, *NORMAL, *(AXIS if any(name in header for name in AXIS) else ()))
    missing = [name for name in wanted if name not in header]
    for words, names in (("twice", doubled), ("unknown", unknown), ("missing", missing)):
        if names:
            raise InputError(
                f"{path.name}, columns {words}", value=", ".join(names), allowed=", ".join(known), remedy=REMEDY
            )
    return {name: index for index, name in enumerate(header)}


def _numbers(
    where: str, row: list[str], columns: dict[str, int], width: int, errors: list[InputError]
) -> dict[str, float]:
    """Numbers of one row by column; what is bad about it is added to ``errors`` and left out."""
    if len(row) != width:
        errors.append(InputError(f"{where}: number of cells", value=len(row), allowed=str(width), remedy=REMEDY))
        return {}
    out: dict[str, float] = {}
    for name, index in columns.items():
        cell = row[index]
        try:
            value = np.nan if name == FEED and not cell else float(cell)
            good = bool(np.isfinite(value)) or (name == FEED and not cell)
        except ValueError:
            good = False
        good = good and not (name == FEED and value <= 0.0)
        if good:
            out[name] = value
        else:
            allowed = "more than 0, or empty" if name == FEED else "a finite number"
            errors.append(InputError(f"{where}, column {name}", value=cell, allowed=allowed, remedy="correct the cell"))
    for group, what in ((NORMAL, "normal"), (AXIS, "tool axis")):
        if all(out.get(name) == 0.0 for name in group):
            columns_named = ", ".join(group)
            errors.append(
                InputError(
                    f"{where}, columns {columns_named}: {what} of length zero",
                    value="0, 0, 0",
                    allowed="a direction",
                    remedy="give one",
                )
            )
    return out
