"""Joint coordinates that make no difference to what is read."""

from __future__ import annotations

import numpy as np

from doe.planning.outset import Outset
from doe.planning.plan import experiments
from doe.planning.protocol import Protocol
from robots.arrays import Array

# Other values tried of a coordinate in each pose.
TRIALS = 4
# Information that changes by less than this share is the same.
SAME = 1e-6


def idle_coordinates(start: Outset, protocol: Protocol, poses: Array, rng: np.random.Generator) -> tuple[str, ...]:
    """Coordinates whose value changes nothing of what any experiment tells, as in q1 under a vertical load.

    Each is moved alone, in ``poses`` (n, dof) rad, to other values that the robot can take; where there are none
    it is not called idle.
    """
    robot = start.free.model.robot
    at = _information(start, poses, protocol)
    # Each parameter against the most that any pose tells of it.
    size = np.sqrt(np.max(np.diagonal(at, axis1=2, axis2=3), axis=(0, 1)))
    scale = np.where(size > 0.0, size, 1.0)
    out = []
    for k, name in enumerate(robot.coordinates):
        low, high = robot.limits[k]
        moved = np.repeat(poses, TRIALS, axis=0)
        moved[:, k] = low + rng.random(len(moved)) * (high - low)
        allowed = np.flatnonzero(robot.reachable(moved))
        if not allowed.size:
            continue
        change = _information(start, moved[allowed], protocol) - at[allowed // TRIALS]
        if np.abs(change / np.outer(scale, scale)).max() < SAME:
            out.append(name)
    return tuple(out)


def _information(start: Outset, poses: Array, protocol: Protocol) -> Array:
    """Information (n, d, p, p) of each pose and direction."""
    B = experiments(start, poses, protocol)
    p = B.shape[2]
    return np.asarray((np.swapaxes(B, 1, 2) @ B).reshape(len(poses), -1, p, p))
