"""Readings under their loads: at which points, in which order, which are used, and what a model says of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from doe.tables.measurements import Measurements, load_size
from fem import ArmModel, spring_influence
from fem.effects import History, PlacedEffect, observed
from fem.statics.loads import as_loaded
from robots import InputError
from robots.arrays import Array, Indices, Integers

# Decimals of a load's direction and relative size that count as the same: real weights hang a little off.
SAME = 3
# Whose point a reading was taken at: the model's tool point, or one of its own (px_mm, py_mm, pz_mm).
PointOf = Literal["tool", "table"]


def history_of(data: Measurements) -> History:
    """Load cycles of a table, each from the unloaded arm: one for every pose, repeat, load direction and point.

    Order within a cycle: by ``step`` where every reading of the cycle has one, not all the same under different loads;
    else by ``phase``: loading by rising load, then unloading by falling load. With steps a load along the same line
    may change its sign within a cycle. Where neither is given each reading is a loading of its own from zero, and the
    history as a whole is not known. Clock: from ``time`` where every reading has one, else from ``step`` if no two
    cycles share one, else NaN.
    """
    cycle = np.empty(data.n, dtype=np.intp)
    order = np.zeros(data.n, dtype=np.intp)
    size = load_size(data.wrench)
    count, known = 0, True
    for rows in _groups(data, size):
        ordered = _ranks(data, size, rows)
        if ordered is None:
            cycle[rows] = np.arange(count, count + len(rows))
            count, known = count + len(rows), False
        else:
            cycle[rows], order[rows] = count, ordered
            count += 1
    session = np.unique(np.array(data.session, dtype=object).astype(str), return_inverse=True)[1].astype(np.intp)
    seconds = data.time - data.time.min() if data.n and np.isfinite(data.time).all() else np.full(data.n, np.nan)
    clock = _clock(data, cycle)
    stay = _stays(data, cycle, clock)
    return History(cycle, order, clock, known and data.n > 0, session.reshape(-1), seconds, data.temperature, stay)


def _stays(data: Measurements, cycle: Indices, clock: Array) -> Indices:
    """Number (n,) of the stay at a pose that each reading belongs to: cycles at one pose, one right after the other."""
    if data.n == 0 or not np.isfinite(clock).all():
        return cycle
    begun = np.full(int(cycle.max()) + 1, np.inf)
    np.minimum.at(begun, cycle, clock)
    over = np.zeros(len(begun))
    np.maximum.at(over, cycle, clock)
    order = np.argsort(begun, kind="stable")
    label = np.unique(np.array(data.pose, dtype=str), return_inverse=True)[1].reshape(-1)
    pose = np.zeros(len(begun), dtype=np.intp)
    pose[cycle] = label
    # Cycles whose readings are mixed in time tell nothing of what was between them.
    moved = (np.diff(pose[order]) != 0) | (begun[order][1:] < np.maximum.accumulate(over[order])[:-1])
    stay = np.empty(len(begun), dtype=np.intp)
    stay[order] = np.cumsum(np.concatenate([[False], moved]))
    return stay[cycle]


def history_of_part(
    data: Measurements, part: Callable[[Measurements], Measurements], history: History | None = None
) -> History:
    """History of the readings that ``part`` keeps of a table, at their places in the whole of it.

    In a table of their own another clock would start, and other readings would be the first under load. ``history``
    of all readings, by default what the table says.
    """
    rows = part(replace(data, row_numbers=tuple(range(data.n)))).row_numbers
    return (history or history_of(data)).take(np.array(rows, dtype=np.intp))


def _groups(data: Measurements, size: Array) -> list[Indices]:
    """Rows of each cycle, in order of first appearance."""
    unit = np.round(data.wrench / np.maximum(size, 1e-300)[:, None], SAME) + 0.0
    point = np.round(np.nan_to_num(data.point, nan=1e9), 9) + 0.0
    # With steps one direction stands for a line: the first component that is not zero is positive.
    first = np.take_along_axis(unit, np.argmax(unit != 0.0, axis=1)[:, None], axis=1)
    unit = np.where(np.isfinite(data.step)[:, None] & (first < 0.0), 0.0 - unit, unit)
    groups: dict[object, list[int]] = {}
    for i, key in enumerate(zip(data.pose, data.repeat, map(bytes, np.hstack([unit, point])), strict=True)):
        groups.setdefault(key, []).append(i)
    return [np.array(rows, dtype=np.intp) for rows in groups.values()]


def _ranks(data: Measurements, size: Array, rows: Indices) -> Indices | None:
    """Places (k,) of a cycle's readings in time, from 0, equal at one time; None where that is not known."""
    if len(rows) == 1:
        alone = np.isfinite(data.step[rows[0]]) or data.phase[rows[0]] is not None
        return np.zeros(1, dtype=np.intp) if alone else None
    step, load = data.step[rows], size[rows]
    # Opposite loads of one size are different loads, as steps may lead from one to the other.
    turned = data.wrench[rows] @ data.wrench[rows[0]] < 0.0
    signed = np.where(turned, -load, load)
    if np.isfinite(step).all():
        _, place = np.unique(step, return_inverse=True)
        if all(np.ptp(signed[place == k]) <= 10.0**-SAME * load.max() for k in range(int(place.max()) + 1)):
            return place.astype(np.intp)
    phases = [data.phase[i] for i in rows]
    if any(phase is None for phase in phases) or turned.any():
        return None
    unloading = np.array([phase == "unloading" for phase in phases])
    keys = np.column_stack([unloading, np.where(unloading, -load, load)])
    return np.unique(np.round(keys, 9), axis=0, return_inverse=True)[1].reshape(-1).astype(np.intp)


