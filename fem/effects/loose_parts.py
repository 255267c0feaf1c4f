"""Base, tool and cables: what rocks, slips or pulls without being a joint."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.effects.base import ASSUMED_LAW, Effect, EffectParameter
from fem.effects.joint_laws import share, torque_shape, zeroed
from fem.effects.lagging_laws import SELDOM, stays_slipped
from fem.effects.situation import Situation
from fem.effects.sizes import Usual
from fem.effects.structure import ASSUMED
from fem.model import ArmModel
from robots.arrays import Array

# Rows of a place's wrench: its force, and the moments about the two axes across.
FORCE, ACROSS = slice(0, 3), slice(3, 5)
# A base that rocks is seen and heard; what little load moves is more often a gauge or a load.
UNEASY = 0.5
# Of a cable package that is wound up little, the pull grows with the way; of one that lies tight, steeply at the end.
WOUND = (1.5, 3.5)


def loose_parts(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    yield _loose_base(usual)
    yield _slip_of("base", ACROSS, "the base slips on its bolts and stays there", usual.moment, usual)
    yield _slip_of("tool", FORCE, "the tool or the fixture at the flange slips and stays there", usual.force, usual)
    if model.robot.dof >= 5:
        yield _cable_package(model)


def _heading(moment: Array) -> tuple[Array, Array]:
    """Size (n,) and direction (n, k) of vectors (n, k); no direction where there is no size."""
    size = np.linalg.norm(moment, axis=1)
    return size, np.divide(moment, size[:, None], out=np.zeros_like(moment), where=size[:, None] > 0.0)


def _loose_base(usual: Usual) -> Effect:
    """The base tips by ``g tanh(|M| / t)`` the way the moment M about its horizontal axes goes: loose bolts, no shims.

    A gap that closes, as in a gear's backlash; which corner it stands on goes by the moment's direction. What lies
    beneath a preload that holds it down all the time is not seen.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        size, way = _heading(s.carried("base", ACROSS))
        return s.moved("base", ACROSS, (v[0] * np.tanh(size / v[1]))[:, None] * way)

    gap = EffectParameter("gap", "angle", "mrad", 0.05e-3, 0.6e-3, ASSUMED, meaning="angle by which the base can tip")
    closing = torque_shape("closing", usual.moment, (0.02, 0.4), 4, "moment that closes the gap")
    return Effect("loose-base", "the base rocks on its bolts", "arm", (gap, closing), law, "loose-base", chance=UNEASY)


def _slip_of(place: str, rows: slice, words: str, size: float, usual: Usual) -> Effect:
    """``b (max |F| / f - 1)`` beyond a force or moment f, the way it acts: a fixture that gives way for good.

    The ratchet goes by the size: what slipped under the largest load is there under the smaller ones after it, the way
    that these act.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        much, way = _heading(s.carried(place, rows))
        gone = s.history.ratchet(much, float(v[1]), lasting=v[2] >= 0.5, zeroed_once=v[3] >= 0.5)
        return s.moved(place, rows, (v[0] / v[1] * gone)[:, None] * way)

    if rows == FORCE:
        amount = EffectParameter(
            "way", "length", "mm", 0.02e-3, 0.5e-3, ASSUMED, meaning="slip at twice the force named"
        )
        tried = np.geomspace(0.15 * size, 0.8 * size, 5)
        limit = EffectParameter(
            "force",
            "force",
            "N",
            float(tried[0]),
            float(tried[-1]),
            ASSUMED,
            role="shape",
            grid=tuple(float(x) for x in tried),
            meaning="force beyond which it slips",
            fine=True,
        )
    else:
        amount = EffectParameter(
            "angle", "angle", "mrad", 0.03e-3, 1e-3, ASSUMED, meaning="slip at twice the moment named"
        )
        limit = torque_shape("moment", size, (0.15, 0.8), 4, "moment beyond which it slips")
    return Effect(
        f"slip:{place}",
        words,
        "arm",
        (amount, limit, stays_slipped(), zeroed()),
        law,
        "slip",
        needs_history=True,
        depends_on="load",
        chance=SELDOM,
    )


def _cable_package(model: ArmModel) -> Effect:
    """Cables beside two wrist joints: springs ``1/c (1 + a w)``, w the mean of ``|q - middle|^p`` of half the travel.

    They stiffen the joints that they are wound about by the angles at which these stand; the steady pull of a bundle
    moves nothing between the unloaded and the loaded arm.
    """
    names, dof = model.robot.joint_names, model.robot.dof
    k = dof - (3 if dof >= 6 else 2)
    pair = [k, k + 1]
    middle, half = model.robot.limits.mean(axis=1)[pair], 0.5 * np.ptp(model.robot.limits, axis=1)[pair]

    def law(_: object, s: Situation, v: Array) -> Array:
        wound = np.mean(np.abs((s.at.q[:, pair] - middle) / half) ** v[1], axis=1)
        held = 1.0 / np.maximum(1.0 + v[0] * wound, 0.1) - 1.0
        turns = [s.turned(n, s.compliance(n) * s.torque(n) * held) for n in names[k : k + 2]]
        return np.asarray(turns[0] + turns[1])

    stiffer = share(
        "share", 0.1, 0.8, "share of the joints' stiffness that the cables add, wound up fully", signed=False
    )
    power = EffectParameter(
        "power",
        "ratio",
        "1",
        1.0,
        5.0,
        ASSUMED,
        role="shape",
        grid=WOUND,
        default=2.0,
        meaning="how steeply it grows with the angle",
    )
    return Effect(
        "cable-package",
        f"cables stiffen joints {names[k]} and {names[k + 1]} where they are wound up",
        "arm",
        (stiffer, power),
        law,
        "cable-package",
        depends_on="pose",
        doubt=ASSUMED_LAW,
    )
