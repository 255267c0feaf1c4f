"""Joint springs that are not linear in the torque: hardening, softening, backlash, friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.effects.base import Effect, EffectParameter
from fem.effects.situation import Situation
from fem.effects.stiffness_laws import share
from fem.effects.structure import ASSUMED, CLASS
from fem.model import ArmModel, JointPart
from robots.arrays import Array

# Of laws that bend one joint's turn over the torque, a second one only corrects the first.
SLOT = "bend"


def torque_laws(model: ArmModel) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    for joint in model.joints:
        yield _hardening(joint)
        yield _softening(joint)
        yield _backlash(joint)
        yield _friction(joint)


def _torque(name: str, lower: float, upper: float, points: int, meaning: str, source: str = ASSUMED) -> EffectParameter:
    """A torque as a shape, tried on a logarithmic grid."""
    grid = tuple(float(x) for x in np.geomspace(lower, upper, points))
    return EffectParameter(name, "torque", "N m", lower, upper, source, role="shape", grid=grid, meaning=meaning)


def _hardening(joint: JointPart) -> Effect:
    """``theta = c (tau - a (tau - t g(tau / t)))``.

    g = tanh bends at the knee t, beyond which the compliance is c (1 - a); with a power below one,
    g = sgn |tau / t|^power bends all the way, as contact that grows does.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau, knee = s.torque(joint.name), v[1]
        bent = np.tanh(tau / knee) if v[2] >= 1.0 else np.sign(tau) * np.abs(tau / knee) ** v[2]
        return s.turned(joint.name, -v[0] * s.compliance(joint.name) * (tau - knee * bent))

    power = EffectParameter("power", "ratio", "1", 0.5, 1.0, ASSUMED, role="shape", grid=(1.0, 0.8, 0.65), default=1.0,
                            meaning="1: a bend, below: bends all the way")  # fmt: skip
    lost = share("share", 0.1, 0.9, "share of the compliance that is lost at large torques", signed=False)
    return Effect(
        f"hardening:{joint.name}", f"joint {joint.name} gets stiffer with the torque", "arm",
        (lost, _torque("knee", 60.0, 1500.0, 7, "torque at which it bends"), power), law, "hardening", slot=SLOT,
    )  # fmt: skip


def _softening(joint: JointPart) -> Effect:
    """``theta = c tau (1 + s (|tau| / t)^p)``: a housing that opens, bolts that let go."""

    def law(_: object, s: Situation, v: Array) -> Array:
        tau = s.torque(joint.name)
        return s.turned(joint.name, v[0] * s.compliance(joint.name) * tau * (np.abs(tau) / v[1]) ** v[2])

    power = EffectParameter("power", "ratio", "1", 0.5, 3.0, ASSUMED, role="shape", grid=(0.5, 1.0, 2.0),
                            meaning="how steeply it grows")  # fmt: skip
    added = share("share", 0.1, 0.7, "share of the compliance that is added at the torque named", signed=False)
    at = _torque("torque", 100.0, 1500.0, 4, "torque that the share belongs to")
    return Effect(
        f"softening:{joint.name}", f"joint {joint.name} gets softer with the torque", "arm",
        (added, at, power), law, "softening", slot=SLOT,
    )  # fmt: skip


def _backlash(joint: JointPart) -> Effect:
    """``theta = c tau + b/2 (tanh((tau + w g)/t) - tanh(w g / t))``: g the torque of the links' own weight.

    A gap b between flanks that the preload w g has closed on one side already, or not; it takes t to cross it.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau, width = s.torque(joint.name), v[1]
        rest = v[2] * s.preload[:, joint.joint]
        way = np.tanh((tau + rest) / width) - np.tanh(rest / width)
        return s.turned(joint.name, 0.5 * v[0] * way)

    gap = EffectParameter("gap", "angle", "mrad", 0.2e-3, 1.8e-3, CLASS, meaning="play between the flanks")
    preload = EffectParameter("preload", "ratio", "1", 0.0, 1.0, ASSUMED, role="shape", grid=(0.0, 1.0), default=0.0,
                              meaning="1: the links' weight presses the flanks together, 0: it does not")  # fmt: skip
    crossing = _torque("crossing", 3.0, 60.0, 4, "torque that it takes to cross the gap")
    return Effect(
        f"backlash:{joint.name}", f"the gear of joint {joint.name} has backlash", "arm",
        (gap, crossing, preload), law, "backlash", slot=SLOT,
    )  # fmt: skip


def _friction(joint: JointPart) -> Effect:
    """``theta = c (tau - a (tau - y))``, y the play of tau with the friction torque: a spring behind dry friction.

    With a = 1 the spring feels y only; less than 1 where a second spring acts beside the friction (Jenkins element).
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau = s.torque(joint.name)
        held = tau - s.history.play(tau, v[1])
        return s.turned(joint.name, -v[0] * s.compliance(joint.name) * held)

    held = share("share", 0.4, 1.2, "share of the spring that the friction holds back", signed=False)
    slips = _torque("friction", 15.0, 350.0, 12, "torque at which it slips", CLASS)
    return Effect(
        f"friction:{joint.name}", f"dry friction in joint {joint.name}", "arm", (held, slips), law, "friction",
        needs_history=True,
    )  # fmt: skip
