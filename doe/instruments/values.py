"""Columns of text as numbers in the table's units, words, and what is kept as it stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from doe.instruments.figures import NOT_READ, Mark, figure
from doe.instruments.layout import Table
from doe.instruments.meanings import WORDS, Meaning, meaning_of
from doe.instruments.times import FORMS, seconds
from doe.instruments.units import converted, dimension
from doe.tables.workbook import Figure
from robots import InputError
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.faults import Faults

# A number of a reading: what it is, "before", "after" or "", and its target ("" where none is named).
Key = tuple[str, str, str]
# No joint turns farther: such an angle is in another unit.
WIDEST_deg: Final = 3600.0
# What may be missing in a row: readings, and what is known of them.
_MAY_BE_EMPTY: Final = (
    "x",
    "y",
    "z",
    "dx",
    "dy",
    "dz",
    "rx",
    "ry",
    "rz",
    "sigma",
    "temperature",
    "time",
    "date",
    "px",
    "py",
    "pz",
    "payload",
    "payload_x",
    "payload_y",
    "payload_z",
)


@dataclass(frozen=True)
class Column:
    """What was made of a column: its meaning and why, how many cells were empty, and the range of its numbers."""

    file: str
    name: str
    meaning: Meaning
    why: str
    empty: int
    lowest: float
    highest: float


@dataclass(frozen=True)
class Read:
    """Readings of n rows.

    ``numbers`` (n,) by key, in units of the table, NaN = not read; ``words`` (n,) by meaning; ``kept`` (n,) by the name
    of the column; ``places`` (n,): file and line; ``columns``: what was made of each; ``dated``: whether times have a
    date.
    """

    name: str
    numbers: dict[Key, Array]
    words: dict[str, tuple[str, ...]]
    kept: dict[str, tuple[str, ...]]
    places: tuple[tuple[str, int], ...]
    columns: tuple[Column, ...]
    dated: bool = True

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.places)

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint columns, as q1."""
        return tuple(key[0] for key in self.numbers if Meaning(key[0]).kind == "joint")

    @property
    def reads(self) -> bool:
        """Whether it has readings of an instrument."""
        return any(key[0] in ("x", "y", "z", "dx", "dy", "dz", "rx", "ry", "rz") for key in self.numbers)


def read_values(
    table: Table,
    meanings: Mapping[str, Meaning],
    why: Mapping[str, str],
    mark: Mark,
    fill: Mapping[str, str],
    joints: Sequence[str] = (),
) -> Read:
    """The values of a table; ``joints``: columns of the model's joints.

    Raises
    ------
    InputErrors
        Every cell that is no number, with its line and column.
    """
    faults = Faults(table.name)
    numbers, words = dict[Key, Array](), dict[str, tuple[str, ...]]()
    kept, columns = dict[str, tuple[str, ...]](), list[Column]()
    for k, name in enumerate(table.header):
        meaning, cells = meanings[name], [row[k] for row in table.rows]
        values = np.full(len(cells), np.nan)
        if meaning.kind:
            values = _numbers(table, name, meaning, cells, mark, faults)
            key = (meaning.what, meaning.when, meaning.target)
            numbers[key] = values
        elif meaning.what in WORDS:
            words[meaning.what] = tuple(cell.strip() for cell in cells)
            if meaning.what in ("session", "target") and any(words[meaning.what]):
                for line, cell in zip(table.lines, words[meaning.what], strict=True):
                    if not cell:
                        faults.add(
                            line,
                            f"column {name} is empty",
                            code="I009",
                            allowed=f"a {meaning.what} in each row, or in none",
                            remedy="fill it in, or leave the line out with --rows FIRST-LAST",
                        )
        elif meaning.what == "keep":
            kept[name] = tuple(cell.strip() for cell in cells)
        there = values[np.isfinite(values)]
        empty = sum(cell.strip().lower() in NOT_READ for cell in cells)
        low, high = (float(there.min()), float(there.max())) if there.size else (np.nan, np.nan)
        columns.append(Column(table.name, name, meaning, why[name], empty, low, high))
    faults.raise_if_any("readings")
    places = tuple((table.name, line) for line in table.lines)
    dated = _with_dates(numbers, meanings)
    for name, text in fill.items():
        columns.append(_fill(name, text, numbers, words, table, joints))
    return Read(table.name, numbers, words, kept, places, tuple(columns), dated)


