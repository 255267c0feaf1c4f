"""The command `rehearse`: what planned readings would show; or an effect hidden in made-up ones, for the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from fem.arm import Arm
from stiffarm.commands.rehearse import payload, words
from stiffarm.commands.rehearse import step as rehearsing
from stiffarm.commands.rehearse.sheet import SETUP_PERCENT, Gauge
from stiffarm.commands.rehearse.step import MOST_DRAWS, Rehearsed, Request
from stiffarm.session.console import progress, say, show_table
from stiffarm.session.frame import Frame, command
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Out, Seed, Sets
from stiffarm.session.table_kinds import DEFLECTIONS, expect

# What --hide says where the effect is drawn at random; and usual sizes drawn where nothing is hidden.
ANY, DRAWN = "any", 24


def rehearse(
    model: ModelArg,
    sheet: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SHEET]",
            help="Measurement table or sheet to fill in (CSV/XLSX) whose poses, loads and order are used; its own "
            "readings are used only for the noise. Default: the robot's bundled table, otherwise a campaign "
            "of 27 poses.",
        ),
    ] = None,
    hide: Annotated[
        str | None,
        typer.Option(
            "--hide",
            metavar="CODE",
            help="Simulate readings with this hidden effect, as in friction:j2, and diagnose them; none hides "
            "nothing, any draws one at random and keeps it secret until the end. Default: a power analysis.",
        ),
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option(
            "--draws",
            help="With --hide: number of rehearsals, each with a new truth (default 1). Otherwise: usual sizes drawn "
            "of each effect (default 24).",
            min=1,
            max=MOST_DRAWS,
        ),
    ] = None,
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
    """Forecast what a planned sheet would show, before you measure.

    For the poses, loads, repeats and noise of your sheet: the smallest size of each effect that would be found with a
    chance of 80 %, the chances that usual sizes are found and named, the intervals to expect of the springs, and what
    one more set-up, load or repeat would add. Writes power.json and a report into --out.

    With --hide it is a dress rehearsal: readings with a hidden effect are simulated by code that shares nothing with
    the diagnosis, the diagnosis runs blind, and then the true effect is shown. Writes rehearsal.json, readings.csv,
    truth.json and a report into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets)
        if sheet is not None:
            expect(sheet, DEFLECTIONS, model=model)
            frame.files["sheet"] = sheet
        gauge = Gauge(noise_percent, noise_um, setup_percent, reads)
        if hide is None:
            _power(frame, given, sheet, Request(None, draws or DRAWN, seed, poses, gauge))
            return
        draws = draws or 1
        request = Request(None if hide == ANY else hide, draws, seed, poses, gauge)
        with frame.folder_if(seed) as folder:
            kept = None if folder is None else folder.stage
            with frame.timed("rehearsal"), rehearsing.places(draws, kept) as places:
                done = rehearsing.rehearsals(given, sheet, request, places, say=say)
            content = payload.rehearsal(done, secret=hide == ANY, seed=seed)
            if folder is not None:
                from stiffarm.commands.rehearse.report import write_report

                folder.write_json("rehearsal.json", content)
                for place, r in zip(places, done, strict=True):
                    folder.write_json(str(place.relative_to(folder.stage) / "truth.json"), rehearsing.truth(r.world))
                with folder.timed("report"):
                    write_report(done, folder)
        frame.answer(content, lambda: _show(done))


def _power(frame: Frame, given: Arm, sheet: Path | None, request: Request) -> None:
    """The power analysis of a sheet."""
    from stiffarm.commands.rehearse.power import payload as power_payload
    from stiffarm.commands.rehearse.power import words as power_words
    from stiffarm.commands.rehearse.power.step import power

    with frame.folder_if(request.seed) as folder:
        with frame.timed("power"), progress("sheets") as bar:
            found = power(given, sheet, request, progress=bar)
        content = power_payload.power(found, request.seed)
        if folder is not None:
            from stiffarm.commands.rehearse.power.report import write_report as write_power

            folder.write_json("power.json", content)
            with folder.timed("report"):
                write_power(found, folder)

    def show() -> None:
        say(f"{found.set_ups.source}; noise {found.set_ups.words}")
        for text in power_words.sentences(found):
            say(text)
        short = [list(row) for row in power_words.short_rows(found)]
        show_table("Effects of usual size: chances with 95 % intervals", list(power_words.SHORT_HEADS), short)
        if len(found.prospects) > len(short):
            rest = "in report.html and power.json" if frame.out is not None else "--out DIR writes them all"
            say(f"{len(found.prospects) - len(short)} other effects: {rest}")
        springs = [list(power_words.spring_row(s)) for s in found.springs]
        show_table("Springs", list(power_words.SPRING_HEADS), springs)
        if found.additions:
            more = [list(power_words.more_row(a)) for a in found.additions]
            show_table("One more", list(power_words.MORE_HEADS), more)

    frame.answer(content, show)


def _show(done: Sequence[Rehearsed]) -> None:
    for text in words.summary(done):
        say(text)
    if len(done) == 1:
        rows = [list(row) for row in words.numbers(done[0])]
        if rows:
            show_table("Parameters", ["parameter", "hidden", "found", "95 % interval", "inside"], rows)
        return
    show_table("Outcomes", ["outcome", "draws", "share", "visible"], [list(row) for row in words.tally(done)])
    rows = [
        [str(k), r.world.code, words.said(r), words.outcome(r), "yes" if r.is_visible else "no"]
        for k, r in enumerate(done, start=1)
    ]
    show_table("Draw by draw", ["draw", "hidden", "the diagnosis", "outcome", "visible"], rows)