def _clock(data: Measurements, cycle: Indices) -> Array:
    unknown = np.full(data.n, np.nan)
    if data.n > 1 and np.isfinite(data.time).all() and np.ptp(data.time) > 0.0:
        return np.asarray((data.time - data.time.min()) / np.ptp(data.time))
    if data.n < 2 or not np.isfinite(data.step).all():
        return unknown
    pairs = np.unique(np.column_stack([data.step, cycle]), axis=0)
    span = float(np.ptp(data.step))
    if span == 0.0 or len(np.unique(pairs[:, 0])) < len(pairs):
        return unknown
    return np.asarray((data.step - data.step.min()) / span)


def loaded_points(model: ArmModel, data: Measurements) -> Array:
    """Loaded and measured points (n, 3) m in the flange frame: the reading's own, else the model's tool point.

    Own points are off by what the model says of them (``ArmModel.load_point``).
    """
    tool = np.broadcast_to(model.robot.T_flange_tool[:3, 3], (data.n, 3))
    return np.where(np.isnan(data.point), tool, data.point + model.load_point)


def points_of(data: Measurements) -> tuple[PointOf, ...]:
    """Whose points these readings have: the model's tool point, the table's own ones, or both."""
    own = ~np.isnan(data.point).any(axis=1)
    every: tuple[PointOf, ...] = ("tool", "table")
    return tuple(whose for whose, some in zip(every, (not own.all(), bool(own.any())), strict=True) if some)


def select_loads(data: Measurements, loads_N: tuple[float, ...]) -> Measurements:
    """Select readings by load magnitude (within 1 %, for a real weight is never its nominal one); () = all.

    Raises
    ------
    InputError
        No reading at one of the loads.
    """
    if not loads_N:
        return data
    keep = np.zeros(data.n, dtype=np.bool_)
    for load in loads_N:
        hit = np.abs(data.loads_N - load) <= 0.01 * abs(load)
        if not hit.any():
            present = ", ".join(f"{v:g}" for v in np.unique(np.round(data.loads_N, 6)))
            raise InputError(f"{data.source}: load to calibrate on (N)", code="T009", value=load, allowed=present)
        keep |= hit
    return data.select(keep)


def select_poses(data: Measurements, poses: Sequence[str], where: str) -> Measurements:
    """Select the readings of some poses (labels); ``where`` names who asks.

    Raises
    ------
    InputError
        A pose label that is not in the data.
    """
    known = list(dict.fromkeys(data.pose))
    for pose in poses:
        if pose not in known:
            raise InputError(
                f"{where}: pose", code="T009", value=pose, allowed=f"one in {data.source}: {', '.join(known)}"
            )
    return data.select(np.isin(np.array(data.pose, dtype=str), poses))


def spring_parts(model: ArmModel, data: Measurements) -> tuple[Array, Array]:
    """What a model makes of every reading, linear in the compliances about the joints' axes.

    Returns
    -------
    influence (n, 6, dof) : displacement (m or rad) per unit compliance of each joint, as fem.spring_influence
    rest (n, 6) : displacement from all else
    """
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    influence, rest = spring_influence(model, at.q, at.wrench, at.point)
    return np.swapaxes(influence, 1, 2), rest


def rms_mm(error: Array, component: Integers) -> float:
    """RMS of the translational errors in mm (NaN if none was read)."""
    linear = error[component < 3]
    return float(np.sqrt(np.mean(linear**2)) * 1e3) if linear.size else float("nan")


def simulate(
    model: ArmModel, data: Measurements, effects: Sequence[PlacedEffect] = (), history: History | None = None
) -> Array:
    """Simulated displacement (n, 6) of every reading; ``history``: by default what the table says of it."""
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    return observed(model, at, effects, history or history_of(data))
