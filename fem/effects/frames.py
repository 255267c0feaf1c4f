"""The table speaks of other axes, points or angles than the model: its frame turned, its tool point, its convention.

A frame that is shifted, not turned, changes no displacement and no force: no reading of this kind could show it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from fem.effects.base import Effect, EffectParameter, PlacedEffect
from fem.effects.situation import Situation
from fem.effects.structure import ASSUMED
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses
from robots.arrays import Array
from robots.frames import rotation_rpy
from robots.kinematics import forward_kinematics

# Azimuths are often set by hand. A tracker is levelled, to a tenth of what an arm may stand out of level by.
TILT, AZIMUTH = float(np.radians(3.0)), float(np.radians(5.0))
LEVELLED = (0.1, 1.0)
# Axes are parallel up to this.
PARALLEL = 1e-9

# By how much conventions of a joint's zero differ, rad: 45 and 90 deg each way, and a half turn.
OFFSETS = (-np.pi / 2.0, -np.pi / 4.0, np.pi / 4.0, np.pi / 2.0, np.pi)

# Of all angles (n, dof), a law's numbers and a joint's index: the joint's real angles (n,).
Angle = Callable[[Array, Array, int], Array]


def _turned_frame() -> Effect:
    def law(_: object, __: object, v: Array) -> Array:
        return rotation_rpy(v[:3] * np.array([v[3], v[3], 1.0]))

    turns = (
        EffectParameter(
            f"r{axis}",
            "angle",
            "deg",
            0.1 * most,
            most,
            ASSUMED,
            signed=True,
            default=0.0,
            meaning=f"turn of the table's frame about the base's {axis}",
        )
        for axis, most in zip("xyz", (TILT, TILT, AZIMUTH), strict=True)
    )
    words = "the frame of forces and displacements is turned against the robot's base"
    share = EffectParameter(
        "levelled",
        "ratio",
        "1",
        *LEVELLED,
        ASSUMED,
        role="shape",
        grid=LEVELLED,
        default=1.0,
        meaning="share of the rotations about x and y that is present",
    )
    return Effect("turned-frame", words, "frame", (*turns, share), law, "turned-frame")


TURNED_FRAME = _turned_frame()


def turned_further(effects: Sequence[PlacedEffect], turn: Array) -> tuple[PlacedEffect, ...]:
    """The effects with the table's frame turned by ``turn`` (3,) rad more, about the base's axes."""
    mine = next((e for e in effects if e.effect is TURNED_FRAME), None)
    if mine is None:
        return (*effects, PlacedEffect(TURNED_FRAME, np.append(turn, 1.0)))
    further = np.append(turn / [mine.values[3], mine.values[3], 1.0], 0.0)
    return tuple(replace(e, values=e.values + further) if e is mine else e for e in effects)


def frame_effects(model: ArmModel) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    yield TURNED_FRAME
    point = [
        EffectParameter(a, "length", "mm", 0.005, 0.05, ASSUMED, signed=True, meaning=f"along the flange's {a}")
        for a in "xyz"
    ]
    yield Effect(
        "tool-point-offset",
        "the measured and loaded point is elsewhere on the flange",
        "load",
        tuple(point),
        _point,
        "load-point-offset",
        chance=0.3,
    )
    axes = forward_kinematics(model.robot, np.zeros((1, model.robot.dof))).axis[0]
    for index, name in enumerate(model.robot.joint_names):
        yield _convention("sign", index, name, f"the sign of {name}'s angle is flipped", (), lambda q, v, k: -q[:, k])
        yield _convention(
            "offset",
            index,
            name,
            f"{name}'s angle counts from another zero, an eighth of a turn away or more",
            (_choice("offset", "angle", "deg", OFFSETS, "error of the angle"),),
            lambda q, v, k: q[:, k] + v[0],
        )
        parallel = bool(index and abs(axes[index] @ axes[index - 1]) > 1.0 - PARALLEL)
        yield from _uncoupled(model, index, name, parallel)
        if parallel:
            yield _convention(
                "coupling",
                index,
                name,
                f"{name}'s angle counts from the horizontal, not from the part before it",
                (_choice("share", "ratio", "1", (-1.0, 1.0), "share of the previous joint's angle that is added"),),
                lambda q, v, k: q[:, k] + v[0] * q[:, k - 1],
            )


def _uncoupled(model: ArmModel, index: int, name: str, parallel: bool) -> Iterator[Effect]:
    """The table's angle is the joint's own after all, though the model says that its controller couples it.

    Not where axes are ``parallel`` and the angle counts from the horizontal: with the other sign of its share that is
    the effect ``angle-coupling`` already.
    """
    controller = model.robot.controller
    if controller is None or index not in controller.coupled:
        return
    others = {int(k): abs(controller.matrix[index, k]) for k in np.flatnonzero(controller.matrix[index]) if k != index}
    if parallel and others == {index - 1: 1.0}:
        return

    def alone(q: Array, _: Array, k: int) -> Array:
        p = controller.controller(q)
        return np.asarray(controller.matrix[k, k] * p[:, k] + controller.offset[k])

    words = f"{name}'s angle is not coupled to others, as the model's [controller] says"
    yield _convention("uncoupled", index, name, words, (), alone)


def _point(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
    return replace(at, point=at.point + v)


def _choice(name: str, dimension: str, unit: str, tried: tuple[float, ...], meaning: str) -> EffectParameter:
    return EffectParameter(
        name, dimension, unit, min(tried), max(tried), "definition", role="shape", grid=tried, meaning=meaning
    )


def _convention(
    kind: str, index: int, name: str, words: str, parameters: tuple[EffectParameter, ...], angle: Angle
) -> Effect:
    """Another convention of a joint's angle: it holds or it does not; gross, so that it would show first."""

    def law(at: LoadedPoses, s: Situation, v: Array) -> LoadedPoses:
        q = at.q.copy()
        q[:, index] = angle(at.q, v, index)
        return replace(at, q=q)

    return Effect(f"angle-{kind}:{name}", words, "load", parameters, law, "angle-convention", gross=True)
