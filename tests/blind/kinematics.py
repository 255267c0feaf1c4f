"""Where joints, bodies and the tool point are, for a batch of poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arm import Arm, Array


@dataclass(frozen=True)
class Frames:
    """Bodies 0 (base) to 6 and joint axes, all in base axes."""

    origins: Array  # (n, 7, 3) of the bodies; body i + 1 sits on joint i's axis
    rotations: Array  # (n, 7, 3, 3)
    axes: Array  # (n, 6, 3) unit
    housings: Array  # (n, 6, 3, 3) the frame each joint turns in, before its rotation
    tool: Array  # (n, 3)


def turn(axis: Array, angle: Array) -> Array:
    """Rotation matrices (n, 3, 3) about a fixed unit axis (Rodrigues)."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def frames(arm: Arm, q: Array) -> Frames:
    """Frames at joint angles ``q`` (n, 6), rad, in the robot's own coordinates."""
    n = len(q)
    R, o = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    rotations, origins, axes, housings = [R], [o], [], []
    for i in range(6):
        o = o + R @ arm.translations[i]
        R = R @ arm.rotations[i]
        housings.append(R)
        axes.append(R @ arm.axes[i])
        R = R @ turn(arm.axes[i], arm.signs[i] * q[:, i] + arm.offsets[i])
        o = o + arm.shifts[i] * (R @ arm.axes[i])
        rotations.append(R)
        origins.append(o)
    tool = o + R @ arm.flange
    return Frames(np.stack(origins, 1), np.stack(rotations, 1), np.stack(axes, 1), np.stack(housings, 1), tool)


def allowed(arm: Arm, q: Array, share: float = 0.8) -> Array:
    """Which poses (n, 6) keep within ``share`` of the limits, couplings, and clear of floor and pedestal."""
    middle, half = arm.limits.mean(1), np.diff(arm.limits, axis=1)[:, 0] / 2
    good = np.all(np.abs(q - middle) <= share * half + 1e-9, axis=1)
    for factors, offset, low, high in arm.couplings:
        value = q @ factors + offset
        good &= (value >= low) & (value <= high)
    at = frames(arm, q)
    for point in (at.tool, at.origins[:, 4]):  # tool point and wrist centre
        good &= (point[:, 2] > 0.15) & (np.hypot(point[:, 0], point[:, 1]) > 0.6)
    return good
