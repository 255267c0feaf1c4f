"""Rigid-body fits of retroreflector coordinates: how one arm moved against its neighbour, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import InputError
from robots.arrays import Array

FEWEST = 3
# Second singular value of the reflectors' spread over the first: below it a turn about their line is not seen.
THIN = 0.05


@dataclass(frozen=True)
class Motion:
    """Rigid motion of a body, small: ``x -> x + t + r x (x - origin)``.

    ``twist`` (6,): t (m), r (rad) in the axes of the coordinates, at ``origin``; ``covariance`` (6, 6) for noise of
    one (m) in each coordinate of each reflector, unloaded and loaded; ``residuals`` (k, 3) m.
    """

    twist: Array
    covariance: Array
    residuals: Array


def kabsch(before: Array, after: Array) -> tuple[Array, Array]:
    """Rotation R (3, 3) and centroid shift: least-squares rigid motion ``after ~ R (before - mean) + mean'``.

    Kabsch (1976), doi:10.1107/S0567739476001873; Horn (1987) gives the same by quaternions.

    Returns
    -------
    R, and the difference of the centroids (3,)
    """
    a, b = before - before.mean(axis=0), after - after.mean(axis=0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    D = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    return np.asarray(Vt.T @ D @ U.T), after.mean(axis=0) - before.mean(axis=0)


def rotation_vector(R: Array) -> Array:
    """Axis times angle (3,) rad of a rotation by less than a quarter turn."""
    axis = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(axis))
    return axis * (np.arcsin(min(sine, 1.0)) / sine) if sine > 0.0 else axis


def motion(unloaded: Array, loaded: Array, origin: Array, what: str) -> Motion:
    """Motion of an arm from its reflectors (k, 3) m before and under the load, at ``origin`` (3,).

    Raises
    ------
    InputError
        Fewer than three reflectors, or reflectors nearly in line: the turn about that line is not seen.
    """
    if len(unloaded) < FEWEST:
        raise InputError(
            f"{what}: reflectors",
            value=len(unloaded),
            allowed=f"{FEWEST} or more, not in line",
            remedy="a rigid body's motion needs three points",
        )
    spread = np.linalg.svd(unloaded - unloaded.mean(axis=0), compute_uv=False)
    if spread[1] < THIN * spread[0]:
        raise InputError(
            f"{what}: reflectors nearly in line",
            value=f"spread across the line {spread[1] / max(spread[0], 1e-300):.3f} of that along it",
            allowed=f"{THIN} or more",
            remedy="move one reflector away from the line: the turn about it cannot be seen",
        )
    R, shift = kabsch(unloaded, loaded)
    r = rotation_vector(R)
    centre = unloaded.mean(axis=0)
    moved = (R @ (unloaded - centre).T).T + centre + shift
    t = shift + (R - np.eye(3)) @ (origin - centre)
    return Motion(np.concatenate([t, r]), _covariance(unloaded - origin), loaded - moved)


def _covariance(arms: Array) -> Array:
    """Covariance of t and r for unit noise in unloaded and loaded coordinates alike: (sum G^T G)^-1 times two."""
    G = np.zeros((len(arms), 3, 6))
    G[:, :, :3] = np.eye(3)
    x, y, z = arms.T
    zero = np.zeros(len(arms))
    # r x a = -[a]x r.
    G[:, :, 3:] = np.stack([np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1), np.stack([y, -x, zero], 1)], axis=1)
    # Scaled to the reflectors' size, so that metres and radians do not spoil the inversion.
    size = np.concatenate([np.ones(3), np.full(3, 1.0 / max(np.linalg.norm(arms, axis=1).max(), 1e-9))])
    A = np.einsum("kia,kib->ab", G * size, G * size)
    return np.asarray(2.0 * np.outer(size, size) * np.linalg.inv(A))


def relative(before: Motion, behind: Motion, R: Array) -> tuple[Array, Array]:
    """Twist (6,) of the arm behind a joint against the arm before it, in axes R (3, 3), and its covariance (6, 6).

    Both motions at the same origin and of the same noise.
    """
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = R.T
    twist = turn @ (behind.twist - before.twist)
    return twist, turn @ (behind.covariance + before.covariance) @ turn.T
