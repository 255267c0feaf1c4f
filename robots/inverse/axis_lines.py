"""The lines that a robot's joints turn about, as they lie at zero of all coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array
from robots.kinematics import forward_kinematics
from robots.robot import Robot


@dataclass(frozen=True)
class AxisLines:
    """Joint axes in the base frame at q = 0, and the flange there.

    ``direction`` (dof, 3): unit vectors about which a growing *coordinate* turns what follows (the robot's
    signs are in there). ``point`` (dof, 3) m: a point on each axis. ``T_home`` (4, 4): base to flange.

    With them the flange is the product of exponentials ``T(q) = exp(q1 S1) ... exp(qn Sn) T_home`` (Lynch and
    Park, Modern Robotics, 2017, eq. 4.14), whatever frames the description was written in.
    """

    direction: Array
    point: Array
    T_home: Array

    @property
    def length(self) -> float:
        """Longest way along the arm from the first axis's point to the flange (m)."""
        path = np.vstack([self.point, self.T_home[:3, 3]])
        return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def axis_lines(robot: Robot) -> AxisLines:
    """Read the axes off the robot's frames at q = 0."""
    frames = forward_kinematics(robot, np.zeros((1, robot.dof)))
    return AxisLines(frames.axis[0] * robot.sign[:, None], frames.p[0, 1:].copy(), frames.T_flange[0])


def nearest_point(direction: Array, point: Array) -> tuple[Array, float]:
    """Point with the least sum of squared distances to k lines ((k, 3), (k, 3)), and the largest distance (m).

    Lines that are all parallel have no one such point; the one of least norm is returned then.
    """
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    centre = point.mean(axis=0)  # about the lines' own middle, so that far-off frames cost no digits
    best, *_ = np.linalg.lstsq(across.sum(axis=0), np.einsum("kij,kj->i", across, point - centre), rcond=1e-10)
    distance = np.linalg.norm(np.einsum("kij,kj->ki", across, centre + best - point), axis=1)
    return centre + best, float(distance.max())


def basis(axis: Array, x_near: Array) -> Array:
    """Right-handed orthonormal basis (3, 3), columns x, y, z: z along ``axis``, x as near ``x_near`` as can be."""
    z = axis / np.linalg.norm(axis)
    x = x_near - (x_near @ z) * z
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
