"""From tables of positions and the options of `calibrate` to a calibration, its answer and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from doe.absolute.calibrate import Positions, calibrate_positions
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.regions import Regions, accuracy_regions
from doe.absolute.table import joined, read_absolute
from doe.absolute.written import Written, written
from fem.arm import Arm
from machining.programs.controller_offsets import ControllerOffsets
from stiffarm.commands.calibrate.positions import corrections, payload, region_pages, tables
from stiffarm.session import parsing
from stiffarm.session.console import progress, say_notes
from stiffarm.session.frame import Frame
from stiffarm.session.outputs import OutputFolder


def calibrate_tables(
    frame: Frame,
    given: Arm,
    data: Sequence[Path],
    refused: Mapping[str, Any],
    *,
    free: str | None,
    holdout: Path | None,
    robust: bool,
    seed: int,
) -> None:
    """Calibrate on tables of positions; options in ``refused`` have no meaning here.

    Raises
    ------
    InputError
        One of those options was given; a table, a name or readings that cannot be used.
    """
    parsing.refuse_given(dict(refused), "no option for tables of positions", "leave it out")
    frame.reads(holdout=holdout)
    read = [read_absolute(file, given.robot) for file in data]
    table = joined(read)
    frame.files |= {f"data_{k}" if k > 1 else "data": one.sha256 for k, one in enumerate(read, start=1)}
    kept: AbsoluteReadings | None = None if holdout is None else read_absolute(holdout, given.robot)
    say_notes((*table.notes, *(() if kept is None else kept.notes)))
    names = parsing.parse_names(free, None, "--free")
    with frame.folder_if(seed) as folder:
        with progress("steps") as bar:
            found = calibrate_positions(given.model, table, names, holdout=kept, robust=robust, seed=seed, progress=bar)
        made = written(found, given.description)
        taken = corrections.offsets(found, made)
        content = payload.positions(given, found)
        by_region = accuracy_regions(found, seed=seed)
        content |= {"regions": region_pages.payload(by_region), "corrections": corrections.content(found, made, taken)}
        if folder is not None:
            _write(given, found, (made, taken), by_region, content, folder)
    frame.answer(content, lambda: tables.show(found, by_region))
    if frame.out is not None and not frame.as_json:
        say_notes(corrections.remarks(found, made))


def _write(
    given: Arm,
    found: Positions,
    back: tuple[Written, tuple[ControllerOffsets, ...]],
    by_region: Regions,
    content: dict[str, Any],
    folder: OutputFolder,
) -> None:
    """positions.json, the corrections, parameters.csv, curves.csv, errors.csv, pictures and report.html."""
    from stiffarm.commands.calibrate.positions.report import write_report

    folder.write_json("positions.json", content)
    corrections.write(found, *back, folder)
    folder.write_text("parameters.csv", payload.parameters_csv(found))
    folder.write_text("regions.csv", region_pages.regions_csv(by_region))
    folder.write_text("errors.csv", payload.errors_csv(found))
    if found.curves:
        folder.write_text("curves.csv", payload.curves_csv(found))
    with folder.timed("report"):
        write_report(given, found, back, by_region, folder)
