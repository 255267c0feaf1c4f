"""What a user sees: messages and progress on stderr, one JSON object on stdout, exit codes."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Final

import typer
from rich.console import Console
from rich.text import Text

from robots import InputError
from robots.errors import one_line
from robots.files.reading import recording
from robots.progress import Progress
from stiffarm.session.interruption import EXIT_STOPPED, stoppable
from stiffarm.session.json_text import json_text
from stiffarm.session.streams import CLOSED, silence

if TYPE_CHECKING:
    from rich.table import Table

EXIT_BAD_INPUT = 2
EXIT_OTHER = 1
# Where no bar can be drawn, work says how far it is after so long without a word.
SILENCE_S = 5.0

# Colons stand in ranges and paths: none of them is a picture.
stderr = Console(stderr=True, highlight=False, emoji=False)


# Where messages go that are not printed; None: to the terminal.
_kept: ContextVar[list[str] | None] = ContextVar("kept", default=None)


@contextmanager
def kept_messages() -> Iterator[list[str]]:
    """Within, nothing is printed: messages join the list that is handed out, and no progress is drawn."""
    messages: list[str] = []
    before = _kept.set(messages)
    try:
        yield messages
    finally:
        _kept.reset(before)


def say(message: str) -> None:
    """One line for the user, on stderr. Whatever comes from files in it cannot steer the terminal.

    A warning that the catalogue of failures knows carries its code.
    """
    if message.startswith("note: ") or "WARNING: " in message:
        from stiffarm.failures import warning_of

        known = warning_of(message)
        message += f" [{known.code}]" if known else ""
    if (kept := _kept.get()) is not None:
        kept.append(one_line(message))
        return
    _print(Text(one_line(message)), soft_wrap=True)


def say_notes(notes: Iterable[str]) -> None:
    """Remarks on the input."""
    for note in notes:
        say(f"note: {note}")


def say_error(error: InputError) -> None:
    """An error, on stderr: one line, or one for each fault."""
    from stiffarm.failures import said

    for line in f"stiffarm: {said(error)}".split("\n"):
        say(line)


def _print(content: Text | Table, *, soft_wrap: bool = False) -> None:
    try:
        stderr.print(content, soft_wrap=soft_wrap)
    except OSError:  # a full disk, a reader that has gone: the results and the exit code still count
        silence(sys.stderr.fileno())


def emit_json(content: Mapping[str, Any]) -> None:
    """Put one JSON object on stdout."""
    text = json_text(content)
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        # Python would try to write the rest again at exit, and complain about that itself.
        silence(sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # the reader has had enough, as in `| head`
            raise typer.Exit(EXIT_OTHER) from None
        raise


# Characters of a table's first column that are never broken, in a terminal of 80.
NAME_WIDTH: Final = 24
# Beside its text a column takes a border and two blanks.
BESIDE_TEXT: Final = 3


def show_table(title: str, columns: list[str], rows: list[list[str]]) -> None:
    """A table for people, on stderr. Names and labels come from files: they are no markup.

    No word is broken where the terminal is wide enough for the longest of each column. A table of few rows that is too
    wide for that is printed with rows and columns exchanged.
    """
    from rich.table import Table

    lines = [[one_line(cell) for cell in row] for row in (columns, *rows)]
    if len(rows) < len(columns) and not _fits(lines):
        turned = [list(cells) for cells in zip(*lines, strict=True)]
        lines = turned if _fits(turned) else lines
    table = Table(title=Text(one_line(title)), title_justify="left", title_style="bold")
    # A name that is broken in the middle is hard to read: the other columns give way first.
    whole = _name_width(lines) is not None
    for i, (column, width) in enumerate(zip(lines[0], _widths(lines), strict=True)):
        table.add_column(
            Text(column), justify="left" if i == 0 else "right", overflow="fold", width=width, no_wrap=i == 0 and whole
        )
    for line in lines[1:]:
        table.add_row(*map(Text, line))
    _print(table)


def _least_widths(lines: list[list[str]]) -> list[int]:
    """Characters of the longest word in each column; of the longest cell in the first one, if that is not too much."""
    words = [max(len(word) for cell in cells for word in cell.split() or [""]) for cells in zip(*lines, strict=True)]
    return [_name_width(lines) or words[0], *words[1:]] if words else []


def _name_width(lines: list[list[str]]) -> int | None:
    """Characters of the first column's longest cell, where these are few enough to keep each in one line."""
    longest = max((len(line[0]) for line in lines if line), default=0)
    return longest if longest <= NAME_WIDTH else None


def _room(columns: int) -> int:
    """Characters of a line of the terminal that the text of so many columns can take."""
    return stderr.width - BESIDE_TEXT * columns - 1


def _fits(lines: list[list[str]]) -> bool:
    """Whether the terminal is wide enough for a table without a broken word."""
    return sum(_least_widths(lines)) <= _room(len(lines[0]))


def _widths(lines: list[list[str]]) -> list[int | None]:
    """Each column's width, the widest ones giving way first and none below its longest word; None where that fails."""
    if not _fits(lines):
        return [None] * len(lines[0])
    least = _least_widths(lines)
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    while sum(widths) > _room(len(widths)):
        over = [i for i in range(len(widths)) if widths[i] > least[i]]
        widths[max(over, key=lambda i: widths[i])] -= 1
    return list(widths)


@contextmanager
def progress(description: str) -> Iterator[Progress]:
    """A bar with a count and the time left; call it with (done, total). Outside a terminal a line now and then."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=stderr,
        transient=True,
        disable=not stderr.is_terminal or _kept.get() is not None,
    )
    with bar:
        task = bar.add_task(one_line(description), total=None)
        told = time.monotonic()

        def report(done: int, total: int) -> None:
            nonlocal told
            bar.update(task, completed=done, total=total)
            if not stderr.is_terminal and _kept.get() is None and time.monotonic() - told >= SILENCE_S:
                told = time.monotonic()
                say(f"{description}: {done} of {total}")

        yield report


@contextmanager
def user_errors(debug: bool) -> Iterator[None]:
    """Turn errors into one clear message and the agreed exit code; with ``debug`` a traceback too.

    Every input file of the command is read once in here, and its hash kept for run.json.
    """
    with stoppable(), recording():
        try:
            _check_stdout()
            yield
        except InputError as error:
            if debug:
                traceback.print_exc()
            say_error(error)
            raise typer.Exit(EXIT_BAD_INPUT) from None
        except KeyboardInterrupt:  # only where Ctrl-C is not ours to handle
            say("stiffarm: stopped by the user; no half-written files are left")
            raise typer.Exit(EXIT_STOPPED) from None
        except (typer.Exit, typer.Abort):
            raise
        except Exception as error:  # the last line of defence: a user never sees a traceback unasked
            if debug:
                raise
            say(f"stiffarm: {_unforeseen(error)}")
            raise typer.Exit(EXIT_OTHER) from None


def _check_stdout() -> None:
    """Refuse to work for an answer that nobody will get."""
    if "stdout" in CLOSED and "--json" in sys.argv[1:]:
        raise InputError(
            "stdout is closed, where the answer belongs (--json)",
            code="F012",
            remedy="redirect it to a file, or leave --json out",
        )


def _unforeseen(error: Exception) -> str:
    from stiffarm.failures import INTERNAL, SYSTEM, with_code

    if isinstance(error, OSError):
        text = f"the system refused: {error}. To fix it: check free space and access rights, then run again"
        return with_code(text, SYSTEM)
    text = f"internal error: {type(error).__name__}: {error} (run again with --debug and report it)"
    return with_code(text, INTERNAL)
