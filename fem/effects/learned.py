"""Laws that nobody wrote down: what one place does along one variable, learned from the readings.

A law is a sum of pieces with a number each: straight between knots over a torque, a force or the clock, waves over a
joint's travel. Knots lie in shares of the largest value that was read (``reach``, ``low``, ``high``), beyond which the
last piece holds. With all numbers zero nothing happens. Such an effect has no name, only a place and an axis; but it is
an effect like any other: in model files, in simulations, and on readings held out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fem.effects.base import Effect, EffectParameter
from fem.effects.joint_laws import SLOT
from fem.effects.learned_parts import FAMILY, SOURCE, Reach, held, pieces
from fem.effects.situation import Situation
from fem.effects.surroundings import surroundings
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses
from robots.arrays import Array

# What each head acts along, as studies and reports say it.
AXES: dict[str, tuple[str, ...]] = {
    "learned-torque": ("load", "pose"),
    "learned-history": ("load history", "load"),
    "learned-angle": ("pose",),
    "learned-clock": ("clock", "temperature", "session"),
    "learned-temperature": ("temperature",),
    "learned-session": ("session",),
    "learned-coupling": ("pose", "load"),
    "learned-load": ("load", "pose"),
    "learned-step": ("clock", "session"),
}
# Knots, in shares of the largest value read.
KNOTS = (0.25, 0.5, 0.75, 1.0)
WAVES = 4
# Sizes tried, in shares of the one named: what nobody knows may be small, and is then no less sure.
WIDTHS = (0.1, 0.33, 1.0)
# Moments at which something may have changed.
MOMENTS = tuple(round(0.05 + 0.1 * k, 2) for k in range(10))


def learned_laws(model: ArmModel, reach: Reach) -> Iterator[Effect]:
    """Every law of this kind that the model can have, of any size."""
    return (replace(law, widths=WIDTHS) for law in _laws(model, reach))


def _laws(model: ArmModel, reach: Reach) -> Iterator[Effect]:
    names = model.robot.joint_names
    for index, name in enumerate(names):
        top = held("reach", "torque", "N m", float(max(reach.torque[index], 1e-6)), "largest torque that was read")
        yield _torque(name, top)
        yield _history(name, top)
        yield _angle(index, name, reach.travel[index])
        yield _clock(name)
        yield _step(name)
        yield _coupling(name, [other for other in names if other != name])
    yield _base(reach)
    yield _gauge_clock(reach)
    yield _gauge_step(reach)
    yield _gauge_history(reach)
    force = held("reach", "force", "N", max(reach.force, 1e-6), "largest force that was read")
    yield _load(force)
    yield _load_history(force)
    yield from surroundings(reach)


def learned_place(code: str) -> str:
    """Where a learned law acts."""
    return code.partition(":")[2]


def axes_of(code: str) -> tuple[str, ...]:
    """What a learned law acts along."""
    return AXES[code.partition(":")[0]]


def hats(u: Array, knots: Sequence[float] = KNOTS) -> Array:
    """Pieces (k, n) that are straight between 0 and the knots, one at one knot each; the last one holds beyond it."""
    x = np.array([0.0, *knots])
    return np.stack([np.interp(np.minimum(u, x[-1]), x, np.eye(len(x))[k]) for k in range(1, len(x))])


def _both_ways(u: Array) -> Array:
    """Pieces (2 k, n) for each sign of u by itself."""
    return np.vstack([hats(np.maximum(u, 0.0)), hats(np.maximum(-u, 0.0))])


def _down(s: Situation) -> Array:
    return s.history.unloading(np.linalg.norm(s.at.wrench[:, :3], axis=1)).astype(float)


UP = tuple(f"{sign}{k}" for sign in ("plus", "minus") for k in range(1, len(KNOTS) + 1))
BACK = tuple(f"{name}_down" for name in UP)
TIMES = tuple(f"at{k}" for k in range(1, len(KNOTS) + 1))


def _torque(name: str, top: EffectParameter) -> Effect:
    """``theta = c T sum v_k N_k(tau / T)``: a joint's turn over its torque."""

    def law(_: object, s: Situation, v: Array) -> Array:
        turn = v[:-1] @ _both_ways(s.torque(name) / v[-1])
        return s.turned(name, s.compliance(name) * v[-1] * turn)

    return Effect(
        f"learned-torque:{name}",
        f"joint {name} turns with its torque by a learned law",
        "arm",
        (*pieces(UP, "share of the turn that the largest torque gives"), top),
        law,
        FAMILY,
        doubt=0.0,
        slot=SLOT,
    )


