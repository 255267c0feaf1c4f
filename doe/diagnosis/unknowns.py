"""What no catalogue names: smooth processes, each along what it varies with.

Along pose and load it is a share of the deflection, a normal process over the joint angles that matter, with a squared-
exponential kernel (Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294), written as columns: the poses' kernel has as
many directions as there are poses. It may change with the load and differ between loading and unloading. Along the
clock it is a displacement or a share of it that wanders over the campaign, along the temperature a straight line; along
the load history, the load, the session and the direction of the load it is a share, the same in every pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import once
from doe.estimation.blocks import Alike
from fem.compiled.compliance import deflection
from robots.arrays import Array, Bools

# Lengths over which it varies over poses, in half ranges of the joints as read; sizes as shares of the deflection.
LENGTHS = (0.8, 1.8)
SIZES = (0.03, 0.08, 0.2)
# Shares of the size with which it changes with the load and the phase.
LOAD, PHASE = 0.7, 0.5
# Directions of the kernel weaker than this carry nothing.
NEGLIGIBLE = 3e-3
# Waves over the clock.
WAVES = 5
# Loads whose directions differ by less than this cosine are of two directions.
SAME_WAY = 0.95


@dataclass(frozen=True)
class Unit:
    """Columns of something unknown along an ``axis``, for a size of one: ``rows`` (g, k) of readings that are alike."""

    axis: str
    rows: Array
    alike: Alike | None

    @property
    def columns(self) -> Array:
        """Columns (m, k) of the readings."""
        return self.rows if self.alike is None else self.rows[self.alike.groups.number]


@dataclass(frozen=True)
class Process:
    """Columns (m, k), standard normal each, of something unknown of one ``size`` along an axis."""

    unit: Unit
    size: float

    @property
    def axis(self) -> str:
        """Along what it varies."""
        return self.unit.axis

    @property
    def columns(self) -> Array:
        """Columns (m, k) of the readings."""
        return self.size * self.unit.columns


def processes(s: Setting) -> list[Process]:
    """Every process that these readings could show, in several sizes."""
    along = [*(("pose", columns) for columns in _over_poses(s)), *_others(s)]
    units = [Unit(axis, *once(s, columns)) for axis, columns in along]
    return [Process(unit, size) for unit in units for size in SIZES]


def discrepancies(s: Setting) -> Iterator[Array]:
    """Columns (m, k) of processes over pose and load, for every length and size."""
    return (size * columns for columns in _over_poses(s) for size in SIZES)


def _over_poses(s: Setting) -> Iterator[Array]:
    """Columns (m, k) of processes over pose and load for a size of one, for every length."""
    p = s.data
    q = np.array([p.free.at.q[p.row[p.pose == g][0]] for g in range(len(p.poses))])
    moving = np.ptp(q, axis=0) > 1e-6
    moving &= _matters(s)
    x = q[:, moving]
    x = (x - x.mean(axis=0)) / np.maximum(0.5 * np.ptp(x, axis=0), 1e-9)
    factors = _load_factors(s)
    for length in LENGTHS:
        distance = np.sum((x[:, None] - x[None]) ** 2, axis=2)
        values, vectors = np.linalg.eigh(np.exp(-0.5 * distance / length**2))
        kept = values > NEGLIGIBLE * values.max(initial=1.0)
        poses = vectors[:, kept] * np.sqrt(values[kept])
        yield np.hstack([f[:, None] * poses[p.pose] for f in factors])


def _others(s: Setting) -> Iterator[tuple[str, Array]]:
    """Columns along all other axes, for a size of one."""
    p, h = s.data, s.history
    components = np.unique(p.component)
    masks = [np.where(p.component == c, 1.0, 0.0)[:, None] for c in components]
    # A displacement of the same size in every reading, and one that grows with what was read.
    own = [mask * np.sqrt(np.mean(p.value[p.component == c] ** 2)) for mask, c in zip(masks, components, strict=True)]
    share = [mask * size_of_pose(s)[:, None] for mask in masks]
    if np.isfinite(h.clock).all() and np.ptp(h.clock) > 0.0:
        t = h.clock[p.row]
        waves = np.stack([np.cos(np.pi * k * t) / k for k in range(1, WAVES + 1)], axis=1)
        yield "clock", np.hstack([mask * waves for mask in own])
        yield "clock", np.hstack([mask * waves for mask in share])
    if h.varies("temperature"):
        warm = _scaled(h.temperature[p.row])
        if warm is not None:
            yield "temperature", np.hstack([mask * warm[:, None] for mask in (*own, *share)])
    if h.session.max(initial=0) > 0:
        steps = (h.session[p.row][:, None] == np.unique(h.session)).astype(float)
        yield "session", np.hstack([mask * steps for mask in (*own, *share)])
    load = _scaled(np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1))
    if load is not None:
        bent = np.stack([np.cos(np.pi * k * 0.5 * (1.0 + load)) for k in (1, 2)], axis=1)
        yield "load", np.hstack([mask * bent for mask in share])
        if h.is_known:
            down = s.unloading[p.row][:, None] * np.hstack([np.ones((len(p), 1)), bent])
            yield "load history", np.hstack([mask * down for mask in share])
            yield "load history", np.hstack([mask * down for mask in own])
    ways = _ways(p.free.at.wrench[p.row])
    if ways.shape[1] > 1:
        yield "direction", np.hstack([mask * ways for mask in share])


def _ways(wrench: Array) -> Array:
    """Which loads (m, d) act along the same line."""
    unit = wrench / np.maximum(np.linalg.norm(wrench, axis=1, keepdims=True), 1e-300)
    heads: list[Array] = []
    for way in np.unique(unit.round(6), axis=0):
        if all(abs(float(way @ head)) < SAME_WAY for head in heads):
            heads.append(way)
    nearest = np.abs(unit @ np.array(heads).T).argmax(axis=1)
    return np.asarray(nearest[:, None] == np.arange(len(heads)), dtype=np.float64)


def _scaled(x: Array) -> Array | None:
    """From -1 to 1; None where it does not vary."""
    half = 0.5 * float(np.ptp(x))
    return None if half < 1e-9 else np.asarray((x - x.min()) / half - 1.0)


def _matters(s: Setting) -> Bools:
    """Joints (dof,) whose angle changes any reading."""
    at, out = s.data.free.at, []
    for k in range(at.q.shape[1]):
        q = at.q.copy()
        q[:, k] += 0.05
        d = deflection(s.arm, q, at.wrench, at.point)[s.data.row, s.data.component]
        out.append(bool(np.max(np.abs(d - s.prediction)) > 1e-6 * np.max(np.abs(s.prediction), initial=1e-300)))
    return np.array(out)


def _load_factors(s: Setting) -> list[Array]:
    """Size of the deflection (m,), alone and times load and phase, for each component."""
    p = s.data
    size = size_of_pose(s)
    force = np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1)
    spread = float(np.ptp(force))
    load = (force - force.mean()) / (0.5 * spread) if spread > 1e-9 else np.zeros(len(force))
    out = []
    for component in np.unique(p.component):
        mine = np.where(p.component == component, size, 0.0)
        out.append(mine)
        if spread > 1e-9:
            out.append(LOAD * load * mine)
        if s.history.is_known:
            out.append(PHASE * np.where(s.unloading[p.row], 1.0, -1.0) * mine)
    return out


def size_of_pose(s: Setting) -> Array:
    """Length of the predicted displacement (m,), of the kind that was read."""
    p = s.data
    square = np.zeros((len(p.free.at), 2))
    np.add.at(square, (p.row, (p.component >= 3).astype(int)), s.prediction**2)
    return np.asarray(np.sqrt(square)[p.row, (p.component >= 3).astype(int)])
