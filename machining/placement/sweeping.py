"""Many base positions at once: every posture of some path points at each, what they are worth, and what they lack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from machining.cell import clearance
from machining.placement.problem import Problem
from machining.posture.drive import limit_distance
from machining.posture.points import Sweep, sweep_gamma
from machining.task import REPEATED, ToolPath
from machining.toolpaths.path_error import PathError
from robots import Reason
from robots.arrays import Array, Bools, Integers
from robots.inverse.branches import BRANCH_NAMES
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

# Targets (positions x points x angles) of one sweep: bounds the memory, not the result.
TARGETS = 60_000
# A joint that is a radian beyond its limit counts as much as this many m out of reach.
LEVER = 1.0
# What a sweep holds of each position, and of each of its angles.
BY_ANGLE = ("gamma", "q", "valid", "value", "reason")
BY_POSITION = ("e", "table", *BY_ANGLE)


@dataclass(frozen=True, eq=False)
class Sites:
    """All postures at p base positions, g angles, b branches, m points.

    ``e`` (p, k) m, ``table`` (p,) rad, ``rows`` (m,) of the path; ``gamma`` (p, g) rad; ``q`` (p, g, b, m, dof) rad;
    ``valid`` and ``value`` (p, g, b, m): stiffness N/m or surface error m, NaN where not valid; ``reason`` likewise.
    For arms without named branches b is 1: the best posture of each point.
    """

    e: Array
    table: Array
    rows: Integers
    gamma: Array
    q: Array
    valid: Bools
    value: Array
    reason: NDArray[np.int8]
    names: tuple[str, ...]

    def at_positions(self, some: Integers) -> Sites:
        """Some of the positions."""
        return replace(self, **{name: getattr(self, name)[some] for name in BY_POSITION})

    def at_points(self, some: Integers) -> Sites:
        """Some of the points."""
        of = {name: getattr(self, name)[..., some] for name in ("valid", "value", "reason")}
        return replace(self, rows=self.rows[some], q=self.q[..., some, :], **of)


def sweep_sites(problem: Problem, e: Array, table: Array, rows: Integers, gamma: Array) -> Sites:
    """Sweep positions e (p, k) m, table (p,) rad at some points and angles gamma (g,) or (p, g) rad.

    Errors as :func:`machining.sweep_gamma`.
    """
    gamma = np.broadcast_to(gamma, (len(e), gamma.shape[-1]))
    size = max(1, TARGETS // (len(rows) * gamma.shape[1]))
    groups = [np.flatnonzero(table == angle) for angle in np.unique(table)]
    chunks = [group[start : start + size] for group in groups for start in range(0, len(group), size)]
    parts = [_sweep(problem, e[some], float(table[some[0]]), rows, gamma[some]) for some in chunks]
    return _joined(parts, BY_POSITION).at_positions(np.argsort(np.concatenate(chunks)))


def _sweep(problem: Problem, e: Array, table: float, rows: Integers, gamma: Array) -> Sites:
    """Positions at one angle of the turntable: their paths one after the other, each moved in the part frame."""
    m = len(rows)
    task, objective = problem.looked_at(e[0], table, rows)
    T = problem.cell.T_base_part(e, [table])
    points = task.path.points + ((T[:, :3, 3] - T[0, :3, 3]) @ T[0, :3, :3])[:, None]
    # One sweep for all, but where a path ends where the next one starts: no path has a point twice.
    touching = np.linalg.norm(points[1:, 0] - points[:-1, -1], axis=1) < REPEATED
    parts = []
    for piece in np.split(np.arange(len(e)), np.flatnonzero(touching) + 1):
        k = len(piece)
        normals, axes = (np.tile(v, (k, 1)) for v in (task.path.normals, task.path.axes))
        path = ToolPath(points[piece].reshape(-1, 3), normals, axes, np.full(k * m, np.nan))
        force = None if objective.force is None else np.tile(objective.force, (k, 1))
        tool = task.tool_at(np.tile(np.arange(m), k))
        there = replace(task, path=path, T_flange_tool=tool)
        found = sweep_gamma(
            problem.arm,
            there,
            replace(objective, force=force),
            np.repeat(gamma[piece], m, axis=0),
            generator=np.random.default_rng(0),
        )
        if found.names != BRANCH_NAMES:
            found = _best_of_each_point(found)
        q, valid, value, reason = (_of_sites(a, k) for a in (found.q, found.valid, found.value, found.reason))
        parts.append(Sites(e[piece], np.full(k, table), rows, gamma[piece], q, valid, value, reason, found.names))
    return _joined(parts, BY_POSITION)


def _of_sites(array: NDArray[Any], k: int) -> NDArray[Any]:
    """From a sweep (k m, g, b, ...) to k positions (k, g, b, m, ...)."""
    return np.moveaxis(array.reshape(k, -1, *array.shape[1:]), 1, 3)


def _best_of_each_point(sweep: Sweep) -> Sweep:
    """Columns of arms without named branches are in no order: each point's best stands for all."""
    best = sweep.merit.argmax(axis=2)[..., None]
    return replace(
        sweep,
        q=np.take_along_axis(sweep.q, best[..., None], axis=2),
        valid=np.take_along_axis(sweep.valid, best, axis=2),
        value=np.take_along_axis(sweep.value, best, axis=2),
        reason=np.take_along_axis(sweep.reason, best, axis=2),
        names=("best of each point",),
    )


