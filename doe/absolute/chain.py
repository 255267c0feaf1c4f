"""Positions of targets by an arm with errors, in the frame of its base, and their exact derivatives.

``P = rail(x) o frames with errors o joints that turn by other angles than they say + what gives way under weight``.
A joint turns by ``q + zero + ratio q + sum of others' shares + sum of sines and cosines of q``; its frame is moved by
an error in its own axes before it turns. What deflects under weight is linear in the compliances
(:mod:`doe.absolute.weight`), at the angles that the joints really have and with levers of the arm as described: errors
of a millimetre in a lever of a metre change a deflection of a millimetre by a micrometre. Derivatives leave out that
these torques move a little with the angles; they are worked out anew after each step, so the estimate does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe.absolute.readings import AbsoluteReadings
from doe.absolute.turns import left_rate, rotation, turned
from doe.absolute.unknowns import BUMPS, SETTLING, THIRD, Layout
from doe.absolute.weight import Weight, weight
from fem import ArmModel
from fem.statics.vectors import cross, times_constant, to_base
from robots.arrays import Array, Integers, in_blocks

# Poses at a time: a block's derivatives by 60 numbers take some 6 MB.
BLOCK = 4096


@dataclass(frozen=True)
class Nominal:
    """What derivatives and laws refer to, the same for all readings.

    ``targets`` (t, 3) m: about where they sit, for levers of what gives way; ``rail``: ends of its length used, m;
    ``time``: of the first and the last reading; ``temperature``: mean, deg C; ``way`` of the rail, about, a metre.
    """

    targets: Array
    rail: tuple[float, float]
    time: tuple[float, float] = (0.0, 0.0)
    temperature: float = 0.0
    way: tuple[float, ...] = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class Sample:
    """Readings of a block, poses last: ``q`` (dof, n), ``rail`` (n,) from -1 to 1 and ``way`` (n,) m, ``target`` (n,).

    ``payload`` (n,); ``weight``: what compliances make of the arm's weight. ``warm`` (n,) K above the mean of all
    readings and ``since`` (n,), the share of their time that has passed; ``came`` (dof, n): which way the joints came;
    empty where that is not known.
    """

    q: Array
    way: Array
    rail: Array
    target: Integers
    payload: Integers
    weight: Weight | None
    warm: Array
    since: Array
    came: Array

    def __len__(self) -> int:
        return int(self.q.shape[1])


def samples(
    model: ArmModel, data: AbsoluteReadings, layout: Layout, nominal: Nominal, u: Array | None = None
) -> list[Sample]:
    """The readings in blocks; ``u`` (p,): variables with which the joints' real angles are worked out."""
    (low, high), out = nominal.rail, []
    for rows in in_blocks(len(data), BLOCK):
        rail = data.rail[rows]
        scaled = (2.0 * rail - low - high) / max(high - low, 1e-12)
        (begin, end), time = nominal.time, data.time[rows]
        s = Sample(
            np.ascontiguousarray(data.q[rows].T),
            rail,
            scaled,
            data.target.number[rows],
            data.payload[rows],
            None,
            data.temperature[rows] - nominal.temperature,
            (time - begin) / max(end - begin, 1e-300),
            np.ascontiguousarray(data.approach[rows].T),
        )
        s = loaded(model, s, data, layout, nominal)
        out.append(s if u is None else loaded(model, s, data, layout, nominal, u))
    return out


def loaded(
    model: ArmModel, s: Sample, data: AbsoluteReadings, layout: Layout, nominal: Nominal, u: Array | None = None
) -> Sample:
    """The block with what gives way at the joints' real angles with variables u; without them, at what joints say."""
    q = s.q if u is None else turning(layout, s, u).angle
    target = nominal.targets[s.target]
    return replace(s, weight=weight(model, np.ascontiguousarray(q.T), target, s.payload, data.payloads, layout))


