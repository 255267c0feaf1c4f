"""The command `help`."""

from __future__ import annotations

from difflib import get_close_matches
from itertools import groupby
from typing import Annotated, Any

import typer

from robots import InputError
from stiffarm.failures import catalogue
from stiffarm.session.console import user_errors
from stiffarm.session.options import Debug

USAGE = "stiffarm help CODE explains the error or warning with this code; it stands at the end of the message.\n"
SHOWN = 4


def help_command(
    context: typer.Context,
    code: Annotated[
        str | None,
        typer.Argument(metavar="[CODE]", help="Code of an error or warning, as in T012; or the name of a command."),
    ] = None,
    debug: Debug = False,
) -> None:
    """Explain an error or warning by its code.

    Without a code, lists the areas and their codes. With the name of a command, shows the help of that command.
    """
    with user_errors(debug):
        group: Any = None if context.parent is None else context.parent.command
        if code is None:
            typer.echo(_areas())
        elif (known := catalogue().get(code.strip("[]").upper())) is not None:
            typer.echo(known.text())
        elif group is not None and code in group.commands:
            group.main([code, "--help"], prog_name="stiffarm", standalone_mode=False)
        else:
            near = get_close_matches(code.upper(), catalogue(), n=SHOWN, cutoff=0.6) or list(catalogue())[:1]
            meant = get_close_matches(code, [] if group is None else group.commands, n=1)
            raise InputError(
                "CODE",
                code="A025",
                value=code,
                allowed=f"a code such as {', '.join(near)}, or the name of a command",
                remedy=f"for the command: `stiffarm help {meant[0]}`"
                if meant
                else "copy the code from the message; `stiffarm help` lists the areas",
            )


def _areas() -> str:
    """What the command does, and which codes there are."""
    lines = [USAGE]
    for area, failures in groupby(catalogue().values(), key=lambda failure: failure.area):
        codes = [failure.code for failure in failures]
        lines.append(f"{codes[0]} to {codes[-1]}  {area}")
    return "\n".join(lines)
