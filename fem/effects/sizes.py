"""What is usual for an arm: test load, torques, springs. Plausible ranges of effects and grids of shapes go by these.

A knee at 100 N m is late for a 5 kg arm and nothing for a 300 kg robot. Half the payload is what arms are tested with
(XR701: 650 N of 1300 N); its torque at a joint is taken at the lever that nine of ten poses stay below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model import ArmModel
from robots import ModelDescription, Robot
from robots.arm_class import (
    MASS_AT_REACH,
    PAYLOAD_OF_MASS,
    SHORTEST,
    MAIN_Nm_per_rad,
    REFERENCE_TORQUE_Nm,
    arm_class,
    reach_of,
)
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.kept import once_for_each
from robots.kinematics import forward_kinematics, tool_position

TESTED = 0.5
# Poses, and the share of them, by which levers go; loads beside the last axes have a lever of 0.1 m or so.
POSES, MOST, LEAST_LEVER = 200, 0.9, 0.1
# Reach (m) of the class whose sizes are the reference.
REFERENCE_REACH = 2.7


@dataclass(frozen=True)
class Usual:
    """Of an arm: ``force`` N of a test load; its ``torque`` (dof,) N m about each axis and ``moment`` N m at the base.

    ``softness`` (dof,) rad/(N m): of the springs about the axes, the model's own, else the middle of the arm's class;
    ``low``, ``high`` (dof,) N m/rad: the class's ends. ``stiff``, ``rigid``: how much stiffer the arm is in turning and
    along a line than the reference of 180 kg payload.
    """

    force: float
    torque: Array
    moment: float
    softness: Array
    low: Array
    high: Array
    stiff: float
    rigid: float


def usual(model: ArmModel, description: ModelDescription | None = None) -> Usual:
    """What is usual for an arm, by what its file says of payload and mass, and by its reach."""
    robot, of = model.robot, arm_class(description, model.robot)
    reach = max(reach_of(robot), SHORTEST)
    stiff = float(np.sqrt(of.low[0] * of.high[0] / np.prod(MAIN_Nm_per_rad)))
    if description is not None and description.payload is not None:
        load = STANDARD_GRAVITY * description.payload.si
    else:
        # An arm of this class is made for its payload and its own mass together.
        load = stiff * REFERENCE_TORQUE_Nm / reach / (1.0 + MASS_AT_REACH / PAYLOAD_OF_MASS)
    force = TESTED * load
    own = np.array([float(j.axial.compliance(np.zeros((1, robot.dof)))[0]) for j in model.joints])
    softness = np.where(own > 0.0, own, 1.0 / np.sqrt(of.low * of.high))
    levers = _levers(robot)
    rigid = stiff / (reach / REFERENCE_REACH) ** 2
    return Usual(force, force * levers, force * float(levers.max()), softness, of.low, of.high, stiff, rigid)


@once_for_each
def _levers(robot: Robot) -> Array:
    """Levers (dof,) m of a force across at the tool about the joints' axes."""
    q = np.random.default_rng(0).uniform(robot.limits[:, 0], robot.limits[:, 1], (POSES, robot.dof))
    frames = forward_kinematics(robot, q)
    arm = tool_position(robot, frames)[:, None] - frames.p[:, 1 : robot.dof + 1]
    lever = np.linalg.norm(np.cross(frames.axis, arm), axis=2)
    return np.asarray(np.maximum(np.quantile(lever, MOST, axis=0), LEAST_LEVER))
