"""Orientations as controllers write them: KUKA's A B C, VAL3's rx ry rz, RAPID's quaternion and others; and back.

Sources: KUKA System Software programming manual (A, B, C turn about Z, then the new Y, then the new X); Staubli VAL3
reference manual (rx, ry, rz turn about X, then the new Y, then the new Z); ABB RAPID reference manual, ``orient`` (unit
quaternion, scalar first); FANUC operator's manual (W, P, R about the fixed X, Y, Z), as Yaskawa's Rx, Ry, Rz;
Kawasaki AS language reference (O, A, T about Z, then the new Y, then the new Z), as Comau's A, E, R; Universal Robots
URScript manual (rotation vector, rad).
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


def _wpr(R: Array) -> Array:
    return zyx_degrees(R)[:, ::-1]


def _from_wpr(angles: Array) -> Array:
    return from_zyx_degrees(angles[:, ::-1])


def zyz_degrees(R: Array) -> Array:
    """Angles (n, 3) deg O, A, T of rotations (n, 3, 3) = Rz(O) Ry(A) Rz(T), A from 0 to 180; O is 0 at its ends."""
    across = np.hypot(R[:, 0, 2], R[:, 1, 2])
    o = np.where(across < LOCKED, 0.0, np.arctan2(R[:, 1, 2], R[:, 0, 2]))
    a = np.arctan2(across, R[:, 2, 2])
    sin, cos = np.sin(o), np.cos(o)
    t = np.arctan2(cos * R[:, 1, 0] - sin * R[:, 0, 0], cos * R[:, 1, 1] - sin * R[:, 0, 1])
    return np.asarray(np.degrees(np.stack([o, a, t], axis=1)))


def from_zyz_degrees(angles: Array) -> Array:
    """Rotations (n, 3, 3) from O, A, T (n, 3) deg."""
    return np.asarray(Rotation.from_euler("ZYZ", angles, degrees=True).as_matrix())


def rotation_vectors(R: Array) -> Array:
    """Rotation vectors (n, 3) rad of rotations (n, 3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def from_rotation_vectors(v: Array) -> Array:
    """Rotations (n, 3, 3) from rotation vectors (n, 3) rad."""
    return np.asarray(Rotation.from_rotvec(v).as_matrix())


WPR = Orientation(_wpr, _from_wpr)
OAT = Orientation(zyz_degrees, from_zyz_degrees)
VECTOR = Orientation(rotation_vectors, from_rotation_vectors, unit=1.0)


@dataclass(frozen=True)
class Spoken:
    """An orientation as a maker's controller shows it: in words, and the table columns that hold it."""

    code: str
    words: str
    columns: tuple[str, ...]
    orientation: Orientation


SPOKEN = (
    Spoken("kuka", "KUKA A B C (deg)", ("a_deg", "b_deg", "c_deg"), ABC),
    Spoken("abb", "ABB quaternion q1 q2 q3 q4", ("qw", "qx", "qy", "qz"), QUATERNION),
    Spoken("fanuc", "FANUC W P R, Yaskawa Rx Ry Rz (deg)", ("w_deg", "p_deg", "r_deg"), WPR),
    Spoken("staubli", "Staubli rx ry rz (deg)", ("rx_deg", "ry_deg", "rz_deg"), RX_RY_RZ),
    Spoken("kawasaki", "Kawasaki O A T, Comau A E R (deg)", ("o_deg", "a_deg", "t_deg"), OAT),
    Spoken("ur", "Universal Robots rotation vector (rad)", ("rx_rad", "ry_rad", "rz_rad"), VECTOR),
    Spoken("rpy", "roll pitch yaw about fixed x y z (deg)", ("roll_deg", "pitch_deg", "yaw_deg"), WPR),
)
