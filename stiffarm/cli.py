"""The command line: a table of commands, each a thin step of the workflow, loaded when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from robots.errors import one_line
from stiffarm import __version__

# Name of a command -> its module in stiffarm.commands and its function there.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("chain", "run"),
    "robots": ("models", "robots"),
    "simulate": ("models", "simulate"),
    "sensitivity": ("sensitivity", "sensitivity"),
    "calibrate": ("calibration", "calibrate"),
    "diagnose": ("diagnosis", "diagnose"),
    "identify": ("identification", "identify"),
    "plan": ("planning", "plan"),
    "fit": ("surrogates", "fit"),
    "query": ("surrogates", "query"),
    "map": ("mapping", "map_command"),
    "index": ("indexing", "index"),
    "posture": ("posture", "posture"),
    "place": ("placement", "place"),
    "post": ("posting", "post"),
    "verify": ("verification", "verify_command"),
    "serve": ("serving", "serve_command"),
    "import": ("importing", "import_command"),
    "export": ("exporting", "export"),
}


class _Commands(TyperGroup):
    """Commands by name. All of them together take seconds to import, one takes a fraction of that."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        module, function = COMMANDS[cmd_name]
        one = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        one.command(cmd_name)(getattr(importlib.import_module(f"stiffarm.commands.{module}"), function))
        return typer.main.get_command(one)

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **more: Any) -> Any:
        with _printable():
            _refuse_empty(args)
            return super().make_context(info_name, args, *rest, **more)

    def invoke(self, ctx: Any) -> Any:
        with _printable():
            return super().invoke(ctx)


def _refuse_empty(args: list[str]) -> None:
    """An empty name, as of a variable that is not set, would stand for the folder one is in."""
    for before, argument in zip(["", *args], args, strict=False):
        if not argument.strip() or (argument.startswith("--") and argument.endswith("=")):
            place = argument if argument.strip() else f"the argument after {before}" if before else "the first argument"
            raise typer.BadParameter(f"{place} is empty: give a value, or leave it out ('.' is the folder you are in)")


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
