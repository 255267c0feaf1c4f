"""The command line: a table of commands, each a thin step of the workflow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from stiffarm import __version__
from stiffarm.commands import (
    calibration,
    chain,
    diagnosis,
    exporting,
    identification,
    importing,
    indexing,
    mapping,
    models,
    placement,
    planning,
    posting,
    posture,
    sensitivity,
    serving,
    surrogates,
    verification,
)

app = typer.Typer(
    name="stiffarm",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge?",
)
_COMMANDS: dict[str, Callable[..., None]] = {
    "run": chain.run,
    "robots": models.robots,
    "simulate": models.simulate,
    "sensitivity": sensitivity.sensitivity,
    "calibrate": calibration.calibrate,
    "diagnose": diagnosis.diagnose,
    "identify": identification.identify,
    "plan": planning.plan,
    "fit": surrogates.fit,
    "query": surrogates.query,
    "map": mapping.map_command,
    "index": indexing.index,
    "posture": posture.posture,
    "place": placement.place,
    "serve": serving.serve_command,
    "post": posting.post,
    "verify": verification.verify_command,
    "import": importing.import_command,
    "export": exporting.export,
}
for _name, _command in _COMMANDS.items():
    app.command(_name)(_command)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point; :mod:`stiffarm.__main__` is the one that also catches Ctrl-C during the imports."""
    app()
