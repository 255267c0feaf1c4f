"""Many base positions at once: every posture of some path points at each of them, and what they are worth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from machining.cell import clearance
from machining.placement.problem import Problem
from machining.posture.drive import limit_distance
from machining.posture.points import sweep_gamma
from machining.task import REPEATED, Task, ToolPath
from robots import Reason
from robots.arrays import Array, Bools, Integers
from robots.inverse.branches import BRANCH_NAMES

# Targets (positions x points x angles) of one sweep: bounds the memory, not the result.
TARGETS = 60_000
# Postures of one position that are asked for collisions before it is given up.
TRIES = 40


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
        of = {name: getattr(self, name)[some] for name in ("e", "table", "gamma", "q", "valid", "value", "reason")}
        return replace(self, **of)

    def at_points(self, some: Integers) -> Sites:
        """Some of the points."""
        of = {name: getattr(self, name)[..., some] for name in ("valid", "value", "reason")}
        return replace(self, rows=self.rows[some], q=self.q[..., some, :], **of)


@dataclass(frozen=True)
class Pick:
    """Angle and branch that a position is best with, ``merit`` large is good, -inf: none; ``why`` it has none."""

    merit: float
    gamma: float
    branch: int
    why: str


def sweep_sites(problem: Problem, e: Array, table: Array, rows: Integers, gamma: Array) -> Sites:
    """Sweep positions e (p, k) m, table (p,) rad at some points and angles gamma (g,) or (p, g) rad.

    Errors as :func:`machining.sweep_gamma`.
    """
    p = len(e)
    gamma = np.broadcast_to(gamma, (p, gamma.shape[-1]))
    parts: list[tuple[Integers, Sites]] = []
    size = max(1, TARGETS // (len(rows) * gamma.shape[1]))
    for angle in np.unique(table):
        group = np.flatnonzero(table == angle)
        force = problem.forces(float(angle))[rows]
        for start in range(0, len(group), size):
            some = group[start : start + size]
            parts += [(some, _sweep(problem, e[some], float(angle), force, rows, gamma[some]))]
    if len(parts) == 1 and np.array_equal(parts[0][0], np.arange(p)):
        return parts[0][1]
    first = parts[0][1]
    widest = max((s for _, s in parts), key=lambda s: s.valid.shape[2])
    shape = (p, *widest.valid.shape[1:])
    q = np.full((*shape, first.q.shape[-1]), np.nan)
    valid, value = np.zeros(shape, dtype=np.bool_), np.full(shape, np.nan)
    reason = np.full(shape, np.int8(Reason.NO_SUCH))
    for some, s in parts:
        b = s.valid.shape[2]
        q[some, :, :b], valid[some, :, :b], value[some, :, :b], reason[some, :, :b] = s.q, s.valid, s.value, s.reason
    return Sites(e, table, rows, gamma, q, valid, value, reason, widest.names)


def _sweep(problem: Problem, e: Array, table: float, force: Array, rows: Integers, gamma: Array) -> Sites:
    """Positions at one angle of the turntable: their paths one after the other, each moved in the part frame."""
    p, m = len(e), len(rows)
    first = problem.task_at(e[0], table).at(rows)
    looked, objective = problem.looked_at(first, force)
    T = problem.cell.T_base_part(e, [table])
    moved = (T[:, :3, 3] - T[0, :3, 3]) @ T[0, :3, :3]
    points = (looked.path.points[None] + moved[:, None]).reshape(-1, 3)
    path = looked.path
    touching = np.linalg.norm(points[m::m] - points[m - 1 : -1 : m], axis=1) < REPEATED
    pieces = np.split(np.arange(p), np.flatnonzero(touching) + 1)
    sweeps = []
    for piece in pieces:
        k = len(piece)
        some = ToolPath(
            points[piece[0] * m : (piece[-1] + 1) * m], np.tile(path.normals, (k, 1)), np.tile(path.axes, (k, 1)),
            np.full(k * m, np.nan),
        )  # fmt: skip
        task = Task(some, first.T_flange_tool, first.T_base_part, first.reference)
        wanted = objective if objective.force is None else type(objective)(objective.quantity, np.tile(force, (k, 1)))
        angles = np.repeat(gamma[piece], m, axis=0)
        sweeps.append(sweep_gamma(problem.arm, task, wanted, angles, generator=np.random.default_rng(0)))
    b = max(len(s.names) for s in sweeps)
    parts = []
    for s, piece in zip(sweeps, pieces, strict=True):
        shape = (len(piece), m, gamma.shape[1], len(s.names))
        more = ((0, 0), (0, 0), (0, 0), (0, b - len(s.names)))
        parts.append((
            np.pad(s.q.reshape(*shape, -1), (*more, (0, 0)), constant_values=np.nan),
            np.pad(s.valid.reshape(shape), more),
            np.pad(s.value.reshape(shape), more, constant_values=np.nan),
            np.pad(s.reason.reshape(shape), more, constant_values=np.int8(Reason.NO_SUCH)),
        ))  # fmt: skip
    q, valid, value, reason = (np.moveaxis(np.concatenate(x), 1, 3) for x in zip(*parts, strict=True))
    names = max((s.names for s in sweeps), key=len)
    sites = Sites(e, np.full(p, table), rows, gamma, q, valid, value, reason, names)
    return sites if sites.names == BRANCH_NAMES else _best_of_each_point(problem, sites)


def _best_of_each_point(problem: Problem, sites: Sites) -> Sites:
    """Columns of arms without named branches are in no order: each point's best stands for all."""
    sign = -1.0 if problem.goal.minimised else 1.0
    merit = np.where(sites.valid, sign * np.where(sites.valid, sites.value, 0.0), -np.inf)
    best = merit.argmax(axis=2)[:, :, None]
    return replace(
        sites,
        q=np.take_along_axis(sites.q, best[..., None], axis=2),
        valid=np.take_along_axis(sites.valid, best, axis=2),
        value=np.take_along_axis(sites.value, best, axis=2),
        reason=np.take_along_axis(sites.reason, best, axis=2),
        names=("best of each point",),
    )


