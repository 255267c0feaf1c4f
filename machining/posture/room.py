"""Room around a posture: what an arm without known springs is posed by.

Where nothing is known in N/mm, no posture is stiffer than another. Then a posture is good that has its elbow up, is far
from the limits of the joints and far from singularities; steps are weighed by :class:`machining.Drive` as always.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from machining.posture.drive import limit_distance, singular_distance
from robots import Robot, forward_kinematics
from robots.arrays import Array, Bools, in_blocks

# Distances from which on more is no better: rad from a joint limit, and of singular_distance.
LIMIT_ROOM, SINGULAR_ROOM = float(np.radians(45.0)), 0.5
# Cosine from which on two axes count as parallel.
PARALLEL = 0.9
# Poses whose frames are made at once.
BLOCK = 16_384


def room(robot: Robot, q: Array) -> Array:
    """Room (k,) of poses q (k, dof) rad: half by the limits, half by singularities, and 1 for the elbow up; 0 to 2."""
    limits = np.clip(limit_distance(robot, q) / LIMIT_ROOM, 0.0, 1.0)
    singular = np.clip(singular_distance(robot, q) / SINGULAR_ROOM, 0.0, 1.0)
    return np.asarray(0.5 * (limits + singular) + elbow_up(robot, q))


def elbow_up(robot: Robot, q: Array) -> Bools:
    """Whether the elbow is above the line from shoulder to wrist, (k,); "above" counts along z of the base."""
    if robot.dof < 4:
        return np.zeros(len(q), dtype=np.bool_)
    elbow, up = _elbow(robot), np.zeros(len(q), dtype=np.bool_)
    for rows in in_blocks(len(q), BLOCK):
        p = forward_kinematics(robot, q[rows]).p
        line, off = p[:, robot.dof - 1] - p[:, 2], p[:, elbow] - p[:, 2]
        length = np.maximum(np.einsum("ni,ni->n", line, line), 1e-12)
        up[rows] = off[:, 2] - np.einsum("ni,ni->n", off, line) / length * line[:, 2] >= 0.0
    return up


@lru_cache(maxsize=8)
def _elbow(robot: Robot) -> int:
    """The body at whose joint the arm bends: the first after joint 2 with an axis parallel to that of joint 2."""
    axis = forward_kinematics(robot, np.zeros((1, robot.dof))).axis[0]
    bends = np.flatnonzero(np.abs(axis[2:] @ axis[1]) > PARALLEL)
    return 3 + int(bends[0]) if len(bends) else 3
