"""Options that several commands share, and what all commands do first."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated

import typer

from doe import Measurements
from doe.tables.joined import join
from robots import content_hash
from stiffarm.session import inputs
from stiffarm.session.console import say
from stiffarm.session.inputs import ModelInput
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.reading_checks import check_readings

ModelArg = Annotated[
    str, typer.Argument(metavar="MODEL", help="bundled name (see `stiffarm robots`), a model TOML or a URDF")
]
DataArg = Annotated[
    Path | None,
    typer.Argument(metavar="[DATA]", help="measurement table, CSV or XLSX; default: the bundled one"),
]
TablesArg = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="DATA",
        help="measurement tables, CSV or XLSX, as one; a filled-in sheet goes beside the table that it adds to; "
        "default, and by the name bundled: the robot's own",
    ),
]
Links = Annotated[
    str | None,
    typer.Option(
        "--links",
        help="beam, shell or rigid; default: as calibrated, else beam. shell:distributing leaves the flanges free to "
        "warp (the soft bound), shell:rigid holds them (the stiff bound); shell takes what the model says",
    ),
]
LoadPathOpt = Annotated[str | None, typer.Option("--load-path", help="parallelogram or serial; default: the model's")]
ConfirmUnits = Annotated[
    bool,
    typer.Option("--confirm-units", help="the table's units have been checked: take it though they look like others"),
]
Out = Annotated[Path | None, typer.Option("--out", help="folder for results")]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
Debug = Annotated[bool, typer.Option("--debug", help="show tracebacks")]
Joints = Annotated[
    str | None, typer.Option("--joints", help="joints, as in j2,j3; default: the scheme's or all that matter")
]
Loads = Annotated[
    str | None,
    typer.Option("--loads", help="force magnitudes in N, as in 150,650, or all; default: the scheme's, else all"),
]
Seed = Annotated[int, typer.Option("--seed", help="of the random numbers", min=0)]
EffectFile = Annotated[
    list[Path] | None,
    typer.Option(
        "--effect", metavar="FILE.py", help="Python file with effects of your own; it is executed. May be repeated"
    ),
]
SchemeFile = Annotated[
    Path | None, typer.Option("--scheme-file", help="calibration scheme TOML; default: the bundled one")
]


# Stands for the robot's own table among several; a table's name ends in .csv or .xlsx.
BUNDLED = "bundled"


def command_line() -> list[str]:
    """The command as the user typed it, for run.json."""
    return ["stiffarm", *sys.argv[1:]]


def output_folder(out: Path, files: dict[str, Path | str], seed: int | None = None) -> OutputFolder:
    """The folder of ``--out``, with the hashes of what went in."""
    return OutputFolder(out, command_line(), files, seed)


def folder_if(
    out: Path | None, files: dict[str, Path | str], seed: int | None = None
) -> AbstractContextManager[OutputFolder | None]:
    """The folder of ``--out``, or nothing where that was not given."""
    return nullcontext() if out is None else output_folder(out, files, seed)


def open_measured(
    model: str,
    data: Path | None,
    links: str | None,
    load_path: str | None,
    *,
    without: str | None = None,
    confirm_units: bool = False,
) -> tuple[ModelInput, Measurements, dict[str, Path | str]]:
    """What commands that calibrate do first: model, table with remarks, and the hashes of both for run.json.

    ``without``: as of :func:`stiffarm.session.inputs.read_model`.
    """
    given = inputs.read_model(model, links, load_path, without=without)
    files: dict[str, Path | str] = {"model": model_hash(given)}
    return given, open_table(given, model, data, files, confirm_units=confirm_units), files


def open_table(
    given: ModelInput, model: str, data: Path | None, files: dict[str, Path | str], *, confirm_units: bool = False
) -> Measurements:
    """The measurement table of a model, checked; its remarks are said, its hash joins ``files``."""
    return open_tables(given, model, () if data is None else (data,), files, confirm_units=confirm_units)


def open_tables(
    given: ModelInput,
    model: str,
    data: Sequence[Path],
    files: dict[str, Path | str],
    *,
    confirm_units: bool = False,
) -> Measurements:
    """One or more measurement tables of a model as one, each checked by itself; none: the bundled one."""
    named = [None if str(file) == BUNDLED else file for file in data or (None,)]
    tables = [inputs.read_data(given.robot, model, file) for file in named]
    table = join(tables)
    say_notes(table.notes)
    for number, one in enumerate(tables, start=1):
        files["data" if number == 1 else f"data_{number}"] = one.sha256
        check_readings(given, one, confirm_units=confirm_units)
    return table


def model_hash(given: ModelInput) -> str:
    """Content hash of the model, for run.json."""
    return content_hash(given.description)


def say_notes(notes: tuple[str, ...]) -> None:
    """Remarks on the input, to stderr."""
    for note in notes:
        say(f"note: {note}")
