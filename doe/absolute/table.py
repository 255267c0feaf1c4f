"""Read tables of absolute readings (CSV, XLSX), one row a target at a pose, with every fault named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.tables import columns as mc
from doe.tables.checks import check_limits
from doe.tables.columns import LOADS, RawTable
from doe.tables.schema import LOAD_COLUMNS, SIGMA, STEP, TIMES, Cells, Column, Need, angle_columns, kept, one_of
from robots import InputError, Robot
from robots.arrays import Array
from robots.faults import Faults

POSITION: Final = ("x_mm", "y_mm", "z_mm")
PAYLOAD: Final = ("payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm")
WHEN: Final = ("time_s", "step", "temperature_C")
# Read for later: their columns are known, and not used yet.
KEPT: Final = ("rx_deg", "ry_deg", "rz_deg", "operator", "instrument", "pose", "repeat")
# Orientations as controllers show them: a table with these was read at a pendant, not by a tracker.
PENDANT: Final = frozenset(("a_deg", "b_deg", "c_deg", "w_deg", "p_deg", "r_deg", "qw", "qx", "qy", "qz"))
COLUMNS: Final = (
    *(Column(name) for name in POSITION),
    Column(
        "payload_kg",
        "none",
        0.0,
        least=0.0,
        allowed="0 or more, or an empty cell (none)",
        remedy="give the mass that the flange carries beside the target",
    ),
    *(Column(name, "none", 0.0) for name in PAYLOAD[1:]),
    Column("rail_mm", missing=0.0),
    SIGMA,
    STEP,
    *TIMES,
    *(Column(name) for name in ("session", "target", "payload", "approach", *KEPT)),
)
WHOLE_POSITION: Final = Need(
    POSITION,
    "no column {}",
    f"all of {', '.join(POSITION)}",
    "give all three coordinates of the target in the tracker's frame",
    code="T001",
)
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
    needs = (
        one_of(f"joint column of {robot.name}", robot.angle_names, table.hint),
        one_of("position column", POSITION, table.hint) if not {*POSITION} & {*table.header} else WHOLE_POSITION,
    )
    columns = (*angle_columns(robot), *LOAD_COLUMNS, *COLUMNS)
    cells = Cells.of(table, columns, needs, faults, robot)
    fits = not faults.count
    data = _assembled(cells.whole_rows(), robot, check_reach and fits)
    faults.raise_if_any("absolute readings")
    if not len(data):
        raise InputError(
            f"{table.name} has no readings", code="T001", remedy="each line below the header holds one target"
        )
    return data


def _assembled(cells: Cells, robot: Robot, check_reach: bool) -> AbsoluteReadings:
    table, q, position = cells.table, cells.angles(robot), cells.numbers(*POSITION)
    far = np.abs(position).max(axis=1)
    cells.check(
        far > FARTHEST_m,
        "position",
        code="T004",
        value=lambda i: f"{1e3 * far[i]:g} mm",
        allowed=f"up to {FARTHEST_m:g} m from the tracker",
        remedy="check the unit: columns are mm",
    )
    held = np.nan_to_num(cells.numbers(*PAYLOAD))
    rail, sigma = cells.numbers("rail_mm")[:, 0], cells.numbers("sigma_mm")[:, 0]
    seconds, step, temperature = cells.numbers(*WHEN).T
    approach = _approaches(cells, robot)
    session = cells.texts("session", Path(table.name).stem)
    target = cells.texts("target") if "target" in cells.known else session
    good = cells.good()
    held = held[good]
    different, payload = np.unique(held, axis=0, return_inverse=True) if len(held) else (held, np.zeros(0, dtype=int))
    lines = kept(table.lines, good)
    if check_reach and lines:
        check_limits(q[good], tuple(f"line {line}" for line in lines), lines, robot, cells.faults)
    return AbsoluteReadings(
        table.name,
        table.sha256,
        q[good],
        position[good],
        Labels.of(kept(session, good)),
        Labels.of(kept(target, good)),
        payload.reshape(-1).astype(np.int64),
        tuple(Payload(float(row[0]), row[1:]) for row in different),
        rail[good],
        sigma[good],
        np.array(lines, dtype=np.int64),
        tuple(_notes(cells, robot)),
        _complete(seconds[good], step[good]),
        _complete(temperature[good]),
        approach[good],
    )


def _approaches(cells: Cells, robot: Robot) -> Array:
    """Which way each joint came (n, dof); no column: nothing is known (n, 0)."""
    if "approach" not in cells.known:
        return np.zeros((len(cells.table.lines), 0))
    texts, dof = cells.texts("approach"), robot.dof
    read = {text: ways_of(text, dof) if text else np.zeros(dof) for text in set(texts)}
    cells.check(
        [read[text] is None for text in texts],
        "column approach",
        code="T003",
        value=lambda i: texts[i],
        allowed=f"a +, - or 0 for each of {dof} joints",
        remedy="write + where the joint last turned the positive way before it stopped, 0 where nobody knows",
    )
    ways = (read[text] for text in texts)
    return np.array([np.zeros(dof) if way is None else way for way in ways]).reshape(-1, dof)


def ways_of(text: str, dof: int) -> Array | None:
    """Ways (dof,) that joints came by signs as ``+-+00+``: 1, -1, 0 where nobody knows; None for other texts."""
    ways = {"+": 1.0, "-": -1.0, "\N{MINUS SIGN}": -1.0, "0": 0.0}
    return np.array([ways[sign] for sign in text]) if len(text) == dof and not set(text) - set(ways) else None


def _complete(*columns: Array) -> Array:
    """The first of columns (n,) that every reading has; empty where none is."""
    return next((x for x in columns if len(x) and np.isfinite(x).all()), np.zeros(0))


def _notes(cells: Cells, robot: Robot) -> Iterator[str]:
    yield from cells.remarks(robot, unused="unknown columns, not used")
    if unused := [name for name in (*KEPT, "payload") if name in cells.known]:
        yield f"columns that are not used: {', '.join(unused)}"


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
