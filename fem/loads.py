"""Loaded poses, and where a load really acts: beside the read point, and not quite along its nominal direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import ArmModel
from robots import Robot
from robots.kinematics import forward_kinematics
from robots.robot import rotation_rpy

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoadedPoses:
    """n loaded poses: ``q`` (n, dof) rad, ``wrench`` (n, 6) base axes at ``point`` (n, 3) m in the flange frame."""

    q: Array
    wrench: Array
    point: Array

    def __len__(self) -> int:
        return len(self.q)


def placed(robot: Robot, at: LoadedPoses, offset: Array, tilt: Array) -> LoadedPoses:
    """The loads turned by ``tilt`` (3,) rad about the base's axes and moved ``offset`` (3,) m, flange axes.

    The result has the equivalent wrench at the same read point: a force beside it adds its moment.
    """
    if not (offset.any() or tilt.any()):
        return at
    R = rotation_rpy(tilt)
    force, moment = at.wrench[:, :3] @ R.T, at.wrench[:, 3:] @ R.T
    lever = forward_kinematics(robot, at.q).R_flange @ offset
    return LoadedPoses(at.q, np.concatenate([force, moment + np.cross(lever, force)], axis=1), at.point)


def as_loaded(model: ArmModel, q: Array, wrench: Array, point: Array) -> LoadedPoses:
    """Nominal loads as the model says that they act."""
    return placed(model.robot, LoadedPoses(q, wrench, point), model.load_offset, model.load_tilt)
