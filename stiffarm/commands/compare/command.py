"""The command `compare`: what differs between results of one kind, by how much, and whether beyond the noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from stiffarm.commands.compare import payload, words
from stiffarm.commands.compare.step import Compared
from stiffarm.commands.compare.step import compare as comparing
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Out


def compare(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B",
            help="Two or more results of one kind: folders of run, calibrate, diagnose, map or place, their JSON "
            "files, calibrated model files, or maps (.vtu, .vti, .vtp). All are compared with the first one.",
        ),
    ],
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show what differs between two results by more than noise.

    Compares calibrations, diagnoses, maps or placements; for two runs, their calibrations. Writes comparison.json and
    a report into --out; for two maps made with --html also a page with both side by side and their difference.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        found = comparing(results)
        for number, one in enumerate((found[0].a, *(c.b for c in found)), start=1):
            frame.files[f"result_{number}"] = one.file
        content = payload.comparison(found)
        with frame.folder_if() as folder:
            if folder is not None:
                from stiffarm.commands.compare.report import write_report

                folder.write_json("comparison.json", content)
                with folder.timed("report"):
                    write_report(found, folder)
        frame.answer(content, lambda: _show(found))


def _show(found: Sequence[Compared]) -> None:
    for c in found:
        title = f"{c.b.name} against {c.a.name}"
        say(f"{title}: {words.headline(c)}")
        for text in words.remarks(c):
            say(text)
        if c.maps is not None:
            show_table(title, list(words.MAP_HEADS), [list(words.map_row(q)) for q in c.maps.quantities])
            continue
        show_table(title, list(words.HEADS), [list(words.row(p)) for p in c.pairs])
        if c.settings:
            show_table(
                "How they were made", list(words.SETTING_HEADS), [list(words.setting_row(s)) for s in c.settings]
            )