@dataclass(frozen=True)
class Turning:
    """How joints turn: real angles (dof, n), and columns ``(place, joint, rate (n,))`` of their derivatives."""

    angle: Array
    columns: list[tuple[int, int, Array]]


def turning(layout: Layout, s: Sample, u: Array) -> Turning:
    """Real angles of the joints with variables u (p,)."""
    q = s.q
    out, columns = q.copy(), []
    for k, (j,) in layout.of("zero"):
        columns.append((k, j, np.ones(q.shape[1])))
    for k, (j,) in layout.of("ratio"):
        columns.append((k, j, q[j]))
    for k, (j, other) in layout.of("coupling"):
        columns.append((k, j, q[other]))
    for k, (j,) in layout.of("reversal") if s.came.size else ():
        columns.append((k, j, -0.5 * s.came[j]))
    waves: dict[tuple[int, int], tuple[Array, Array]] = {}
    for k, (j, order, phase) in layout.of("periodic"):
        if (j, order) not in waves:
            waves[j, order] = np.sin(order * q[j]), np.cos(order * q[j])
        columns.append((k, j, waves[j, order][phase]))
    for k, j, rate in columns:
        out[j] += u[k] * rate
    for k, j, rate, share in () if s.weight is None else s.weight.turns(layout, u):
        columns.append((k, j, rate))
        out[j] += share * u[k] * rate
    return Turning(out, columns)


@dataclass(frozen=True)
class Pose:
    """The arm with errors: joint axes ``axis`` (dof, 3, n) and origins (dof, 3, n); flange ``R`` (3, 3, n), ``p``.

    ``before`` (dof, 3, 3, n): the joints' frames before their errors.
    """

    axis: Array
    origin: Array
    before: Array
    R: Array
    p: Array


def posed(model: ArmModel, angle: Array, frames: Array) -> Pose:
    """Kinematics at joint coordinates ``angle`` (dof, n) with frame errors (dof, 5): positions, turns about x and y."""
    robot, n = model.robot, angle.shape[1]
    theta = robot.sign[:, None] * angle + robot.offset[:, None]
    cos, sin = np.cos(theta), np.sin(theta)
    R, p = np.repeat(np.eye(3)[:, :, None], n, axis=2), np.zeros((3, n))
    axis, origin, before = np.empty((robot.dof, 3, n)), np.empty((robot.dof, 3, n)), np.empty((robot.dof, 3, 3, n))
    for j in range(robot.dof):
        pre = robot.T_pre[j]
        p = p + to_base(R, pre[:3, 3][:, None])
        R = before[j] = times_constant(R, pre[:3, :3])
        p = origin[j] = p + to_base(R, frames[j, :3][:, None])
        R = times_constant(R, rotation(np.append(frames[j, 3:], 0.0)))
        x, y, z = R[:, 0], R[:, 1], R[:, 2]
        axis[j] = z
        R = np.stack([cos[j] * x + sin[j] * y, cos[j] * y - sin[j] * x, z], axis=1)
        R = times_constant(R, robot.R_post[j])
    p = p + to_base(R, robot.T_last_flange[:3, 3][:, None])
    return Pose(axis, origin, before, times_constant(R, robot.T_last_flange[:3, :3]), p)


def frame_errors(layout: Layout, dof: int, u: Array) -> Array:
    """Frame errors (dof, 5) among the variables u (p,)."""
    out = np.zeros((dof, 5))
    for k, (j, c) in layout.of("frame"):
        out[j, c] = u[k]
    return out


def flange_targets(layout: Layout, u: Array) -> Array:
    """Targets (t, 3) m in the flange frame among the variables."""
    found = layout.of("target")
    out = np.zeros((1 + max((t for _, (t, _) in found), default=0), 3))
    for k, (t, a) in found:
        out[t, a] = u[k]
    return out


