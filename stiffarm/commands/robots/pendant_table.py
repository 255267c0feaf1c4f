"""Positions read at the controller, from a table: angles, x y z, and an orientation in one of the usual conventions."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from doe.tables.columns import Columns, RawTable, drop_ragged, joint_angles, numbers, read_table, sorted_columns, texts
from machining.programs.orientation import SPOKEN, Spoken
from robots import InputError, Robot
from robots.arrays import Array
from robots.errors import line_ranges, listed
from robots.faults import Faults
from robots.pendant.explanations import PendantReadings
from stiffarm.session.table_kinds import PENDANT, expect

POSITION = ("x_mm", "y_mm", "z_mm")
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
    if not path.is_file():
        raise InputError(
            "PENDANT", code="A007", value=str(path), allowed="an existing CSV or XLSX file", remedy="check the path"
        )
    expect(path, PENDANT, model=model)
    table = read_table(path, "pendant table", "pose")
    faults = Faults(table.name)
    own = tuple(dict.fromkeys(column for spoken in SPOKEN for column in spoken.columns))
    columns, meant = sorted_columns(table, (*robot.angle_names, *POSITION, *own, "pose"), faults)
    missing = [name for name in POSITION if name not in {*columns.known, *meant}]
    if missing:
        faults.add(
            1,
            f"no column {', '.join(missing)}",
            code="A007",
            allowed=", ".join(POSITION),
            remedy="add the tool's position as the controller shows it, in mm",
        )
    if not {*columns.known, *meant}.intersection(robot.angle_names):
        faults.add(
            1,
            "no joint column",
            code="A007",
            value=", ".join(table.header),
            allowed=", ".join(robot.angle_names),
            remedy="name the columns of the joint angles exactly so",
        )
    spoken = _convention(set(columns.known), faults)
    table, unread = _read_rows(drop_ragged(table, faults), columns)
    q = joint_angles(table, columns, robot, faults)
    for row in np.flatnonzero((np.abs(q) > np.radians(WIDEST_deg)).any(axis=1)):
        faults.add(
            table.lines[row],
            "joint angles",
            code="A007",
            value=str(np.degrees(q[row]).round(3).tolist()),
            allowed=f"up to {WIDEST_deg:g} deg in size",
            remedy="give degrees, as the controller shows them",
        )
    position = numbers(table, columns, POSITION, faults)
    for row in np.flatnonzero((np.abs(position) > FARTHEST_m).any(axis=1)):
        faults.add(
            table.lines[row],
            f"columns {', '.join(POSITION)}",
            code="A007",
            value=str((1e3 * position[row]).tolist()),
            allowed=f"up to {1e3 * FARTHEST_m:g} mm in size",
            remedy="give mm, as the controller shows them",
        )
    turned = None if spoken is None else numbers(table, columns, spoken.columns, faults, si=False)
    if spoken is not None and turned is not None and spoken.code == "abb":
        for row in np.flatnonzero(np.abs(np.linalg.norm(turned, axis=1) - 1.0) > UNIT_LENGTH):
            faults.add(
                table.lines[row],
                "columns qw, qx, qy, qz",
                code="A007",
                value=str(turned[row].tolist()),
                allowed="a quaternion of length 1",
                remedy="copy all four numbers, scalar first",
            )
    faults.raise_if_any("pendant table")
    at = columns.known.get("pose")
    labels = tuple(str(i + 1) for i in range(len(q))) if at is None else texts(table, at)
    remarks = [f"{path.name}: columns not used: {listed(columns.unknown)}"] if columns.unknown else []
    given = [name for name in robot.angle_names if name in columns.known]
    absent = [n for n in _same_kind(robot, given) if n not in given]
    remarks += [f"{path.name}: joint columns missing, taken as 0: {', '.join(absent)}"] if absent else []
    remarks += [f"{path.name}: rows without a position skipped: {line_ranges(unread)}"] if unread else []
    remarks += [f"{path.name}: {note}" for note in table.notes]
    if spoken is None or turned is None:
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


def _read_rows(table: RawTable, columns: Columns) -> tuple[RawTable, list[int]]:
    """The rows in which a position was filled in, and the lines of the others.

    Raises
    ------
    InputError
        There is none.
    """
    at = [columns.known[name] for name in POSITION if name in columns.known]
    read = [not at or any(row[i] for i in at) for row in table.rows]
    if table.rows and not any(read):
        raise InputError(
            f"pendant table {table.name}: no position was filled in yet",
            code="R007",
            allowed=f"{', '.join(POSITION)} as the controller shows them at each pose",
            remedy="drive to the poses and fill them in; rows left empty are skipped",
        )
    unread = [line for line, there in zip(table.lines, read, strict=True) if not there]
    kept = replace(table, rows=tuple(compress(table.rows, read)), lines=tuple(compress(table.lines, read)))
    return kept, unread


def _same_kind(robot: Robot, given: list[str]) -> tuple[str, ...]:
    """The names that belong to those given: the controller's, where one of these is only its."""
    if robot.controller is not None and any(name not in robot.coordinates for name in given):
        return robot.controller.names
    return robot.coordinates


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
