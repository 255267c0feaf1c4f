"""Columns and cells of a measurement file: text in, numbers or faults (with their line) out."""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from doe.tables.workbook import MOST_COLUMNS, read_first_sheet
from robots import InputError, Robot
from robots.arrays import Array
from robots.errors import line_ranges
from robots.faults import Faults
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
_UNIT: Final = re.compile(
    r"([munckd]|da|milli|micro|kilo)?(m|n|g|nm|n_m|n_mm|nmm|rad|deg|met(re|er)s?|newtons?|radians?|degrees?)"
    r"|inch(es)?|in|mils?|microns?|kgf|lbf?|arcmin|arcsec|"
)
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_DOUBLED: Final = re.compile(r"\.\d+$")  # the mark some programs put on a column name's second use
# Joint coordinates as robot programs usually name them; only "q" is clear enough without a unit.
_JOINT_LIKE: Final = re.compile(r"q_?\d+[a-z]*(_[a-z]+)?|(a|j|joint|axis|theta)_?\d+[a-z]*_(deg|rad)", re.I)


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


@dataclass(frozen=True)
class Columns:
    """Where each column stands: those of the contract, and unknown ones."""

    known: dict[str, int]
    unknown: dict[str, int]


def find_columns(
    table: RawTable,
    robot: Robot,
    faults: Faults,
    own: Sequence[str] = (*DISPLACEMENTS, *OPTIONAL),
    needed: Mapping[str, Sequence[str]] = MappingProxyType({"deflection column": DISPLACEMENTS}),
) -> Columns:
    """Sort the header into columns of the contract and unknown ones; faults go to ``faults``.

    The contract has joint coordinates, loads and ``own`` columns; of each group ``needed`` (by what it is called), as
    of the first two, at least one must be there.
    """
    angles = robot.angle_names
    columns, meant = sorted_columns(table, (*angles, *LOADS, *own), faults)
    for name in [name for name in columns.unknown if _JOINT_LIKE.fullmatch(name)]:
        del columns.unknown[name]
        meant.update(robot.coordinates)
        faults.add(
            1,
            f"column {name} is not a joint coordinate of {robot.name}",
            code="T003",
            value=name,
            allowed=", ".join(angles),
            remedy="choose the robot that was measured, or convert the angles",
        )
    groups = {f"joint column of {robot.name}": angles, "load column": LOADS, **needed}
    _check_groups(groups, {*columns.known, *meant}, faults, table.hint)
    return columns


def sorted_columns(table: RawTable, names: Sequence[str], faults: Faults) -> tuple[Columns, set[str]]:
    """The header sorted into columns of these names and unknown ones, and the names meant by those in another unit.

    Columns twice, without a name, or in another unit go to ``faults``.
    """
    known, unknown, meant = dict[str, int](), dict[str, int](), set[str]()
    for i, name in enumerate(table.header):
        column = f"column {name}" if name else f"column number {i + 1}"
        if not name and not any(row[i] for row in table.rows if len(row) > i):
            continue  # spreadsheets leave empty columns behind
        if not name:
            faults.add(
                1,
                f"{column} has cells but no name",
                code="T003",
                allowed="a name for each column",
                remedy="name the column, or clear its cells",
            )
        elif name in known or name in unknown or _DOUBLED.sub("", name) in known:
            faults.add(
                1,
                f"{column} stands there twice",
                code="T003",
                value=name,
                allowed="each name once",
                remedy="rename or remove one of the two",
            )
        elif name in names:
            known[name] = i
        elif right := _right_name(name, names):
            meant.add(right)
            faults.add(
                1,
                f"{column} has a wrong or missing unit",
                code="T003",
                value=name,
                allowed=right,
                remedy=f"convert the values if need be and name the column {right}",
            )
        else:
            unknown[name] = i
    return Columns(known, unknown), meant


def _right_name(name: str, names: Sequence[str]) -> str | None:
    """Return the contract's name if ``name`` has a known stem and a wrong, missing or misspelt unit."""
    plain = name.lower().replace("\u00b5", "u").replace("\u03bc", "u")
    plain = re.sub(r"[\W_]+", "_", plain).strip("_")
    for right in names:
        stem = (right.rpartition("_")[0] or right).lower()
        if plain.startswith(stem) and _UNIT.fullmatch(plain.removeprefix(stem).strip("_")):
            return right
    return None


def likely_ours(name: str, joints: Collection[str] = ()) -> bool:
    """Whether a column of this name would be taken for one of ours, right or misspelt; ``joints``: the arm's."""
    own = (*LOADS, *DISPLACEMENTS, *OPTIONAL, *joints)
    return name in own or _right_name(name, own) is not None or _JOINT_LIKE.fullmatch(name) is not None


