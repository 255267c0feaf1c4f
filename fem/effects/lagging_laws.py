"""Joints that remember, or change with time: creep, slip, stick-slip, warming.

What friction alone remembers is in :mod:`fem.effects.joint_laws`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.effects.base import ASSUMED_LAW, Effect, EffectParameter
from fem.effects.joint_laws import LAG, carried, carried_over, share, torque_shape, zeroed
from fem.effects.situation import Situation
from fem.effects.sizes import Usual
from fem.effects.structure import ASSUMED
from fem.model import ArmModel, JointPart
from robots.arrays import Array

# Seconds in which greased, rubber-sealed or plastic-bushed joints creep, and in which test benches wait for them.
CREEPS = (30.0, 3600.0)
# Decades to either side of its middle time over which a creep may be spread, and elements that stand for these.
SPECTRUM, ELEMENTS = 1.5, 7
# Gears warm up in 10 min to 3 h; shares of a campaign. 0: as warm as was read.
SETTLES = (0.1, 0.4, 2.0, 0.0)
# A slip that stays over cycles is known by its first time only, and stick-slip by its jumps: both fit outliers too.
SELDOM = 0.3


def lagging_laws(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """Effects of this kind that the model can have."""
    for joint in model.joints:
        torque = float(usual.torque[joint.joint])
        yield _creep(joint)
        yield _warming(joint)
        yield _stick_slip(joint, torque)
        yield _slip(joint, torque)


def _creep(joint: JointPart) -> Effect:
    """``theta = c (tau + a x)``, ``T dx/dt = tau - x``: a Kelvin-Voigt element in series with the spring.

    Under a steady torque the turn grows by the share a of the spring's own, with the time constant T, and goes back
    likewise (Flugge 1975, Viscoelasticity, doi:10.1007/978-3-662-02276-4, section 1.3). Most materials have a spectrum
    of times: with a ``spread`` of n decades x is the mean of elements whose times are even in the logarithm, n decades
    to either side of T, which creep with the logarithm of time (ibid., section 6.2).
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        torque = s.torque(joint.name)
        times = float(v[1]) * 10.0 ** np.linspace(-v[2], v[2], 1 if v[2] == 0.0 else ELEMENTS)
        once = v[3] >= 0.5
        late = np.mean([s.history.lag(torque, t, zeroed_once=once) for t in times.tolist()], axis=0)
        return s.turned(joint.name, v[0] * s.compliance(joint.name) * late)

    tried = tuple(float(x) for x in np.geomspace(60.0, 1800.0, 4))
    time = EffectParameter(
        "time",
        "time",
        "min",
        *CREEPS,
        ASSUMED,
        role="shape",
        grid=tried,
        meaning="time after which 63 % of the creep has developed",
        fine=True,
    )
    spread = EffectParameter(
        "spread",
        "ratio",
        "1",
        0.0,
        2.0,
        ASSUMED,
        role="shape",
        grid=(0.0, SPECTRUM),
        default=0.0,
        meaning="decades to either side of that time over which it spreads; 0: none",
    )
    crept = share("share", 0.03, 0.4, "share of the spring's rotation that develops with time", signed=False)
    return Effect(
        f"creep:{joint.name}",
        f"joint {joint.name} creeps under load",
        "arm",
        (crept, time, spread, zeroed()),
        law,
        "creep",
        needs_history=True,
        slot=LAG,
        differs=lambda v: v[2] == 0.0 or v[1] == tried[1],
    )


def _warming(joint: JointPart) -> Effect:
    """``theta = c tau (1 + a w)``, w = 0 cold and 1 after the campaign, or 1 for each 10 K above 20 deg C.

    Friction's heat goes with the way travelled and is carried off in proportion to what the gear is warmer than the
    air: first order in time (Bittencourt and Gunnarsson 2012, doi:10.1115/1.4006589, for friction; the modulus of
    greased contacts and plastic cages follows).
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        warm = s.history.warmth(float(v[1]))
        return s.turned(joint.name, v[0] * s.compliance(joint.name) * s.torque(joint.name) * warm)

    settling = EffectParameter(
        "settling",
        "ratio",
        "1",
        0.0,
        10.0,
        ASSUMED,
        role="shape",
        grid=SETTLES,
        meaning="time to warm up, as a share of the campaign; 0: follows the measured temperature, per 10 K",
    )
    more = share("share", 0.03, 0.4, "share of the compliance that is added when warm; negative: it gets stiffer")
    return Effect(
        f"warming:{joint.name}",
        f"joint {joint.name}'s stiffness changes as it warms up",
        "arm",
        (more, settling),
        law,
        "warming",
        depends_on="clock",
        doubt=ASSUMED_LAW,
    )


def _stick_slip(joint: JointPart, torque: float) -> Effect:
    """``theta = c (tau - a (tau - y))``, y sticks up to a torque t and then jumps (:meth:`History.stick`).

    As friction, but what is held is let go at once, down to half of t: readings lie on two branches, between which
    they jump. Loads in small steps show it; of one step up and one down it cannot be told from friction.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau = s.torque(joint.name)
        held = tau - s.history.stick(tau, float(v[1]), float(v[2]), carried_over(v[3]))
        return s.turned(joint.name, -v[0] * s.compliance(joint.name) * held)

    stuck = share("share", 0.4, 1.2, "share of the spring that sticks", signed=False)
    lets_go = torque_shape("torque", torque, (0.03, 0.8), 8, "torque at which it lets go")
    kept = EffectParameter(
        "kept",
        "ratio",
        "1",
        0.2,
        0.7,
        ASSUMED,
        role="shape",
        grid=(0.35, 0.65),
        default=0.5,
        meaning="share of that torque that is still held after a jump",
        fine=True,
    )
    return Effect(
        f"stick-slip:{joint.name}",
        f"joint {joint.name} sticks and lets go in jumps",
        "arm",
        (stuck, lets_go, kept, carried()),
        law,
        "stick-slip",
        needs_history=True,
        slot=LAG,
        chance=SELDOM,
    )


def stays_slipped(tried: tuple[float, ...] = (0.0, 1.0)) -> EffectParameter:
    """The shape that says for how long something stays where it has slipped to."""
    return EffectParameter(
        "lasting",
        "ratio",
        "1",
        0.0,
        1.0,
        "definition",
        role="shape",
        grid=tried,
        default=0.0,
        meaning="1: it lasts through all later cycles, 0: only until the end of its cycle",
    )


def _slip(joint: JointPart, torque: float) -> Effect:
    """``theta = b (max |tau| / t - 1)`` beyond a torque t, each way on its own, and never back: a joint that slips.

    A clamp, key or belt that gives way by Coulomb's limit (a slider beside a spring: Iwan 1966, doi:10.1115/1.3625199).
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        tau, limit = s.torque(joint.name), float(v[1])
        gone = [
            s.history.ratchet(way * tau, limit, lasting=v[2] >= 0.5, zeroed_once=v[3] >= 0.5) for way in (1.0, -1.0)
        ]
        return s.turned(joint.name, v[0] / limit * (gone[0] - gone[1]))

    angle = EffectParameter("angle", "angle", "mrad", 0.03e-3, 1e-3, ASSUMED, meaning="slip at twice the torque named")
    limit = torque_shape("torque", torque, (0.1, 0.8), 4, "torque beyond which it slips")
    return Effect(
        f"slip:{joint.name}",
        f"joint {joint.name} slips and stays there",
        "arm",
        (angle, limit, stays_slipped(), zeroed()),
        law,
        "slip",
        needs_history=True,
        slot=LAG,
        chance=SELDOM,
    )
