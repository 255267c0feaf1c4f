"""From files as instruments write them to one table that `calibrate` and `diagnose` read: the whole way."""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from doe.absolute.table import COLUMNS, PENDANT, POSITION, absolute_of
from doe.instruments.cells import Grid, read_grids
from doe.instruments.combined import combined
from doe.instruments.figures import NOT_READ, Mark, decimal_mark, is_number
from doe.instruments.layout import Table, by_joint, find_table, without_units
from doe.instruments.mapping_file import Settings
from doe.instruments.meanings import QUANTITIES, Meaning
from doe.instruments.output import DEFLECTIONS, POSITIONS, Cells, joint_columns_of, kind_of, table_of
from doe.instruments.recognised import Recognised, recognise
from doe.instruments.times import time_form
from doe.instruments.units import unit_of
from doe.instruments.values import Column, Read, read_values
from doe.tables.columns import PHASES, RawTable
from doe.tables.reading import measurements_of
from robots import InputError, Robot
from robots.errors import listed, raise_any
from robots.faults import Faults

# Columns of a table of positions beside the positions themselves.
_OWN: Final = frozenset(column.name for column in COLUMNS) - {*POSITION, "step", "time_s", "temperature_C"}
# Names by which other commands know their own tables (a column that is kept must not make ours look like one).
_OTHERS: Final = frozenset((*PENDANT, "reflector", "joint", "nx", "ny", "nz", "alpha_deg", "a_mm", "d_mm"))
# Cells of a column that tell numbers from words.
_LOOKED_AT: Final = 2000


