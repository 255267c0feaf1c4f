"""The set-up is another than the sheet says: load, where it acts, where the arm stands; gauge's zero, scale, drift."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem.effects.base import ASSUMED_LAW, NEARLY_STRAIGHT, Effect, EffectParameter
from fem.effects.history import settled
from fem.effects.situation import Situation
from fem.effects.sizes import Usual
from fem.effects.structure import ASSUMED
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses, placed
from robots.arrays import Array

# What every joint's zero is off by, rad, one standard deviation.
ZERO_OFF_BY = float(np.radians(0.04))
# Mastering leaves some 0.1 deg. The range goes up to thirty times that, and sizes are as likely per decade, not per
# degree: what is beyond a degree has a third of the chance.
BEYOND_MASTERING = 0.3


def set_up_effects(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    # A hanger that nobody counted, or a load cell or weight that shows too much.
    force = EffectParameter(
        "force",
        "force",
        "N",
        0.015 * usual.force,
        0.12 * usual.force,
        ASSUMED,
        signed=True,
        meaning="force that acts with every load; negative: the loads in the table are too large",
    )
    yield Effect(
        "payload",
        "a force that is not in the table acts with every load",
        "load",
        (force,),
        _payload,
        "payload",
        depends_on="load",
        doubt=NEARLY_STRAIGHT,
    )
    offset = [
        EffectParameter(a, "length", "mm", 0.005, 0.05, ASSUMED, signed=True, meaning=f"along the flange's {a}")
        for a in "xyz"
    ]
    yield Effect(
        "load-point-offset",
        "the load does not act at the point that the table names",
        "load",
        tuple(offset),
        _offset,
        "load-point-offset",
    )
    tilt = [
        EffectParameter(
            f"tilt_{a}",
            "angle",
            "deg",
            np.radians(0.5),
            np.radians(5.0),
            ASSUMED,
            signed=True,
            default=0.0,
            meaning=f"turned about the base's {a}",
        )
        for a in "xyz"
    ]
    yield Effect("load-misalignment", "the load's direction is off", "load", tuple(tilt), _tilt, "load-misalignment")
    for index, name in enumerate(model.robot.joint_names):
        yield _joint_zero(index, name)
    zeros = tuple(
        EffectParameter(a, "length", "um", 5e-6, 60e-6, ASSUMED, signed=True, meaning=f"reading along {a} without load")
        for a in AXES
    )
    yield Effect(
        "gauge-zero",
        "the gauge does not read zero without load",
        "gauge",
        zeros,
        _gauge_zero,
        "gauge-zero",
        depends_on="load",
    )
    scale = EffectParameter(
        "share", "ratio", "%", 0.005, 0.1, ASSUMED, signed=True, meaning="share by which it reads too much"
    )
    yield Effect("gauge-scale", "the gauge's scale is off", "gauge", (scale,), _scale, "gauge-scale", depends_on="load")
    drifts = tuple(
        EffectParameter(
            a, "length", "um", 10e-6, 120e-6, ASSUMED, signed=True, meaning=f"drift along {a} over the whole campaign"
        )
        for a in AXES
    )
    settling = EffectParameter(
        "settling",
        "ratio",
        "1",
        0.05,
        10.0,
        ASSUMED,
        role="shape",
        grid=(0.1, 0.3, 10.0),
        meaning="time to settle, as a share of the campaign; large: nearly linear",
    )
    yield Effect(
        "drift",
        "readings drift with time",
        "gauge",
        (*drifts, settling),
        _drift,
        "drift",
        depends_on="clock",
        doubt=ASSUMED_LAW,
    )


def _payload(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
    """A constant force along the load's own direction, wherever there is a load."""
    force = at.wrench[:, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    way = np.divide(force, size, out=np.zeros_like(force), where=size > 0.0)
    return replace(at, wrench=at.wrench + np.hstack([v[0] * way, np.zeros_like(force)]))


def _offset(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
    return placed(s.model.robot, at, v, np.zeros(3))


def _tilt(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
    return placed(s.model.robot, at, np.zeros(3), v)


def _joint_zero(index: int, name: str) -> Effect:
    def law(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
        q = at.q.copy()
        q[:, index] += v[0]
        return replace(at, q=q)

    angle = EffectParameter(
        "angle",
        "angle",
        "deg",
        np.radians(0.1),
        np.radians(3.0),
        ASSUMED,
        signed=True,
        meaning="real angle less the one that the controller says",
    )
    return Effect(
        f"joint-zero-offset:{name}",
        f"joint {name} is at another angle than the controller says",
        "load",
        (angle,),
        law,
        "joint-zero-offset",
        usual=ZERO_OFF_BY,
        chance=BEYOND_MASTERING,
        lasting=True,
    )


AXES = ("x", "y", "z")


def _gauge_zero(d: Array, s: Situation, v: Array) -> Array:
    out = d.copy()
    out[:, :3] += v
    return out


def _scale(d: Array, s: Situation, v: Array) -> Array:
    return np.asarray(d * (1.0 + v[0]))


def _drift(d: Array, s: Situation, v: Array) -> Array:
    """In the course of :func:`fem.effects.history.settled`, t from 0 to 1 over the campaign."""
    out = d.copy()
    out[:, :3] += settled(np.nan_to_num(s.history.clock), float(v[3]))[:, None] * v[:3]
    return out
