"""The files of a finished map: arrays for other programs, a table, the page to turn and pick in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fem.arm import Arm
from robots.arrays import in_blocks
from robots.files.csv_text import write_rows
from stiffarm.commands.maps.request import MapRequest
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.data import Field, MapData
from surrogate.maps.mesh import write_map

# A table of more points is nothing to open in a spreadsheet.
CSV_UP_TO = 200_000
# Points up to which pictures are drawn: they hold all points and cells in memory.
DRAWN_UP_TO = 1_000_000
ROWS = 1 << 15


def write_arrays(
    given: Arm, data: MapData, folder: OutputFolder, asked: MapRequest, stem: str, title: str
) -> list[str]:
    """Write the map's arrays in each of the formats, and the page to pick in; returns the names of the files."""
    names = [f"{stem}.{form}" for form in asked.formats]
    for name in names:
        write_map(data, folder.path(name))
    if asked.html:
        from stiffarm.commands.maps.viewer import viewer_page
        from stiffarm.commands.maps.what_if import what_if_data

        what_if = what_if_data(given, data, asked.frame(given.robot)[:3, 3])
        folder.write_text("map.html", viewer_page(data, given.description, given.model, title=title, what_if=what_if))
        names.append("map.html")
    return names


def write_table(data: MapData, path: Path) -> None:
    """All points as CSV: where they are (mm), the pose (deg), the quantities; empty cells where there is no pose."""
    columns = {**data.places(), **data.fields}
    with path.open("w", encoding="utf-8", newline="") as file:
        write_rows(file, [columns], "\r\n")
        for rows in in_blocks(data.layout.n, ROWS):
            write_rows(file, zip(*(_cells(f, rows) for f in columns.values()), strict=True), "\r\n")


def _cells(f: Field, rows: slice) -> Iterator[str]:
    # Poses on a limit are rounded to it; -0 is 0.
    values = np.asarray(f.values[rows]) + 0.0
    if f.categories:
        return (f.categories[int(v)] if v >= 0.0 else "" for v in values)
    return ("" if np.isnan(v) else f"{v:.9g}" for v in values)
