"""Read tables of absolute readings (CSV, XLSX), one row a target at a pose, with every fault named."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.tables import columns as mc
from doe.tables.checks import check_limits
from doe.tables.columns import LOADS, Columns, RawTable
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.errors import listed
from robots.faults import Faults

POSITION: Final = ("x_mm", "y_mm", "z_mm")
NUMBERS: Final = ("payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm", "rail_mm", "sigma_mm")
WHEN: Final = ("time_s", "step", "temperature_C")
WORDS: Final = ("session", "target", "payload", "approach")
# Read for later: their columns are known, and not used yet.
KEPT: Final = ("rx_deg", "ry_deg", "rz_deg", "operator", "instrument", "pose", "repeat")
# Orientations as controllers show them: a table with these was read at a pendant, not by a tracker.
PENDANT: Final = frozenset(("a_deg", "b_deg", "c_deg", "w_deg", "p_deg", "r_deg", "qw", "qx", "qy", "qz"))
# A tracker reaches some 80 m; farther coordinates are another unit.
FARTHEST_m: Final = 200.0


def is_absolute(header: Sequence[str]) -> bool:
    """Whether a table has positions, and neither loads, displacements nor a controller's orientations."""
    names = {name.strip() for name in header}
    return {*POSITION} <= names and not names & {*LOADS, *mc.DISPLACEMENTS, *PENDANT}


def read_absolute(path: str | Path, robot: Robot, *, check_reach: bool = True) -> AbsoluteReadings:
    """Read a table of positions for ``robot``.

    One row a reading: joint columns (``q1_deg`` ...), ``x_mm y_mm z_mm`` of a target in the tracker's frame. Optional:
    ``session`` (tracker and base stayed in place; without the column all is one, named after the file), ``target`` (a
    point fixed to the flange, the same in all sessions; without the column one for each session), ``payload_kg`` with
    ``payload_x_mm payload_y_mm payload_z_mm`` (its centre in the flange frame), ``rail_mm``, ``sigma_mm``, ``time_s``
    (or ``step``, the order in time), ``temperature_C`` and ``approach``: for each joint in turn ``+`` or ``-``, the way
    that it last turned before it stopped, ``0`` where that is not known, as in ``+-+00+``.

    Raises
    ------
    InputErrors
        Faults in the header or the rows, all of them, each with line, column, value and remedy.
    InputError
        The file as a whole cannot be read.
    """
    return absolute_of(mc.read_table(Path(path)), robot, check_reach=check_reach)


def absolute_of(table: RawTable, robot: Robot, *, check_reach: bool = True) -> AbsoluteReadings:
    """Readings of a table of text, as :func:`read_absolute`."""
    faults = Faults(table.name)
    needed = MappingProxyType({"position column": POSITION, "load column": POSITION})
    columns = mc.find_columns(table, robot, faults, (*POSITION, *NUMBERS, *WHEN, *WORDS, *KEPT), needed)
    for name in POSITION:
        if name not in columns.known and not faults.count:
            faults.add(
                1,
                f"no column {name}",
                code="T001",
                allowed=f"all of {', '.join(POSITION)}",
                remedy="give all three coordinates of the target in the tracker's frame",
            )
    fits = not faults.count
    data = _assembled(mc.drop_ragged(table, faults), columns, robot, faults)
    if fits and len(data):
        _check(data, robot, faults, check_reach)
    faults.raise_if_any("absolute readings")
    if not len(data):
        raise InputError(
            f"{table.name} has no readings", code="T001", remedy="each line below the header holds one target"
        )
    return data