def _check_groups(needed: Mapping[str, Sequence[str]], present: set[str], faults: Faults, hint: str) -> None:
    for kind, group in needed.items():
        if not present.intersection(group):
            faults.add(
                1,
                f"the header has no {kind}",
                code="T003",
                allowed=f"at least one of {', '.join(group)}",
                remedy=f"add those that are not zero throughout, named exactly so{hint}",
            )
    missing = [name for name in POINT if name not in present]
    if 0 < len(missing) < len(POINT):
        faults.add(
            1,
            f"no column {', '.join(missing)}",
            code="T003",
            allowed=f"all of {', '.join(POINT)}, or none",
            remedy="give all three coordinates of the loaded point in the flange frame",
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


def numbers(
    table: RawTable,
    columns: Columns,
    names: Sequence[str],
    faults: Faults,
    *,
    empty: str | None = None,
    missing: float = np.nan,
    positive: bool = False,
    si: bool = True,
) -> Array:
    """Columns (n, len(names)), in SI units if ``si``; NaN where empty or faulty, ``missing`` without a column.

    ``empty`` says what an empty cell means ("not read"); None makes an empty cell a fault.
    """
    out = np.full((len(table.rows), len(names)), missing)
    allowed = "a finite number" + " above 0" * positive + (f", or an empty cell ({empty})" if empty else "")
    for k, name in enumerate(names):
        if name not in columns.known:
            continue
        cells, factor = texts(table, columns.known[name]), si_factor(name) if si else 1.0
        # Most cells of a bad table are bad in the same way; the others are read once more by the loop of C.
        read = {text: _number(text, positive, empty is not None) for text in set(cells)}
        out[:, k] = factor * np.array([read[text][0] for text in cells]).reshape(-1)
        bad = [i for i, text in enumerate(cells) if read[text][1]]

        def fault(
            n: int,
            name: str = name,
            cells: Sequence[str] = cells,
            bad: Sequence[int] = bad,
            read: Mapping[str, tuple[float, str]] = read,
        ) -> dict[str, str | None]:
            text = cells[bad[n]]
            why = read[text][1]
            hint = table.hint if "decimal comma" in why or "unit" in why else ""
            return {
                "problem": f"column {name}" + ("" if text else " is empty"),
                "value": text or None,
                "allowed": allowed,
                "remedy": why + hint,
            }

        faults.each([table.lines[i] for i in bad], fault, code="T004")
    return out


def _number(text: str, positive: bool, may_be_empty: bool) -> tuple[float, str]:
    """The number in a cell, NaN where there is none, and what is wrong with it, "" where nothing is."""
    try:
        return parse_number(text, positive=positive) if text or not may_be_empty else np.nan, ""
    except ValueError as error:
        return np.nan, str(error)


def joint_angles(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> Array:
    """Coordinates (n, dof) rad of the model: from its own columns, or from those of its controller's angles.

    Where a row has both, they must agree; a column that is missing among those given is 0.
    """
    controller = robot.controller
    own = [name for name in robot.coordinates if name in columns.known]
    shown = () if controller is None else controller.names
    other = [name for name in shown if name in columns.known and name not in robot.coordinates]
    q = numbers(table, columns, robot.coordinates, faults, missing=0.0)
    if controller is None or not other:
        return q
    read = controller.model(numbers(table, columns, shown, faults, missing=0.0))
    if not set(own) - set(shown):
        return read
    for row in np.flatnonzero(np.abs(read - q).max(axis=1) > SAME_ANGLE_rad):
        k = int(np.argmax(np.abs(read[row] - q[row])))
        faults.add(
            table.lines[row],
            f"column {robot.coordinates[k]}",
            code="T005",
            value=f"{np.degrees(q[row, k]):g}",
            allowed=f"{np.degrees(read[row, k]):g}, as the controller's angles of this row say",
            remedy=f"correct one of them, or keep only the columns {', '.join(shown)}",
        )
    return q


def texts(table: RawTable, index: int | None) -> tuple[str, ...]:
    """One column as text; empty strings if the column is missing."""
    return tuple("" if index is None else row[index] for row in table.rows)


def check_words(table: RawTable, columns: Columns, faults: Faults) -> None:
    """Check the cells of ``pose``, ``repeat`` and ``phase``."""
    for name, good, allowed, remedy in (
        ("pose", re.compile(r"(?s).+"), "a label in each row", "name the pose, or leave the column out"),
        (
            "repeat",
            re.compile(r"\d{0,9}", re.ASCII),
            "a whole number, or an empty cell",
            "count the repeats 1, 2, 3 ...",
        ),
        (
            "phase",
            re.compile(f"(?:{'|'.join(PHASES)})?"),
            f"{', '.join(PHASES)}, or an empty cell",
            "use one of these words",
        ),
    ):
        if name in columns.known:
            cells = texts(table, columns.known[name])
            words = {text for text in set(cells) if not good.fullmatch(text)}
            bad = [i for i, text in enumerate(cells) if text in words] if words else []
            parts = {"problem": f"column {name}", "allowed": allowed, "remedy": remedy}
            faults.each(
                [table.lines[i] for i in bad],
                lambda n, cells=cells, bad=bad, parts=parts: parts | {"value": cells[bad[n]]},  # type: ignore[misc]
                code="T004",
            )


def drop_ragged(table: RawTable, faults: Faults) -> RawTable:
    """Record rows with too many or too few cells as faults and leave them out."""
    width = len(table.header)
    whole = tuple(len(row) == width for row in table.rows)
    bad = [i for i, fits in enumerate(whole) if not fits]
    faults.each(
        [table.lines[i] for i in bad],
        lambda n: {
            "problem": "the row does not fit the header",
            "value": f"{len(table.rows[bad[n]])} cells",
            "allowed": f"{width} cells",
            "remedy": f"look for a missing or extra separator, or a decimal comma{table.hint}",
        },
        code="T002",
    )
    return replace(table, rows=tuple(compress(table.rows, whole)), lines=tuple(compress(table.lines, whole)))
