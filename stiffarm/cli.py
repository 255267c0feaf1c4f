"""The command line: a table of commands, each a thin step of the workflow, loaded when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from robots import InputError
from robots.errors import one_line
from stiffarm import __version__
from stiffarm.session.console import EXIT_BAD_INPUT, say_error

# Name of a command -> its folder in stiffarm/commands and its function in that folder's command.py.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run", "run"),
    "robots": ("simulate", "robots"),
    "simulate": ("simulate", "simulate"),
    "sensitivity": ("sensitivity", "sensitivity"),
    "calibrate": ("calibrate", "calibrate"),
    "diagnose": ("diagnose", "diagnose"),
    "identify": ("identify", "identify"),
    "plan": ("plan", "plan"),
    "fit": ("fit", "fit"),
    "query": ("fit", "query"),
    "map": ("maps", "map_command"),
    "index": ("index", "index"),
    "posture": ("posture", "posture"),
    "place": ("place", "place"),
    "post": ("post", "post"),
    "verify": ("verify", "verify_command"),
    "serve": ("serve", "serve_command"),
    "import": ("importing", "import_command"),
    "export": ("export", "export"),
}


class _Commands(TyperGroup):
    """Commands by name. All of them together take seconds to import, one takes a fraction of that."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        folder, function = COMMANDS[cmd_name]
        one = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        one.command(cmd_name)(getattr(importlib.import_module(f"stiffarm.commands.{folder}.command"), function))
        return typer.main.get_command(one)

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **more: Any) -> Any:
        _refuse_empty(args)
        with _printable():
            return super().make_context(info_name, args, *rest, **more)

    def invoke(self, ctx: Any) -> Any:
        with _printable():
            return super().invoke(ctx)


def _refuse_empty(args: list[str]) -> None:
    """An empty name, as of a variable that is not set, would stand for the folder one is in."""
    for before, argument in zip(["", *args], args, strict=False):
        if not argument.strip() or (argument.startswith("--") and argument.endswith("=")):
            place = argument if argument.strip() else f"the argument after {before}" if before else "the first argument"
            say_error(
                InputError(f"{place} is empty", remedy="give a value, or leave it out ('.' is the folder you are in)")
            )
            raise SystemExit(EXIT_BAD_INPUT)


@contextmanager
def _printable() -> Iterator[None]:
    """What the command line says of wrong options repeats them: as text that a terminal only prints."""
    try:
        yield
    except Exception as error:
        if isinstance(message := getattr(error, "message", None), str):
            error.message = one_line(message)  # type: ignore[attr-defined]
        raise


app = typer.Typer(
    name="stiffarm",
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge?",
)


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