def _joined(parts: Sequence[Sites], names: tuple[str, ...], axis: int = 0) -> Sites:
    found: Mapping[str, Any] = {n: np.concatenate([getattr(s, n) for s in parts], axis=axis) for n in names}
    return replace(parts[0], **found)


def with_more_angles(a: Sites, b: Sites) -> Sites:
    """Two sweeps of the same positions and points as one, the angles of the second behind those of the first."""
    return _joined((a, b), BY_ANGLE, axis=1)


def in_the_way(problem: Problem, q: Array, e: Array, table: float, point: Integers) -> str:
    """Say "singularity" or "collision" if poses q (m, dof) rad come too near, else nothing; e (k,) or (m, k) m.

    ``point`` (m,): the path points of the poses.
    """
    return blocked(problem, q, e, table, point)[0]


def blocked(problem: Problem, q: Array, e: Array, table: float, point: Integers) -> tuple[str, int]:
    """What is in the way of poses q (m, dof) rad, as :func:`in_the_way`, and the number of a pose where it is."""
    if problem.drive.singular_least > 0.0:
        clear = problem.drive.near_singular(problem.model.robot, q)[1]
        if not clear.all():
            return "singularity", int(clear.argmin())
    if problem.scene is None:
        return "", -1
    base = np.broadcast_to(e, (len(q), np.shape(e)[-1]))
    gap = distances(problem, q, base, table, point)
    nearest = int(gap.argmin())
    return ("collision", nearest) if gap[nearest] < problem.clearance else ("", -1)


def distances(problem: Problem, q: Array, e: Array, table: float, point: Integers) -> Array:
    """Clearance (m,) m of poses q (m, dof) rad, up to what matters; inf where collisions are not looked at.

    ``e`` (m, k) m; ``point`` (m,): the path points of the poses.
    """
    out = np.full(len(q), np.inf)
    within = max(problem.clearance, problem.drive.clearance_zone, 1e-3)
    for rows, scene in problem.by_scene(point):
        out[rows] = clearance(scene, q[rows], e[rows], np.array([table]), within=within).distance
    return out


def beyond_limits(problem: Problem, sites: Sites) -> Array:
    """Rad (p, g, b, m) by which the nearest turn of a posture is beyond joint limits; 0 inside, inf out of reach."""
    out = np.where(sites.valid, 0.0, np.inf)
    blocked = sites.reason == Reason.LIMITS
    excess = np.maximum(-limit_distance(problem.model.robot, sites.q[blocked]), 0.0)
    out[blocked] = np.where(np.isnan(excess), np.inf, excess)
    return out


@dataclass(frozen=True)
class Shortfall:
    """What lacks at a position: ``distance`` m of reach or ``angle`` rad of a joint, at path point ``point``.

    ``lack`` m: both, the angle at :data:`LEVER`.
    """

    lack: float
    distance: float
    angle: float
    point: int

    @property
    def words(self) -> str:
        """In words."""
        if np.isinf(self.distance):
            return f"point {self.point} is out of reach"
        if self.distance > 0.0:
            return f"point {self.point} is {self.distance * 1e3:.3g} mm out of reach"
        return f"point {self.point} needs a joint {np.degrees(self.angle):.3g} deg beyond its limit"


