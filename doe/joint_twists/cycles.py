"""Load cycles: one slope a row, half the width of the hysteresis loop, and the noise of a reading.

In a cycle the load goes up and down along one line. The reading of row r is ``y = u F + g h + e``: F the load's size,
g = -1 on the way up and +1 on the way down, h half the loop's width. Fitting u and h together is the mean of the two
branches, with each reading counted: friction holds back on the way up what it holds back on the way down. From the
way up alone (through zero) friction stays in the slope. What a cycle leaves over is the noise of a reading, whatever
the joint's stiffness matrix may be.
"""

from __future__ import annotations

from bisect import bisect
from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.joint_twists.laws import on_one_turn
from doe.joint_twists.readings import TwistReadings
from doe.tables.measurements import rows_of
from fem import ArmModel
from fem.statics.transfers import joint_rows
from robots import InputError, forward_kinematics
from robots.arrays import Array, Bools, Indices
from robots.kinematics import BodyFrames, tool_position

Branches = Literal["mean", "loading"]

# Directions of loads within this angle are one cycle's: a real force wanders a little as it rises.
SAME_DIRECTION = np.cos(np.radians(8.0))
# Of a noise that is zero to the last digit: weights must stay finite.
LEAST = 1e-15


@dataclass(frozen=True, eq=False)
class Cycles:
    """Load cycles of a campaign, m of them; rows tx, ty, tz, rx, ry, rz of the watched joint.

    ``q`` (m, dof); ``joint`` (m,); ``setup`` (m,) number of the set-up; ``top`` (m,) N: the largest load; ``force``
    (m, 3): its unit direction, flange axes. ``carried`` (m, 6): force and moment at the joint per newton of load.
    ``slope`` (m, 6) per newton with ``variance``; NaN where not read. ``loading``: the same from the way up alone.
    ``half_width`` (m, 6) m, rad, with ``half_width_variance``; NaN where the way down is missing. ``noise`` (dof, 2)
    standard deviation of a reading's translations and rotations, by joint, with ``noise_dof``; ``noise_known``
    (dof, 2): false where nothing tells it, neither the readings nor the table. ``setups``: labels. Angles of the
    watched joint that differ by whole turns are one.
    """

    q: Array
    joint: Indices
    setup: Indices
    setups: tuple[str, ...]
    top: Array
    force: Array
    carried: Array
    slope: Array
    variance: Array
    loading: Array
    half_width: Array
    half_width_variance: Array
    noise: Array
    noise_dof: Indices
    noise_known: Bools
    number: Indices

    @property
    def m(self) -> int:
        """Number of cycles."""
        return len(self.q)

    @property
    def angle(self) -> Array:
        """Angle (m,) rad of the watched joint."""
        return self.q[np.arange(self.m), self.joint]


def cycles_of(model: ArmModel, data: TwistReadings, branches: Branches = "mean") -> Cycles:
    """Reduce readings to load cycles.

    Raises
    ------
    InputError
        A parallelogram's load path; loads all zero; no way up, or (with ``branches`` "mean") no way down in a
        set-up.
    """
    if model.bar is not None:
        raise InputError(
            f"load path of {model.robot.name}",
            code="M003",
            value=model.load_path,
            allowed="serial: behind a parallelogram the joint's spring does not sit between the two arms",
            remedy="use --load-path serial, or calibrate with `stiffarm calibrate`",
        )
    if not data.wrench.any():
        raise InputError(
            f"{data.source}: loads",
            code="J001",
            value="zero in every row",
            allowed="loads other than 0",
            remedy="give the forces",
        )
    number = _numbers(data)
    _check_branches(data, number, branches)
    m = int(number.max()) + 1
    F, g = data.load, np.where(data.is_loading, -1.0, 1.0)
    first = np.array([int(np.flatnonzero((number == c) & (F > 0.0))[0]) for c in range(m)], dtype=np.intp)
    top = np.zeros(m)
    np.maximum.at(top, number, F)
    # A zero reading before the load is the reference itself and says nothing.
    informs = (F > 0.0) | ~data.is_loading
    sigma = np.where(np.isfinite(data.twist), data.sigma, np.nan)
    use = np.where(np.isfinite(data.twist) & informs[:, None], 1.0, 0.0)
    if branches == "loading":
        use *= data.is_loading[:, None]
        g = np.zeros(data.n)  # a straight line through zero, as the way up is usually read
    w = use / np.where(np.isfinite(sigma), sigma, 1.0) ** 2
    fit = _Sums.of(w, F, g, data.twist, number, m)
    noise, dof = _noise(data, fit, use, sigma, number)
    kind = noise[data.joint[first]][:, [0, 0, 0, 1, 1, 1]]
    own = _cycle_sigma(sigma, use, number, m)
    scale = np.where(own, 1.0, kind**2)
    slope, variance, half, half_variance = fit.solved()
    up = _Sums.of(w * data.is_loading[:, None], F, np.zeros(len(F)), data.twist, number, m)
    force, carried = _loads(model, data, number, first)
    q, joint = data.q[first].copy(), data.joint[first]
    for j in np.unique(joint):
        q[joint == j, j] = on_one_turn(q[joint == j, j])
    # Cycles and rows that nothing was read of need no noise.
    untold = np.zeros_like(dof, dtype=np.bool_)
    for k, rows in enumerate((slice(0, 3), slice(3, 6))):
        np.logical_or.at(untold[:, k], joint, (~own[:, rows] & np.isfinite(slope[:, rows])).any(axis=1))
    return Cycles(
        q,
        data.joint[first],
        *_setups(data, first),
        top,
        force,
        carried,
        slope,
        variance * scale,
        up.solved()[0],
        half,
        half_variance * scale,
        noise,
        dof,
        ~untold | (dof > 0),
        number,
    )