def evaluate(model: ArmModel, layout: Layout, s: Sample, u: Array, *, slopes: bool = True) -> tuple[Array, Array]:
    """Positions (3, n) m of the targets in the base's frame, and derivatives (p, 3, n); empty without ``slopes``."""
    turn, errors = turning(layout, s, u), frame_errors(layout, model.robot.dof, u)
    at = posed(model, turn.angle, errors)
    local = np.ascontiguousarray(flange_targets(layout, u)[s.target].T)
    P = at.p + to_base(at.R, local)
    J = np.zeros((len(layout) if slopes else 0, 3, len(s)))
    if slopes:
        for k, (j, c) in layout.of("frame"):
            J[k] = _frame_slope(at, P, errors[j], j, c)
        spun = {j: model.robot.sign[j] * cross(at.axis[j], P - at.origin[j]) for j in {j for _, j, _ in turn.columns}}
        for k, j, rate in turn.columns:
            J[k] += spun[j] * rate
        for k, (t, a) in layout.of("target"):
            J[k] = at.R[:, a] * (s.target == t)
    if s.weight is not None:
        P = P + s.weight.add(layout, u, J)
    for k, _ in layout.of("growth") if len(s.warm) else ():
        grown = 1.0 + u[k] * s.warm
        J *= grown
        if slopes:
            J[k] = s.warm * P
        P = grown * P
    if layout.of("rail"):
        P, J = _along_rail(layout, s, u, P, J)
    if layout.of("drift") and len(s.since):
        P, J = _drifted(layout, s, u, P, J)
    return P, J


def gone(way: int, since: Array) -> Array:
    """How much of a move (n,) is done after a share (n,) of the time: evenly, settling, or at once."""
    if way == SETTLING:
        return np.asarray(np.expm1(-since / THIRD) / np.expm1(-1.0 / THIRD))
    return np.asarray(since >= way / BUMPS, dtype=np.float64) if way else since


def _drifted(layout: Layout, s: Sample, u: Array, P: Array, J: Array) -> tuple[Array, Array]:
    """Positions and derivatives of an arm that moves against the tracker: turns about its axes, and shifts."""
    shift, w, unit = np.zeros_like(P), np.zeros_like(P), np.eye(3)[:, :, None]
    found = [(k, i, gone(i[0], s.since)) for k, i in layout.of("drift")]
    for k, (_, turns, a), shape in found:
        (w if turns else shift)[a] += u[k] * shape
    if len(J):
        J = J + np.moveaxis(cross(w[:, None], np.moveaxis(J, 0, 1)), 1, 0)
        for k, (_, turns, a), shape in found:
            J[k] = (cross(np.broadcast_to(unit[a], P.shape), P) if turns else unit[a]) * shape
    return P + shift + cross(w, P), J


def _frame_slope(at: Pose, P: Array, error: Array, j: int, c: int) -> Array:
    if c < 3:
        return np.asarray(at.before[j][:, c])
    rate = left_rate(np.append(error[3:], 0.0)[:, None], np.eye(3)[:, c - 3, None])
    return cross(to_base(at.before[j], rate), P - at.origin[j])


def legendre(order: int, x: Array) -> Array:
    """The Legendre polynomial of an order at x (n,)."""
    return np.asarray(np.polynomial.legendre.legval(x, np.eye(order + 1)[order]))


def _along_rail(layout: Layout, s: Sample, u: Array, P: Array, J: Array) -> tuple[Array, Array]:
    """Positions and derivatives of an arm whose base is carried by a rail."""
    found = [(k, i, legendre(i[1], s.rail) if i[:2] != (0, 1) else s.way) for k, i in layout.of("rail")]
    moved, w = np.zeros_like(P), np.zeros_like(P)
    for k, (turns, _, a), shape in found:
        (w if turns else moved)[a] += u[k] * shape
    out = turned(w, P)
    if len(J):
        J = np.moveaxis(turned(w[:, None], np.moveaxis(J, 0, 1)), 1, 0)
        for k, (turns, _, a), shape in found:
            unit = np.eye(3)[:, a, None] * shape
            J[k] = cross(left_rate(w, unit), out) if turns else unit
    return out + moved, J