def wrist_lack(problem: Problem, sites: Sites) -> Array:
    """Distance (p, g, m) m by which the wrist centre is out of reach, 0 within; joint limits are not looked at.

    Exact for arms with a spherical wrist: from the annulus about axis 2 and the lateral offset of axis 1. For others
    inf where no posture was found.
    """
    p, g, _, m = sites.valid.shape
    robot = problem.model.robot
    if why_not_spherical(robot) is not None:
        reached: Bools = np.any(np.isfinite(sites.q).all(axis=-1), axis=2)
        return np.where(reached, 0.0, np.inf)
    arm = spherical_wrist_arm(robot)
    lack = np.zeros((p, g, m))
    for i in range(p):
        task = problem.task_at(sites.e[i], float(sites.table[i])).at(sites.rows)
        tool = np.linalg.inv(task.T_flange_tool)
        flange = task.tool_frames(sites.gamma[i]) @ (tool if tool.ndim == 2 else tool[:, None])
        centre = flange[..., :3, 3] + flange[..., :3, :3] @ arm.wrist.centre_flange
        x, y, z = np.moveaxis((centre - arm.p1) @ arm.B1, -1, 0)
        radius, across = np.hypot(x, y), (arm.along_2 - arm.cos12 * z) / arm.sin12
        shoulder = np.maximum(np.abs(across) - radius, 0.0)
        swing = 2.0 * np.arctan2(np.sqrt(np.maximum(radius - across, 0.0)), np.sqrt(np.maximum(radius + across, 0.0)))
        best = np.full(radius.shape, np.inf)
        for side in (arm.front, -arm.front):
            q1 = np.arctan2(y, x) - side * swing
            place = np.stack([np.cos(q1) * x + np.sin(q1) * y, np.cos(q1) * y - np.sin(q1) * x, z], axis=-1)
            seen = (place @ arm.R_21.T)[..., :2] - arm.t_21[:2]
            distance = np.hypot(seen[..., 0], seen[..., 1])
            ring = np.maximum(distance - arm.upper - arm.fore, abs(arm.upper - arm.fore) - distance)
            best = np.minimum(best, np.maximum(ring, 0.0) + shoulder)
        lack[i] = best.T
    return lack


def lacks(problem: Problem, sites: Sites) -> tuple[Array, Array, Array]:
    """Lack (p, g, b, m) in m, angles at :data:`LEVER`, and its two parts: distance m and angle rad.

    0 is a posture that can be taken. A posture the wrist of which is within reach, but which was not found, lacks what
    cannot be told: inf.
    """
    angle = beyond_limits(problem, sites)
    distance = np.broadcast_to(wrist_lack(problem, sites)[:, :, None], angle.shape)
    reached = np.isfinite(angle)
    apart = np.where(reached, 0.0, np.where(distance > 0.0, distance, np.inf))
    angle = np.where(reached, angle, 0.0)
    return apart + LEVER * angle + np.where(reached, 0.0, LEVER * np.pi), apart, angle


def shortfalls(problem: Problem, sites: Sites) -> list[Shortfall]:
    """Least lack (p,) over angles and branches of the worst point of the path: how much, where and what it is."""
    total, distance, angle = lacks(problem, sites)
    found = []
    for i, worst in enumerate(total.max(axis=3)):
        g, b = np.unravel_index(int(np.argmin(worst)), worst.shape)
        at = i, g, b, int(np.argmax(total[i, g, b]))
        found.append(Shortfall(float(total[at]), float(distance[at]), float(angle[at]), int(sites.rows[at[3]])))
    return found


def unreachable(problem: Problem, x: Array, lacking: Shortfall, *, pieces: str = "") -> PathError:
    """The path cannot be driven from any base position; x (d,) is the one that lacks least."""
    return PathError(
        lacking.point,
        f"no base position reaches the whole path{pieces}",
        code="G001",
        value=f"nearest at {problem.space.words(x)}, where {lacking.words}",
        allowed="every point within reach and joint limits at one angle gamma and one branch",
        remedy="widen the ranges of the axes or of gamma, cut the path into more pieces (steps), let the axes move "
        "along the path (moving), or move the part",
    )


def check_reached(problem: Problem, sites: Sites, pieces: str) -> None:
    """Raise PathError, which is an InputError, where none of the positions reaches some point of the path."""
    lost = np.flatnonzero(~sites.valid.any(axis=(0, 1, 2)))
    if len(lost):
        short = shortfalls(problem, sites.at_points(lost))
        at = int(np.argmin([one.lack for one in short]))
        x = problem.space.coordinates(sites.e[at], float(sites.table[at]))
        raise unreachable(problem, x, short[at], pieces=pieces)