@dataclass(frozen=True)
class Converted:
    """The table made of some files.

    ``kind``: "deflections" or "positions"; ``header``, ``rows``: the table as text; ``columns``: what was made of each
    column that was read; ``files``: what was found in each, in words, by name; ``notes``: remarks; ``settings``: all of
    it for the next file of this layout; ``places``: file and line of each row.
    """

    kind: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    columns: tuple[Column, ...]
    files: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]
    settings: Settings
    places: tuple[tuple[str, int], ...]

    @property
    def source(self) -> str:
        """The files' names."""
        return " + ".join(self.files)

    def table(self) -> RawTable:
        """As the readers of tables take it; its lines are those of the file where all rows are from one."""
        digest = hashlib.sha256(repr((self.header, self.rows)).encode()).hexdigest()
        files = list(dict.fromkeys(file for file, _ in self.places))
        lines = [line for _, line in self.places] if len(files) == 1 else range(2, len(self.rows) + 2)
        return RawTable(" + ".join(files), digest, self.header, self.rows, tuple(lines), ())

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest number of each column of numbers."""
        out = {}
        for name, cells in zip(self.header, zip(*self.rows, strict=True), strict=True):
            try:
                values = [float(cell) for cell in cells if cell]
            except ValueError:
                continue
            if values and all(map(math.isfinite, values)):
                out[name] = (min(values), max(values))
        return out


def convert(files: Sequence[Path], settings: Settings | None = None, robot: Robot | None = None) -> Converted:
    """Make one table of files: exports of instruments, controllers' logs, sheets filled in by hand.

    Parameters
    ----------
    files : texts with any separator, or workbooks
    settings : what is known of them; all else is found, or asked for
    robot : names the joint columns; with it the table is read back as `calibrate` does

    Raises
    ------
    InputError
        Whatever cannot be read, or is not sure, with the option that settles it; nothing is guessed.
    """
    asked = settings or Settings()
    if not files:
        raise InputError("files of readings", code="I005", value="none", allowed="one or more", remedy="name them")
    resolved = [os.path.abspath(file) for file in files]
    if again := [str(file) for k, file in enumerate(files) if resolved[k] in resolved[:k]]:
        raise InputError(
            "files of readings", code="I005", value=again[0], allowed="each file once", remedy="leave it out"
        )
    units = _units(asked)
    tables = [table for file in files for table in _tables(file, asked, several=len(files) > 1)]
    joints = robot.angle_names if robot else ()
    found = [_recognised(table, asked, units, joints) for table in tables]
    known = {name for table in tables for name in table.header}
    known |= {f"{table.name.partition(', sheet ')[0]}:{name}" for table in tables for name in table.header}
    faults = [
        InputError(
            f'--column "{name}=..."',
            code="I004",
            value=name,
            allowed=listed(dict.fromkeys(n for t in tables for n in t.header), 40),
            remedy="use a name of the files' columns, or another mapping file",
        )
        for name in asked.columns
        if name not in known
    ]
    faults += [q.error(table.name) for table, one in zip(tables, found, strict=True) for q in one.questions]
    faults += _of_other_joints(found, robot)
    raise_any("ambiguous columns", faults)
    marks = [_mark(table, one, asked) for table, one in zip(tables, found, strict=True)]
    reads = [
        read_values(table, one.meanings, one.why, mark, _fill_of(table, one, asked, tables), joints)
        for table, one, (mark, _) in zip(tables, found, marks, strict=True)
    ]
    whole, notes = combined(reads, asked.join)
    kind = kind_of(whole, asked.kind)
    cells, more, places = table_of(whole, kind, asked, robot)
    made = _made(kind, cells, whole, asked, tables, found, marks, (*notes, *more), places)
    _check_words(made)
    return replace(made, notes=(*made.notes, *_read_back(made, robot)))


def _units(asked: Settings) -> tuple[str, ...]:
    out = []
    for word in asked.units:
        unit = unit_of(word)
        if unit is None:
            raise InputError(
                "--units",
                code="A001",
                value=word,
                allowed="units such as mm, inch, deg, rad, N, Nm, C",
                remedy="write them separated by commas, as in --units mm,deg",
            )
        out.append(unit)
    return tuple(out)


def _tables(file: Path, asked: Settings, *, several: bool) -> list[Table]:
    grids = read_grids(file, encoding=asked.encoding, separator=asked.separator, sheets=asked.sheets)

    def of(grid: Grid) -> Table | None:
        found = find_table(grid, columns=asked.names, if_bare=several, header=asked.header, rows=asked.rows)
        return found and without_units(by_joint(found), asked.columns)

    if len(grids) == 1 or asked.sheets:
        found = [of(grid) for grid in grids]
        for grid, table in zip(grids, found, strict=True):
            if table is None or not table.rows:
                raise InputError(
                    f"{grid.name} has no table of readings",
                    code="I002",
                    allowed="rows with two numbers or more",
                    remedy="say where its names stand with --header LINE, or how its cells are separated "
                    "with --separator",
                )
        return [table for table in found if table is not None]
    holding = [grid for grid in grids if _holds(grid)]
    if len(holding) != 1:
        every = " ".join(f'--sheet "{grid.how[0].removeprefix("sheet ")}"' for grid in holding or grids)
        raise InputError(
            f"readings file {file} has {len(holding)} sheets that look like readings",
            code="I002",
            allowed=every,
            remedy="say which to read: one, or several by repeating --sheet",
        )
    table = of(holding[0])
    if table is None:
        raise InputError(
            f"{holding[0].name} has no table of readings",
            code="I002",
            allowed="rows with two numbers or more",
            remedy="check --header and --rows",
        )
    left = listed(grid.how[0].removeprefix("sheet ") for grid in grids if grid is not holding[0])
    return [replace(table, how=(*table.how, f"no readings on sheet {left}"))]


def _holds(grid: Grid) -> bool:
    """Whether a sheet has rows of numbers: three cells in each of two rows at least."""
    return sum(sum(map(is_number, row)) > 2 for row in grid.rows) > 1


def _recognised(table: Table, asked: Settings, units: Sequence[str], joints: Sequence[str]) -> Recognised:
    columns = [
        [row[k] for row in table.rows if row[k].strip().lower() not in NOT_READ] for k in range(len(table.header))
    ]
    kinds = [_kind(cells) for cells in columns]
    file = table.name.partition(", sheet ")[0]
    given = {name: asked.columns[name] for name in table.header if name in asked.columns}
    given |= {name: asked.columns[f"{file}:{name}"] for name in table.header if f"{file}:{name}" in asked.columns}
    return recognise(table.header, table.units, kinds, given=given, stated=table.stated, said=units, joints=joints)


def _kind(cells: Sequence[str]) -> str:
    """What the cells of a column are: number, text, or a form of time. The first ones tell a number."""
    first = cells[:_LOOKED_AT]
    return "number" if 2 * sum(map(is_number, first)) > len(first) else time_form(cells) or "text"


def _of_other_joints(found: Sequence[Recognised], robot: Robot | None) -> list[InputError]:
    """Columns of joints that the model does not have."""
    if robot is None:
        return []
    known = joint_columns_of(robot)
    return [
        InputError(
            f"column {name!r} is taken as joint {meaning.what}, which {robot.name} does not have",
            code="I004",
            allowed=" or ".join(f'--column "{name}={what} {meaning.unit}"' for what in known),
            remedy="say which of its joints it is, or keep: an angle of another convention must be converted first",
        )
        for one in found
        for name, meaning in one.meanings.items()
        if meaning.kind == "joint" and meaning.what not in known
    ]


def _mark(table: Table, found: Recognised, asked: Settings) -> tuple[Mark, str]:
    at = [k for k, name in enumerate(table.header) if found.meanings[name].kind]
    cells = [(line, row[k]) for line, row in zip(table.lines, table.rows, strict=True) for k in at]
    return decimal_mark(cells, table.name, asked.decimal)


def _fill_of(table: Table, found: Recognised, asked: Settings, tables: Sequence[Table]) -> dict[str, str]:
    """Values that stand in no file: in a file of angles beside one of readings only the joints'."""
    reads = any(m.what in ("x", "y", "z", "dx", "dy", "dz", "rx", "ry", "rz") for m in found.meanings.values())
    return dict(asked.fill) if reads or len(tables) == 1 else {}


