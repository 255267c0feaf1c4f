"""Orientations of the tool: a tool axis with an angle gamma about it, directions over the sphere, small turns.

The tool axis leads from the tip into the holder, so it is minus the tool frame's z axis. gamma is right-handed about
the tool axis; at 0 the tool frame's x is a reference direction laid onto the plane across the axis, as in
:mod:`machining.task`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from robots.arrays import Array
from robots.frames import unit_vector

# Cosine between reference direction and tool axis above which the next base axis is taken.
NEAR = 0.966


def tool_rotations(axis: ArrayLike, gamma: ArrayLike) -> Array:
    """Tool frames' rotations (m, 3, 3) in the base frame for one tool axis (3,) and angles gamma (m,) rad.

    gamma counts from the base's x, or from y where the axis comes within some 15 deg of x. Errors: :func:`unit_vector`.
    """
    a, angle = unit_vector(axis, "tool axis"), np.atleast_1d(np.asarray(gamma, dtype=np.float64))
    near = np.abs(a)
    reference = np.eye(3)[int(np.flatnonzero(near < NEAR)[0])]
    x0 = reference - (a @ reference) * a
    x0 /= np.linalg.norm(x0)
    x = np.cos(angle)[:, None] * x0 + np.sin(angle)[:, None] * np.cross(a, x0)
    z = np.broadcast_to(-a, x.shape)
    return np.stack([x, np.cross(z, x), z], axis=2)


def directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere (golden spiral), no two alike and none at a pole.

    Neighbours are some ``sqrt(4 pi / count)`` rad apart.
    """
    i = np.arange(count) + 0.5
    z = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * i
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def spread_rotations(count: int, gammas: int) -> Array:
    """Rotations (count * gammas, 3, 3): each of :func:`directions` as tool axis, with angles gamma about it.

    The angles start elsewhere at each axis, so that they do not line up between neighbours.
    """
    axes = directions(count)
    start = 2.0 * np.pi * np.modf(np.arange(count) * 0.5 * (np.sqrt(5.0) - 1.0))[0]
    turns = 2.0 * np.pi * np.arange(gammas) / gammas
    return np.concatenate([tool_rotations(a, s + turns) for a, s in zip(axes, start, strict=True)])


def pattern(step: int, *, tilts_only: bool) -> Array:
    """Rotation vectors (k, 3) of unit length in the tool frame to try next, turned from step to step.

    Two or three perpendicular directions, each both ways; with ``tilts_only`` across the tool axis. That the pattern
    turns keeps a search from getting stuck where a joint limit cuts across it.
    """
    if tilts_only:
        angle = step * np.pi * (3.0 - np.sqrt(5.0)) + 0.5 * np.pi * np.arange(4)
        return np.column_stack([np.cos(angle), np.sin(angle), np.zeros(4)])
    rows = Rotation.random(rng=np.random.default_rng(step)).as_matrix()
    return np.concatenate([rows, -rows])
