"""Files as rows of cells: separators found, comments set apart, sheets of a workbook chosen."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from doe.instruments.decoded import decoded
from doe.instruments.figures import is_number
from doe.tables.columns import check_width, split_rows
from doe.tables.workbook import read_sheet, sheet_names
from robots import InputError
from robots.files.reading import read_bytes

# Marks between cells by the name that users type; blank: one or more of them, blanks: two or more.
SEPARATORS: Final = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "blanks": "  ", "blank": " "}
# Lines that a separator is found by.
_LOOKED_AT: Final = 400
_COMMENT: Final = re.compile(r"\s*(?://|#(?!\d)|%|!)[/#%! ]*")
# What spreadsheets write in front of a CSV file.
_SEP: Final = re.compile(r"sep=(.)\s*", re.I)
# A word, with the unit in brackets behind it; or several words with single blanks between them.
_WORD: Final = re.compile(r'"([^"]*)"|(\S+(?: [\[(][^\])\s]*[\])])?)')
_WORDS: Final = re.compile(r'"([^"]*)"|(\S+(?: \S+)*)')
_AREA: Final = re.compile(r"\$?([A-Z]{1,3})\$?(\d+):\$?([A-Z]{1,3})\$?(\d+)")


@dataclass(frozen=True)
class Grid:
    """Rows of cells with their line numbers, from one file or sheet.

    ``comments``: lines set apart, with their numbers; ``how``: what was found or asked (encoding, separator, sheet);
    ``split``: the separator, None in a workbook; ``merged``: areas of merged cells, with their last line.
    """

    name: str
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    comments: tuple[tuple[int, str], ...]
    how: tuple[str, ...]
    split: str | None
    merged: tuple[tuple[int, str], ...] = ()

    def between(self, first: int, last: int) -> Grid:
        """The same with the rows of some lines only."""
        keep = [k for k, line in enumerate(self.lines) if first <= line <= last]
        return replace(self, rows=tuple(self.rows[k] for k in keep), lines=tuple(self.lines[k] for k in keep))


def read_grids(
    path: Path, *, encoding: str | None = None, separator: str | None = None, sheets: Sequence[str] = ()
) -> tuple[Grid, ...]:
    """A file's rows, one grid for a text, one for each sheet of a workbook (all of them, or those asked for).

    Raises
    ------
    InputError
        The file cannot be read, is empty, or is not what its name says; a separator that is not found for sure.
    """
    data = read_bytes(path, "readings file")
    where = f"readings file {path}"
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        for option, given in (("--encoding", encoding), ("--separator", separator)):
            if given is not None:
                raise InputError(f"{option}: {path} is a workbook", code="I002", remedy="leave it out")
        return tuple(_sheet(data, where, path.name, name) for name in sheets or sheet_names(data, where))
    if sheets:
        raise InputError(f"--sheet: {path} is no workbook", code="I002", allowed="an XLSX file", remedy="leave it out")
    if not data.strip():
        raise InputError(f"{where} is empty", code="I002", remedy="export it again")
    text, name = decoded(data, where, encoding)
    if text.lstrip()[:1] in ("{", "[") and _is_json(text):
        raise InputError(
            f"{where} is JSON",
            code="I002",
            allowed="text in rows and columns, or a workbook (XLSX)",
            remedy="write a CSV file from it: a row for each reading, a column for each value",
        )
    return (_text_grid(text, where, path.name, name, separator),)


def _is_json(text: str) -> bool:
    """Whether it is JSON, or its first line is, as in a log of one object a line."""
    for part in (text, text.lstrip().partition("\n")[0]):
        with suppress(ValueError, RecursionError):
            return bool(json.loads(part))
    return False


def _sheet(data: bytes, where: str, file: str, name: str) -> Grid:
    sheet = read_sheet(data, where, name)
    rows = [list(row) for row in sheet.rows]
    for area in sheet.merged:
        _spread(rows, area)
    return Grid(
        f"{file}, sheet {name}",
        tuple(map(tuple, rows)),
        tuple(range(1, len(rows) + 1)),
        (),
        (f"sheet {name}", *sheet.notes),
        None,
        tuple((_last_line(area), area) for area in sheet.merged),
    )


def _last_line(area: str) -> int:
    found = _AREA.fullmatch(area)
    return int(found[4]) if found else 0


def _spread(rows: list[list[str]], area: str) -> None:
    """Write the value of cells that are merged along one row into each of them, where they hold text: a heading."""
    from openpyxl.utils import column_index_from_string  # type: ignore[import-untyped]

    found = _AREA.fullmatch(area)
    if found is None:
        return
    row, first, last = int(found[2]) - 1, column_index_from_string(found[1]) - 1, column_index_from_string(found[3])
    if found[2] != found[4] or row >= len(rows) or first >= len(rows[row]) or is_number(rows[row][first]):
        return
    for k in range(first + 1, min(last, len(rows[row]))):
        rows[row][k] = rows[row][first]


def _text_grid(text: str, where: str, file: str, encoding: str, separator: str | None) -> Grid:
    if separator is not None and separator not in SEPARATORS:
        raise InputError(
            "--separator", code="I002", value=separator, allowed=", ".join(SEPARATORS), remedy="choose one of them"
        )
    lines = re.split(r"\r\n|\r|\n", text)
    comments = tuple((k, _COMMENT.sub("", line).strip()) for k, line in enumerate(lines, 1) if _COMMENT.match(line))
    for k, _ in comments:
        lines[k - 1] = ""
    if separator is None and (sep := _SEP.fullmatch(lines[0])):
        separator = next((name for name, mark in SEPARATORS.items() if mark == sep[1]), None)
        lines[0] = ""
    if not any(line.strip() for line in lines):
        raise InputError(
            f"{where} has no line of readings", code="I002", remedy="export it again, or check its encoding"
        )
    asked, told = separator, "as asked"
    if separator is None:
        separator, told = _separator([line for line in lines if line.strip()], where), "found"
    split = SEPARATORS[separator]
    numbered = split_cells("\n".join(lines), split, where)
    kept = [(k, tuple(cell.strip() for cell in row)) for k, row in numbered]
    how = (f"text in {encoding}", f"separator {separator}" + f" ({told})" * (asked is not None))
    return Grid(file, tuple(row for _, row in kept), tuple(k for k, _ in kept), comments, how, split)


def split_cells(text: str, split: str, where: str) -> list[tuple[int, list[str]]]:
    """Rows of cells with their line numbers."""
    if split.strip() or split == "\t":
        return split_rows(text, split, where)
    out, word = [], _WORD if split == " " else _WORDS
    for k, line in enumerate(text.split("\n"), 1):
        row = [quoted or plain for quoted, plain in word.findall(line)]
        check_width(where, k, len(row))
        out.append((k, row))
    return out


def _separator(lines: Sequence[str], where: str) -> str:
    """The separator under which most cells are whole numbers or words, in rows of one width."""
    looked = lines[:_LOOKED_AT]
    scores = {name: _score(looked, mark, where) for name, mark in SEPARATORS.items()}
    if scores["tab"] and _by_tabs(_rows(looked, "\t", where)):
        scores["blank"] = scores["blanks"] = 0.0  # these are inside of its cells
    best = max(scores, key=lambda name: scores[name])
    if scores[best] == 0.0:
        raise InputError(
            f"{where}: no separator makes a table of it",
            code="I002",
            allowed=", ".join(SEPARATORS),
            remedy="name it with --separator, or export the file as CSV",
        )
    rivals = [name for name in scores if name != best and scores[name] >= scores[best]]
    same = _rows(looked, SEPARATORS[best], where)
    rivals = [name for name in rivals if _rows(looked, SEPARATORS[name], where) != same]
    if rivals:
        raise InputError(
            f"{where}: the separator may be {best} or {' or '.join(rivals)}",
            code="I002",
            allowed=", ".join(SEPARATORS),
            remedy=f"say which, as in --separator {best}",
        )
    return best


def _by_tabs(rows: Sequence[Sequence[str]]) -> bool:
    """Whether rows of cells between tabs are a table: one width with numbers, and no cell of several numbers."""
    holding = [row for row in rows if sum(map(is_number, row)) > 1]
    several = (cell for row in holding for cell in row if " " in cell and not is_number(cell))
    return len({len(row) for row in holding}) == 1 and not any(all(map(is_number, c.split())) for c in several)


def _score(lines: Sequence[str], mark: str, where: str) -> float:
    """Share of the lines that have one width under a separator, times the share of their cells that are numbers."""
    rows = _rows(lines, mark, where)
    widths: dict[int, list[list[str]]] = {}
    for row in rows:
        numbers = sum(map(is_number, row))
        if len(row) > 1 and numbers:
            widths.setdefault(len(row), []).append(row)
    if not widths:
        return 0.0
    block = max(widths.values(), key=len)
    cells = [cell for row in block for cell in row if cell.strip()]
    return len(block) / len(lines) * sum(map(is_number, cells)) / len(cells)


def _rows(lines: Sequence[str], mark: str, where: str) -> list[list[str]]:
    """Rows of cells under a separator; none where it splits no line properly."""
    try:
        return [row for _, row in split_cells("\n".join(lines), mark, where) if row]
    except InputError:
        return []
