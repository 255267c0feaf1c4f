"""Candidate poses at points: all branches at sampled orientations, the best of them, and these improved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from robots import Robot, forward_kinematics, inverse_kinematics
from robots.arrays import Array, Bools, Indices, in_blocks
from robots.frames import framed
from robots.inverse.axis_lines import axis_lines
from surrogate.maps.orientation import tool_rotations
from surrogate.maps.self_motion import NEARLY_THERE, THERE, brought_back, improve

Merit = Callable[[Array], Array]

# Targets a call of the inverse kinematics: bounds its memory, not the result.
TARGETS = 40_000
# Turns (rad) of gamma below which its search ends: the merit then changes by less than 1e-6 of itself.
FINEST = 5e-4
# Rounds of that search at most.
ROUNDS = 30
# Stands for a merit without end.
MOST = 1e300
# Poses none of whose joints differ by more than this (rad) lie on one peak.
SAME_PEAK_RAD = 0.3
# Corrections that bring a pose from far beyond its limits to them, from a neighbour's point, and how many poses of a
# point that has none are given them.
FAR_CORRECTIONS, NEXT_CORRECTIONS, RESCUED = 25, 12, 8


@dataclass(frozen=True, eq=False)
class Chosen:
    """Poses at m points: ``q`` (m, dof) rad, NaN where there is none; ``sure`` (m,): all branches were looked at.

    ``besides``: what else a rule gives at each point, (m, ...) by name.
    """

    q: Array
    sure: Bools
    besides: Mapping[str, Array] = field(default_factory=dict)

    @property
    def reached(self) -> Bools:
        """Points (m,) with a pose."""
        return np.asarray(np.isfinite(self.q).all(axis=1))


@dataclass(frozen=True, eq=False)
class Arm:
    """What a rule needs of a robot.

    ``T_flange_tool`` (4, 4) m; ``merit``: poses (n, dof) rad -> (n,), large is good, infinite where nothing deflects,
    NaN where a pose does not count; ``last_is_free``: joint 6 changes
    neither the tool point nor the merit, see :func:`last_joint_is_free`.
    """

    robot: Robot
    T_flange_tool: Array
    merit: Merit
    last_is_free: bool = False

    def poses(
        self, points: Array, R: Array, generator: np.random.Generator | None, sign: float = 1.0
    ) -> tuple[Array, Array, Bools]:
        """All poses that bring the tool to points (k, 3) m with rotations R (k, 3, 3).

        Returns
        -------
        ``q`` (k, b, dof) rad; ``merit`` (k, b) times ``sign``, -inf where the pose cannot be taken; ``sure`` (k,)
        """
        found = inverse_kinematics(self.robot, framed(R, points), T_flange_tool=self.T_flange_tool, generator=generator)
        q, valid = found.q, found.valid
        if self.last_is_free:
            q = q.copy()
            q[..., -1] = np.where(found.reached, self.robot.limits[-1].mean(), np.nan)
            valid = self.robot.reachable(q.reshape(-1, self.robot.dof)).reshape(valid.shape)
        merit = np.full(valid.shape, -np.inf)
        if valid.any():
            merit[valid] = self.signed(q[valid], sign)
        return q, merit, found.sure

    def signed(self, q: Array, sign: float) -> Array:
        """Merit (n,) times ``sign``: finite, but -inf where a pose does not count."""
        value = self.merit(q)
        return np.where(np.isnan(value), -np.inf, sign * np.clip(value, -MOST, MOST))

    def brought(
        self, q: Array, points: Array, sign: float, corrections: int, near: float = THERE
    ) -> tuple[Array, Array]:
        """Poses q (t k, dof) brought to points (k, 3) m, t times over, and their merit, -inf where that failed."""
        q, kept = brought_back(
            self.robot, q, points, self.T_flange_tool[:3, 3], self.last_is_free, corrections=corrections, near=near
        )
        merit = np.full(len(q), -np.inf)
        if kept.any():
            merit[kept] = self.signed(q[kept], sign)
        return q, merit


@dataclass(frozen=True, eq=False)
class Peaks:
    """The s best poses of m points: q (m, s, dof), merit (m, s) with its sign, -inf where none; sure (m,)."""

    q: Array
    merit: Array
    sure: Bools

    def joined(self, other: Peaks, rows: Indices | slice = slice(None)) -> Peaks:
        """With further peaks at some of the points, ``rows``."""
        q, merit = (
            np.full((len(self.q), *a.shape[1:]), fill) for a, fill in ((other.q, np.nan), (other.merit, -np.inf))
        )
        q[rows], merit[rows] = other.q, other.merit
        return Peaks(np.concatenate([self.q, q], axis=1), np.concatenate([self.merit, merit], axis=1), self.sure)

    def best(self, count: int) -> Peaks:
        """The ``count`` best of each point that are not the same peak."""
        q, merit = np.empty((len(self.q), count, self.q.shape[2])), np.empty((len(self.q), count))
        left, each = self.merit.copy(), np.arange(len(self.q))
        for s in range(count):
            most = left.argmax(axis=1)
            q[:, s], merit[:, s] = self.q[each, most], left[each, most]
            if s + 1 < count:
                with np.errstate(invalid="ignore"):
                    left[np.abs(self.q - q[:, s : s + 1]).max(axis=2) < SAME_PEAK_RAD] = -np.inf
                left[each, most] = -np.inf
        return Peaks(q, merit, self.sure)

    def chosen(self) -> Chosen:
        """The best pose of each point."""
        rows, best = np.arange(len(self.q)), self.merit.argmax(axis=1)
        found = self.merit[rows, best] > -np.inf
        return Chosen(np.where(found[:, None], self.q[rows, best], np.nan), self.sure)


def best_of_sample(
    arm: Arm,
    points: Array,
    R: Array,
    sign: float,
    starts: int,
    apart: float,
    generator: np.random.Generator | None,
) -> Peaks:
    """The best of rotations R (r, 3, 3) at points (m, 3); ``starts`` of them, ``apart`` rad or of other branches."""
    m, r, dof = len(points), len(R), arm.robot.dof
    out = Peaks(
        np.full((m, starts, dof), np.nan),
        np.full((m, starts), -np.inf),
        np.ones(m, dtype=np.bool_),
    )
    near, lost = np.flatnonzero(within_length(arm, points)), list[tuple[Indices, Array]]()
    size = max(1, TARGETS // r)
    for rows in (near[part] for part in in_blocks(len(near), size)):
        k = len(rows)
        q, merit, sure = arm.poses(np.repeat(points[rows], r, axis=0), np.tile(R, (k, 1, 1)), generator, sign)
        b = merit.shape[1]
        q, left = q.reshape(k, r * b, dof), merit.reshape(k, r, b).copy()
        each = np.arange(k)
        out.sure[rows] = sure.reshape(k, r).all(axis=1)
        if starts > 1:
            none = np.flatnonzero(~np.isfinite(left.reshape(k, -1)).any(axis=1))
            lost.append((rows[none], _nearest_to_limits(arm.robot, q[none], starts)))
        for s in range(starts):
            flat = left.reshape(k, -1)
            best = flat.argmax(axis=1)
            found = flat[each, best] > -np.inf
            out.merit[rows[found], s] = flat[each, best][found]
            out.q[rows[found], s] = q[each, best][found]
            at, branch = np.divmod(best, b)
            if s + 1 < starts:
                # Turn between two rotations: 1 + 2 cos(angle) is the trace of R_a^T R_b; tilts only where 6 is free.
                if arm.last_is_free:
                    cosine = R[at][:, :, 2] @ R[:, :, 2].T
                else:
                    cosine = 0.5 * (np.einsum("kij,rij->kr", R[at], R) - 1.0)
                k_at, r_at = np.nonzero(cosine > np.cos(apart))
                left[k_at, r_at, branch[k_at]] = -np.inf
    if lost:
        _rescue(arm, points, sign, np.concatenate([n for n, _ in lost]), np.concatenate([q for _, q in lost]), out)
    return out


def _nearest_to_limits(robot: Robot, q: Array, most: int) -> Array:
    """Of poses q (k, c, dof) that break limits the few (k, s, dof) that do so least, NaN where there are fewer."""
    low, high = robot.limits.T
    over = np.maximum(q - high, 0.0) + np.maximum(low - q, 0.0)
    far = np.where(np.isfinite(q).all(axis=2), over.max(axis=2), np.inf)
    return np.take_along_axis(q, np.argsort(far, axis=1)[:, : min(RESCUED, most), None], axis=1)


def _rescue(arm: Arm, points: Array, sign: float, rows: Indices, q: Array, out: Peaks) -> None:
    """Bring poses q (k, s, dof) within limits, for points ``rows`` (k,) at which no sampled pose keeps them.

    At the rim of reach few orientations are left, and a sample meets none of them.
    """
    at, start = np.nonzero(np.isfinite(q).all(axis=2))
    for part in in_blocks(len(at), TARGETS // 4):
        which, column = at[part], start[part]
        found, merit = arm.brought(q[which, column], points[rows[which]], sign, FAR_CORRECTIONS)
        kept = merit > -np.inf
        place = rows[which[kept]], column[kept]
        out.q[place], out.merit[place] = found[kept], merit[kept]


def best_of_starts(arm: Arm, points: Array, sign: float, starts: int, random: int) -> Peaks:
    """The best poses at points (m, 3) that ``random`` poses come to when the tool point is brought there.

    For arms whose inverse kinematics is no closed form, and for any number of joints; always the same random poses.
    """
    low, high = arm.robot.limits.T
    q = np.repeat(np.random.default_rng(0).uniform(low, high, (random, arm.robot.dof)), len(points), axis=0)
    q, merit = arm.brought(q, points, sign, FAR_CORRECTIONS, NEARLY_THERE)
    found = q.reshape(random, len(points), -1).swapaxes(0, 1), merit.reshape(random, len(points)).T
    return Peaks(*found, np.zeros(len(points), dtype=np.bool_)).best(starts)


def within_length(arm: Arm, points: Array) -> Bools:
    """Points no farther from joint 1 than the arm with its tool is long; the others need no look."""
    lines = axis_lines(arm.robot)
    longest = lines.length + np.linalg.norm(arm.T_flange_tool[:3, 3])
    return np.asarray(np.linalg.norm(points - lines.point[0], axis=1) <= longest * (1.0 + 1e-9))


def shared(arm: Arm, points: Array, peaks: Peaks, neighbours: Indices, sign: float) -> Peaks:
    """With what the peaks of the neighbours (m, k), numbers of points (m, 3), become when brought to each point."""
    q, merit = (a[neighbours].reshape(len(points), -1, *a.shape[2:]) for a in (peaks.q, peaks.merit.copy()))
    row, column = np.nonzero(np.isfinite(merit))
    q[row, column], merit[row, column] = arm.brought(q[row, column], points[row], sign, NEXT_CORRECTIONS, NEARLY_THERE)
    return peaks.joined(Peaks(q, merit, peaks.sure))


def climbed(arm: Arm, peaks: Peaks, sign: float, step: float, rounds: int, near: float = NEARLY_THERE) -> Peaks:
    """Improve peaks by self-motions of the arm, from which joint limits do not keep it; rad ``step`` to begin with."""
    q, merit = peaks.q.reshape(-1, arm.robot.dof).copy(), peaks.merit.ravel().copy()
    there = np.flatnonzero(np.isfinite(merit))
    q[there], merit[there] = improve(
        arm.robot,
        lambda poses: arm.signed(poses, sign),
        q[there],
        merit[there],
        arm.T_flange_tool[:3, 3],
        step=step,
        rounds=rounds,
        hold_last=arm.last_is_free,
        near=near,
    )
    return Peaks(q.reshape(peaks.q.shape), merit.reshape(peaks.merit.shape), peaks.sure)


def refined_gamma(
    arm: Arm, points: Array, tool_axis: Array, gammas: Array, peaks: Peaks, generator: np.random.Generator | None
) -> Peaks:
    """Improve gamma about the best of a sample, between the first and the last angle or over the full turn."""
    q, merit = peaks.q[:, 0].copy(), peaks.merit[:, 0].copy()
    there = np.flatnonzero(np.isfinite(merit))
    R = forward_kinematics(arm.robot, q[there]).R_flange @ arm.T_flange_tool[:3, :3]
    inside = tool_rotations(tool_axis, [0.0])[0].T @ R
    # A positive gamma turns the tool's x towards minus its y.
    gamma = np.full(len(points), np.nan)
    gamma[there] = np.arctan2(-inside[:, 1, 0], inside[:, 0, 0])
    sample = np.sort(gammas)
    step = float(np.diff(sample).max())
    low, high = sample[0], sample[-1]
    closed = high - low > 2.0 * np.pi - 1.5 * step
    size = np.full(len(points), 0.5 * step)
    for _ in range(ROUNDS):
        rows = there[size[there] > FINEST]
        if not len(rows):
            break
        for some in np.array_split(rows, -(-2 * len(rows) // TARGETS)):
            trial = gamma[some] + size[some] * np.array([[-1.0], [1.0]])
            if not closed:
                trial = np.clip(low + np.mod(trial - low + step, 2.0 * np.pi) - step, low, high)
            R = tool_rotations(tool_axis, trial.ravel())
            found, value, _ = arm.poses(np.tile(points[some], (2, 1)), R, generator)
            branch, each = value.argmax(axis=1), np.arange(2 * len(some))
            value, found = value[each, branch].reshape(2, -1), found[each, branch].reshape(2, len(some), -1)
            best, column = value.argmax(axis=0), np.arange(len(some))
            better = value[best, column] > merit[some]
            for old, new in ((q, found), (merit, value), (gamma, trial)):
                old[some[better]] = new[best, column][better]
            size[some[~better]] *= 0.5
    return Peaks(q[:, None], merit[:, None], peaks.sure)