def _numbers(data: TwistReadings) -> Indices:
    """Number of the cycle of each reading; zero loads join the cycle that they begin or end."""
    out = np.full(data.n, -1, dtype=np.intp)
    ways: list[Array] = []
    size = data.load
    for label, rows in rows_of(data.setup).items():
        begun: list[int] = []
        loaded = rows[size[rows] > 0.0].tolist()
        if not loaded:
            raise InputError(
                f"{data.source}, row {data.row_numbers[rows[0]]}: set-up {label} has no load other than zero",
                code="J001",
                remedy="remove the row, or give the loads of its cycle",
            )
        for i in loaded:
            way = data.wrench[i] / np.linalg.norm(data.wrench[i])
            known = [c for c in begun if ways[c] @ way > SAME_DIRECTION]
            if not known:
                known = [len(ways)]
                begun.append(len(ways))
                ways.append(way)
            out[i] = known[0]
        for i in rows[size[rows] == 0.0].tolist():
            place = bisect(loaded, i)
            # A zero before a load begins its cycle, a zero after one ends it.
            after = data.phase[i] == "loading"
            out[i] = out[loaded[min(place, len(loaded) - 1) if after else max(place - 1, 0)]]
    return out


def _check_branches(data: TwistReadings, number: Indices, branches: Branches) -> None:
    up = np.bincount(number, data.is_loading & (data.load > 0.0))
    down = np.bincount(number, ~data.is_loading & (data.load > 0.0))
    for missing, name in ((up == 0, "loading"), ((down == 0) & (branches == "mean"), "unloading")):
        if missing.any():
            rows = np.flatnonzero(missing[number])
            labels = list(dict.fromkeys(data.setup[i] for i in rows))
            raise InputError(
                f"{data.source}: {name} readings missing in {int(missing.sum())} of {len(missing)} load cycles",
                code="J001",
                value=", ".join(labels[:6]) + (" ..." if len(labels) > 6 else ""),
                allowed="each load step on the way up and on the way down",
                remedy="measure the way down too, or use the way up alone (--branches loading): then friction stays "
                "in the stiffnesses"
                if name == "unloading"
                else "mark the readings of rising loads as loading",
            )


def _summed(x: Array, number: Indices, m: int) -> Array:
    """Sums (m, ...) over cycles of x (n, ...)."""
    out = np.zeros((m, *x.shape[1:]))
    np.add.at(out, number, x)
    return out


