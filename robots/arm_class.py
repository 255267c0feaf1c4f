"""The class of arm that a robot belongs to: which joint stiffnesses arms of its size have.

An arm's joints are made for the torque that its payload and its own mass put on them, and are about as much stiffer as
they are stronger: ``stiffness ~ torque = g reach (payload + MASS_AT_REACH mass)``. The reference is the class of 100 to
270 kg payload, whose joints 1 to 3 have 4e5 to 4e6 and joints 4 to 6 2e4 to 3e6 N m/rad. Published springs of arms
from 5 kg to 210 kg payload (UR5, UR10, KR 60-3, KR 240-2, XR701, R-2000iC) lie in the range so scaled or within twice
its ends. Where neither mass nor payload is given, reach alone stands for both, by a fit to data sheets of arms of 0.8
to 3.7 m, of which most lie within three times; the range is as much wider.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import ModelDescription, Robot
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.kinematics import stretched_length

# The reference class: 180 kg payload, 1200 kg mass, 2.7 m from axis 1.
REFERENCE_TORQUE_Nm = STANDARD_GRAVITY * 2.7 * (180.0 + 0.15 * 1200.0)
MAIN_Nm_per_rad = (4e5, 4e6)
WRIST_Nm_per_rad = (2e4, 3e6)
# Joints that carry the arm; the others carry the tool.
MAIN_JOINTS = 3
# Share of the arm's mass that acts at full reach: most of it sits at the base.
MASS_AT_REACH = 0.15
# Data sheets of industrial arms: payload over mass 0.05 to 0.25.
PAYLOAD_OF_MASS = 0.12
WIDER_WITHOUT_ONE = 1.5
# torque (N m) = 220 reach^3.5 (m): UR5 0.85 m, KR 16 1.6 m, KR 60-3 2.2 m, R-2000iC 2.9 m, XR701 3.0 m.
TORQUE_OF_REACH = (220.0, 3.5)
WIDER_WITHOUT_BOTH = 3.0
# A shorter reach (one joint and a tool) is no arm; its class is that of the smallest, m.
SHORTEST = 0.2
# The source of springs that nobody measured: the middle of what arms of the size have (`stiffarm new --springs class`).
CLASS_PRIOR = "class-prior"
# Springs this far beyond their class are still taken without a question.
BEYOND_CLASS = 3.0


@dataclass(frozen=True)
class ArmClass:
    """``low``, ``high`` (dof,) N m/rad: stiffnesses about the axes that arms of this size have; ``size`` in words."""

    low: Array
    high: Array
    size: str

    @property
    def allowed(self) -> tuple[Array, Array]:
        """What is taken without a question: three times beyond the class on both sides."""
        return self.low / BEYOND_CLASS, self.high * BEYOND_CLASS


def arm_class(description: ModelDescription | None, robot: Robot) -> ArmClass:
    """The class of a robot by what its file says of mass and payload, if there is one, and by its reach."""
    torque, wider, size = _torque(description, reach_of(robot))
    main = np.arange(robot.dof) < MAIN_JOINTS
    scale = torque / REFERENCE_TORQUE_Nm
    low = np.where(main, MAIN_Nm_per_rad[0], WRIST_Nm_per_rad[0]) * scale / wider
    high = np.where(main, MAIN_Nm_per_rad[1], WRIST_Nm_per_rad[1]) * scale * wider
    return ArmClass(low, high, size)


def reach_of(robot: Robot) -> float:
    """How far (m) the stretched arm reaches from axis 1, up to the flange."""
    # What lies along axis 1 lifts the arm and does not reach.
    first = robot.T_pre[1, :3, 3] if robot.dof > 1 else robot.T_last_flange[:3, 3]
    lifted = np.linalg.norm(first) - np.linalg.norm(first[:2])
    return float(stretched_length(robot, np.zeros(3)) - lifted)


def _torque(description: ModelDescription | None, reach: float) -> tuple[float, float, str]:
    """Torque (N m) that the arm is made for, how much wider the class is for what is not known, and both in words."""
    mass = None if description is None or description.mass is None else description.mass.si
    payload = None if description is None or description.payload is None else description.payload.si
    if mass is None and payload is None:
        factor, power = TORQUE_OF_REACH
        size = f"{reach:.2g} m reach, mass and payload not given"
        return factor * max(reach, SHORTEST) ** power, WIDER_WITHOUT_BOTH, size
    known = [f"{reach:.2g} m reach", *(f"{v:g} kg {n}" for v, n in ((payload, "payload"), (mass, "mass")) if v)]
    if mass is None and payload is not None:
        mass = payload / PAYLOAD_OF_MASS
    elif payload is None and mass is not None:
        payload = PAYLOAD_OF_MASS * mass
    wider = 1.0 if len(known) > 2 else WIDER_WITHOUT_ONE
    load = (payload or 0.0) + MASS_AT_REACH * (mass or 0.0)
    return STANDARD_GRAVITY * max(reach, SHORTEST) * load, wider, ", ".join(known)


def usual_load(robot: Robot, description: ModelDescription | None = None) -> float:
    """The force (N) that results per newton are judged by: the payload's weight, else what arms of this reach bear."""
    if description is not None and description.payload is not None:
        return STANDARD_GRAVITY * description.payload.si
    factor, power = TORQUE_OF_REACH
    return float(factor * max(reach_of(robot), SHORTEST) ** (power - 1.0))


def stated_load(robot: Robot, description: ModelDescription) -> float:
    """The force (N) that stiffnesses are stated at: of the calibration's loads the one nearest to the usual one."""
    usual = usual_load(robot, description)
    read = () if description.calibration is None else description.calibration.loads_N
    return min((abs(load) for load in read if load), key=lambda load: abs(load - usual), default=usual)
