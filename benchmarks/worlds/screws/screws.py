"""Screw algebra on batches: exponentials, adjoints, wrenches, screw axes at a pose.

Twists are (angular, linear), wrenches (moment, force), both in base axes about the base's origin.
Source: Lynch and Park, Modern Robotics, 2017, equations 3.51, 3.83 and 5.11.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


def hat(vector: Array) -> Array:
    """Matrix (..., 3, 3) of the cross product with ``vector`` (..., 3)."""
    x, y, z = np.moveaxis(vector, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def screw_through(axis: Array, point: Array) -> Array:
    """Unit screw (6,) of a rotation about ``axis`` through ``point``."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([unit, np.cross(point, unit)])


def exponential(screw: Array, angle: Array) -> Array:
    """Motion (n, 4, 4) by ``angle`` (n,) in rad about a unit screw (6,) of a rotation."""
    K, v, a = hat(screw[:3]), screw[3:], np.asarray(angle, float)[:, None, None]
    sin, cos = np.sin(a), np.cos(a)
    motion = np.zeros((len(a), 4, 4))
    motion[:, :3, :3] = np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
    slide = a * np.eye(3) + (1.0 - cos) * K + (a - sin) * (K @ K)
    motion[:, :3, 3] = slide @ v
    motion[:, 3, 3] = 1.0
    return motion


def adjoint(motion: Array) -> Array:
    """Map (n, 6, 6) of twists by ``motion`` (n, 4, 4)."""
    R, p = motion[:, :3, :3], motion[:, :3, 3]
    big = np.zeros((len(motion), 6, 6))
    big[:, :3, :3] = R
    big[:, 3:, 3:] = R
    big[:, 3:, :3] = hat(p) @ R
    return big


def body_motions(screws: Array, angles: Array) -> Array:
    """Motions (n, joints + 1, 4, 4) of base and bodies from home, of screws (6, joints) and angles (n, joints)."""
    count, joints = angles.shape
    motions = np.tile(np.eye(4), (count, joints + 1, 1, 1))
    for i in range(joints):
        motions[:, i + 1] = motions[:, i] @ exponential(screws[:, i], angles[:, i])
    return motions


def axes_at(screws: Array, motions: Array) -> Array:
    """Screw axes (n, 6, joints) at the poses of ``body_motions``: the space Jacobian."""
    columns = [adjoint(motions[:, i]) @ screws[:, i] for i in range(screws.shape[1])]
    return np.stack(columns, -1)


def wrench_at(force: Array, point: Array) -> Array:
    """Wrench (n, 6) of a force (n, 3) at a point (n, 3)."""
    return np.concatenate([np.cross(point, force), force], axis=1)


def displacement(twist: Array, point: Array) -> Array:
    """Displacement (n, 3) of a point (n, 3) by a small twist (n, 6)."""
    return twist[:, 3:] + np.cross(twist[:, :3], point)


def carried(compliance: Array, motion: Array, wrench: Array) -> Array:
    """Twist (n, 6) by a spatial compliance (6, 6) at home of a body that ``motion`` moved, under wrenches (n, 6)."""
    ad = adjoint(motion)
    felt = np.einsum("nji,nj->ni", ad, wrench)
    return np.asarray(np.einsum("nij,nj->ni", ad, felt @ compliance.T))
