"""The whole chain: `run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffarm.session.frame import command
from stiffarm.session.options import (
    ConfirmUnits,
    DataArg,
    Debug,
    Json,
    Links,
    SchemeFile,
    Seed,
)


def run(
    model: Annotated[
        str,
        typer.Argument(
            metavar="[MODEL]",
            help="Robot to run: a bundled name, a model TOML or a URDF. It needs a calibration scheme, bundled"
            " or given.",
        ),
    ] = "xr701",
    data: DataArg = None,
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
    out: Annotated[Path, typer.Option("--out", help="Folder for the results; it is created if needed.")] = Path("out"),
    points: Annotated[
        int, typer.Option(help="Number of values of each swept coordinate in the map.", min=2, max=200)
    ] = 21,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run everything from readings to report, surrogate and maps.

    First model, sensitivity, calibration, surrogate, maps and one report that tells the whole story.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        from stiffarm.commands.run.workflow import run_all

        content = run_all(frame, model, data, scheme_file, links, points, seed, holdout, confirm_units=confirm_units)
        frame.answer(content)
