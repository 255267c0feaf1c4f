"""What a user sees: messages and progress on stderr, one JSON object on stdout, exit codes."""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from robots import InputError

EXIT_BAD_INPUT = 2
EXIT_OTHER = 1

stderr = Console(stderr=True, highlight=False)


def say(message: str) -> None:
    """One line for the user, on stderr."""
    stderr.print(message, markup=False, soft_wrap=True)


def emit_json(content: Mapping[str, Any]) -> None:
    """Put one JSON object on stdout."""
    sys.stdout.write(json.dumps(content, indent=2, allow_nan=False) + "\n")


def show_table(title: str, columns: list[str], rows: list[list[str]]) -> None:
    """A table for people, on stderr."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    stderr.print(table)


@contextmanager
def progress(description: str) -> Iterator[Callable[[int, int], None]]:
    """A bar with a count and the time left; call it with (done, total)."""
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=stderr, transient=True,
    )
    with bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def user_errors(debug: bool) -> Iterator[None]:
    """Turn errors into one clear message and the agreed exit code; with ``debug`` a traceback too."""
    try:
        yield
    except InputError as error:
        if debug:
            traceback.print_exc()
        say(f"stiffarm: {error}")
        raise typer.Exit(EXIT_BAD_INPUT) from None
    except KeyboardInterrupt:
        say("stiffarm: stopped by the user; nothing was written")
        raise typer.Exit(EXIT_OTHER) from None
    except (typer.Exit, typer.Abort):
        raise
    except Exception as error:  # the last line of defence: a user never sees a traceback unasked
        if debug:
            raise
        say(f"stiffarm: internal error: {type(error).__name__}: {error} (run again with --debug and report it)")
        raise typer.Exit(EXIT_OTHER) from None
