"""What the columns of a kind of table hold, as data, and the one reader that makes arrays and faults of its cells.

A kind of table is a tuple of :class:`Column` and a tuple of :class:`Need`; what only several cells or rows together can
break is checked with :meth:`Cells.check`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any, Final, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from doe.tables.columns import (
    DISPLACEMENTS,
    LARGEST_NUMBER,
    LOADS,
    LONGEST_NUMBER,
    OPTIONAL,
    POINT,
    RawTable,
    SAME_ANGLE_rad,
    parse_number,
    si_factor,
)
from robots import Robot
from robots.arrays import Array, Bools
from robots.errors import listed
from robots.faults import Faults

Kept = TypeVar("Kept", Array, tuple[Any, ...])

_UNIT: Final = re.compile(
    r"([munckd]|da|milli|micro|kilo)?(m|n|g|nm|n_m|n_mm|nmm|rad|deg|met(re|er)s?|newtons?|radians?|degrees?)"
    r"|inch(es)?|in|mils?|microns?|kgf|lbf?|arcmin|arcsec|"
)
_DOUBLED: Final = re.compile(r"\.\d+$")  # the mark some programs put on a column name's second use
# Joint coordinates as robot programs usually name them; only "q" is clear enough without a unit.
JOINT_LIKE: Final = re.compile(r"q_?\d+[a-z]*(_[a-z]+)?|(a|j|joint|axis|theta)_?\d+[a-z]*_(deg|rad)", re.I)
# Cells of these signs alone are numbers, or none that Python reads either.
_DIGITS: Final = re.compile(r"[0-9.eE+-]*", re.ASCII)


class Column(NamedTuple):
    """What the cells of a column may hold: numbers, or texts where ``words`` says which.

    ``empty`` says what an empty cell means ("not read"), None: it is a fault; ``missing``: the number without the
    column. Numbers are ``positive``, or from ``least`` to ``most`` in the column's unit, or ``whole``. ``allowed``,
    ``remedy`` and ``code`` of a fault, where the usual ones do not fit.
    """

    name: str
    empty: str | None = None
    missing: float = np.nan
    positive: bool = False
    least: float = -np.inf
    most: float = np.inf
    whole: bool = False
    words: Collection[str] | re.Pattern[str] | None = None
    allowed: str = ""
    remedy: str = ""
    code: str = "T004"

    def good(self, text: str) -> bool:
        """Whether a text is one of those allowed."""
        words = self.words
        return words is None or (words.fullmatch(text) is not None if isinstance(words, re.Pattern) else text in words)

    def number(self, text: str) -> tuple[float, str]:
        """The number in a cell, NaN where there is none, and what to do about it, "" where nothing is wrong."""
        if not text and self.empty is not None:
            return np.nan, ""
        try:
            value = parse_number(text, positive=self.positive)
        except ValueError as error:
            return np.nan, str(error)
        fits = self.least <= value <= self.most and not (self.whole and value % 1.0)
        return (value, "") if fits else (np.nan, self.remedy or "correct the cell")

    def plain(self, cells: Sequence[str]) -> Array | None:
        """Numbers (n,) of cells without a fault, fast; None where each has to be looked at."""
        empty = "" in cells
        if (empty and self.empty is None) or not _DIGITS.fullmatch("".join(cells)):
            return None
        if max(map(len, cells), default=0) > LONGEST_NUMBER:
            return None
        try:
            values = np.array([text or "nan" for text in cells] if empty else cells, dtype=np.float64)
        except ValueError:
            return None
        least = np.nextafter(0.0, 1.0) if self.positive else self.least
        fits = (np.abs(values) < LARGEST_NUMBER) & (values >= least) & (values <= self.most)
        fits &= (values == np.rint(values)) | (not self.whole)
        return values if (fits | np.isnan(values)).all() else None


class Need(NamedTuple):
    """Columns that a table must have: one of ``names``, all, or all or none. ``{}`` of ``problem``: those missing."""

    names: Sequence[str]
    problem: str
    allowed: str
    remedy: str
    code: str = "T003"
    rule: Literal["one", "all", "all or none"] = "all"


def one_of(what: str, names: Sequence[str], hint: str) -> Need:
    """At least one of a group of columns; ``hint``: what else can be done about a table without them."""
    remedy = f"add those that are not zero throughout, named exactly so{hint}"
    return Need(names, f"the header has no {what}", f"at least one of {', '.join(names)}", remedy, rule="one")


def angle_columns(robot: Robot) -> tuple[Column, ...]:
    """The columns of a robot's joint angles: its own and those of its controller."""
    return tuple(Column(name, missing=0.0) for name in robot.angle_names)