@dataclass(frozen=True)
class _Sums:
    """Weighted sums of each cycle and row (m, 6) for the fit of slope and half width, loads over the top one's."""

    ff: Array
    fg: Array
    gg: Array
    fy: Array
    gy: Array
    yy: Array

    @staticmethod
    def of(w: Array, F: Array, g: Array, y: Array, number: Indices, m: int) -> _Sums:
        y, f, s = np.where(np.isfinite(y), y, 0.0), F[:, None], g[:, None]
        return _Sums(*(_summed(w * x, number, m) for x in (f * f, f * s, s * s, f * y, s * y, y * y)))

    def solved(self) -> tuple[Array, Array, Array, Array]:
        """Slope, its variance, half width, its variance, for weights that are one over the variance."""
        det = self.ff * self.gg - self.fg**2
        with np.errstate(divide="ignore", invalid="ignore"):
            both = det > 1e-9 * self.ff * self.gg
            slope = np.where(both, (self.gg * self.fy - self.fg * self.gy) / det, self.fy / self.ff)
            variance = np.where(both, self.gg / det, 1.0 / self.ff)
            half = np.where(both, (self.ff * self.gy - self.fg * self.fy) / det, np.nan)
            half_variance = np.where(both, self.ff / det, np.nan)
        seen = self.ff > 0.0
        return np.where(seen, slope, np.nan), np.where(seen, variance, np.nan), half, half_variance

    def left_over(self) -> tuple[Array, Indices]:
        """Weighted sum of squares that the fit leaves over, and the number of fitted numbers."""
        slope, _, half, _ = self.solved()
        took = np.where(np.isfinite(slope), slope * self.fy, 0.0) + np.where(np.isfinite(half), half * self.gy, 0.0)
        fitted = np.isfinite(slope).astype(np.intp) + np.isfinite(half)
        return np.maximum(self.yy - took, 0.0), fitted


def _noise(data: TwistReadings, fit: _Sums, use: Array, sigma: Array, number: Indices) -> tuple[Array, Indices]:
    """Standard deviation (dof, 2) of readings without a sigma of their own, by joint and kind, with freedoms."""
    squares, fitted = fit.left_over()
    own = _cycle_sigma(sigma, use, number, len(squares))
    free = np.where(own, 0.0, _summed(use, number, len(squares)) - fitted)
    squares = np.where(own, 0.0, squares)
    joint = np.zeros(len(squares), dtype=np.intp)
    joint[number] = data.joint
    noise = np.full((data.q.shape[1], 2), LEAST)
    dof = np.zeros((data.q.shape[1], 2), dtype=np.intp)
    for kind, rows in enumerate((slice(0, 3), slice(3, 6))):
        s = np.bincount(joint, squares[:, rows].sum(axis=1), minlength=len(noise))
        d = np.bincount(joint, free[:, rows].sum(axis=1), minlength=len(noise))
        dof[:, kind] = np.round(d).astype(np.intp)
        noise[d > 0.0, kind] = np.maximum(np.sqrt(s[d > 0.0] / d[d > 0.0]), LEAST)
    return noise, dof


def _cycle_sigma(sigma: Array, use: Array, number: Indices, m: int) -> Bools:
    """Cycles and rows (m, 6) whose readings all bring their sigma."""
    return np.asarray(_summed(use * ~np.isfinite(sigma), number, m) == 0.0)


def _setups(data: TwistReadings, first: Indices) -> tuple[Indices, tuple[str, ...]]:
    labels = [data.setup[i] for i in first]
    names = tuple(dict.fromkeys(labels))
    return np.array([names.index(label) for label in labels], dtype=np.intp), names


def _loads(model: ArmModel, data: TwistReadings, number: Indices, first: Indices) -> tuple[Array, Array]:
    """Mean direction of each cycle's force (m, 3), flange axes, and what its joint carries per newton (m, 6)."""
    # Weighted by the load, as its directions count in the slope.
    per = _summed(data.wrench * data.load[:, None], number, len(first))
    per /= _summed(data.load**2, number, len(first))[:, None]
    return per[:, :3], carried(model, data.q[first], per, data.point[first])[np.arange(len(first)), data.joint[first]]


def carried(model: ArmModel, q: Array, wrench: Array, point: Array) -> Array:
    """Force and moment (n, dof, 6) at every joint, in its own frame, under a wrench in flange axes at ``point``.

    q (n, dof), wrench (n, 6), point (n, 3) m in the flange frame.
    """
    frames = forward_kinematics(model.robot, q)
    w = np.einsum("nij,nkj->nki", frames.R_flange, wrench.reshape(-1, 2, 3)).reshape(-1, 6)
    rows = carried_rows(model, frames, tool_position(model.robot, frames, point))
    return np.asarray(np.einsum("njsk,nk->njs", rows, w))


def carried_rows(model: ArmModel, frames: BodyFrames, tool: Array) -> Array:
    """What the rows of every joint carry (n, dof, 6, 6) per force and moment at ``tool`` (n, 3) m, base axes."""
    return np.stack([np.moveaxis(T, -1, 0) for _, T in joint_rows(model, frames, tool)], axis=1)
