"""The command `rehearse`: hide an effect in made-up readings, and see whether the diagnosis finds it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from stiffarm.commands.rehearse import payload, words
from stiffarm.commands.rehearse import step as rehearsing
from stiffarm.commands.rehearse.sheet import SETUP_PERCENT, Gauge
from stiffarm.commands.rehearse.step import MOST_DRAWS, Rehearsed, Request
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Out, Seed, Sets
from stiffarm.session.table_kinds import DEFLECTIONS, expect


def rehearse(
    model: ModelArg,
    sheet: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SHEET]",
            help="Measurement table or sheet to fill in (CSV/XLSX) whose poses, loads and order are used; its own "
            "readings only tell the noise. Default: the robot's bundled table, otherwise a campaign of 27 poses.",
        ),
    ] = None,
    hide: Annotated[
        str | None,
        typer.Option(
            "--hide",
            metavar="CODE",
            help="Effect to hide, as in friction:j2, or none for nothing. Default: drawn at random and kept secret "
            "until the end.",
        ),
    ] = None,
    draws: Annotated[
        int, typer.Option("--draws", help="Number of rehearsals, each with a new truth.", min=1, max=MOST_DRAWS)
    ] = 1,
    poses: Annotated[
        int | None,
        typer.Option(
            "--poses",
            help="Number of poses of a campaign that fills the workspace, in place of a SHEET or a bundled table.",
            min=2,
            max=200,
        ),
    ] = None,
    reads: Annotated[
        str | None, typer.Option("--reads", help="Axes that the campaign reads, as in z or xyz. Default: xyz.")
    ] = None,
    noise_percent: Annotated[
        float | None,
        typer.Option(
            "--noise-percent",
            help="Standard deviation of a reading, in percent of the deflection. Default: as the sheet's sigma_mm or "
            "the scatter of its repeats says, otherwise 3.",
            min=0.0,
            max=50.0,
        ),
    ] = None,
    noise_um: Annotated[
        float | None,
        typer.Option(
            "--noise-um",
            help="Standard deviation of a reading that does not depend on its size, in um. Default: as for "
            "--noise-percent, otherwise 3.",
            min=0.0,
            max=10000.0,
        ),
    ] = None,
    setup_percent: Annotated[
        float,
        typer.Option(
            "--setup-percent",
            help="True scatter between set-ups, in percent of the deflection.",
            min=0.0,
            max=20.0,
        ),
    ] = SETUP_PERCENT,
    seed: Seed = 0,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Hide an effect in made-up readings and see whether it is found.

    Readings are made by mechanics that share nothing with the diagnosis, for the poses, loads, repeats and noise of
    your sheet. The diagnosis runs blind; then the truth is unveiled. Writes rehearsal.json, readings.csv, truth.json
    and a report into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets)
        if sheet is not None:
            expect(sheet, DEFLECTIONS, model=model)
            frame.files["sheet"] = sheet
        gauge = Gauge(noise_percent, noise_um, setup_percent, reads)
        request = Request(hide, draws, seed, poses, gauge)
        with frame.folder_if(seed) as folder:
            kept = None if folder is None else folder.stage
            with frame.timed("rehearsal"), rehearsing.places(draws, kept) as places:
                done = rehearsing.rehearsals(given, sheet, request, places, say=say)
            content = payload.rehearsal(done, secret=hide is None, seed=seed)
            if folder is not None:
                from stiffarm.commands.rehearse.report import write_report

                folder.write_json("rehearsal.json", content)
                for place, r in zip(places, done, strict=True):
                    folder.write_json(str(place.relative_to(folder.stage) / "truth.json"), rehearsing.truth(r.world))
                with folder.timed("report"):
                    write_report(done, folder)
        frame.answer(content, lambda: _show(done))


def _show(done: Sequence[Rehearsed]) -> None:
    for text in words.summary(done):
        say(text)
    if len(done) == 1:
        rows = [list(row) for row in words.numbers(done[0])]
        if rows:
            show_table("Numbers", ["number", "hidden", "found", "95 % interval", "inside"], rows)
        return
    show_table("Outcomes", ["outcome", "draws", "share", "visible"], [list(row) for row in words.tally(done)])
    rows = [
        [str(k), r.world.code, words.said(r), words.outcome(r), "yes" if r.is_visible else "no"]
        for k, r in enumerate(done, start=1)
    ]
    show_table("Draw by draw", ["draw", "hidden", "the diagnosis", "outcome", "visible"], rows)
