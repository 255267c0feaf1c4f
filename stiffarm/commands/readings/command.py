"""The command `readings`: what instruments and people write, made a measurement table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json

_COLUMNS = "Columns"
_FILE = "Layout of the files"


def readings(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Files from an instrument or filled in by hand: text with any separator, or XLSX. Joint angles "
            "may be in a separate file.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Table to write (CSV). Default: none; only show how the files are understood."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option("--model", help="Arm that was measured: its joint names are used, and its limits are checked."),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", help="Mapping file (TOML) that an earlier run wrote with its table. Default: none."),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option("--kind", help="Table to make: deflections or positions. Default: what the columns hold."),
    ] = None,
    replace: Annotated[
        bool,
        typer.Option("--replace", help="Replace an existing table; the old one moves to previous/TIME beside it."),
    ] = False,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="NAME=MEANING",
            help="What a column holds, as in 'Dial 1=dz um before', 'Load=hung kg', 'A3=q3 deg' or 'Note=ignore'. "
            "May be repeated.",
            rich_help_panel=_COLUMNS,
        ),
    ] = None,
    units: Annotated[
        str | None,
        typer.Option("--units", help="Units of columns that state none, as in mm,deg,N.", rich_help_panel=_COLUMNS),
    ] = None,
    fill: Annotated[
        list[str] | None,
        typer.Option(
            "--fill",
            metavar="NAME=VALUE",
            help="A value for all rows that no file contains, as in 'session=day 1' or 'hung=20 kg'. May be repeated.",
            rich_help_panel=_COLUMNS,
        ),
    ] = None,
    sigma_mm: Annotated[
        float | None,
        typer.Option(
            "--sigma-mm",
            help="Standard deviation of one reading of a coordinate, in mm. Default: from a column, otherwise none.",
            rich_help_panel=_COLUMNS,
        ),
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(
            "--axes",
            help="Axes of an instrument whose positions are subtracted: base, their orientation A,B,C in the base "
            "frame, in deg about fixed x, then y, then z, or found (from the positions without a load, with --model).",
            rich_help_panel=_COLUMNS,
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option("--target", help="Use the readings of this target only.", rich_help_panel=_COLUMNS),
    ] = None,
    join: Annotated[
        str | None,
        typer.Option(
            "--join",
            help="How joint angles of one file find the readings of another: pose (same label) or order (row by row). "
            "Default: pose, if both have it.",
            rich_help_panel=_COLUMNS,
        ),
    ] = None,
    names: Annotated[
        str | None,
        typer.Option(
            "--names",
            help="Names of the columns of a file without any, separated by commas, as in pose,target,x_mm,y_mm,z_mm.",
            rich_help_panel=_FILE,
        ),
    ] = None,
    header: Annotated[
        int | None,
        typer.Option("--header", help="Line with the names of the columns. Default: found.", rich_help_panel=_FILE),
    ] = None,
    rows: Annotated[
        str | None,
        typer.Option(
            "--rows",
            help="First and last line of the readings, as in 8-40. Default: all below the names.",
            rich_help_panel=_FILE,
        ),
    ] = None,
    sheet: Annotated[
        list[str] | None,
        typer.Option(
            "--sheet",
            help="Sheet of a workbook. May be repeated. Default: the one that holds readings.",
            rich_help_panel=_FILE,
        ),
    ] = None,
    encoding: Annotated[
        str | None,
        typer.Option(
            "--encoding", help="Encoding, as in utf-8, utf-16 or windows-1252. Default: found.", rich_help_panel=_FILE
        ),
    ] = None,
    separator: Annotated[
        str | None,
        typer.Option(
            "--separator",
            help="Separator: comma, semicolon, tab, bar, blank (one or more) or blanks (two or more). Default: found.",
            rich_help_panel=_FILE,
        ),
    ] = None,
    decimal: Annotated[
        str | None,
        typer.Option(
            "--decimal",
            help="Decimal mark: point or comma. Default: found if the numbers settle it.",
            rich_help_panel=_FILE,
        ),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Make a measurement table from instrument files or sheets.

    Reads exports of laser trackers, controllers' logs and sheets filled in by hand, and writes a table that
    `calibrate` and `diagnose` read, with a mapping file for the next file of the same layout. Anything ambiguous is
    refused, with the option that settles it.
    """
    with command(as_json=as_json, debug=debug) as frame:
        from doe.instruments.convert import convert
        from stiffarm.commands.readings import step
        from stiffarm.commands.readings.words import show

        arm = step.arm_of(model)
        asked = step.settings_of(
            mapping,
            step.pairs(column, "--column"),
            step.pairs(fill, "--fill"),
            arm,
            kind=kind,
            units=step.words_of(units, "--units"),
            sigma_mm=sigma_mm,
            axes=axes,
            target=target,
            join=join,
            names=step.words_of(names, "--names"),
            header=header,
            rows=step.lines_of(rows),
            sheets=tuple(sheet or ()),
            encoding=encoding,
            separator=separator,
            decimal=decimal,
        )
        if out is not None:  # before any work
            step.check_place(out, files, first=mapping is None, replace=replace)
        made = step.Written(convert(files, asked, arm), None, None, None)
        if out is not None:
            made = step.save(made.converted, out, first=mapping is None, replace=replace)
        frame.answer(step.payload(made), lambda: show(made, model))
