"""Effects in a model with numbers set free: the arm as the numbers say, with its effects, and what is then read.

Effects depend on the springs (friction holds back a share of a spring's turn) and on one another, so the arm is built
anew for each set of numbers, and derivatives are differences. Those by stiffnesses are exact: an arm is statically
determinate, so that loads and torques do not depend on its compliances, and every effect of the catalogue is linear in
them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fem.effects.base import PlacedEffect
from fem.free.base import Flexibility, Parameter
from fem.free.kinds import with_spring
from fem.free.laws import AXIAL, FreeLaw
from fem.model import ArmModel, JointPart
from fem.springs import LawSpring
from robots.arrays import Array

# Steps of differences: a share of the range for what is linear, where any step is exact; else small enough for a
# third-order error below 1e-8.
LINEAR_STEP, STEP = 1e-2, 1e-4


def changed_model(
    model: ArmModel,
    parameters: Sequence[Parameter],
    laws: Sequence[FreeLaw],
    walls: Mapping[str, Flexibility],
    u: Array,
) -> ArmModel:
    """The model with stiffnesses, moduli, walls and laws at the estimator's variables u (p,)."""
    for p, v in zip(parameters, u.tolist(), strict=True):
        model = p.kind.changed(p, v, model, walls)
    for law in laws:
        coefficients = u[law.first : law.first + law.basis.size]
        spring = LawSpring(law.basis, coefficients)
        model = with_spring(model, law.joint, spring) if law.row == AXIAL else _with_bearing_law(model, law, spring)
    return model


def changed_effects(
    effects: Sequence[PlacedEffect], parameters: Sequence[Parameter], u: Array
) -> tuple[PlacedEffect, ...]:
    """The effects with those of their numbers that are free at the estimator's variables u (p,)."""
    values = {e.effect.code: e.values.copy() for e in effects}
    for p, v in zip(parameters, u.tolist(), strict=True):
        if p.kind.of_effect:
            # A stiffness acts as a compliance, which is its variable already.
            values[p.place][p.index[0]] = v if p.scale == "compliance" else p.outer(v)
    return tuple(replace(e, values=values[e.effect.code]) for e in effects)


def step_of(p: Parameter, u: float, *, exact: bool) -> tuple[float, float]:
    """Ends of the difference by one variable at u, within its range; ``exact``: readings are linear in it."""
    low, high = p.inner_bounds
    if p.scale == "compliance":
        # The range spans decades; its geometric middle is the size that a compliance usually has.
        size = max(abs(u), float(np.sqrt(low * high)))
        h = size if exact else STEP * size
    elif exact:
        h = LINEAR_STEP * (high - low)
    elif p.is_logarithm:
        h = STEP
    else:
        h = STEP * min(max(abs(u), 0.1 * high), high - low)
    return max(u - h, low), min(u + h, high)


def _with_bearing_law(model: ArmModel, law: FreeLaw, spring: LawSpring) -> ArmModel:
    def changed(joint: JointPart) -> JointPart:
        others = tuple((row, one) for row, one in joint.laws if row != law.row)
        return replace(joint, laws=(*others, (law.row, spring)))

    return replace(model, joints=tuple(changed(j) if j.name == law.joint else j for j in model.joints))