def _history(name: str, top: EffectParameter) -> Effect:
    """A joint's turn over its torque, another one on the way down."""

    def law(_: object, s: Situation, v: Array) -> Array:
        N = _both_ways(s.torque(name) / v[-1])
        turn = v[: len(N)] @ N + _down(s) * (v[len(N) : -1] @ N)
        return s.turned(name, s.compliance(name) * v[-1] * turn)

    return Effect(
        f"learned-history:{name}",
        f"joint {name} turns with its torque by a learned law, another in unloading",
        "arm",
        (*pieces((*UP, *BACK), "share of the turn that the largest torque gives"), top),
        law,
        FAMILY,
        needs_history=True,
        doubt=0.0,
        slot=SLOT,
    )


def _angle(index: int, name: str, travel: Array) -> Effect:
    """``theta = c tau sum v_k cos(pi k u)``, u from 0 to 1 over the travel: a stiffness that varies with the angle."""

    def law(_: object, s: Situation, v: Array) -> Array:
        low, high = v[WAVES], v[WAVES + 1]
        u = np.clip((s.at.q[:, index] - low) / max(float(high - low), 1e-9), 0.0, 1.0)
        share = v[:WAVES] @ np.cos(np.pi * np.outer(np.arange(1, WAVES + 1), u))
        return s.turned(name, s.compliance(name) * s.torque(name) * share)

    ends = (
        held("low", "angle", "deg", float(travel[0]), "smallest angle that was read"),
        held("high", "angle", "deg", float(travel[1]), "largest angle that was read"),
    )
    waves = pieces([f"wave{k}" for k in range(1, WAVES + 1)], "share of the compliance")
    return Effect(
        f"learned-angle:{name}",
        f"joint {name}'s stiffness varies with its angle by a learned law",
        "arm",
        (*waves, *ends),
        law,
        FAMILY,
        depends_on="angle",
        doubt=0.0,
    )


def _clock(name: str) -> Effect:
    """``theta = c tau sum v_k N_k(t)``: a joint's stiffness that changes over the campaign."""

    def law(_: object, s: Situation, v: Array) -> Array:
        share = v @ hats(s.history.clock_or_middle)
        return s.turned(name, s.compliance(name) * s.torque(name) * share)

    return Effect(
        f"learned-clock:{name}",
        f"joint {name}'s stiffness changes over the campaign",
        "arm",
        pieces(TIMES, "share of the compliance that is added by then"),
        law,
        FAMILY,
        depends_on="clock",
        doubt=0.0,
    )


def _when() -> EffectParameter:
    return EffectParameter(
        "when",
        "ratio",
        "1",
        0.0,
        1.0,
        SOURCE,
        role="shape",
        grid=MOMENTS,
        meaning="when it happened, in shares of the campaign",
        fine=True,
    )


def _step(name: str) -> Effect:
    """``theta = c tau v`` from a moment on: a joint that was changed in the middle of the campaign."""

    def law(_: object, s: Situation, v: Array) -> Array:
        after = s.history.clock_or_middle > v[1]
        return s.turned(name, v[0] * s.compliance(name) * s.torque(name) * after)

    return Effect(
        f"learned-step:{name}",
        f"joint {name}'s stiffness changed at one moment of the campaign",
        "arm",
        (*pieces(["share"], "share of the compliance that is added from then on"), _when()),
        law,
        FAMILY,
        depends_on="clock",
        doubt=0.0,
    )


def _coupling(name: str, others: Sequence[str]) -> Effect:
    """``theta = c sum v_k tau_k``: torques at other joints turn this one."""

    def law(_: object, s: Situation, v: Array) -> Array:
        felt = sum(x * s.torque(other) for x, other in zip(v, others, strict=True))
        return s.turned(name, s.compliance(name) * felt)

    shares = pieces([f"by_{other}" for other in others], "share of the compliance by which a torque there turns it")
    return Effect(
        f"learned-coupling:{name}", f"torques at other joints turn joint {name}", "arm", shares, law, FAMILY, doubt=0.0
    )


