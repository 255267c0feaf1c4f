"""Tables of Denavit-Hartenberg parameters: read with every slip named, and an empty one to fill in."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from doe.tables.columns import Columns, RawTable, drop_ragged, numbers, read_table, sorted_columns, texts
from robots import InputError
from robots.arrays import Array
from robots.errors import listed
from robots.faults import Faults
from robots.files.csv_text import write_rows
from robots.library.dh import DHLine
from stiffarm.session.table_kinds import DH, expect

FIGURES = ("alpha_deg", "a_mm", "d_mm")
LIMITS = ("lower_deg", "upper_deg")
COLUMNS = ("joint", *FIGURES, "theta_deg", *LIMITS, "sign")
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
    if not path.is_file():
        raise InputError(
            option,
            code="A007",
            value=str(path),
            allowed="an existing CSV or XLSX file",
            remedy="check the path; `stiffarm new NAME` alone writes an empty table",
        )
    expect(path, DH)
    table = read_table(path, "table of Denavit-Hartenberg parameters", "joint")
    faults = Faults(table.name)
    columns, meant = sorted_columns(table, COLUMNS, faults)
    for name in ("joint", *FIGURES, *LIMITS):
        if name not in columns.known and name not in meant:
            faults.add(
                1,
                f"no column {name}",
                code="A007",
                allowed=", ".join(COLUMNS),
                remedy="add it; sign and theta_deg may be left out",
            )
    for name, index in columns.unknown.items():
        if name.strip().lower() in KIND:
            _check_kinds(table, index, name, faults)
            continue
        faults.add(
            1,
            f"column {name} is not known",
            code="A007",
            value=name,
            allowed=", ".join(COLUMNS),
            remedy="name it as one of these, or remove it",
        )
    faults.raise_if_any("table of Denavit-Hartenberg parameters")
    table = drop_ragged(table, faults)
    lines = _lines(table, columns, faults) if table.rows else []
    faults.raise_if_any("table of Denavit-Hartenberg parameters")
    return [line for line in lines if line.limits is not None], next((x for x in lines if x.limits is None), None)


def _check_kinds(table: RawTable, index: int, column: str, faults: Faults) -> None:
    """Name joints that slide: an arm of this program turns at all its joints."""
    for line, row in zip(table.lines, table.rows, strict=True):
        said = (row[index] if index < len(row) else "").lower()
        if said not in TURNS:
            slides = "a joint that slides cannot be modelled yet" if said in SLIDES else "no kind of joint"
            faults.add(
                line,
                f"column {column}: {slides}",
                code="R005",
                value=said,
                allowed=", ".join(filter(None, TURNS)),
                remedy="leave it out; where it stands, its length is a neighbour's d_mm or a_mm",
            )


def _lines(table: RawTable, columns: Columns, faults: Faults) -> list[DHLine]:
    names = texts(table, columns.known["joint"])
    _check_names(table, names, faults)
    filled = zip(*(texts(table, columns.known[name]) for name in FIGURES), strict=True)
    empty = [name for name, row in zip(names, filled, strict=True) if not any(row)]
    if empty:
        faults.add(
            table.lines[names.index(empty[0])],
            f"{', '.join(FIGURES)} are empty for {listed(empty)}",
            code="R005",
            allowed="a number in each, 0 too",
            remedy="fill them in, or remove that row",
        )
        return []
    cells = (table, columns)
    figures = numbers(*cells, FIGURES, faults, si=False)
    theta = numbers(*cells, ("theta_deg",), faults, empty="0", missing=0.0, si=False)[:, 0]
    limits = numbers(*cells, LIMITS, faults, empty="of the flange", si=False)
    sign = numbers(*cells, ("sign",), faults, empty="1", missing=1.0, si=False)[:, 0]
    sign[np.isnan(sign)], theta[np.isnan(theta)] = 1.0, 0.0
    joint = np.array([name != FLANGE for name in names], dtype=np.bool_)
    for i in np.flatnonzero(joint).tolist():
        _check_limits(table.lines[i], limits[i], faults)
        if sign[i] not in (1.0, -1.0):
            faults.add(
                table.lines[i],
                "column sign",
                code="R005",
                value=f"{sign[i]:g}",
                allowed="1 or -1",
                remedy="-1 where the joint turns against the table's axis",
            )
    for i, row in enumerate(figures):
        _check_figures(table.lines[i], row, faults)
        for name, angle in (("alpha_deg", row[0]), ("theta_deg", theta[i])):
            if abs(angle) > WIDEST_deg[name]:
                faults.add(
                    table.lines[i],
                    f"column {name}",
                    code="R005",
                    value=f"{angle:g}",
                    allowed=f"up to {WIDEST_deg[name]:g} deg in size",
                    remedy="give degrees",
                )
    in_all = float(np.abs(figures[:, 1:]).sum())
    if not faults and in_all < SHORTEST_mm:
        faults.add(
            table.lines[0],
            "columns a_mm, d_mm",
            code="R005",
            value=f"{in_all:.4g} mm in all",
            allowed=f"{SHORTEST_mm:g} mm or more",
            remedy="these look like metres: give mm" if in_all else "fill in the lengths of the data sheet",
        )
    if joint.any() and not faults and np.abs(limits[joint]).max() < _NARROW_deg:
        faults.add(
            table.lines[0],
            "columns lower_deg, upper_deg",
            code="R005",
            value=f"{limits[0, 0]:g} to {limits[0, 1]:g}",
            allowed="degrees",
            remedy="these look like radians: convert all angles to degrees",
        )
    if faults:
        return []
    return [
        DHLine(
            name,
            alpha=float(figures[i, 0]),
            a=float(figures[i, 1]),
            d=float(figures[i, 2]),
            theta=float(theta[i]),
            limits=(float(limits[i, 0]), float(limits[i, 1])) if joint[i] else None,
            sign=-1 if sign[i] < 0.0 else 1,
        )
        for i, name in enumerate(names)
    ]


def _check_names(table: RawTable, names: tuple[str, ...], faults: Faults) -> None:
    for line, name in zip(table.lines, names, strict=True):
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]{0,30}", name) or names.count(name) > 1:
            faults.add(
                line,
                "column joint",
                code="R005",
                value=name,
                allowed="a name of its own, as in j1 (or flange): up to 31 letters, digits, - _ .",
                remedy="name each joint once, beginning with a letter",
            )
    if FLANGE in names and names[-1] != FLANGE:
        faults.add(
            table.lines[names.index(FLANGE)],
            "column joint",
            code="R005",
            value=FLANGE,
            allowed="as the last row",
            remedy="move it to the end: it lies beyond the last joint",
        )
    if len(names) > MOST_JOINTS + 1:
        faults.add(
            table.lines[MOST_JOINTS],
            "rows",
            code="R005",
            value=str(len(names)),
            allowed=f"up to {MOST_JOINTS} joints and a flange",
            remedy="give the joints of one arm",
        )
    if not set(names) - {FLANGE}:
        faults.add(table.lines[0], "no joint", code="R005", allowed="a row for each joint", remedy="add them")


def _check_limits(line: int, limits: Array, faults: Faults) -> None:
    missing = [name for name, v in zip(LIMITS, limits, strict=True) if np.isnan(v)]
    if missing and line not in faults.lines:
        faults.add(
            line,
            f"no {' and no '.join(missing)}",
            code="R005",
            allowed="both ends of the joint's range, in deg",
            remedy="fill them in from the data sheet (-360 and 360 where it turns without end)",
        )
    elif not missing and not (limits[0] < limits[1] and np.abs(limits).max() <= WIDEST_deg["limits"]):
        faults.add(
            line,
            "columns lower_deg, upper_deg",
            code="R005",
            value=f"{limits[0]:g}, {limits[1]:g}",
            allowed=f"lower_deg less than upper_deg, at most {WIDEST_deg['limits']:g} deg in size",
            remedy="swap them, or correct one",
        )


def _check_figures(line: int, row: Array, faults: Faults) -> None:
    alpha = row[0]
    if np.abs(np.abs(alpha) - _IN_RADIANS).min() < 2e-3:
        faults.add(
            line,
            "column alpha_deg",
            code="R005",
            value=f"{alpha:g}",
            allowed="degrees, as in 90",
            remedy="this looks like radians: convert all angles to degrees",
        )
    for name, value in zip(FIGURES[1:], row[1:], strict=True):
        if abs(value) > LONGEST_mm:
            faults.add(
                line,
                f"column {name}",
                code="R005",
                value=f"{value:.12g}",
                allowed=f"up to {LONGEST_mm:g} mm in size",
                remedy="give mm, with a decimal point and no separator of thousands",
            )
