"""Laws that a diagnosis found: curves with bands, what the readings say about them, and their figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe.diagnosis.diagnose import State
from doe.diagnosis.known import free_numbers
from doe.diagnosis.setting import own_compliance, with_compliances
from fem.effects import History, PlacedEffect
from fem.effects.situation import plain_history
from fem.model import ArmModel
from robots import InputError
from robots.arrays import Array, Bools, Indices
from robots.constants import NORMAL_95
from stiffarm.commands.diagnose.effect_numbers import Number, short
from stiffarm.pages.figure_parts import above, drawing, log_ticks, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO

Axis = Literal["torque", "angle"]

POINTS = 181
# Readings that a law moves by less than this share of the most tell too little about it to be drawn.
LEVER = 0.25
# Steps of differences, in standard deviations.
STEP = 0.1
_UP: Final = OKABE_ITO["blue"]
_DOWN: Final = OKABE_ITO["vermillion"]
_MANY: Final = 200
# Single readings at small torques may imply wild turns; the axis keeps to these quantiles of them.
_KEPT: Final = (1.0, 99.0)


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


def curves_of(state: State, given: int) -> Sequence[LawCurve | None]:
    """Curves of the effects found, those after the first ``given``; None for what is no law of one joint."""
    return [curve_of(state, k) for k in range(given, len(state.setting.accepted))]


def law_figure(curve: LawCurve, heading: str) -> Figure:
    """Draw a joint's law with its 95 % band, the spring without it, and what single readings imply.

    Over the torque: the turn; for friction the loop of loading and unloading. Over the angle: the compliance.
    """
    with drawing(heading, (8.4, 5.0)) as (figure, (ax,)):
        names = ("loading", "unloading") if len(curve.branches) > 1 else ("law found",)
        for (x, y, low, high), colour, name in zip(curve.branches, (_UP, _DOWN), names, strict=False):
            ax.fill_between(x, low, high, color=colour, alpha=0.18, linewidth=0)
            ax.plot(x, y, color=colour, linewidth=2.4, label=name)
        ax.plot(curve.branches[0][0], curve.plain, color=INK, linestyle="--", linewidth=1.2, label="its spring alone")
        size = 8 if len(curve.read_x) > _MANY else 20
        look: dict[str, Any] = {"s": size, "alpha": 0.45, "linewidths": 0, "zorder": 1.5}
        for side, colour, name in (
            (~curve.unloading, _UP, "readings"),
            (curve.unloading, _DOWN, "readings, unloading"),
        ):
            if side.any():
                ax.scatter(curve.read_x[side], curve.read_y[side], color=colour, label=name, **look)
        _limits(ax, curve)
        if curve.axis == "torque":
            ax.set(xlabel=f"torque about {curve.joint} under the load (N m)", ylabel=f"turn of {curve.joint} (mrad)")
        else:
            ax.set(xlabel=f"angle of {curve.joint} (deg)", ylabel=f"compliance of {curve.joint} (µrad/(N m))")
        above(ax, ax.get_legend_handles_labels()[0], 5)
    return figure


def _limits(ax: Axes, curve: LawCurve) -> None:
    values = [np.concatenate([low, high]) for _, _, low, high in curve.branches]
    ends = [curve.plain, *values]
    if curve.read_y.size:
        ends.append(np.percentile(curve.read_y, _KEPT))
    flat = np.concatenate(ends)
    low, high = float(np.nanmin(flat)), float(np.nanmax(flat))
    if curve.axis == "angle":
        low = min(low, 0.0) if low < 0.3 * high else low
    room = 0.06 * max(high - low, 1e-9)
    ax.set_ylim(low - room, high + room)


def numbers_figure(numbers: Sequence[Number]) -> Figure:
    """Draw each number with its 95 % interval over the range that was thought plausible, a panel each.

    Raises
    ------
    InputError
        No number that can be drawn.
    """
    shown = [n for n in numbers if np.isfinite(n.value)]
    if not shown:
        raise InputError("numbers figure: no number to draw", code="B002")
    heading = "Numbers found, with 95 % intervals; grey: what was thought plausible"
    with drawing(heading, (9.0, 0.9 + 1.15 * len(shown)), len(shown)) as (figure, axes):
        for ax, n in zip(axes, shown, strict=True):
            _number(ax, n)
    return figure


def _number(ax: Axes, n: Number) -> None:
    low, high = n.plausible
    ranges = [(-high, -low), (low, high)] if n.signed else [(low, high)]
    points = [n.value, *(v for one in ranges for v in one), *(v for v in (n.low, n.high) if v is not None)]
    finite = np.array([v for v in points if np.isfinite(v)])
    for a, b in ranges:
        ax.axvspan(a, b, color=FAINT, alpha=0.45, linewidth=0)
    left, right = float(finite.min()), float(finite.max())
    log = not n.signed and left > 0.0 and right > 8.0 * left
    if log:
        ax.set_xscale("log")
        edges = left / 1.3, right * 1.3
    else:
        edges = left - 0.08 * (right - left), right + 0.08 * (right - left)
    ax.set_xlim(*edges)
    if n.low is not None and n.high is not None:
        ends = [max(n.low, edges[0]), min(n.high, edges[1])]
        ax.plot(ends, [0.0, 0.0], color=_UP, linewidth=2.6, solid_capstyle="butt")
        if n.high > edges[1]:
            ax.plot(edges[1], 0.0, ">", color=_UP, markersize=8, clip_on=False)
    ax.plot(n.value, 0.0, "o", color=_UP, markersize=9, markeredgecolor="white", zorder=3)
    note(ax, short(n.value), (n.value, 0.0), (0, 9), va="bottom", weight="bold")
    if log:
        log_ticks(ax.xaxis)
    ax.set(ylim=(-0.6, 1.1), yticks=[])
    ax.grid(visible=False, axis="y")
    ax.spines["left"].set_visible(False)
    unit = "" if n.unit == "1" else f" ({n.unit})"
    ax.set_xlabel(f"{n.code}: {n.name}{unit}")