def _base(reach: Reach) -> Effect:
    """The base turns about two level axes by a law of its own over the moment."""

    def law(_: object, s: Situation, v: Array) -> Array:
        port, top, turn = s.places["base"], v[-2], v[-1]
        moment = port.carried[3:5]
        N = [_both_ways(moment[k] / top) for k in range(2)]
        half = len(N[0])
        angle = [turn * (v[k * half : (k + 1) * half] @ N[k]) for k in range(2)]
        return np.asarray((port.T[3] * angle[0] + port.T[4] * angle[1]).T)

    own = pieces([f"{axis}_{name}" for axis in "xy" for name in UP], "share of the turn named")
    ends = (
        held("reach", "torque", "N m", max(reach.moment, 1e-6), "largest moment that was read"),
        held(
            "turn",
            "angle",
            "mrad",
            reach.size * reach.force / max(reach.moment, 1e-6),
            "rotation to which the shares refer",
        ),
    )
    return Effect(
        "learned-load:base", "the base deflects by a learned law", "arm", (*own, *ends), law, FAMILY, doubt=0.0
    )


def _gauge_clock(reach: Reach) -> Effect:
    """Readings move over the campaign by a law of their own."""

    def law(d: Array, s: Situation, v: Array) -> Array:
        N = hats(np.nan_to_num(s.history.clock))
        out, k = d.copy(), len(N)
        for axis in range(3):
            out[:, axis] += v[-1] * (v[axis * k : (axis + 1) * k] @ N)
        return out

    own = pieces([f"{axis}_{name}" for axis in "xyz" for name in TIMES], "share of the size named")
    size = held("size", "length", "mm", max(reach.size, 1e-9), "size to which the shares refer")
    return Effect(
        "learned-clock:gauge",
        "readings drift over the campaign by a learned law",
        "gauge",
        (*own, size),
        law,
        FAMILY,
        depends_on="clock",
        doubt=0.0,
    )


def _gauge_step(reach: Reach) -> Effect:
    """Readings move at one moment of the campaign: someone touched the gauge."""

    def law(d: Array, s: Situation, v: Array) -> Array:
        out, after = d.copy(), np.nan_to_num(s.history.clock) > v[3]
        out[:, :3] += np.outer(after, v[:3]) * v[4]
        return out

    size = held("size", "length", "mm", max(reach.size, 1e-9), "size to which the shares refer")
    return Effect(
        "learned-step:gauge",
        "readings shifted at one moment of the campaign",
        "gauge",
        (*pieces("xyz", "share of the size named"), _when(), size),
        law,
        FAMILY,
        depends_on="clock",
        doubt=0.0,
    )


def _gauge_history(reach: Reach) -> Effect:
    """Readings lag behind: on the way down, and more or less with the load, by a length of its own."""

    def law(d: Array, s: Situation, v: Array) -> Array:
        down = _down(s)
        share = np.linalg.norm(s.at.wrench[:, :3], axis=1)
        share = share / max(float(share.max(initial=0.0)), 1e-9)
        out = d.copy()
        for axis in range(3):
            up, back, slope = v[3 * axis : 3 * axis + 3]
            out[:, axis] += v[9] * (up + down * (back + slope * share))
        return out

    names = [f"{axis}_{part}" for axis in "xyz" for part in ("always", "back", "back_with_load")]
    size = held("size", "length", "mm", max(0.2 * reach.size, 1e-9), "size to which the shares refer")
    return Effect(
        "learned-history:gauge",
        "readings lag behind the load",
        "gauge",
        (*pieces(names, "share of the size named"), size),
        law,
        FAMILY,
        needs_history=True,
        doubt=0.0,
    )


def _load(top: EffectParameter) -> Effect:
    """Another force than the sheet says, by a law of its own over the force."""

    def law(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
        share = v[:-1] @ hats(np.linalg.norm(at.wrench[:, :3], axis=1) / v[-1])
        return replace(at, wrench=at.wrench * (1.0 + share)[:, None])

    own = pieces([f"share{k}" for k in range(1, len(KNOTS) + 1)], "share of the force that is added")
    return Effect(
        "learned-load:load",
        "forces differ from the table by a learned law",
        "load",
        (*own, top),
        law,
        FAMILY,
        doubt=0.0,
    )


def _load_history(top: EffectParameter) -> Effect:
    """Readings as if forces were others than the sheet says, others again on the way down."""

    def law(d: Array, s: Situation, v: Array) -> Array:
        N = hats(np.linalg.norm(s.at.wrench[:, :3], axis=1) / v[-1])
        return np.asarray(d * (1.0 + v[: len(N)] @ N + _down(s) * (v[len(N) : -1] @ N))[:, None])

    names = [f"share{k}" for k in range(1, len(KNOTS) + 1)]
    own = pieces([*names, *(f"{name}_down" for name in names)], "share of the deflection that is added")
    return Effect(
        "learned-history:load",
        "forces differ from the table by a learned law, another in unloading",
        "gauge",
        (*own, top),
        law,
        FAMILY,
        needs_history=True,
        doubt=0.0,
    )