def with_more_angles(a: Sites, b: Sites) -> Sites:
    """Two sweeps of the same positions and points as one, the angles of the second behind those of the first."""
    width = max(a.valid.shape[2], b.valid.shape[2])

    def padded(one: Sites) -> Sites:
        missing = width - one.valid.shape[2]
        if not missing:
            return one
        more = ((0, 0), (0, 0), (0, missing), (0, 0))
        return replace(
            one,
            q=np.pad(one.q, (*more, (0, 0)), constant_values=np.nan),
            valid=np.pad(one.valid, more),
            value=np.pad(one.value, more, constant_values=np.nan),
            reason=np.pad(one.reason, more, constant_values=np.int8(Reason.NO_SUCH)),
        )

    a, b = padded(a), padded(b)
    return replace(
        a,
        gamma=np.concatenate([a.gamma, b.gamma], axis=1),
        q=np.concatenate([a.q, b.q], axis=1),
        valid=np.concatenate([a.valid, b.valid], axis=1),
        value=np.concatenate([a.value, b.value], axis=1),
        reason=np.concatenate([a.reason, b.reason], axis=1),
        names=max(a.names, b.names, key=len),
    )


def merits(problem: Problem, sites: Sites) -> Array:
    """Merit (p, g, b) of each posture kept all along the path, -inf where some point does not allow it."""
    whole = sites.valid.all(axis=3)
    out = np.full(whole.shape, -np.inf)
    if whole.any():
        share = problem.share_of(sites.rows)
        out[whole] = problem.goal.merit(sites.value[whole], share, problem.path.n)
    return out


def picks(problem: Problem, sites: Sites, merit: Array) -> list[Pick]:
    """Best angle and branch of each position that keeps clear of singularities and of everything in the cell."""
    return [_pick(problem, sites, merit[i], i) for i in range(len(sites.e))]


def _pick(problem: Problem, sites: Sites, merit: Array, site: int) -> Pick:
    order = np.argsort(-merit, axis=None, kind="stable")
    order = order[np.isfinite(merit.ravel()[order])]
    if not len(order):
        return Pick(-np.inf, np.nan, -1, "reach")
    why = ""
    for flat in order[:TRIES]:
        g, b = np.unravel_index(flat, merit.shape)
        q = sites.q[site, g, b]
        why = in_the_way(problem, q, sites.e[site], float(sites.table[site]))
        if not why:
            return Pick(float(merit[g, b]), float(sites.gamma[site, g]), int(b), "")
    return Pick(-np.inf, np.nan, -1, why)


def in_the_way(problem: Problem, q: Array, e: Array, table: float) -> str:
    """Say "singularity" or "collision" if poses q (m, dof) rad come too near, else nothing; e (k,) or (m, k) m."""
    if problem.drive.singular_least > 0.0 and not problem.drive.near_singular(problem.model.robot, q)[1].all():
        return "singularity"
    if problem.scene is None:
        return ""
    return "collision" if (distances(problem, q, e, table) < problem.clearance).any() else ""


def distances(problem: Problem, q: Array, e: Array, table: float) -> Array:
    """Clearance (m,) m of poses q (m, dof) rad, up to what matters; inf where collisions are not looked at."""
    if problem.scene is None:
        return np.full(len(q), np.inf)
    within = max(problem.clearance, problem.drive.clearance_zone, 1e-3)
    return clearance(problem.scene, q, np.atleast_2d(e), np.array([table]), within=within).distance


def beyond_limits(problem: Problem, sites: Sites) -> Array:
    """Rad (p, g, b, m) by which the nearest turn of a posture is beyond joint limits; 0 inside, inf out of reach."""
    out = np.where(sites.valid, 0.0, np.inf)
    blocked = sites.reason == Reason.LIMITS
    if blocked.any():
        q = sites.q[blocked]
        known = np.isfinite(q).all(axis=1)
        excess = np.full(len(q), np.inf)
        excess[known] = np.maximum(-limit_distance(problem.model.robot, q[known]), 0.0)
        out[blocked] = excess
    return out
