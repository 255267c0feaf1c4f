"""Tables of Denavit-Hartenberg parameters: read with every slip named, and an empty one to fill in."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from doe.tables.schema import Cells, Column, Need
from robots.arrays import Array, Bools
from robots.errors import listed
from robots.faults import Faults
from robots.files.csv_text import write_rows
from robots.library.dh import DHLine
from stiffarm.session.table_kinds import DH, open_table

FIGURES = ("alpha_deg", "a_mm", "d_mm")
LIMITS = ("lower_deg", "upper_deg")
COLUMN = (
    Column("joint"),
    *map(Column, FIGURES),
    Column("theta_deg", "0", missing=0.0),
    *(Column(name, "of the flange") for name in LIMITS),
    Column("sign", "1", missing=1.0),
)
COLUMNS = tuple(column.name for column in COLUMN)
NEEDS = tuple(
    Need((name,), "no column {}", ", ".join(COLUMNS), "add it; sign and theta_deg may be left out", code="A007")
    for name in ("joint", *FIGURES, *LIMITS)
)
FLANGE = "flange"
# A column that says how joints move, and its words.
KIND = ("type", "joint_type", "kind")
TURNS = ("", "revolute", "r", "rotary", "rotational", "continuous", "fixed", FLANGE)
SLIDES = ("prismatic", "p", "sliding", "linear", "translational", "t")
# No arm has more from one joint to the next.
LONGEST_mm = 10_000.0
# No arm has more joints in a row.
MOST_JOINTS = 20
# No arm is shorter in all.
SHORTEST_mm = 20.0
# More is no angle of a table; limits may be several turns.
WIDEST_deg = {"alpha_deg": 360.0, "theta_deg": 360.0, "limits": 3600.0}
# Right angles and half turns in rad, which nobody has in deg.
_IN_RADIANS = np.array([np.pi / 2.0, np.pi])
# A joint that turns over less than that in all was given in rad.
_NARROW_deg = 7.0


def empty_table(joints: int = 6) -> str:
    """A table to fill in."""
    stream = io.StringIO()
    rows = [[f"j{i}", *[""] * 3, "0", "", "", "1"] for i in range(1, joints + 1)]
    write_rows(stream, [COLUMNS, *rows, [FLANGE, *[""] * 3, "0", "", "", ""]])
    return stream.getvalue()


def read_dh(path: Path, option: str) -> tuple[list[DHLine], DHLine | None]:
    """Lines of the joints, and that of the flange if there is one.

    Raises
    ------
    InputError
        The file cannot be read; or its faults, each with row, column, value and remedy.
    """
    more = "; `stiffarm new NAME` alone writes an empty table"
    table = open_table(path, DH, "table of Denavit-Hartenberg parameters", "joint", option=option, more=more)
    faults = Faults(table.name)
    cells = Cells.of(table, COLUMN, NEEDS, faults)
    cells.refuse_unknown(code="A007", remedy="name it as one of these, or remove it", but=KIND)
    for name, index in cells.unknown.items():
        if name.strip().lower() in KIND:
            _check_kinds(cells, [(row[index] if index < len(row) else "").lower() for row in table.rows], name)
    faults.raise_if_any("table of Denavit-Hartenberg parameters")
    cells = cells.whole_rows()
    lines = _lines(cells) if cells.table.rows else []
    faults.raise_if_any("table of Denavit-Hartenberg parameters")
    return [line for line in lines if line.limits is not None], next((x for x in lines if x.limits is None), None)


def _check_kinds(cells: Cells, said: Sequence[str], column: str) -> None:
    """Name joints that slide: an arm of this program turns at all its joints."""
    slides = dict.fromkeys(SLIDES, "a joint that slides cannot be modelled yet")
    cells.check(
        [kind not in TURNS for kind in said],
        lambda i: f"column {column}: {slides.get(said[i], 'no kind of joint')}",
        code="R005",
        value=lambda i: said[i],
        allowed=", ".join(filter(None, TURNS)),
        remedy="leave it out; where it stands, its length is a neighbour's d_mm or a_mm",
    )


def _lines(cells: Cells) -> list[DHLine]:
    faults, first = cells.faults, np.arange(len(cells.table.rows)) == 0
    names = cells.texts("joint")
    _check_names(cells, names)
    filled = zip(*map(cells.texts, FIGURES), strict=True)
    empty = [name for name, row in zip(names, filled, strict=True) if not any(row)]
    if empty:
        faults.add(
            cells.table.lines[names.index(empty[0])],
            f"{', '.join(FIGURES)} are empty for {listed(empty)}",
            code="R005",
            allowed="a number in each, 0 too",
            remedy="fill them in, or remove that row",
        )
        return []
    alpha, a, d, theta, lower, upper, sign = cells.numbers(*FIGURES, "theta_deg", *LIMITS, "sign", si=False).T
    joint = np.array([name != FLANGE for name in names], dtype=np.bool_)
    sign[np.isnan(sign)], theta[np.isnan(theta)] = 1.0, 0.0
    _check_limits(cells, lower, upper, joint)
    cells.check(
        joint & (np.abs(sign) != 1.0),
        "column sign",
        code="R005",
        value=lambda i: f"{sign[i]:g}",
        allowed="1 or -1",
        remedy="-1 where the joint turns against the table's axis",
    )
    cells.check(
        np.abs(np.abs(alpha)[:, None] - _IN_RADIANS).min(axis=1) < 2e-3,
        "column alpha_deg",
        code="R005",
        value=lambda i: f"{alpha[i]:g}",
        allowed="degrees, as in 90",
        remedy="this looks like radians: convert all angles to degrees",
    )
    for name, values, most, unit, remedy in (
        ("a_mm", a, LONGEST_mm, "mm", "give mm, with a decimal point and no separator of thousands"),
        ("d_mm", d, LONGEST_mm, "mm", "give mm, with a decimal point and no separator of thousands"),
        ("alpha_deg", alpha, WIDEST_deg["alpha_deg"], "deg", "give degrees"),
        ("theta_deg", theta, WIDEST_deg["theta_deg"], "deg", "give degrees"),
    ):
        cells.check(
            np.abs(values) > most,
            f"column {name}",
            code="R005",
            value=lambda i, values=values: f"{values[i]:.12g}",  # type: ignore[misc]
            allowed=f"up to {most:g} {unit} in size",
            remedy=remedy,
        )
    in_all = float(np.abs([a, d]).sum())
    cells.check(
        first & (not faults and in_all < SHORTEST_mm),
        "columns a_mm, d_mm",
        code="R005",
        value=lambda _: f"{in_all:.4g} mm in all",
        allowed=f"{SHORTEST_mm:g} mm or more",
        remedy="these look like metres: give mm" if in_all else "fill in the lengths of the data sheet",
    )
    cells.check(
        first & (not faults and np.abs([lower[joint], upper[joint]]).max(initial=0.0) < _NARROW_deg),
        "columns lower_deg, upper_deg",
        code="R005",
        value=lambda _: f"{lower[0]:g} to {upper[0]:g}",
        allowed="degrees",
        remedy="these look like radians: convert all angles to degrees",
    )
    if faults:
        return []
    rows = zip(names, *(v.tolist() for v in (alpha, a, d, theta, lower, upper, sign)), strict=True)
    return [
        DHLine(
            name,
            alpha=row[0],
            a=row[1],
            d=row[2],
            theta=row[3],
            limits=None if name == FLANGE else (row[4], row[5]),
            sign=-1 if row[6] < 0.0 else 1,
        )
        for name, *row in rows
    ]


def _check_names(cells: Cells, names: tuple[str, ...]) -> None:
    rows = np.arange(len(names))
    cells.check(
        [not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]{0,30}", name) or names.count(name) > 1 for name in names],
        "column joint",
        code="R005",
        value=lambda i: names[i],
        allowed="a name of its own, as in j1 (or flange): up to 31 letters, digits, - _ .",
        remedy="name each joint once, beginning with a letter",
    )
    cells.check(
        rows == (names.index(FLANGE) if FLANGE in names and names[-1] != FLANGE else -1),
        "column joint",
        code="R005",
        value=lambda i: names[i],
        allowed="as the last row",
        remedy="move it to the end: it lies beyond the last joint",
    )
    cells.check(
        (rows == MOST_JOINTS) & (len(names) > MOST_JOINTS + 1),
        "rows",
        code="R005",
        value=lambda _: str(len(names)),
        allowed=f"up to {MOST_JOINTS} joints and a flange",
        remedy="give the joints of one arm",
    )
    cells.check(
        (rows == 0) & (not set(names) - {FLANGE}),
        "no joint",
        code="R005",
        allowed="a row for each joint",
        remedy="add them",
    )


def _check_limits(cells: Cells, lower: Array, upper: Array, joint: Bools) -> None:
    ends = np.column_stack([lower, upper])
    missing = np.isnan(ends)
    cells.check(
        joint & missing.any(axis=1) & cells.good(),
        lambda i: f"no {' and no '.join(name for name, gone in zip(LIMITS, missing[i], strict=True) if gone)}",
        code="R005",
        allowed="both ends of the joint's range, in deg",
        remedy="fill them in from the data sheet (-360 and 360 where it turns without end)",
    )
    cells.check(
        joint & ((lower >= upper) | (np.abs(ends).max(axis=1) > WIDEST_deg["limits"])),
        "columns lower_deg, upper_deg",
        code="R005",
        value=lambda i: f"{lower[i]:g}, {upper[i]:g}",
        allowed=f"lower_deg less than upper_deg, at most {WIDEST_deg['limits']:g} deg in size",
        remedy="swap them, or correct one",
    )
