"""Positions read at the controller, from a table: angles, x y z, and an orientation in one of the usual conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from doe.tables.schema import Cells, Column, Need, angle_columns
from machining.programs.orientation import SPOKEN, Spoken
from robots import InputError, Robot
from robots.arrays import Array
from robots.errors import line_ranges
from robots.faults import Faults
from robots.pendant.explanations import PendantReadings
from stiffarm.session.table_kinds import PENDANT, open_table

POSITION = ("x_mm", "y_mm", "z_mm")
WHOLE_POSITION = Need(
    POSITION,
    "no column {}",
    ", ".join(POSITION),
    "add the tool's position as the controller shows it, in mm",
    code="A007",
)
# No tool is farther from its robot frame.
FARTHEST_m = 100.0
# No joint turns farther, deg.
WIDEST_deg = 3600.0
# Quaternions from a pendant have four decimals or so.
UNIT_LENGTH = 0.02


def read_pendant(path: Path, robot: Robot, model: str = "MODEL") -> tuple[PendantReadings, str | None, list[str]]:
    """The table's readings, the convention of its orientations (None: there are none), and remarks.

    ``model``: its name in what is said of a table that another command takes.

    Raises
    ------
    InputError
        The file cannot be read, or every fault of its columns and cells.
    """
    table = open_table(path, PENDANT, "pendant table", "pose", option="PENDANT", model=model)
    faults = Faults(table.name)
    own = tuple(Column(name) for name in dict.fromkeys(column for spoken in SPOKEN for column in spoken.columns))
    position_columns = tuple(Column(name) for name in POSITION)
    joints = Need(
        robot.angle_names,
        "no joint column",
        ", ".join(robot.angle_names),
        "name the columns of the joint angles exactly so",
        code="A007",
        rule="one",
    )
    columns = (*angle_columns(robot), *position_columns, *own, Column("pose"))
    header = Cells.of(table, columns, (WHOLE_POSITION, joints), faults)
    spoken = _convention(set(header.known), faults)
    cells, unread = _read_rows(header.whole_rows())
    q, position = cells.angles(robot), cells.numbers(*POSITION)
    cells.check(
        (np.abs(q) > np.radians(WIDEST_deg)).any(axis=1),
        "joint angles",
        code="A007",
        value=lambda i: str(np.degrees(q[i]).round(3).tolist()),
        allowed=f"up to {WIDEST_deg:g} deg in size",
        remedy="give degrees, as the controller shows them",
    )
    cells.check(
        (np.abs(position) > FARTHEST_m).any(axis=1),
        f"columns {', '.join(POSITION)}",
        code="A007",
        value=lambda i: str((1e3 * position[i]).tolist()),
        allowed=f"up to {1e3 * FARTHEST_m:g} mm in size",
        remedy="give mm, as the controller shows them",
    )
    turned = np.zeros((len(q), 0)) if spoken is None else cells.numbers(*spoken.columns, si=False)
    cells.check(
        (np.abs(np.linalg.norm(turned, axis=1) - 1.0) > UNIT_LENGTH) & (spoken is not None and spoken.code == "abb"),
        "columns qw, qx, qy, qz",
        code="A007",
        value=lambda i: str(turned[i].tolist()),
        allowed="a quaternion of length 1",
        remedy="copy all four numbers, scalar first",
    )
    faults.raise_if_any("pendant table")
    labels = cells.texts("pose") if "pose" in cells.known else tuple(map(str, range(1, len(q) + 1)))
    remarks = [f"{path.name}: {remark}" for remark in cells.remarks(robot)]
    remarks += [f"{path.name}: rows without a position skipped: {line_ranges(unread)}"] if unread else []
    if spoken is None:
        return PendantReadings(q, position, None, labels), None, remarks
    rotation = spoken.orientation.read(turned)
    return PendantReadings(q, position, rotation, labels, _others(spoken, turned)), spoken.code, remarks


def _others(spoken: Spoken, turned: Array) -> dict[str, Array]:
    """The same numbers as each other convention has them, by the columns that they should be in then."""
    if spoken.code == "abb":
        last = spoken.orientation.read(np.roll(turned, 1, axis=1))
        return {"a quaternion, scalar last: the columns in the order qx, qy, qz, qw": last}
    degrees = [one for one in SPOKEN if one.columns[0].endswith("_deg") and one.code != "rpy"]
    if spoken not in degrees and spoken.code != "rpy":
        return {}
    out: dict[str, Array] = {}
    for one in degrees:
        if one.orientation is not spoken.orientation:
            out[f"{one.words}: columns {', '.join(one.columns)}"] = one.orientation.read(turned)
    return out


def _read_rows(cells: Cells) -> tuple[Cells, list[int]]:
    """The rows in which a position was filled in, and the lines of the others.

    Raises
    ------
    InputError
        There is none.
    """
    read = [any(row) for row in zip(*(cells.texts(name) for name in POSITION), strict=True)]
    if not {*POSITION} & {*cells.known}:
        return cells, []
    if read and not any(read):
        raise InputError(
            f"pendant table {cells.table.name}: no position was filled in yet",
            code="R007",
            allowed=f"{', '.join(POSITION)} as the controller shows them at each pose",
            remedy="drive to the poses and fill them in; rows left empty are skipped",
        )
    return cells.only(read), [line for line, there in zip(cells.table.lines, read, strict=True) if not there]


def _convention(present: set[str], faults: Faults) -> Spoken | None:
    """The convention whose columns are all there."""
    whole = [spoken for spoken in SPOKEN if present.issuperset(spoken.columns)]
    begun = {column for spoken in SPOKEN for column in spoken.columns} & present
    allowed = "; ".join(f"{spoken.words}: {', '.join(spoken.columns)}" for spoken in SPOKEN)
    if len(whole) > 1 and begun != set(whole[0].columns):
        faults.add(
            1,
            "orientations in more than one convention",
            code="R007",
            value=", ".join(sorted(begun)),
            allowed=allowed,
            remedy="keep the columns of one",
        )
    elif not whole and begun:
        faults.add(
            1,
            "an orientation that is not whole",
            code="R007",
            value=", ".join(sorted(begun)),
            allowed=allowed,
            remedy="add the missing columns, or remove these",
        )
    return whole[0] if whole else None
