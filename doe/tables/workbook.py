"""Sheets of an XLSX workbook as text, read only if each of their cells holds what a person sees in it.

A workbook is a ZIP archive of XML files. What openpyxl would expand is measured first (:class:`_Scan`): a small file
can hold billions of cells. What openpyxl passes over in silence is refused: a formula without a stored value (programs
write such files), cells merged into one, rows that a filter hides.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from posixpath import join, normpath
from typing import Any, Final
from xml.etree import ElementTree
from xml.parsers import expat

from robots import InputError
from robots.errors import line_ranges, listed, raise_any

# Columns and cells of a table: sixteen columns and a hundred thousand readings fit; a campaign has thousands.
MOST_COLUMNS, MOST_CELLS = 1000, 2_000_000
# Bytes and files in an archive when unpacked: a sheet of MOST_CELLS numbers has 80 MB.
_LARGEST_UNPACKED, _MOST_FILES = 200 * 2**20, 10_000
# Up to here a float holds every whole number.
_EXACT = 2.0**53
_CELL: Final = re.compile(r"([A-Z]{1,3})([1-9]\d{0,6})", re.ASCII)
_SAVE: Final = "open the file in a spreadsheet program, save it, and use that file"
_OWN: Final = "http://schemas.openxmlformats.org/"
_SHEET: Final = f"{_OWN}spreadsheetml/2006/main"
_RELATION: Final = f"{_OWN}officeDocument/2006/relationships"
_PACKAGE: Final = f"{_OWN}package/2006/relationships"


@dataclass(frozen=True)
class Sheet:
    """A sheet as text: its rows from the first on, "" where nothing stands; and what is to be said of it.

    ``merged``: the areas of cells that are merged into one, as A1:B2.
    """

    rows: list[list[str]]
    notes: tuple[str, ...]
    merged: tuple[str, ...] = ()


class Figure(str):
    """The text of a cell that holds a number, and no text that looks like one."""

    __slots__ = ()


def read_first_sheet(data: bytes, where: str) -> Sheet:
    """Cells of the first sheet of a workbook; ``where`` names the file in messages.

    Raises
    ------
    InputError
        It is no workbook, or one that would expand beyond all measure, or its first sheet is hidden.
    InputErrors
        Cells that do not hold what they show, each with its address.
    """
    with _readable(data, where) as archive:
        sheets, stale = _sheets(archive, where)
        name, part, visible = sheets[0]
        if not visible:
            raise InputError(
                f"{where}: the first sheet, {name}, is hidden",
                code="T010",
                allowed="the readings on the first sheet",
                remedy="show it, or move the sheet with the readings to the front",
            )
        sheet = _read(data, archive, where, (0, name, part), stale, heads=False)
    others = [other for other, _, _ in sheets[1:]]
    notes = (f"only the first sheet, {name}, is read; left out: {listed(others)}",) if others else ()
    return Sheet(sheet.rows, (*notes, *sheet.notes))


def sheet_names(data: bytes, where: str) -> tuple[str, ...]:
    """Names of the sheets of a workbook that can be seen, in their order.

    Raises
    ------
    InputError
        It is no workbook, one that would expand beyond all measure, or one without a sheet that can be seen.
    """
    with _readable(data, where) as archive:
        names = tuple(name for name, _, visible in _sheets(archive, where)[0] if visible)
        if not names:
            raise InputError(
                f"{where} has no sheet that can be seen", code="T010", remedy="show the sheet with the readings"
            )
        return names


def read_sheet(data: bytes, where: str, name: str) -> Sheet:
    """Cells of the sheet of this name (the first of them), numbers as :class:`Figure`; cells may be merged.

    Raises
    ------
    InputError, InputErrors
        As :func:`read_first_sheet`; or there is no such sheet.
    """
    with _readable(data, where) as archive:
        sheets, stale = _sheets(archive, where)
        for k, (known, part, _) in enumerate(sheets):
            if known == name:
                return _read(data, archive, where, (k, name, part), stale, heads=True)
        allowed = listed(known for known, _, _ in sheets)
        raise InputError(f"{where}: sheet", code="T010", value=name, allowed=allowed, remedy="choose one of them")


@contextmanager
def _readable(data: bytes, where: str) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_archive(archive, where)
            yield archive
    except InputError:
        raise
    except Exception as error:  # a broken workbook raises zip, XML, key and value errors alike
        raise InputError(
            f"{where} is not a readable XLSX workbook ({error})",
            code="T010",
            remedy="save it again as XLSX, or as CSV (UTF-8)",
        ) from error


def _read(
    data: bytes, archive: zipfile.ZipFile, where: str, sheet: tuple[int, str, str], stale: bool, *, heads: bool
) -> Sheet:
    number, name, part = sheet
    scan = _Scan(f"{where}, sheet {name}", stale, heads)
    scan.read(archive, part)
    scan.raise_if_faulty()
    rows = _rows(data, scan, number)
    if not scan.hidden_columns:
        return Sheet(rows, (), tuple(scan.merged))
    notes = (f"hidden columns of sheet {name} are read too: {listed(scan.hidden_columns)}",)
    return Sheet(rows, notes, tuple(scan.merged))


def _check_archive(archive: zipfile.ZipFile, where: str) -> None:
    parts = archive.infolist()
    size = sum(part.file_size for part in parts)
    if len(parts) > _MOST_FILES or size > _LARGEST_UNPACKED:
        raise InputError(
            f"{where}: unpacked",
            code="F002",
            value=f"{size / 2**20:.0f} MB in {len(parts)} files",
            allowed=f"up to {_LARGEST_UNPACKED / 2**20:.0f} MB in {_MOST_FILES} files",
            remedy="save the table alone in a workbook, or as CSV (UTF-8)",
        )
    for part in parts:
        if part.filename.endswith((".xml", ".rels")):
            _refuse_document_type(archive, part, where)


def _refuse_document_type(archive: zipfile.ZipFile, part: zipfile.ZipInfo, where: str) -> None:
    """No workbook has one; what it defines can expand a thousandfold, or name files of this machine."""

    def refuse(*_: object) -> None:
        raise InputError(f"{where}: {part.filename} has a document type (<!DOCTYPE>)", code="T010", remedy=_SAVE)

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    with archive.open(part) as file:
        parser.ParseFile(file)


def _sheets(archive: zipfile.ZipFile, where: str) -> tuple[list[tuple[str, str, bool]], bool]:
    """Name and part of each sheet and whether it can be seen, and whether formulas wait to be calculated."""
    book = ElementTree.fromstring(archive.read("xl/workbook.xml"))  # noqa: S314 - without a document type
    links = ElementTree.fromstring(archive.read("xl/_rels/workbook.xml.rels"))  # noqa: S314 - as above
    targets = {link.get("Id"): link for link in links.iter(f"{{{_PACKAGE}}}Relationship")}
    sheets = [s for s in book.iter(f"{{{_SHEET}}}sheet") if _is_worksheet(targets.get(s.get(f"{{{_RELATION}}}id")))]
    if not sheets:
        raise InputError(f"{where} has no sheet of cells", code="T010", remedy=_SAVE)
    calculation = next(book.iter(f"{{{_SHEET}}}calcPr"), None)
    stale = calculation is not None and calculation.get("fullCalcOnLoad", "0") in ("1", "true")
    found = []
    for sheet in sheets:
        target = targets[sheet.get(f"{{{_RELATION}}}id")].get("Target", "")
        part = target.lstrip("/") if target.startswith("/") else normpath(join("xl", target))
        found.append((sheet.get("name", ""), part, sheet.get("state", "visible") == "visible"))
    return found, stale


def _is_worksheet(link: ElementTree.Element | None) -> bool:
    return link is not None and link.get("Type", "").endswith("/worksheet")


@dataclass
class _Scan:
    """How far a sheet's cells reach, and which of them do not hold what they show.

    ``stale``: the program that wrote the workbook left its formulas to whoever opens it next; the values beside them
    are placeholders (0, for instance). ``heads``: whoever reads the cells knows what merged ones mean.
    """

    where: str
    stale: bool
    heads: bool
    rows: int = 0
    columns: int = 0
    _hidden_columns: list[tuple[int, int]] = field(default_factory=list)
    _hidden_rows: list[int] = field(default_factory=list)
    _formulas: list[str] = field(default_factory=list)
    _errors: list[str] = field(default_factory=list)
    merged: list[str] = field(default_factory=list)
    _row: int = 0
    _column: int = 0
    _row_hidden: bool = False

    def read(self, archive: zipfile.ZipFile, part: str) -> None:
        """Go through the sheet once; raises InputError where it cannot be a table."""
        with archive.open(part) as file:
            for event, element in ElementTree.iterparse(file, events=("start", "end")):  # noqa: S314 - as above
                tag = element.tag.removeprefix(f"{{{_SHEET}}}")
                if event == "start":
                    if tag == "row":
                        self._open_row(element)
                elif tag == "c":
                    self._take_cell(element)
                elif tag == "row":
                    element.clear()  # millions of cells are not kept
                elif tag == "mergeCell":
                    self.merged.append(element.get("ref", "?"))
                elif tag == "col" and _is_hidden(element):
                    self._hidden_columns.append((int(element.get("min", "1")), int(element.get("max", "1"))))

    def raise_if_faulty(self) -> None:
        """Raise InputErrors where cells within the table do not hold what they show."""
        kinds = (
            (
                self._formulas,
                "a formula without a stored value",
                f"{_SAVE}; or copy the cells and paste them as values",
            ),
            (self._errors, "an error in place of a value", "correct it, or clear the cell"),
        )
        faults = [
            InputError(
                f"{self.where}: {what} in {listed(cells)}", code="T010", allowed="numbers and text", remedy=remedy
            )
            for cells, what, remedy in kinds
            if cells
        ]
        if merged := [area for area in self.merged if not self.heads and self._within(area)]:
            faults.append(
                InputError(
                    f"{self.where}: merged cells {listed(merged)}: all but the first of each would count as empty",
                    code="T010",
                    allowed="one value in each cell",
                    remedy="unmerge them and write the value that was read into each cell",
                )
            )
        if self._hidden_rows:
            faults.append(
                InputError(
                    f"{self.where}: rows {line_ranges(self._hidden_rows)} are hidden",
                    code="T010",
                    allowed="rows that can be seen",
                    remedy="show them (clear the filter) if they count, or delete them",
                )
            )
        raise_any(self.where, faults)

    @property
    def hidden_columns(self) -> list[str]:
        """Letters of the table's columns that cannot be seen."""
        from openpyxl.utils import get_column_letter  # type: ignore[import-untyped]

        ranges = [range(max(first, 1), min(last, self.columns) + 1) for first, last in self._hidden_columns]
        return [get_column_letter(i) for one in ranges for i in one]

    def _within(self, area: str) -> bool:
        first = _CELL.fullmatch(area.partition(":")[0].replace("$", ""))
        return first is None or (int(first[2]) <= self.rows and _column_number(first[1]) <= self.columns)

    def _open_row(self, element: ElementTree.Element) -> None:
        number = element.get("r", "")
        row = int(number) if number.isdecimal() else self._row + 1
        if row <= self._row:
            raise InputError(f"{self.where}: row {row} stands behind row {self._row}", code="T010", remedy=_SAVE)
        self._row, self._column, self._row_hidden = row, 0, _is_hidden(element)

    def _take_cell(self, cell: ElementTree.Element) -> None:
        self._column = self._column_of(cell.get("r"))
        kind, has_formula = cell.get("t", "n"), cell.find(f"{{{_SHEET}}}f") is not None
        # A formula's text may be empty.
        has_value = any(
            part.text or (kind == "str" and part.tag == f"{{{_SHEET}}}v")
            for part in cell.iter()
            if part.tag in (f"{{{_SHEET}}}v", f"{{{_SHEET}}}t")
        )
        if not (has_value or has_formula):
            return  # formatted, nothing in it
        from openpyxl.utils import get_column_letter

        address = f"{get_column_letter(self._column)}{self._row}"
        if has_formula and (self.stale or not has_value):
            self._formulas.append(address)
        if kind == "e":
            self._errors.append(address)
        if self._row_hidden and self._hidden_rows[-1:] != [self._row]:
            self._hidden_rows.append(self._row)
        self.rows, self.columns = self._row, max(self.columns, self._column)
        if self.columns > MOST_COLUMNS or self.rows * self.columns > MOST_CELLS:
            raise InputError(
                f"{self.where}: cell {address} makes this a table",
                code="T010",
                value=f"of {self.rows} rows and {self.columns} columns",
                allowed=f"up to {MOST_COLUMNS} columns, and {MOST_CELLS} cells",
                remedy="clear the cells away from the readings, or save the readings alone as CSV (UTF-8)",
            )

    def _column_of(self, address: str | None) -> int:
        """The column of a cell, which must stand behind those before it in its row."""
        if address is None:
            return self._column + 1
        place = _CELL.fullmatch(address)
        column = 0 if place is None else _column_number(place[1])
        if place is None or int(place[2]) != self._row or column <= self._column:
            raise InputError(f"{self.where}: cell {address} stands in a wrong place", code="T010", remedy=_SAVE)
        return column


def _is_hidden(element: ElementTree.Element) -> bool:
    return element.get("hidden") in ("1", "true")


def _column_number(letters: str) -> int:
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


def _rows(data: bytes, scan: _Scan, number: int) -> list[list[str]]:
    """The cells of sheet ``number`` that the scan has found, as text."""
    from openpyxl import load_workbook  # type: ignore[import-untyped]

    book = load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
    try:
        sheet: Any = book.worksheets[number]
        sheet.reset_dimensions()  # what the file says of them may be wrong
        found: Iterator[tuple[object, ...]] = sheet.iter_rows(
            min_row=1, max_row=scan.rows, max_col=scan.columns, values_only=True
        )
        return [[_as_text(cell) for cell in row] for row in found] if scan.rows else []
    finally:
        book.close()


def _as_text(cell: object) -> str:
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < _EXACT:
        return Figure(int(cell))  # some programs write every number as 1.0, counts too
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return Figure(cell)
    return "" if cell is None else str(cell)