def _made(
    kind: str,
    cells: Cells,
    read: Read,
    asked: Settings,
    tables: Sequence[Table],
    found: Sequence[Recognised],
    marks: Sequence[tuple[Mark, str]],
    notes: Sequence[str],
    places: tuple[tuple[str, int], ...],
) -> Converted:
    out = dict(cells)
    more = list(notes)
    for name in list(out):
        if name in read.kept and (name in _OTHERS or (kind == POSITIONS and name in _OWN)):
            out[f"original {name}"] = out.pop(name)
            more.append(f"column {name} is kept as 'original {name}'")
    columns: dict[str, Meaning] = {}
    for table, one in zip(tables, found, strict=True):
        for name, meaning in one.meanings.items():
            same_name = columns.setdefault(name, meaning)
            if same_name != meaning:
                columns[f"{table.name.partition(', sheet ')[0]}:{name}"] = meaning
    same = {mark for mark, _ in marks}
    settings = replace(
        asked, columns=columns, decimal=next(iter(same)) if len(same) == 1 else None, rows=None, kind=kind
    )
    files = {
        table.name: (*table.how, f"decimal {mark} ({why})") for table, (mark, why) in zip(tables, marks, strict=True)
    }
    rows = tuple(zip(*out.values(), strict=True))
    return Converted(kind, tuple(out), rows, read.columns, files, tuple(more), settings, places)


def _check_words(made: Converted) -> None:
    """Words that the readers of tables do not take."""
    faults = Faults(made.source)
    for name, good, allowed in (
        ("repeat", re.compile(r"\d{0,9}", re.ASCII), "whole numbers, or empty cells"),
        ("phase", re.compile(f"(?:{'|'.join(PHASES)})?"), f"{', '.join(PHASES)}, or empty cells"),
        ("pose", re.compile(r"(?s).+"), "a label in each row"),
    ):
        if name not in made.header or (made.kind == POSITIONS and name != "phase"):
            continue
        k = made.header.index(name)
        for (file, line), row in zip(made.places, made.rows, strict=True):
            if not good.fullmatch(row[k]):
                faults.say(
                    line,
                    f"{file}, row {line}, column {name}",
                    code="I009",
                    value=row[k],
                    allowed=allowed,
                    remedy='correct it in the file, or keep the column: --column "NAME=keep"',
                )
    faults.raise_if_any("readings")


def _read_back(made: Converted, robot: Robot | None) -> tuple[str, ...]:
    """Remarks of the reader that will take the table; without a robot joints that have no column are said."""
    if robot is None:
        return ("joint columns are named q1_deg, q2_deg ...; with --model as the arm's model names them",)
    if made.kind == DEFLECTIONS:
        return measurements_of(made.table(), robot).notes
    return absolute_of(made.table(), robot).notes


def meaning_words(meaning: Meaning) -> str:
    """What a column became, for people."""
    if meaning.what == "keep":
        return "kept as it is"
    if meaning.what == "ignore":
        return "left out"
    if meaning.when or meaning.what not in QUANTITIES:
        return str(meaning)
    return f"{meaning} -> {QUANTITIES[meaning.what][1]}"
