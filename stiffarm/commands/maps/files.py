"""The files of a finished map: arrays for other programs, a table, pictures, the page to turn and pick in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem.arm import Arm
from robots import InputError
from robots.arrays import Array, in_blocks
from robots.files.csv_text import write_rows
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_names
from surrogate.maps.data import Field, MapData
from surrogate.maps.mesh import write_map
from surrogate.maps.quantities import STIFFNESS_ARRAY

FORMATS = ("vtu", "vti", "vtp")
# A table of more points is nothing to open in a spreadsheet.
CSV_UP_TO = 200_000
# Points up to which pictures are drawn: they hold all points and cells in memory.
DRAWN_UP_TO = 1_000_000
ROWS = 1 << 15


@dataclass(frozen=True)
class Files:
    """What is written besides map.json, and where the map is worked.

    ``formats``: of :data:`FORMATS`; ``figures``: those for papers of a joint sweep too, which has two pictures of its
    own; ``dask``: address of a scheduler; ``work``: folder of the blocks, which then stays; ``table``: all points as
    CSV, where they are not too many.
    """

    formats: tuple[str, ...] = ("vtu",)
    figures: bool = False
    pictures: bool = True
    html: bool = False
    dask: str | None = None
    work: Path | None = None
    table: bool = True


def formats_of(kind: str, text: str | None, *, turned: bool = False) -> tuple[str, ...]:
    """File formats of ``--format``, or the natural one of the kind of map; ``turned``: its frame is not the base's.

    Raises
    ------
    InputError
        An unknown format, or .vti for a grid that is no image.
    """
    formats = parse_names(text, FORMATS, "--format")
    image = kind in ("slice", "box") or (kind == "index" and not turned)
    if formats is not None and "vti" in formats and not image:
        raise InputError(
            f"--format vti of a map over {kind}", code="A001", allowed="a slice or a box", remedy="take vtu"
        )
    return formats or (("vti",) if kind in ("slice", "box") else ("vtu",))


def write_files(
    given: Arm, data: MapData, folder: OutputFolder, files: Files, tool: Array | None = None
) -> tuple[list[str], list[str]]:
    """Write all files but map.json; ``tool`` (3,) m: the tool point in the flange frame, if not the model's.

    Returns
    -------
    Their names, and messages for the user.
    """
    messages: list[str] = []
    joints = data.layout.kind == "joints"
    title = f"Stiffness map of the {given.description.title.split(' (')[0]}"
    names = write_arrays(given, data, folder, files, "stiffness_map" if joints else "map", title, tool)
    if files.table and data.layout.n <= CSV_UP_TO:
        names.append("map.csv")
        write_table(data, folder.path(names[-1]))
    drawn = files.pictures and (not joints or files.figures or STIFFNESS_ARRAY in data.fields)
    if drawn and data.layout.n > DRAWN_UP_TO:
        messages.append(f"no figures of more than {DRAWN_UP_TO} points; the {files.formats[0]} file has them all")
    elif drawn:
        from stiffarm.commands.maps.figures.whole import draw_map_figures

        names += draw_map_figures(data, given, folder, messages, every=files.figures or not joints)
    return names, messages


def write_arrays(
    given: Arm, data: MapData, folder: OutputFolder, files: Files, stem: str, title: str, tool: Array | None = None
) -> list[str]:
    """Write the map's arrays in each of the formats, and the page to pick in; returns the names of the files."""
    names = [f"{stem}.{form}" for form in files.formats]
    for name in names:
        write_map(data, folder.path(name))
    if files.html:
        from stiffarm.commands.maps.viewer import viewer_page
        from stiffarm.commands.maps.what_if import what_if_data

        asked = what_if_data(given, data, tool)
        folder.write_text("map.html", viewer_page(data, given.description, given.model, title=title, what_if=asked))
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