# Columns that several kinds of tables have.
LOAD_COLUMNS: Final = tuple(Column(name, missing=0.0) for name in LOADS)
READ_COLUMNS: Final = tuple(Column(name, "not read") for name in DISPLACEMENTS)
SIGMA: Final = Column("sigma_mm", "not known", positive=True)
STEP: Final = Column("step", "not known")
TIMES: Final = (Column("time_s", "not known"), Column("temperature_C", "not known"))
WHOLE_POINT: Final = Need(
    POINT,
    "no column {}",
    f"all of {', '.join(POINT)}, or none",
    "give all three coordinates of the loaded point in the flange frame",
    rule="all or none",
)


@dataclass(frozen=True)
class Cells:
    """The cells of a table, by column; what is wrong with them goes to ``faults``.

    ``known``, ``unknown``: where each column stands; ``meant``: names of columns that are there in another unit.
    """

    table: RawTable
    columns: dict[str, Column]
    known: dict[str, int]
    unknown: dict[str, int]
    meant: frozenset[str]
    faults: Faults

    @staticmethod
    def of(
        table: RawTable,
        columns: Sequence[Column],
        needs: Sequence[Need],
        faults: Faults,
        joints: Robot | None = None,
        code: str = "T003",
    ) -> Cells:
        """Sort the header: columns twice, without a name, in another unit or missing go to ``faults``.

        ``joints``: the robot beside whose angles no others may stand; ``code``: of what is wrong with a name.
        """
        specified = {column.name: column for column in columns}
        known, unknown, meant = dict[str, int](), dict[str, int](), set[str]()
        for i, name in enumerate(table.header):
            problem = allowed = remedy = ""
            column = f"column {name}" if name else f"column number {i + 1}"
            if not name:
                if any(row[i] for row in table.rows if len(row) > i):  # spreadsheets leave empty columns behind
                    problem, allowed = "has cells but no name", "a name for each column"
                    remedy = "name the column, or clear its cells"
            elif name in known or name in unknown or _DOUBLED.sub("", name) in known:
                problem, allowed, remedy = "stands there twice", "each name once", "rename or remove one of the two"
            elif name in specified:
                known[name] = i
            elif right := right_name(name, tuple(specified)):
                meant.add(right)
                problem, allowed = "has a wrong or missing unit", right
                remedy = f"convert the values if need be and name the column {right}"
            elif joints is not None and JOINT_LIKE.fullmatch(name):
                meant.update(joints.coordinates)
                problem, allowed = f"is not a joint coordinate of {joints.name}", ", ".join(joints.angle_names)
                remedy = "choose the robot that was measured, or convert the angles"
            else:
                unknown[name] = i
            if problem:
                what = f"{column} {problem}"
                faults.add(1, what, code=code, value=name or None, allowed=allowed, remedy=remedy)
        for need in needs:
            missing = [name for name in need.names if name not in known and name not in meant]
            none = len(missing) == len(need.names)
            if missing and none == {"one": True, "all": none, "all or none": False}[need.rule]:
                what = need.problem.format(", ".join(missing))
                faults.add(1, what, code=need.code, allowed=need.allowed, remedy=need.remedy)
        return Cells(table, specified, known, unknown, frozenset(meant), faults)

    def whole_rows(self, code: str = "T002") -> Cells:
        """The same without the rows of too many or too few cells, which are faults."""
        table, width = self.table, len(self.table.header)
        whole = [len(row) == width for row in table.rows]
        self.check(
            np.invert(np.array(whole, dtype=np.bool_)),
            "the row does not fit the header",
            code=code,
            value=lambda i: f"{len(table.rows[i])} cells",
            allowed=f"{width} cells",
            remedy=f"look for a missing or extra separator, or a decimal comma{table.hint}",
        )
        return self.only(whole)

    def only(self, rows: Sequence[bool]) -> Cells:
        """The same with some of the rows."""
        kept, lines = tuple(compress(self.table.rows, rows)), tuple(compress(self.table.lines, rows))
        return replace(self, table=replace(self.table, rows=kept, lines=lines))

    def check(
        self,
        bad: ArrayLike,
        problem: str | Callable[[int], str],
        *,
        code: str,
        allowed: str | Callable[[int], str],
        remedy: str | Callable[[int], str],
        value: Callable[[int], str | None] = lambda _: None,
    ) -> None:
        """Record a fault of each row that is ``bad`` (n,); its parts as text, or made of the row's place."""
        rows = np.flatnonzero(bad).tolist()
        parts = {"problem": problem, "value": value, "allowed": allowed, "remedy": remedy}
        self.faults.each(
            [self.table.lines[i] for i in rows],
            lambda n: {name: part(rows[n]) if callable(part) else part for name, part in parts.items()},
            code=code,
        )

    def refuse_unknown(self, *, code: str, remedy: str, but: Collection[str] = ()) -> None:
        """Record columns of no known name, ``but`` some, in small letters."""
        names = [name for name in self.unknown if name.strip().lower() not in but]
        if names:
            what = f"column {names[0]} is not known" if len(names) == 1 else f"columns {listed(names)} are not known"
            allowed = ", ".join(self.columns)
            self.faults.add(1, what, code=code, value=listed(names), allowed=allowed, remedy=remedy)

    def _check_cells(self, column: Column, cells: Sequence[str], wrong: dict[str, str], allowed: str) -> None:
        """Record the cells whose texts are ``wrong`` (with what to do about each); most texts stand there often."""
        self.check(
            [text in wrong for text in cells] if wrong else (),
            lambda i: f"column {column.name}" + ("" if cells[i] else " is empty"),
            code=column.code,
            value=lambda i: cells[i] or None,
            allowed=allowed,
            remedy=lambda i: wrong[cells[i]],
        )

    def numbers(self, *names: str, si: bool = True) -> Array:
        """Columns (n, len(names)) in SI units, or in the file's; NaN where empty or faulty."""
        out = np.empty((len(self.table.rows), len(names)))
        for k, name in enumerate(names):
            column = self.columns[name]
            if name not in self.known:
                out[:, k] = column.missing
                continue
            cells = self.texts(name)
            values = column.plain(cells)
            if values is None:
                read = {text: column.number(text) for text in set(cells)}
                values = np.array([read[text][0] for text in cells])
                wrong = {
                    text: why + self.table.hint * ("decimal comma" in why or "unit" in why)
                    for text, (_, why) in read.items()
                    if why
                }
                empty = f", or an empty cell ({column.empty})" if column.empty else ""
                usual = "a finite number" + " above 0" * column.positive + empty
                self._check_cells(column, cells, wrong, column.allowed or usual)
            out[:, k] = values * (si_factor(name) if si else 1.0)
        return out

    def texts(self, name: str, default: str = "") -> tuple[str, ...]:
        """A column (n,) as text, ``default`` where it is empty or missing."""
        if name not in self.known:
            return (default,) * len(self.table.rows)
        at = self.known[name]
        return (
            tuple(row[at] or default for row in self.table.rows) if default else tuple(r[at] for r in self.table.rows)
        )

    def words(self, name: str, default: str = "") -> tuple[str, ...]:
        """A column of texts (n,), each one of those allowed."""
        column, cells = self.columns[name], self.texts(name, default)
        if name in self.known:
            bad = {text: column.remedy for text in set(cells) if not column.good(text)}
            self._check_cells(column, cells, bad, column.allowed)
        return cells

    def angles(self, robot: Robot) -> Array:
        """Coordinates (n, dof) rad of the model: from its own columns, or from those of its controller's angles.

        Where a row has both, they must agree; a column that is missing among those given is 0.
        """
        controller = robot.controller
        shown = () if controller is None else controller.names
        q = self.numbers(*robot.coordinates)
        if controller is None or not any(name in self.known and name not in robot.coordinates for name in shown):
            return q
        read = controller.model(self.numbers(*shown))
        if not any(name in self.known and name not in shown for name in robot.coordinates):
            return read
        off = np.abs(read - q)
        worst = off.argmax(axis=1)
        self.check(
            off.max(axis=1) > SAME_ANGLE_rad,
            lambda i: f"column {robot.coordinates[worst[i]]}",
            code="T005",
            value=lambda i: f"{np.degrees(q[i, worst[i]]):g}",
            allowed=lambda i: f"{np.degrees(read[i, worst[i]]):g}, as the controller's angles of this row say",
            remedy=f"correct one of them, or keep only the columns {', '.join(shown)}",
        )
        return q

    def good(self) -> Bools:
        """Which rows (n,) have no fault."""
        return np.array([line not in self.faults.lines for line in self.table.lines], dtype=np.bool_)

    def remarks(self, robot: Robot, *, loads: bool = False, unused: str = "columns not used") -> Iterator[str]:
        """Which columns are missing, and which are not used; then what was said of the file itself."""
        shown = () if robot.controller is None else robot.controller.names
        own = any(name in self.known and name not in robot.coordinates for name in shown)
        for kind, group in (("joint", shown if own else robot.coordinates), ("load", LOADS if loads else ())):
            if missing := [name for name in group if name not in self.known]:
                yield f"{kind} columns missing, taken as 0: {', '.join(missing)}"
        if self.unknown:
            yield f"{unused}: {listed(self.unknown)}"
        yield from self.table.notes


def kept(values: Kept, good: Bools) -> Kept:
    """A column, array or tuple, where ``good`` (n,) is true."""
    return values[good] if isinstance(values, np.ndarray) else tuple(compress(values, good))


def as_cells(name: str, values: Array) -> tuple[str, ...]:
    """A column (n,) of SI numbers as text in the unit of its name, with 15 digits, empty where NaN."""
    return tuple("" if np.isnan(v) else f"{v:.15g}" for v in (values / si_factor(name) + 0.0).tolist())


def right_name(name: str, names: Sequence[str]) -> str | None:
    """One of ``names``, if ``name`` has its stem and a wrong, missing or misspelt unit."""
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
    return name in own or right_name(name, own) is not None or JOINT_LIKE.fullmatch(name) is not None
