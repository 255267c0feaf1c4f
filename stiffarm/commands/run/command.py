"""The whole chain: `run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffarm.session.frame import command
from stiffarm.session.options import (
    ConfirmUnits,
    Debug,
    Json,
    Links,
    SchemeFile,
    Seed,
    Sets,
    TablesArg,
)


def run(
    model: Annotated[
        str,
        typer.Argument(
            metavar="[MODEL]",
            help="Robot to run: a bundled name, a model TOML or a URDF.",
        ),
    ] = "xr701",
    data: TablesArg = None,
    scheme_file: SchemeFile = None,
    holdout: Annotated[
        Path | None,
        typer.Option(
            "--holdout",
            help="Measurement table of other poses (CSV/XLSX), kept out of every calibration to test its prediction.",
        ),
    ] = None,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    sets: Sets = None,
    out: Annotated[Path, typer.Option("--out", help="Folder for the results; it is created if needed.")] = Path("out"),
    points: Annotated[
        int, typer.Option(help="Number of values of each swept coordinate in the map.", min=2, max=200)
    ] = 21,
    rehearse: Annotated[
        bool,
        typer.Option(
            "--rehearse/--no-rehearse",
            help="End with a rehearsal: hide an effect in simulated readings at the same set-ups and check "
            "whether the diagnosis finds it.",
        ),
    ] = True,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run everything from readings to report, surrogate and maps.

    Diagnosis, first model, sensitivity, calibration, surrogate, maps and one report of it all. If there is a
    published scheme, it is carried out stage by stage; otherwise all springs are calibrated at once.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        from stiffarm.commands.run.workflow import Options, run_all

        options = Options(links, points, seed, scheme_file, holdout, confirm_units, sets, rehearse)
        frame.answer(run_all(frame, model, data or (), options))
