"""The command `study`: sets with a key through the diagnosis, blind, and strict scores."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from stiffarm.commands.study import payload, words
from stiffarm.commands.study import step as studying
from stiffarm.commands.study.sets import study_sets
from stiffarm.session.console import progress, say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Out


def study(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folder of sets; each is a folder with set.json, readings.csv and key.json, and may have unseen.csv.",
        ),
    ],
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", help="Number of sets diagnosed at the same time. Default: one per processor.", min=1, max=256
        ),
    ] = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Score the diagnosis on readings whose true cause is known.

    Any simulator can make the sets: readings with a hidden effect, and a key that the diagnosis does not see. Every
    set is diagnosed blind, with unchanged defaults, and counted strictly: "unknown" and "none" are never right for an
    effect of the catalogue, and candidates that were only tried do not count. Writes study.json, rows.csv and a
    report into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        sets = study_sets(folder)
        with frame.folder_if() as results:
            with frame.timed("study"), progress("sets") as bar:
                say(f"{len(sets)} sets")
                rows = studying.study(sets, jobs or os.cpu_count() or 1, bar)
            content = payload.study(rows)
            if results is not None:
                from stiffarm.commands.study.report import write_report

                results.write_json("study.json", content)
                results.write_text("rows.csv", payload.as_csv(rows))
                with results.timed("report"):
                    write_report(rows, folder.name or str(folder), results)

        def show() -> None:
            for text in words.summary(rows):
                say(text)
            show_table("Scores", list(words.HEADS), [list(line) for line in words.lines(rows)])
            if families := words.families(rows):
                show_table("By effect, detectable singles", list(words.FAMILY_HEADS), [list(f) for f in families])

        frame.answer(content, show)
