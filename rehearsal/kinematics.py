"""Where joints, bodies and the tool point are, for a batch of poses."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from rehearsal.arm import Arm
from robots.arrays import Array, Bools, Indices

# Clear of floor and pedestal: heights and distances from the first axis, m. For arms of some 2 to 3 m reach.
CLEAR = (0.15, 0.6)


@dataclass(frozen=True)
class Frames:
    """Bodies 0 (base) to n and joint axes, all in base axes, at m poses."""

    origins: Array  # (m, n + 1, 3) of the bodies; body i + 1 sits on joint i's axis
    rotations: Array  # (m, n + 1, 3, 3)
    axes: Array  # (m, n, 3) unit
    housings: Array  # (m, n, 3, 3) the frame each joint turns in, before its rotation
    hand: Array  # (m, 3, 3) the flange's axes
    point: Array  # (m, 3) the model's tool point
    tool: Array  # (m, 3) where loads act and displacements are read

    def at(self, rows: Indices) -> Frames:
        """The frames of some poses, or of some of them several times."""
        return Frames(**{f.name: getattr(self, f.name)[rows] for f in dataclasses.fields(self)})


def turn(axis: Array, angle: Array) -> Array:
    """Rotation matrices (m, 3, 3) about a fixed unit axis (Rodrigues)."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + s * K + (1 - c) * (K @ K))


def rotation_of(rpy: Array) -> Array:
    """Rotation (3, 3) by roll, pitch and yaw about the fixed axes x, y, z, one after the other."""
    x, y, z = (turn(axis, angle[None])[0] for axis, angle in zip(np.eye(3), np.asarray(rpy), strict=True))
    return np.asarray(z @ y @ x)


def z_to(axis: Array) -> Array:
    """Rotation (3, 3) that brings z onto a unit axis by the shortest way; below the xy plane from x's half turn on.

    So model files have the axes of a joint's bearing.
    """
    if axis[2] < 0:
        half = np.diag([1.0, -1.0, -1.0])
        return np.asarray(half @ z_to(half @ axis))
    cross = np.array([-axis[1], axis[0], 0.0])
    size = np.linalg.norm(cross)
    if size < 1e-15:
        return np.eye(3)
    return np.asarray(turn(cross / size, np.array([np.arctan2(size, axis[2])]))[0])


def frames(arm: Arm, q: Array, point: Array | None = None) -> Frames:
    """Frames at joint angles ``q`` (m, n), rad, in the robot's own coordinates.

    ``point`` (m, 3) in the flange frame: where loads act and displacements are read; NaN or None: the tool point.
    """
    m = len(q)
    R, o = np.broadcast_to(np.eye(3), (m, 3, 3)), np.zeros((m, 3))
    rotations, origins, axes, housings = [R], [o], [], []
    for i in range(arm.dof):
        o = o + R @ arm.translations[i]
        R = R @ arm.rotations[i]
        housings.append(R)
        axes.append(R @ arm.axes[i])
        R = R @ turn(arm.axes[i], arm.signs[i] * q[:, i] + arm.offsets[i])
        o = o + arm.shifts[i] * (R @ arm.axes[i])
        rotations.append(R)
        origins.append(o)
    flange, hand = o + R @ arm.flange, R @ arm.flange_turn
    own = flange + hand @ arm.tool
    tool = own
    if point is not None:
        there = flange + np.einsum("nij,nj->ni", hand, np.nan_to_num(point))
        tool = np.where(np.isnan(point).any(axis=1, keepdims=True), own, there)
    return Frames(
        np.stack(origins, 1), np.stack(rotations, 1), np.stack(axes, 1), np.stack(housings, 1), hand, own, tool
    )


def allowed(arm: Arm, q: Array, share: float = 0.8, clear: tuple[float, float] = CLEAR) -> Bools:
    """Which poses (m, n) keep within ``share`` of the limits, couplings, and clear of floor and pedestal."""
    middle, half = arm.limits.mean(1), np.diff(arm.limits, axis=1)[:, 0] / 2
    good = np.all(np.abs(q - middle) <= share * half + 1e-9, axis=1)
    for factors, offset, low, high in arm.couplings:
        value = q @ factors + offset
        good &= (value >= low) & (value <= high)
    at = frames(arm, q)
    for point in (at.tool, at.origins[:, max(arm.dof - 2, 1)]):  # tool point and, of six joints, wrist centre
        good &= (point[:, 2] > clear[0]) & (np.hypot(point[:, 0], point[:, 1]) > clear[1])
    return np.asarray(good)