def _assembled(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> AbsoluteReadings:
    cells = (table, columns)
    q = mc.joint_angles(*cells, robot, faults)
    position = mc.numbers(*cells, POSITION, faults)
    kg, *centre = mc.numbers(*cells, NUMBERS[:4], faults, empty="none", missing=0.0).T
    rail = mc.numbers(*cells, ("rail_mm",), faults, missing=0.0)[:, 0]
    sigma = mc.numbers(*cells, ("sigma_mm",), faults, empty="not known", positive=True)[:, 0]
    seconds, step, temperature = mc.numbers(*cells, WHEN, faults, empty="not known").T
    approach = _approaches(table, columns, robot, faults)
    good: Bools = np.array([line not in faults.lines for line in table.lines], dtype=np.bool_)

    def words(name: str, without: str) -> tuple[str, ...]:
        if name not in columns.known:
            return (without,) * int(good.sum())
        return tuple(compress((text or without for text in mc.texts(table, columns.known[name])), good))

    session = words("session", Path(table.name).stem)
    target = words("target", "") if "target" in columns.known else session
    held = np.nan_to_num(np.column_stack([kg, *centre]))[good]
    different, payload = np.unique(held, axis=0, return_inverse=True) if len(held) else (held, np.zeros(0, dtype=int))
    return AbsoluteReadings(
        table.name,
        table.sha256,
        q[good],
        position[good],
        Labels.of(session),
        Labels.of(target),
        payload.reshape(-1).astype(np.int64),
        tuple(Payload(float(row[0]), row[1:]) for row in different),
        rail[good],
        sigma[good],
        np.array(table.lines, dtype=np.int64)[good],
        tuple(_notes(table, columns, robot)),
        _complete(seconds[good], step[good]),
        _complete(temperature[good]),
        approach[good],
    )


def _approaches(table: RawTable, columns: Columns, robot: Robot, faults: Faults) -> Array:
    """Which way each joint came (n, dof); no column: nothing is known (n, 0)."""
    if "approach" not in columns.known:
        return np.zeros((len(table.lines), 0))
    out = np.zeros((len(table.lines), robot.dof))
    for k, (line, text) in enumerate(zip(table.lines, mc.texts(table, columns.known["approach"]), strict=True)):
        ways = ways_of(text.strip(), robot.dof) if text.strip() else np.zeros(robot.dof)
        if ways is None:
            faults.add(
                line,
                "column approach",
                code="T003",
                value=text,
                allowed=f"a +, - or 0 for each of {robot.dof} joints",
                remedy="write + where the joint last turned the positive way before it stopped, 0 where nobody knows",
            )
            continue
        out[k] = ways
    return out


def ways_of(text: str, dof: int) -> Array | None:
    """Ways (dof,) that joints came by signs as ``+-+00+``: 1, -1, 0 where nobody knows; None for other texts."""
    ways = {"+": 1.0, "-": -1.0, "\N{MINUS SIGN}": -1.0, "0": 0.0}
    return np.array([ways[sign] for sign in text]) if len(text) == dof and not set(text) - set(ways) else None


def _complete(*columns: Array) -> Array:
    """The first of columns (n,) that every reading has; empty where none is."""
    return next((x for x in columns if len(x) and np.isfinite(x).all()), np.zeros(0))


def _notes(table: RawTable, columns: Columns, robot: Robot) -> list[str]:
    notes = list(table.notes)
    missing = [name for name in robot.coordinates if name not in columns.known]
    if missing and robot.controller is None:
        notes.append(f"no column {', '.join(missing)}: taken as 0")
    unused = [name for name in (*KEPT, "payload") if name in columns.known]
    if unused:
        notes.append(f"columns that are not used: {', '.join(unused)}")
    if columns.unknown:
        notes.append(f"unknown columns, not used: {listed(columns.unknown)}")
    return notes


def _check(data: AbsoluteReadings, robot: Robot, faults: Faults, check_reach: bool) -> None:
    far = np.abs(data.position).max(axis=1) > FARTHEST_m
    for k in np.flatnonzero(far):
        faults.add(
            int(data.line[k]),
            "position",
            code="T004",
            value=f"{1e3 * np.abs(data.position[k]).max():g} mm",
            allowed=f"up to {FARTHEST_m:g} m from the tracker",
            remedy="check the unit: columns are mm",
        )
    for k in np.flatnonzero([p.kg < 0.0 for p in data.payloads]):
        row = int(np.flatnonzero(data.payload == k)[0])
        faults.add(
            int(data.line[row]),
            "column payload_kg",
            code="T004",
            value=f"{data.payloads[k].kg:g}",
            allowed="0 or more",
            remedy="give the mass that the flange carries beside the target",
        )
    if check_reach:
        names = tuple(f"line {line}" for line in data.line)
        check_limits(data.q, names, data.line.tolist(), robot, faults)


def joined(tables: Sequence[AbsoluteReadings]) -> AbsoluteReadings:
    """Several tables as one; sessions and targets with the same name are the same.

    Raises
    ------
    InputError
        No table.
    """
    if not tables:
        raise InputError("tables", code="T008", value="none", allowed="one or more")
    if len(tables) == 1:
        return tables[0]
    held = np.array([[p.kg, *p.centre] for t in tables for p in t.payloads])
    different, place = np.unique(held, axis=0, return_inverse=True)
    starts = np.cumsum([0, *(len(t.payloads) for t in tables)])

    def stacked(name: str) -> Array:
        return np.concatenate([getattr(t, name) for t in tables])

    def labels(name: str) -> Labels:
        return Labels.of(tuple(getattr(t, name).names[k] for t in tables for k in getattr(t, name).number))

    payload = np.concatenate([place.reshape(-1)[s + t.payload] for s, t in zip(starts[:-1], tables, strict=True)])
    return AbsoluteReadings(
        ", ".join(t.source for t in tables),
        "+".join(t.sha256 for t in tables),
        stacked("q"),
        stacked("position"),
        labels("session"),
        labels("target"),
        payload.astype(np.int64),
        tuple(Payload(float(row[0]), row[1:]) for row in different),
        stacked("rail"),
        stacked("sigma"),
        np.concatenate([t.line for t in tables]),
        tuple(dict.fromkeys(n for t in tables for n in t.notes)),
        np.zeros(0),
        stacked("temperature") if all(len(t.temperature) for t in tables) else np.zeros(0),
        stacked("approach") if all(t.approach.size for t in tables) else np.zeros((sum(map(len, tables)), 0)),
    )
