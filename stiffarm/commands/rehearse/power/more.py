"""The same sheet with one more set-up, load or repeat."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from doe import Measurements
from rehearsal import Arm as WorldArm
from rehearsal.design import between
from rehearsal.kinematics import allowed
from robots.arrays import Array, Indices
from stiffarm.commands.rehearse.sheet import SetUps, arranged

# Poses among which the one farthest from all others is chosen.
TRIED = 64


def one_more(world: WorldArm, set_ups: SetUps, seed: int) -> dict[str, SetUps]:
    """The sheets by what is added, in words; what cannot be added is left out."""
    made = {"one more repeat": _repeat(set_ups), "one more load": _load(set_ups)}
    return {word: one for word, one in {**made, **_pose(world, set_ups, seed)}.items() if one is not None}


def _extended(set_ups: SetUps, rows: Indices, changed: Measurements, step: Array) -> SetUps:
    """The set-ups with copies of some ``rows``, which are ``changed``, and steps (n,) that say when all are taken."""
    t = set_ups.table
    both: dict[str, Any] = {
        name: np.concatenate([getattr(t, name), getattr(changed, name)])
        for name in ("q", "wrench", "displacement", "point", "sigma", "time", "temperature")
    }
    both |= {name: (*getattr(t, name), *getattr(changed, name)) for name in ("pose", "repeat", "phase", "session")}
    order = 1.0 + np.argsort(np.argsort(step, kind="stable"), kind="stable").astype(np.float64)
    n = len(order)
    table = replace(t, **both, step=order, row_numbers=tuple(range(2, n + 2)), extra={}, notes=())
    back = np.empty(t.n, dtype=np.intp)
    back[set_ups.row] = np.arange(t.n)
    read = set_ups.read[back]
    floor = set_ups.noise.floor_m
    if isinstance(floor, np.ndarray):
        own = floor[back]
        floor = np.concatenate([own, own[rows]])
    return arranged(
        set_ups.source, table, np.vstack([read, read[rows]]), replace(set_ups.noise, floor_m=floor), set_ups.words
    )


def _when(set_ups: SetUps) -> Array:
    """When each row of the table is taken (n,), counted from 0."""
    when = np.empty(set_ups.table.n)
    when[set_ups.row] = np.arange(set_ups.table.n)
    return when


def _repeat(set_ups: SetUps) -> SetUps:
    """Each pose's last repeat once more."""
    t, when = set_ups.table, _when(set_ups)
    repeat = np.array([r or 1 for r in t.repeat])
    last = {label: max(repeat[rows]) for label, rows in t.pose_groups().items()}
    rows = np.flatnonzero([repeat[k] == last[t.pose[k]] for k in range(t.n)])
    copy = t.select(np.isin(np.arange(t.n), rows))
    copy = replace(copy, repeat=tuple(int(repeat[k]) + 1 for k in rows))
    end = {label: when[own].max() for label, own in t.pose_groups().items()}
    step = np.array([end[t.pose[k]] for k in rows]) + (1.0 + when[rows]) / (2.0 + t.n)
    whole = replace(set_ups, table=replace(t, repeat=tuple(int(r) for r in repeat)))
    return _extended(whole, rows, copy, np.concatenate([when, step]))


def _load(set_ups: SetUps) -> SetUps:
    """Between the largest load of each cycle and the next one; half of it where there is but one."""
    t, when = set_ups.table, _when(set_ups)
    size = np.linalg.norm(t.wrench, axis=1)
    largest = size.max()
    other = size[size < 0.98 * largest]
    share = 0.5 * (1.0 + (other.max() / largest if len(other) else 0.0))
    rows = np.flatnonzero(size > 0.98 * largest)
    copy = t.select(np.isin(np.arange(t.n), rows))
    copy = replace(copy, wrench=share * copy.wrench)
    down = np.array([t.phase[k] == "unloading" for k in rows])
    return _extended(set_ups, rows, copy, np.concatenate([when, when[rows] + np.where(down, 0.4, -0.4)]))


def _pose(world: WorldArm, set_ups: SetUps, seed: int) -> dict[str, SetUps]:
    """The pose farthest from all others within the angles read, with the readings of the pose that has most."""
    t, when = set_ups.table, _when(set_ups)
    low, high = t.q.min(axis=0), t.q.max(axis=0)
    q = between(
        world,
        (low + high) / 2,
        (high - low) / 2,
        TRIED,
        np.random.default_rng([seed, 5]),
        lambda q: allowed(world, q, 1.0, (-np.inf, -1.0)),
    )
    if not len(q):
        return {}
    half = np.where(high > low, high - low, 1.0)
    distance = np.linalg.norm((q[:, None] - t.q[None]) / half, axis=2).min(axis=1)
    if distance.max() <= 0.0:
        return {}
    rows = max(t.pose_groups().values(), key=len)
    copy = t.select(np.isin(np.arange(t.n), rows))
    copy = replace(copy, q=np.tile(q[int(distance.argmax())], (len(rows), 1)), pose=("one more",) * len(rows))
    return {"one more set-up": _extended(set_ups, rows, copy, np.concatenate([when, t.n + when[rows]]))}
