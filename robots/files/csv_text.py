"""The one way in which CSV is written: no text in it becomes a formula when a spreadsheet opens it.

A spreadsheet runs a cell that begins with ``=``, ``+``, ``-`` or ``@``, and labels, names and notes come from anybody's
files. Such a text gets a single quote in front (OWASP, CSV injection); plain numbers keep their sign. :func:`as_read`
takes the quote off again, so that our own tables come back as they were.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

# Rows that are turned into text at once.
BLOCK = 4096
# With the full-width signs, which some spreadsheets take for the plain ones.
_FORMULA = re.compile(r"'*(?:\s*[=+\-@\uff1d\uff0b\uff0d\uff20]|[\t\r\n])")
_QUOTED = re.compile(r'[",\r\n]')
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def _would_run(text: str) -> bool:
    return _FORMULA.match(text) is not None and _NUMBER.fullmatch(text) is None


def cell(value: object) -> str:
    """A value as the text of a cell: numbers with all their digits, "" for None and NaN, texts that do nothing."""
    if isinstance(value, str):
        return f"'{value}" if _would_run(value) else value
    if hasattr(value, "item"):  # numpy's numbers write their type beside them
        value = value.item()
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return repr(value) if isinstance(value, int | float) else cell(str(value))


def as_read(text: str) -> str:
    """The text that :func:`cell` wrote as this."""
    return text[1:] if text.startswith("'") and _would_run(text[1:]) else text


def write_rows(stream: IO[str], rows: Iterable[Iterable[object]], ends: str = "\n") -> None:
    """Write rows of cells; ``ends``: what a line ends with."""
    # csv.writer leaves a lone carriage return without quotation marks where lines end in another sign.
    stream.writelines(",".join([_written(value) for value in row]) + ends for row in rows)


def _written(value: object) -> str:
    """A cell with its quotation marks; most are plain numbers, which need none."""
    if type(value) is float:
        return repr(value) if value == value else ""
    return repr(value) if type(value) is int else _quoted(cell(value))


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text


def rows_text(rows: Iterable[Iterable[object]], ends: str = "\n") -> str:
    """Rows of cells as text."""
    stream = io.StringIO()
    write_rows(stream, rows, ends)
    return stream.getvalue()


def records_text(records: Iterable[Mapping[str, Any]]) -> str:
    """Records as text, with the keys of all of them as columns; a record without one has an empty cell."""
    kept = list(records)
    names = list(dict.fromkeys(name for record in kept for name in record))
    return rows_text([names, *([record.get(name) for name in names] for record in kept)])


def columns_parts(columns: Mapping[str, Sequence[Any]], digits: int | None = None) -> Iterator[str]:
    """Columns of one length as text, some thousand rows at a time, so that long ones take no memory.

    ``digits``: significant ones of numbers that are not whole, None: all.
    """

    def short(value: Any) -> object:
        return f"{value:.{digits}g}" if digits and isinstance(value, float) and math.isfinite(value) else value

    yield rows_text([columns])
    for first in range(0, max(map(len, columns.values()), default=0), BLOCK):
        some = [values[first : first + BLOCK] for values in columns.values()]
        plain = [values.tolist() if hasattr(values, "tolist") else values for values in some]
        yield rows_text(map(short, row) for row in zip(*plain, strict=True))


def columns_text(columns: Mapping[str, Sequence[Any]], digits: int | None = None) -> str:
    """All of :func:`columns_parts` as one text."""
    return "".join(columns_parts(columns, digits))
