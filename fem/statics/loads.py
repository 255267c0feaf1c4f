"""Loaded poses, and where a load really acts: beside the read point, and not quite along its nominal direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model import ArmModel
from robots import Robot
from robots.arrays import Array
from robots.frames import rotation_rpy
from robots.kinematics import forward_kinematics


@dataclass(frozen=True)
class LoadedPoses:
    """n loaded poses: ``q`` (n, dof) rad, ``wrench`` (n, 6) base axes at ``point`` (n, 3) m in the flange frame."""

    q: Array
    wrench: Array
    point: Array

    def __len__(self) -> int:
        return len(self.q)


def placed(robot: Robot, at: LoadedPoses, offset: Array, tilt: Array) -> LoadedPoses:
    """The loads turned by ``tilt`` rad about the base's axes and moved ``offset`` m, flange axes; (3,) or (n, 3) each.

    The result has the equivalent wrench at the same read point: a force beside it adds its moment.
    """
    if not (offset.any() or tilt.any()):
        return at
    R = np.broadcast_to(np.moveaxis(rotation_rpy(tilt.T), (0, 1), (-2, -1)), (len(at), 3, 3))
    force, moment = np.einsum("nij,nj->ni", R, at.wrench[:, :3]), np.einsum("nij,nj->ni", R, at.wrench[:, 3:])
    lever = np.einsum("nij,nj->ni", forward_kinematics(robot, at.q).R_flange, np.broadcast_to(offset, (len(at), 3)))
    return LoadedPoses(at.q, np.concatenate([force, moment + np.cross(lever, force)], axis=1), at.point)


def as_read(model: ArmModel, at: LoadedPoses) -> LoadedPoses:
    """The nominal loads of loads that act as the model says: :func:`as_loaded` undone.

    Further tilts and offsets are added to the model's own before loads are placed: turns about several axes cannot be
    put on one after the other in two steps.
    """
    if not (model.load_offset.any() or model.load_tilt.any()):
        return at
    back = rotation_rpy(model.load_tilt).T
    lever = forward_kinematics(model.robot, at.q).R_flange @ model.load_offset
    moment = at.wrench[:, 3:] - np.cross(lever, at.wrench[:, :3])
    return LoadedPoses(at.q, np.hstack([at.wrench[:, :3] @ back.T, moment @ back.T]), at.point)


def as_loaded(model: ArmModel, q: Array, wrench: Array, point: Array) -> LoadedPoses:
    """Nominal loads as the model says that they act."""
    return placed(model.robot, LoadedPoses(q, wrench, point), model.load_offset, model.load_tilt)
