"""Rotations and rigid frames: made from angles and positions, read back, inverted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from robots.arrays import Array, Integers
from robots.errors import InputError

# Cosine of a pitch below which roll and yaw turn about one axis, but for the rounding of a rotation.
GIMBAL = 1e-15


def rotation_rpy(rpy: Array) -> Array:
    """3x3 rotation of fixed-axis roll, pitch, yaw (URDF's convention)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(R: Array) -> Array:
    """The angles (3,) rad of :func:`rotation_rpy`; where the second is a right angle, the third is taken as 0.

    Yaw first, then roll and pitch of what remains: near a pitch of 90 deg, where roll and yaw are hardly told
    apart, the three still give the rotation back to round-off. Separate arctangents lose half the digits.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0]) if np.hypot(R[0, 0], R[1, 0]) > GIMBAL else 0.0
    rest = rotation_rpy(np.array([0.0, 0.0, -yaw])) @ R
    return np.array([np.arctan2(-rest[1, 2], rest[1, 1]), np.arctan2(-rest[2, 0], rest[0, 0]), yaw])


def framed(R: Array, position: Array) -> Array:
    """Frames (..., 4, 4) from rotations (..., 3, 3) and positions (..., 3) m, broadcast to one another."""
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], position.shape[:-1]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, position, 1.0
    return T


def frame_mm_deg(values: Sequence[float]) -> Array:
    """A frame (4, 4) m from x, y, z in mm and a, b, c in deg about the fixed axes x, then y, then z (none: 0)."""
    turn = np.zeros(3)
    turn[: len(values) - 3] = np.radians(values[3:])
    return framed(rotation_rpy(turn), np.array(values[:3]) * 1e-3)


def by_frame(T: Array, n: int) -> list[tuple[Integers, Array]]:
    """Rows (k,) of n that share a frame, and that frame (4, 4); T is (4, 4), one for all, or (n, 4, 4)."""
    if T.ndim == 2:
        return [(np.arange(n), T)]
    different, which = np.unique(T.reshape(len(T), 16), axis=0, return_inverse=True)
    return [(np.flatnonzero(which == i), frame.reshape(4, 4)) for i, frame in enumerate(different)]


def inverse(T: Array) -> Array:
    """Inverse of rigid transforms (..., 4, 4)."""
    back = np.swapaxes(T[..., :3, :3], -1, -2)
    return framed(back, -(back @ T[..., :3, 3, None])[..., 0])


def frames_between(A: Array, B: Array, share: Array) -> Array:
    """Frames (m, 4, 4) on the way from A to B (m, 4, 4): origins straight, axes turned evenly the short way."""
    from scipy.spatial.transform import Rotation  # not at the start: most commands need none

    T = A.copy()
    T[:, :3, 3] += share[:, None] * (B[:, :3, 3] - A[:, :3, 3])
    turn = Rotation.from_matrix(np.swapaxes(A[:, :3, :3], 1, 2) @ B[:, :3, :3]).as_rotvec()
    T[:, :3, :3] = A[:, :3, :3] @ Rotation.from_rotvec(share[:, None] * turn).as_matrix()
    return T


def unit_vector(vector: ArrayLike, what: str) -> Array:
    """A unit vector (3,) along one of any length.

    Raises
    ------
    InputError
        Not three finite numbers, or all zero.
    """
    v = np.asarray(vector, dtype=np.float64)
    norm = float(np.linalg.norm(v)) if v.shape == (3,) else 0.0
    if not 0.0 < norm < np.inf:
        raise InputError(what, code="B001", value=v.tolist(), allowed="three finite numbers, not all zero")
    return np.asarray(v / norm)