def _numbers(table: Table, name: str, meaning: Meaning, cells: Sequence[str], mark: Mark, faults: Faults) -> Array:
    out = np.full(len(cells), np.nan)
    optional = meaning.what in _MAY_BE_EMPTY
    unit = str(meaning.unit)
    allowed = "a finite number" if unit not in FORMS else f"a time ({unit})"
    for i, cell in enumerate(cells):
        if cell.strip().lower() in NOT_READ:
            if not optional:
                faults.add(
                    table.lines[i],
                    f"column {name} is empty",
                    code="I009",
                    value=cell.strip() or None,
                    allowed=allowed,
                    remedy="fill in the value, 0 too; or leave the line out with --rows FIRST-LAST",
                )
            continue
        try:
            value = seconds(cell, unit) if unit in FORMS else figure(cell, mark)
        except ValueError as error:
            faults.add(table.lines[i], f"column {name}", code="I009", value=cell, allowed=allowed, remedy=str(error))
            continue
        out[i] = in_table_unit(value, meaning)
        if meaning.kind == "joint" and abs(out[i]) > WIDEST_deg:
            faults.add(
                table.lines[i],
                f"column {name}",
                code="I009",
                value=cell,
                allowed=f"up to ten turns, {WIDEST_deg:g} deg",
                remedy=f"check its unit, which is {unit}",
            )
        if meaning.kind == "hung" and value < 0.0:
            faults.add(
                table.lines[i],
                f"column {name}",
                code="I009",
                value=cell,
                allowed="0 or more: what hangs pulls down",
                remedy="correct it, or give the load as a force (fz)",
            )
        if meaning.what == "sigma" and not out[i] > 0.0:
            faults.add(
                table.lines[i],
                f"column {name}",
                code="I009",
                value=cell,
                allowed="a number above 0, or an empty cell",
                remedy="a standard deviation of 0 is none: clear the cell",
            )
    return out


def in_table_unit(value: float, meaning: Meaning) -> float:
    """A value in the unit of the table's column: N downwards of what is hung, mm, deg, mrad, C, s."""
    unit = str(meaning.unit)
    if unit in FORMS:
        made = value
    elif meaning.kind == "hung":
        force = dimension(unit) == "force"
        made = -(converted(value, unit, "force") if force else converted(value, unit, "mass") * STANDARD_GRAVITY)
    elif meaning.kind == "joint":
        made = converted(value, unit, dimension(unit))
    else:
        made = converted(value, unit, meaning.kind)
    return -made + 0.0 if meaning.negated else made + 0.0


def _with_dates(numbers: dict[Key, Array], meanings: Mapping[str, Meaning]) -> bool:
    """Clock times with the dates of a column of their own; whether times have a date."""
    forms = {m.what: m.unit for m in meanings.values() if m.what in ("time", "date")}
    date = next((numbers.pop(key) for key in list(numbers) if key[0] == "date"), None)
    if date is None:
        return forms.get("time") != "clock"
    times = [key for key in numbers if key[0] == "time"]
    for key in times:
        if forms["time"] == "clock":
            numbers[key] = numbers[key] + date
    if not times:
        numbers["time", "", ""] = date
    return True


def _fill(
    name: str,
    text: str,
    numbers: dict[Key, Array],
    words: dict[str, tuple[str, ...]],
    table: Table,
    joints: Sequence[str],
) -> Column:
    """A value that stands in no file, in every row."""
    where = f"--fill {name}={text}"
    n = len(table.rows)
    if name in WORDS:
        if name in words:
            raise InputError(f"{where}: {table.name} has a column of it", code="I010", remedy="leave the option out")
        words[name] = (text.strip(),) * n
        return Column(table.name, where, Meaning(name), "as given", 0, np.nan, np.nan)
    number, _, unit = text.strip().partition(" ")
    meaning = meaning_of(f"{name} {unit}", where, joints)
    key = (meaning.what, "", "")
    if not meaning.kind or meaning.needs_unit:
        raise InputError(
            where,
            code="I010",
            allowed="a word such as session=day1, or a number with its unit as fz=-650 N",
            remedy="give the unit too",
        )
    if any(known[0] == meaning.what for known in numbers):
        raise InputError(f"{where}: {table.name} has a column of it", code="I010", remedy="leave the option out")
    try:
        value = in_table_unit(figure(Figure(float(number)), "point"), meaning)
    except ValueError as error:
        raise InputError(where, code="I010", value=number, allowed="a finite number with a decimal point") from error
    numbers[key] = np.full(n, value)
    return Column(table.name, where, meaning, "as given", 0, value, value)
