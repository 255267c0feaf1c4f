"""Columns and cells of a measurement file: text in, numbers or faults (with their line) out."""

from __future__ import annotations

import csv
import hashlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from doe.tables.workbook import MOST_COLUMNS, read_first_sheet
from robots import InputError
from robots.errors import line_ranges
from robots.files.csv_text import as_read
from robots.files.reading import read_bytes
from robots.schema.units import factor

if TYPE_CHECKING:
    import pandas as pd

LOADS: Final = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
DISPLACEMENTS: Final = ("dx_mm", "dy_mm", "dz_mm", "rx_mrad", "ry_mrad", "rz_mrad")
COMPONENTS: Final = tuple(name.rpartition("_")[0] for name in DISPLACEMENTS)
POINT: Final = ("px_mm", "py_mm", "pz_mm")
OPTIONAL: Final = ("pose", "repeat", "phase", "step", "sigma_mm", *POINT, "time_s", "temperature_C", "session")
PHASES: Final = ("loading", "unloading")
SUFFIXES: Final = (".csv", ".xlsx")
# What no command reads.
UNREADABLE: Final = (".ods", ".json", ".xls", ".parquet", ".pdf")
# What reading files are to users, unless somebody says otherwise; and what to do with one in other words than ours.
READINGS: Final = "measurement file"
CONVERT: Final = "; `stiffarm readings FILE --out table.csv` converts what instruments write"

_TO_SI: Final = MappingProxyType(
    {"deg": factor("angle", "deg"), "mrad": factor("angle", "mrad"), "mm": factor("length", "mm")}
)
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)


def si_factor(column: str) -> float:
    """Factor from the unit in a column's name to SI; 1 for N, Nm and names without a unit."""
    return _TO_SI.get(column.rpartition("_")[2], 1.0)


@dataclass(frozen=True)
class RawTable:
    """A file as stripped text: header, rows with their line numbers, and remarks on what was left out.

    ``hint``: what else a user can do about cells and columns that cannot be read.
    """

    name: str
    sha256: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    notes: tuple[str, ...]
    hint: str = ""


def read_table(path: Path, kind: str = READINGS, row: str = "reading") -> RawTable:
    """Read a CSV or XLSX (first sheet) file as text; the header is line 1. ``kind``, ``row``: what messages call them.

    Raises
    ------
    InputError
        No such file, not a file, other suffix, empty, header only, or not readable as its suffix says.
    """
    allowed = f"a file ending in {' or '.join(SUFFIXES)}"
    data = read_bytes(path, "measurement file")
    suffix = path.suffix.lower()
    hint = CONVERT if kind == READINGS and suffix not in UNREADABLE else ""
    if suffix not in SUFFIXES:
        raise InputError(kind, code="T001", value=str(path), allowed=allowed, remedy=f"save it as one of these{hint}")
    remedy = f"the first line holds the column names, each further line one {row}"
    if not data.strip():
        raise InputError(f"{kind} {path} is empty", code="T001", remedy=remedy)
    where = f"{kind} {path}"
    if suffix == ".csv":
        numbered, notes = _csv_rows(data, where, hint), list[str]()
    else:
        sheet = read_first_sheet(data, where)
        numbered, notes = list(enumerate(sheet.rows, start=1)), list(sheet.notes)
    stripped = [(line, tuple(map(str.strip, row))) for line, row in numbered]
    if not stripped or not any(stripped[0][1]):
        raise InputError("; ".join((f"{where} has no column names in line 1", *notes)), code="T001", remedy=remedy)
    body = {line: row for line, row in stripped[1:] if any(row)}
    if not body:
        raise InputError("; ".join((f"{where} has a header but no {row}s", *notes)), code="T001", remedy=remedy)
    if blank := [line for line, row in stripped[1:] if not any(row)]:
        notes.append(f"blank lines skipped: {line_ranges(blank)}")
    return RawTable(
        name=path.name,
        sha256=hashlib.sha256(data).hexdigest(),
        header=stripped[0][1],
        rows=tuple(body.values()),
        lines=tuple(body),
        notes=tuple(notes),
        hint=hint,
    )


