"""Laws that a diagnosis found: curves with their 95 % bands, and what single readings say about them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from doe.diagnosis.diagnose import State
from doe.diagnosis.known import free_numbers
from doe.diagnosis.setting import own_compliance, with_compliances
from fem.effects import History, PlacedEffect
from fem.effects.situation import plain_history
from fem.model import ArmModel
from robots.arrays import Array, Bools, Indices
from robots.constants import NORMAL_95

Axis = Literal["torque", "angle"]

POINTS = 181
# Readings that a law moves by less than this share of the most tell too little about it to be drawn.
LEVER = 0.25
# Steps of differences, in standard deviations.
STEP = 0.1


@dataclass(frozen=True)
class LawCurve:
    """A joint's law.

    ``axis`` "torque": over the torque's size (N m) the joint's turn (mrad); "angle": over the joint's angle (deg) its
    compliance (urad/(N m)).
    ``branches``: x, law, low and high (k,) each; two for friction, loading and unloading; ``plain`` (k,): the spring
    without the effect on the first branch; ``read_x``, ``read_y``, ``unloading`` (r,): what single readings imply.
    """

    code: str
    joint: str
    axis: Axis
    branches: tuple[tuple[Array, Array, Array, Array], ...]
    plain: Array
    read_x: Array
    read_y: Array
    unloading: Bools


def curve_of(state: State, number: int) -> LawCurve | None:
    """The curve of an accepted effect (its place among them); None if it is no law of one joint."""
    placed = state.setting.accepted[number]
    joint, axis = placed.effect.place, placed.effect.drawn_over
    if axis is None or joint not in state.setting.model.robot.joint_names:
        return None
    return (_over_torque if axis == "torque" else _over_angle)(state, number, placed, joint)


@dataclass(frozen=True)
class _Numbers:
    """Compliance of a joint and values of an effect: the best, and a step either way along each free one.

    ``c`` (1 + 2 f,) and ``values`` (1 + 2 f, k), first the best; ``covariance`` (f, f) of the free ones in steps.
    """

    c: Array
    values: Array
    covariance: Array


def _numbers(state: State, number: int, joint: str) -> _Numbers:
    s, placed = state.setting, state.setting.accepted[number]
    free = free_numbers(placed)
    own = [s.free.index(joint)] if joint in s.free else []
    index = [*own, *state.refit.columns(number)]
    C = state.refit.inverse[np.ix_(index, index)]
    step = STEP * np.sqrt(np.diag(C))
    start = s.springs[own[0]] if own else own_compliance(s.arm, joint)
    c, values = [float(start)], [placed.values]
    for i in range(len(index)):
        for sign in (1.0, -1.0):
            there, k = placed.values.copy(), i - len(own)
            if k >= 0:
                there[free[k][0]] += sign * step[i]
            c.append(float(start) + (sign * step[i] if k < 0 else 0.0))
            values.append(there)
    return _Numbers(np.array(c), np.array(values), C / np.outer(step, step))


def _band(curves: Array, covariance: Array) -> tuple[Array, Array, Array]:
    """Curve with its 95 % limits (k,), of curves (1 + 2 f, k) at the numbers of :class:`_Numbers`.

    To first order, as the numbers themselves were found: spring and effect trade off, and only what the readings see
    of both is known.
    """
    J = 0.5 * (curves[1::2] - curves[2::2])
    spread = NORMAL_95 * np.sqrt(np.maximum(np.einsum("fk,fg,gk->k", J, covariance, J), 0.0))
    return curves[0], curves[0] - spread, curves[0] + spread


def _over_torque(state: State, number: int, placed: PlacedEffect, joint: str) -> LawCurve:
    s = state.setting
    tau = s.situation.torque(joint)
    top = int(np.abs(tau).argmax())
    way = np.sign(tau[top]) or 1.0
    index = s.model.robot.joint_names.index(joint)
    preload = float(s.situation.preload[top, index])
    up = np.linspace(0.0, float(np.abs(tau).max()), POINTS)
    path = np.concatenate([up, up[::-1]]) if placed.effect.needs_history else up
    n = _numbers(state, number, joint)
    turns = np.stack(
        [turn_on_bench(placed, v, way * path, c, preload, index) for c, v in zip(n.c, n.values, strict=True)]
    )
    turn, low, high = _band(1e3 * way * turns, n.covariance)
    parts = [slice(0, POINTS), slice(POINTS, 2 * POINTS)][: len(path) // POINTS]
    branches = tuple((path[k], turn[k], low[k], high[k]) for k in parts)
    extra = placed.effect.law(None, s.situation, placed.values)
    x, angle, unloading = _implied(s, joint, s.situation.compliance(joint) * tau, extra)
    sign = np.where(tau[x] < 0.0, -1.0, 1.0)
    return LawCurve(
        placed.effect.code, joint, "torque", branches, 1e3 * n.c[0] * up, np.abs(tau[x]), 1e3 * sign * angle, unloading
    )


def turn_on_bench(placed: PlacedEffect, v: Array, tau: Array, c: float, preload: float, index: int) -> Array:
    """Turn (k,) rad of one joint on a path of torques, from zero."""
    n = len(tau)
    history = History(np.zeros(n, dtype=np.intp), np.arange(n), np.full(n, np.nan), is_known=True)
    weight = np.zeros((n, index + 1))
    weight[:, index] = preload
    bench: Any = _Bench(tau, np.full(n, c), history, weight)
    return np.asarray(c * tau + placed.effect.law(None, bench, v)[:, 0])


@dataclass(frozen=True)
class _Bench:
    """A single joint on a test bench, as a law asks for it (:class:`fem.effects.Situation`): turns are turns."""

    tau: Array
    c: Array
    history: History
    preload: Array
    at: Any = None

    def torque(self, joint: str) -> Array:
        return self.tau

    def compliance(self, joint: str) -> Array:
        return self.c

    def turned(self, joint: str, angle: Array) -> Array:
        return angle[:, None]


def _implied(s: Any, joint: str, plain: Array, extra: Array) -> tuple[Indices, Array, Bools]:
    """Rows (r,), turns (r,) rad of a joint that single readings imply, the rest as the model says, and their phase.

    ``plain`` (n,): the spring's turn; ``extra`` (n, 6): what the effect adds at the tool. Readings that the joint
    hardly moves are left out.
    """
    p = s.data
    lever = s.situation.row(joint)[p.component, p.row]
    good = np.abs(lever) > LEVER * np.abs(lever).max(initial=0.0)
    rows = p.row[good]
    added = extra[rows, p.component[good]]
    angle = plain[rows] + (added + s.residual[good]) / lever[good]
    down = s.unloading[rows] if s.history.is_known else np.zeros(len(rows), dtype=bool)
    return rows.astype(np.intp), angle, down


def _over_angle(state: State, number: int, placed: PlacedEffect, joint: str) -> LawCurve:
    s = state.setting
    index = s.model.robot.joint_names.index(joint)
    at = s.data.free.at
    q = np.tile(np.median(at.q, axis=0), (4 * POINTS, 1))
    q[:, index] = np.linspace(at.q[:, index].min(), at.q[:, index].max(), len(q))
    n = _numbers(state, number, joint)
    curves = 1e6 * np.stack(
        [compliance_over(s.arm, placed, v, q, c, index) for c, v in zip(n.c, n.values, strict=True)]
    )
    curve, low, high = _band(curves, n.covariance)
    angle = np.degrees(q[:, index])
    tau = s.situation.torque(joint)
    own = compliance_over(s.arm, placed, placed.values, at.q, n.c[0], index)
    strong = np.abs(tau) > LEVER * np.abs(tau).max()
    rows, turn, down = _implied(s, joint, own * tau, np.zeros((len(at), 6)))
    keep = strong[rows]
    rows, turn, down = rows[keep], turn[keep], down[keep]
    return LawCurve(
        placed.effect.code,
        joint,
        "angle",
        ((angle, curve, low, high),),
        np.full(len(q), 1e6 * n.c[0]),
        np.degrees(at.q[rows, index]),
        1e6 * turn / tau[rows],
        down,
    )


def compliance_over(arm: ArmModel, placed: PlacedEffect, v: Array, q: Array, c: float, index: int) -> Array:
    """Compliance (k,) rad/(N m) of a joint over poses q (k, dof), with the effect."""
    if placed.effect.stage == "model":
        changed = placed.effect.law(with_compliances(arm, (placed.effect.place,), np.array([c])), None, v)
        return np.asarray(changed.joints[index].axial.compliance(q))
    n = len(q)
    bench: Any = _Bench(np.ones(n), np.full(n, c), plain_history(n), np.zeros((n, 1)), SimpleNamespace(q=q))
    return np.asarray(c + placed.effect.law(None, bench, v)[:, 0])
