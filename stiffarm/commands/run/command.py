"""The whole chain: `run`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffarm.session.console import emit_json, user_errors
from stiffarm.session.options import (
    ConfirmUnits,
    DataArg,
    Debug,
    Json,
    Links,
    SchemeFile,
    Seed,
    command_line,
)


def run(
    model: Annotated[str, typer.Argument(metavar="[MODEL]", help="a robot with a bundled or given scheme")] = "xr701",
    data: DataArg = None,
    scheme_file: SchemeFile = None,
    holdout: Annotated[
        Path | None, typer.Option("--holdout", help="table of other poses, to judge every variant's prediction")
    ] = None,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    out: Annotated[Path, typer.Option("--out", help="folder for results")] = Path("out"),
    points: Annotated[int, typer.Option(help="values of each swept coordinate of the map", min=2, max=200)] = 21,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """The whole chain: data, first model, sensitivity, calibration, surrogate, maps, report."""
    with user_errors(debug):
        from stiffarm.commands.run.workflow import run_all

        content = run_all(
            model, data, scheme_file, links, out, points, seed, command_line(), holdout, confirm_units=confirm_units
        )
        if as_json:
            emit_json(content)
