"""Joint springs that vary with the joint's angle, or are not linear in the torque.

Linear in the load, but different from pose to pose: a gear's bearing, its mesh, a gravity compensator. Bent over the
torque: hardening, softening, backlash, friction. Torques are tried in shares of what is usual for the joint
(:mod:`fem.effects.sizes`).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.effects.base import ASSUMED_LAW, Effect, EffectParameter
from fem.effects.history import Carried
from fem.effects.situation import Situation
from fem.effects.sizes import Usual
from fem.effects.structure import ASSUMED, CLASS
from fem.model import ArmModel, JointPart
from fem.springs import VaryingSpring
from robots.arrays import Array
from robots.kinematics import forward_kinematics

# A ripple fits any scatter between poses, if its number of teeth is free: it is believed less easily.
RARE = 0.1
# Pins of the gear, or turns of its input, over a turn of the joint.
TEETH = tuple(float(n) for n in range(6, 241))


def share(
    name: str, lower: float, upper: float, meaning: str, source: str = ASSUMED, *, signed: bool = True
) -> EffectParameter:
    """A share of a joint's own compliance or stiffness."""
    return EffectParameter(name, "ratio", "1", lower, upper, source, signed=signed, meaning=meaning)


def joint_laws(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    for joint in model.joints:
        yield _angle_dependent(joint)
        yield _gear_ripple(joint)
    if model.robot.dof >= 2:
        yield _gravity_compensator(model)
    for joint in model.joints:
        torque = float(usual.torque[joint.joint])
        yield _hardening(joint, torque, weighs=bool(model.masses))
        yield _softening(joint, torque, weighs=bool(model.masses))
        yield _backlash(joint, torque, weighs=bool(model.masses))
        yield _friction(joint, torque)


def _angle_dependent(joint: JointPart) -> Effect:
    """``c (1 + sum_m a_m cos m q + b_m sin m q)``, m = 1, 2: what a gear's bearing and housing vary over a turn."""

    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        def varied(q: Array) -> Array:
            x = q[:, joint.joint]
            return np.asarray(v[0] * np.cos(x) + v[1] * np.sin(x) + v[2] * np.cos(2.0 * x) + v[3] * np.sin(2.0 * x))

        old = model.joints[joint.joint]
        return model.with_joint(joint.name, axial=VaryingSpring(old.axial, varied))

    shares = (
        share("cos1", 0.05, 0.45, "share of the compliance that goes with the cosine of the angle", CLASS),
        share("sin1", 0.05, 0.45, "share that goes with its sine", CLASS),
        share("cos2", 0.02, 0.15, "share that goes with the cosine of twice the angle"),
        share("sin2", 0.02, 0.15, "share that goes with the sine of twice the angle"),
    )
    return Effect(
        f"angle-dependent-stiffness:{joint.name}",
        f"joint {joint.name}'s stiffness varies with its angle",
        "model",
        shares,
        law,
        "angle-dependent-stiffness",
        depends_on="angle",
        doubt=ASSUMED_LAW,
    )


def _gravity_compensator(model: ArmModel) -> Effect:
    """``k (1 + rho g)``, g = (1 + cos(phi - phase)) / 2: phi is the angle of the upper arm from the vertical.

    A spring cylinder between carousel and upper arm stiffens joint 2 by an amount that follows its lever.
    """
    second = model.joints[1]

    def angle(q: Array) -> Array:
        frames = forward_kinematics(model.robot, q)
        arm = frames.p[:, min(3, model.robot.dof)] - frames.p[:, 2]
        return np.asarray(np.arctan2(np.hypot(arm[:, 0], arm[:, 1]) * _forward(frames.axis[:, 1], arm), arm[:, 2]))

    def law(changed: ArmModel, _: object, v: Array) -> ArmModel:
        def varied(q: Array) -> Array:
            g = 0.5 * (1.0 + np.cos(angle(q) - v[1]))
            return np.asarray(1.0 / np.maximum(1.0 + v[0] * g, 0.1) - 1.0)

        old = changed.joints[1]
        return changed.with_joint(second.name, axial=VaryingSpring(old.axial, varied))

    phase = EffectParameter(
        "phase",
        "angle",
        "deg",
        -np.pi,
        np.pi,
        ASSUMED,
        role="shape",
        grid=(-np.pi / 2.0, 0.0, np.pi / 2.0, np.pi),
        meaning="angle at which it does",
    )
    stiffer = share("share", 0.1, 0.4, "share by which it stiffens the joint at most", signed=False)
    return Effect(
        f"gravity-compensator:{second.name}",
        f"a gravity compensator stiffens joint {second.name}",
        "model",
        (stiffer, phase),
        law,
        "angle-dependent-stiffness",
        depends_on="angle",
        doubt=ASSUMED_LAW,
    )


def _forward(axis: Array, arm: Array) -> Array:
    """Sign (n,) of the lean of an arm: positive where turning about the joint's axis leans it further."""
    lean = axis[:, 1] * arm[:, 0] - axis[:, 0] * arm[:, 1]
    return np.where(lean < 0.0, -1.0, 1.0)


def _gear_ripple(joint: JointPart) -> Effect:
    """``c (1 + a cos N q + b sin N q)``: stiffness of the mesh, which hardly two poses share."""

    def law(_: object, s: Situation, v: Array) -> Array:
        x = v[2] * s.at.q[:, joint.joint]
        ripple = v[0] * np.cos(x) + v[1] * np.sin(x)
        return s.turned(joint.name, s.compliance(joint.name) * s.torque(joint.name) * ripple)

    teeth = EffectParameter(
        "teeth", "ratio", "1", TEETH[0], TEETH[-1], ASSUMED, role="shape", grid=TEETH, meaning="ripples in a full turn"
    )
    in_phase = share("cos", 0.03, 0.3, "share of the ripple in phase")
    across = share("sin", 0.03, 0.3, "share of the ripple across it")
    return Effect(
        f"gear-ripple:{joint.name}",
        f"the mesh of joint {joint.name}'s gear makes its stiffness ripple",
        "arm",
        (in_phase, across, teeth),
        law,
        "gear-ripple",
        depends_on="angle",
        chance=RARE,
    )


# Of laws that bend one joint's turn over the torque, a second one only corrects the first; so with those that lag.
SLOT, LAG = "bend", "lag"


def torque_shape(
    name: str, usual: float, shares: tuple[float, float], points: int, meaning: str, source: str = ASSUMED
) -> EffectParameter:
    """A torque as a shape, tried on a logarithmic grid between two shares of the usual one, N m.

    A single point lies in the middle: a law that the torque only scales needs no other.
    """
    lower, upper = (float(share * usual) for share in shares)
    tried = np.geomspace(lower, upper, points) if points > 1 else [np.sqrt(lower * upper)]
    grid = tuple(float(x) for x in tried)
    return EffectParameter(
        name, "torque", "N m", lower, upper, source, role="shape", grid=grid, meaning=meaning, fine=points > 1
    )


def _preload(*, weighs: bool) -> EffectParameter:
    """The shape that says whether the links' weight, hanging on a joint all the time, has a part in its law.

    What is read is the turn from weight alone to weight and load. A balancer takes a part of the weight off.
    """
    return EffectParameter(
        "preload",
        "ratio",
        "1",
        0.0,
        1.5,
        ASSUMED,
        role="shape",
        grid=(0.0, 1.0) if weighs else (0.0,),
        default=0.0,
        meaning="share of the links' weight that loads the joint; 0: the law depends on the torque of the load alone",
        fine=True,
    )


def _hardening(joint: JointPart, torque: float, *, weighs: bool) -> Effect:
    """``theta = c (tau - a (tau - t g(tau / t)))``.

    g = tanh bends at the knee t, beyond which the compliance is c (1 - a); with a power below one,
    g = sgn |tau / t|^power bends all the way, as contact that grows does. There the knee only shares the spring's turn
    out between c and a, so that one knee does for all.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau, knee = s.torque(joint.name), v[1]

        def bent(x: Array) -> Array:
            u = x / knee
            return np.asarray(knee * (np.tanh(u) if v[2] >= 1.0 else np.sign(u) * np.abs(u) ** v[2]))

        weight = v[3] * s.preload[:, joint.joint]
        return s.turned(joint.name, -v[0] * s.compliance(joint.name) * (tau - bent(tau + weight) + bent(weight)))

    power = EffectParameter(
        "power",
        "ratio",
        "1",
        0.5,
        1.0,
        ASSUMED,
        role="shape",
        grid=(1.0, 0.8, 0.65),
        default=1.0,
        meaning="1: changes at one torque; below 1: changes gradually",
    )
    lost = share("share", 0.1, 0.9, "share of the compliance that is lost at large torques", signed=False)
    knee = torque_shape("knee", torque, (0.06, 1.2), 5, "torque at which the stiffness changes")
    middle = knee.grid[len(knee.grid) // 2]
    return Effect(
        f"hardening:{joint.name}",
        f"joint {joint.name} gets stiffer with the torque",
        "arm",
        (lost, knee, power, _preload(weighs=weighs)),
        law,
        "hardening",
        slot=SLOT,
        differs=lambda v: bool(v[2] >= 1.0 or v[1] == middle),
    )


def _softening(joint: JointPart, torque: float, *, weighs: bool) -> Effect:
    """``theta = c tau (1 + s (|tau| / t)^p)``: a housing that opens, bolts that let go.

    Another t is another s: one is tried.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        def more(x: Array) -> Array:
            return np.asarray(x * (np.abs(x) / v[1]) ** v[2])

        weight = v[3] * s.preload[:, joint.joint]
        turn = more(s.torque(joint.name) + weight) - more(weight)
        return s.turned(joint.name, v[0] * s.compliance(joint.name) * turn)

    power = EffectParameter(
        "power",
        "ratio",
        "1",
        0.5,
        3.0,
        ASSUMED,
        role="shape",
        grid=(0.5, 1.0, 2.0, 3.0),
        meaning="how steeply it grows",
        fine=True,
    )
    added = share("share", 0.05, 0.7, "share of the compliance that is added at the torque named", signed=False)
    at = torque_shape("torque", torque, (0.1, 1.5), 1, "torque at which the share is reached")
    return Effect(
        f"softening:{joint.name}",
        f"joint {joint.name} gets softer with the torque",
        "arm",
        (added, at, power, _preload(weighs=weighs)),
        law,
        "softening",
        slot=SLOT,
    )


def _backlash(joint: JointPart, torque: float, *, weighs: bool) -> Effect:
    """``theta = c tau + b/2 (tanh((tau + p)/t) - tanh(p / t))``, p the torque that presses the flanks together.

    A gap b between flanks that has closed on one side already, or not; it takes t to cross it, up to a quarter of what
    a test load brings. They are pressed by the links' own weight, or by as much in every pose: cables, a balancer, what
    nobody weighed. ``weighs``: whether the model says what the links weigh.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau, width = s.torque(joint.name), v[1]
        rest = v[2] * s.preload[:, joint.joint] + v[3] * width
        way = np.tanh((tau + rest) / width) - np.tanh(rest / width)
        return s.turned(joint.name, 0.5 * v[0] * way)

    gap = EffectParameter("gap", "angle", "mrad", 0.2e-3, 1.8e-3, CLASS, meaning="play between the flanks")
    pressed = EffectParameter(
        "pressed",
        "ratio",
        "1",
        -1.5,
        1.5,
        ASSUMED,
        role="shape",
        grid=(0.0, -0.8, 0.8),
        default=0.0,
        meaning="torque that presses the flanks together in every pose, in shares of the crossing torque",
    )
    crossing = torque_shape("crossing", torque, (0.005, 0.25), 4, "torque that it takes to cross the gap")
    return Effect(
        f"backlash:{joint.name}",
        f"the gear of joint {joint.name} has backlash",
        "arm",
        (gap, crossing, _preload(weighs=weighs), pressed),
        law,
        "backlash",
        slot=SLOT,
        differs=lambda v: v[2] == 0.0 or v[3] == 0.0,
    )


def carried() -> EffectParameter:
    """The shape that says whether what sticks under no load is still there when the next load cycle begins."""
    return EffectParameter(
        "carried",
        "ratio",
        "1",
        0.0,
        2.0,
        "definition",
        role="shape",
        grid=(0.0, 1.0, 2.0),
        default=0.0,
        meaning="0: each load cycle starts released; 1: a stuck joint stays stuck until the arm moves on; 2: the "
        "same, and the gauge is zeroed only then",
        of_stays=True,
    )


def zeroed() -> EffectParameter:
    """The shape that says when the gauge was zeroed, for laws that remember by themselves."""
    return EffectParameter(
        "zeroed",
        "ratio",
        "1",
        0.0,
        1.0,
        "definition",
        role="shape",
        grid=(0.0, 1.0),
        default=0.0,
        meaning="0: the gauge is zeroed before each load cycle; 1: only before the first one at a pose",
        of_stays=True,
    )


def carried_over(value: float) -> Carried:
    """The shape's value."""
    return 0 if value < 0.5 else 1 if value < 1.5 else 2


def _friction(joint: JointPart, torque: float) -> Effect:
    """``theta = c (tau - a (tau - y))``, y the play of tau with the friction torque: a spring behind dry friction.

    With a = 1 the spring feels y only; less than 1 where a second spring acts beside the friction (Jenkins element).
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau = s.torque(joint.name)
        held = tau - s.history.play(tau, v[1], carried_over(v[2]))
        return s.turned(joint.name, -v[0] * s.compliance(joint.name) * held)

    held = share("share", 0.4, 1.2, "share of the spring that the friction holds back", signed=False)
    slips = torque_shape("friction", torque, (0.015, 0.8), 8, "torque at which it slips", CLASS)
    return Effect(
        f"friction:{joint.name}",
        f"dry friction in joint {joint.name}",
        "arm",
        (held, slips, carried()),
        law,
        "friction",
        needs_history=True,
        slot=LAG,
    )
