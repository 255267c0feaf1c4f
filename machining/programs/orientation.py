"""Orientations as controllers write them: KUKA's A B C, VAL3's rx ry rz, RAPID's quaternion; and back.

Sources: KUKA System Software programming manual (A, B, C turn about Z, then the new Y, then the new X); Staubli VAL3
reference manual (rx, ry, rz turn about X, then the new Y, then the new Z); ABB RAPID reference manual, ``orient`` (unit
quaternion, scalar first).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from robots.arrays import Array

# Sine of the middle angle's distance from 90 deg below which the first angle is given as 0: the third is then found
# from it, so that the orientation is right to this figure in rad whatever the first is.
LOCKED = 1e-9


def zyx_degrees(R: Array) -> Array:
    """Angles (n, 3) deg A, B, C of rotations (n, 3, 3) = Rz(A) Ry(B) Rx(C); A is 0 where B is +-90."""
    across = np.hypot(R[:, 0, 0], R[:, 1, 0])
    a = np.where(across < LOCKED, 0.0, np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    b = np.arctan2(-R[:, 2, 0], across)
    sin, cos = np.sin(a), np.cos(a)
    c = np.arctan2(sin * R[:, 0, 2] - cos * R[:, 1, 2], cos * R[:, 1, 1] - sin * R[:, 0, 1])
    return np.asarray(np.degrees(np.stack([a, b, c], axis=1)))


def from_zyx_degrees(angles: Array) -> Array:
    """Rotations (n, 3, 3) from A, B, C (n, 3) deg."""
    return np.asarray(Rotation.from_euler("ZYX", angles, degrees=True).as_matrix())


def xyz_degrees(R: Array) -> Array:
    """Angles (n, 3) deg rx, ry, rz of rotations (n, 3, 3) = Rx(rx) Ry(ry) Rz(rz); rx is 0 where ry is +-90."""
    across = np.hypot(R[:, 1, 2], R[:, 2, 2])
    a = np.where(across < LOCKED, 0.0, np.arctan2(-R[:, 1, 2], R[:, 2, 2]))
    b = np.arctan2(R[:, 0, 2], across)
    sin, cos = np.sin(a), np.cos(a)
    c = np.arctan2(cos * R[:, 1, 0] + sin * R[:, 2, 0], cos * R[:, 1, 1] + sin * R[:, 2, 1])
    return np.asarray(np.degrees(np.stack([a, b, c], axis=1)))


def from_xyz_degrees(angles: Array) -> Array:
    """Rotations (n, 3, 3) from rx, ry, rz (n, 3) deg."""
    return np.asarray(Rotation.from_euler("XYZ", angles, degrees=True).as_matrix())


def quaternions(R: Array) -> Array:
    """Unit quaternions (n, 4), scalar first and not negative, of rotations (n, 3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True))


def from_quaternions(q: Array) -> Array:
    """Rotations (n, 3, 3) from quaternions (n, 4), scalar first, of about length 1."""
    return np.asarray(Rotation.from_quat(q, scalar_first=True).as_matrix())


@dataclass(frozen=True)
class Orientation:
    """How a language writes rotations (n, 3, 3), and reads them back.

    ``decimals``: which of the options' digits its numbers have; ``unit``: rad for each unit of the last digit.
    """

    write: Callable[[Array], Array]
    read: Callable[[Array], Array]
    decimals: Literal["angle", "quaternion"] = "angle"
    unit: float = float(np.radians(1.0))


ABC = Orientation(zyx_degrees, from_zyx_degrees)
RX_RY_RZ = Orientation(xyz_degrees, from_xyz_degrees)
QUATERNION = Orientation(quaternions, from_quaternions, "quaternion", 2.0)