def table_of_frame(frame: pd.DataFrame, name: str = "DataFrame") -> RawTable:
    """A data frame as the table that a file with the same cells would give: empty where a value is missing.

    Raises
    ------
    InputError
        No columns or no rows.
    """
    if not len(frame.columns) or not len(frame):
        raise InputError(
            f"{name}: rows, columns", code="T001", value=f"{len(frame)}, {len(frame.columns)}", allowed="1 or more"
        )
    missing = frame.isna().to_numpy()
    rows = tuple(
        tuple("" if gone else str(cell).strip() for cell, gone in zip(row, without, strict=True))
        for row, without in zip(frame.itertuples(index=False, name=None), missing, strict=True)
    )
    header = tuple(str(column).strip() for column in frame.columns)
    digest = hashlib.sha256(repr((header, rows)).encode()).hexdigest()
    return RawTable(name, digest, header, rows, tuple(range(2, len(rows) + 2)), ())


def _csv_rows(data: bytes, where: str, hint: str) -> list[tuple[int, list[str]]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        what = f"{where} is not UTF-8 text (byte {error.start})"
        raise InputError(what, code="T002", remedy=f"save it as 'CSV UTF-8', or a workbook as .xlsx{hint}") from error
    first = re.split(r"[\r\n]", text, maxsplit=1)[0]
    return split_rows(text, max(",;\t", key=first.count), where)


def split_rows(text: str, separator: str, where: str) -> list[tuple[int, list[str]]]:
    """Rows of cells with their line numbers; ``where`` names the file in messages.

    Raises
    ------
    InputError
        A quotation mark that does not end, or more columns than any table of readings has.
    """
    # csv, not pandas.read_csv: that pads short rows, renames doubled columns and loses line numbers.
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    quoted = "'" in text
    rows, line = list[tuple[int, list[str]]](), 1
    try:
        for row in reader:
            rows.append((line, list(map(as_read, row)) if quoted else row))
            check_width(where, line, len(row))
            line = reader.line_num + 1  # a quoted cell may run over several lines
    except csv.Error as error:
        what = f"{where}, row {line} is not valid CSV ({error})"
        raise InputError(what, code="T002", remedy='check the quotation marks (") from that line on') from error
    return rows


def check_width(where: str, line: int, columns: int) -> None:
    """Refuse a row of more columns than any table of readings has; a text has no limit of cells."""
    if columns > MOST_COLUMNS:
        raise InputError(
            f"{where}, row {line}: columns",
            code="T003",
            value=columns,
            allowed=f"up to {MOST_COLUMNS} columns",
            remedy="split the table, or leave out what is no reading",
        )


# What a sheet rounds angles of two conventions to; beyond it they contradict one another.
SAME_ANGLE_rad: Final = float(np.radians(0.01))
# No angle, load or deflection of an arm in the file's units comes near; beyond it products overflow.
LARGEST_NUMBER = 1e12
LONGEST_NUMBER = 100


def parse_number(text: str, *, positive: bool = False) -> float:
    """Read one finite number written with a decimal point, above 0 if ``positive``.

    Raises
    ------
    ValueError
        It is not one; the message is the remedy.
    """
    if len(text) > LONGEST_NUMBER:
        # The patterns take a time that grows with the square of the length.
        raise ValueError(f"a number of {len(text)} characters: write at most {LONGEST_NUMBER}")
    if _NUMBER.fullmatch(text):
        value = float(text)
        if not abs(value) < LARGEST_NUMBER:
            raise ValueError(f"the number is too large (below {LARGEST_NUMBER:.0e}): check its exponent")
        if positive and value <= 0.0:
            raise ValueError("give a value above 0, or leave the cell empty")
        return value
    if not text:
        raise ValueError("fill in the value, 0 too")
    if text.lower().lstrip("+-") in {"nan", "inf", "infinity"}:
        raise ValueError("give the value that was set or read; only an empty cell means 'not read'")
    if _DECIMAL_COMMA.fullmatch(text):
        raise ValueError(f"this is a decimal comma: write {text.replace(',', '.')}")
    if "\u2212" in text or "\u2013" in text:
        raise ValueError("this is a typographic minus: write it with the hyphen '-'")
    raise ValueError("write digits with a decimal point, without unit or text")
