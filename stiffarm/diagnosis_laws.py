"""Curves of the laws that a diagnosis found, with bands, and what the readings say about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from doe.diagnosis.diagnose import State
from doe.diagnosis.known import error_count, free_numbers
from fem.effects import History, PlacedEffect
from fem.model import ArmModel
from fem.springs import ConstantSpring

Array = NDArray[np.float64]
Axis = Literal["torque", "angle"]

TORQUE_LAWS = ("hardening", "softening", "backlash", "friction")
ANGLE_LAWS = ("angle-dependent-stiffness", "gravity-compensator", "gear-ripple")
POINTS, DRAWS = 181, 200
# Readings that a law moves by less than this share of the most tell too little about it to be drawn.
LEVER = 0.25
# Quantiles of the band.
BAND = (0.025, 0.975)


@dataclass(frozen=True)
class LawCurve:
    """A joint's law. Over the torque's size (N m): its turn (mrad). Over the joint's angle (deg): its compliance
    (urad/(N m)).

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
    unloading: NDArray[np.bool_]


def curve_of(state: State, number: int, rng: np.random.Generator) -> LawCurve | None:
    """The curve of an accepted effect (its place among them); None if it is no law of one joint."""
    placed = state.setting.accepted[number]
    family, _, joint = placed.effect.code.partition(":")
    if placed.effect.own or joint not in state.setting.model.robot.joint_names:
        return None
    if family in TORQUE_LAWS:
        return _over_torque(state, number, placed, joint, rng)
    return _over_angle(state, number, placed, joint, rng) if family in ANGLE_LAWS else None


def _draws(state: State, number: int, joint: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """Compliances (d,) of the joint and values (d, k) of the effect, as the readings leave them; the first the best."""
    s, placed = state.setting, state.setting.accepted[number]
    free = free_numbers(placed)
    first = len(s.free) + error_count(s) + sum(len(free_numbers(e)) for e in s.accepted[:number])
    index = [*range(first, first + len(free))]
    own = s.free.index(joint) if joint in s.free else None
    mean = placed.values[[k for k, _ in free]]
    if own is not None:
        index, mean = [own, *index], np.concatenate([[s.springs[own]], mean])
    C = state.refit.inverse[np.ix_(index, index)]
    size = np.sqrt(np.diag(C))
    L = np.linalg.cholesky(C / np.outer(size, size) + 1e-9 * np.eye(len(size))) * size[:, None]
    drawn = mean + np.vstack([np.zeros(len(index)), rng.standard_normal((DRAWS, len(index))) @ L.T])
    values = np.tile(placed.values, (len(drawn), 1))
    fixed = _compliance(s.arm, joint)
    c = np.full(len(drawn), fixed) if own is None else np.maximum(drawn[:, 0], 0.0)
    for i, (k, p) in enumerate(free):
        column = drawn[:, i + (own is not None)]
        least = 1e-3 * p.lower if p.role == "shape" else -np.inf if p.signed else 0.0
        values[:, k] = np.maximum(column, least)
    return c, values


def _compliance(arm: ArmModel, joint: str) -> float:
    part = arm.joints[arm.robot.joint_names.index(joint)]
    return float(part.axial.compliance(np.zeros((1, arm.robot.dof)))[0])


def _over_torque(
    state: State, number: int, placed: PlacedEffect, joint: str, rng: np.random.Generator
) -> LawCurve:  # fmt: skip
    s = state.setting
    tau = s.situation.torque(joint)
    top = int(np.abs(tau).argmax())
    way = np.sign(tau[top]) or 1.0
    index = s.model.robot.joint_names.index(joint)
    preload = float(s.situation.preload[top, index])
    up = np.linspace(0.0, float(np.abs(tau).max()), POINTS)
    path = np.concatenate([up, up[::-1]]) if placed.effect.needs_history else up
    c, values = _draws(state, number, joint, rng)
    turns = np.stack([_turn(placed, v, way * path, ci, preload, index) for ci, v in zip(c, values, strict=True)])
    turns = 1e3 * way * turns
    low, high = np.quantile(turns, BAND, axis=0)
    parts = [slice(0, POINTS), slice(POINTS, 2 * POINTS)][: len(path) // POINTS]
    branches = tuple((path[k], turns[0, k], low[k], high[k]) for k in parts)
    extra = placed.effect.law(None, s.situation, placed.values)
    x, angle, unloading = _implied(s, joint, s.situation.compliance(joint) * tau, extra)
    sign = np.where(tau[x] < 0.0, -1.0, 1.0)
    return LawCurve(
        placed.effect.code, joint, "torque", branches, 1e3 * c[0] * up, np.abs(tau[x]), 1e3 * sign * angle, unloading
    )


def _turn(placed: PlacedEffect, v: Array, tau: Array, c: float, preload: float, index: int) -> Array:
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


def _implied(s: Any, joint: str, plain: Array, extra: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
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


def _over_angle(state: State, number: int, placed: PlacedEffect, joint: str, rng: np.random.Generator) -> LawCurve:
    s = state.setting
    index = s.model.robot.joint_names.index(joint)
    at = s.data.free.at
    q = np.tile(np.median(at.q, axis=0), (4 * POINTS, 1))
    q[:, index] = np.linspace(at.q[:, index].min(), at.q[:, index].max(), len(q))
    c, values = _draws(state, number, joint, rng)
    curves = 1e6 * np.stack([_varied(s.arm, placed, v, q, ci, index) for ci, v in zip(c, values, strict=True)])
    low, high = np.quantile(curves, BAND, axis=0)
    angle = np.degrees(q[:, index])
    tau = s.situation.torque(joint)
    own = _varied(s.arm, placed, placed.values, at.q, c[0], index)
    strong = np.abs(tau) > LEVER * np.abs(tau).max()
    rows, turn, down = _implied(s, joint, own * tau, np.zeros((len(at), 6)))
    keep = strong[rows]
    rows, turn, down = rows[keep], turn[keep], down[keep]
    return LawCurve(
        placed.effect.code, joint, "angle", ((angle, curves[0], low, high),), np.full(len(q), 1e6 * c[0]),
        np.degrees(at.q[rows, index]), 1e6 * turn / tau[rows], down,
    )  # fmt: skip


def _varied(arm: ArmModel, placed: PlacedEffect, v: Array, q: Array, c: float, index: int) -> Array:
    """Compliance (k,) rad/(N m) of a joint over poses q (k, dof), with the effect."""
    if placed.effect.stage == "model":
        joints = tuple(replace(j, axial=_spring(c)) if j.joint == index else j for j in arm.joints)
        changed = placed.effect.law(replace(arm, joints=joints), None, v)
        return np.asarray(changed.joints[index].axial.compliance(q))
    n = len(q)
    bench: Any = _Bench(np.ones(n), np.full(n, c), _still(n), np.zeros((n, 1)), SimpleNamespace(q=q))
    return np.asarray(c + placed.effect.law(None, bench, v)[:, 0])


def _spring(c: float) -> ConstantSpring:
    return ConstantSpring(1.0 / c if c > 0.0 else np.inf)


def _still(n: int) -> History:
    return History(np.arange(n), np.zeros(n, dtype=np.intp), np.full(n, np.nan), is_known=False)


def curves_of(state: State, given: int, seed: int = 0) -> Sequence[LawCurve | None]:
    """Curves of the effects found, those after the first ``given``; None for what is no law of one joint."""
    rng = np.random.default_rng(seed)
    return [curve_of(state, k, rng) for k in range(given, len(state.setting.accepted))]
