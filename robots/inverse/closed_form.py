"""Inverse kinematics of arms with a spherical wrist in closed form, for many targets at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Bools, in_blocks
from robots.inverse.branches import Reason
from robots.inverse.spherical_wrist import SphericalWristArm
from robots.inverse.wrist import BOUNDARY, FORK, SINGULAR, root, solve_wrist

# Targets a pass: the arrays of one pass then stay in the processor's cache.
CHUNK = 2048


@dataclass(frozen=True)
class ClosedForm:
    """Angles of all eight branches for n targets, arrays (n, 8, ...), targets contiguous in memory.

    ``q`` (n, 8, 6) rad, not yet turned into limits, NaN where there is no solution; ``reason`` (n, 8) of the
    missing ones (FOUND or out of reach, limits are not looked at); ``singular`` (n, 8, 3).
    """

    q: Array
    reason: NDArray[np.int8]
    singular: Bools

    @staticmethod
    def of(q: Array, reason: NDArray[np.int8], singular: Bools) -> ClosedForm:
        """From arrays (8, 6, n), (8, n) and (8, 3, n): what is missing has neither angles nor marks."""
        missing = reason != Reason.FOUND
        q.swapaxes(0, 1)[:, missing] = np.nan
        singular.swapaxes(0, 1)[:, missing] = False
        return ClosedForm(np.moveaxis(q, -1, 0), reason.T, np.moveaxis(singular, -1, 0))


def closed_form(arm: SphericalWristArm, T_base_flange: Array, near: Array) -> ClosedForm:
    """All eight branches of the arm for n flange frames; a loop over branches, none over targets.

    Parameters
    ----------
    arm : from :func:`robots.inverse.spherical_wrist.spherical_wrist_arm`
    T_base_flange : (n, 4, 4), rotations orthonormal (not checked here)
    near : (n, 6) rad: joint 1, 2 or 4 where the target leaves it free

    Notes
    -----
    Pieper's decoupling (D. L. Pieper, The kinematics of manipulators under computer control, Stanford 1968): the
    wrist centre depends on joints 1 to 3, and its way along axis 2 on joint 1 alone. What remains are three
    triangles: two plane ones and a spherical one. Each is solved for half its angle by two-argument
    arctangents of square roots, which keeps digits next to singularities where an arccosine loses half of
    them. Every later angle is computed from the earlier ones as rounded, so errors do not add up: mapped back,
    the targets are met within some 1e-15 of the arm's length, or ``BOUNDARY`` at the edge of reach.
    """
    n = len(T_base_flange)
    # Forks first: front and back, up and down, no flip and flip.
    q = np.empty((2, 2, 2, 6, n))
    reason = np.zeros((2, 2, 2, n), dtype=np.int8)
    singular = np.zeros((2, 2, 2, 3, n), dtype=np.bool_)
    for part in in_blocks(n, CHUNK):
        T = np.ascontiguousarray(np.moveaxis(T_base_flange[part], 0, -1))
        _solve(arm, T, near[part].T, q[..., part], reason[..., part], singular[..., part])
    return ClosedForm.of(q.reshape(8, 6, n), reason.reshape(8, n), singular.reshape(8, 3, n))


def _solve(arm: SphericalWristArm, T: Array, near: Array, q: Array, reason: NDArray[np.int8], singular: Bools) -> None:
    """One pass: T (4, 4, k), near (6, k), and views of the results, forks first and poses last."""
    R, p, margin = T[:3, :3], T[:3, 3], arm.margin_m
    place = arm.B1.T @ (p + times(R, arm.wrist.centre_flange) - arm.p1[:, None])
    # Axis 6 and the x beside it, in B1 coordinates: what the wrist has to bring about.
    hand = (arm.B1.T @ times(R, arm.wrist.z6_flange), arm.B1.T @ times(R, arm.wrist.x6_flange))
    radius = np.hypot(place[0], place[1])
    across = (arm.along_2 - arm.cos12 * place[2]) / arm.sin12
    swing = 2.0 * np.arctan2(root(radius - across), root(radius + across))
    free = (radius < BOUNDARY * arm.length) & (np.abs(across) < margin)
    q1 = np.where(free, near[0] + np.pi * (FORK < 0.0), np.arctan2(place[1], place[0]) - arm.front * FORK * swing)
    place = _seen(q1, place)
    hand = (_in_basis(arm.R_21, _seen(q1, hand[0])), _in_basis(arm.R_21, _seen(q1, hand[1])))
    wrist = _in_basis(arm.R_21, place)[:2] - arm.t_21[:2, None, None]

    # Joints 2 and 3 bring the wrist centre to ``wrist`` across axis 2.
    upper, fore = arm.upper, arm.fore
    distance = np.hypot(wrist[0], wrist[1])
    stretch = (upper + fore - distance) * (upper + fore + distance)
    fold = (distance - abs(upper - fore)) * (distance + abs(upper - fore))
    bend = 2.0 * np.arctan2(root(stretch), root(fold))
    elbow = arm.elbow_up * (FORK[:, None] * FORK) * bend[:, None]
    q2 = np.arctan2(wrist[1], wrist[0])[:, None] - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
    q2 = np.where((distance < BOUNDARY * arm.length)[:, None], near[1], q2)
    pitch = q2 + elbow - arm.elbow_zero
    z6, x6 = (_in_basis(arm.R_42, _seen(pitch, v[:, :, None])) for v in hand)

    turned = solve_wrist(arm.wrist, (z6, x6), near[3], arm.margin_rad)
    q[..., 0, :], q[..., 1, :] = q1[:, None, None], q2[:, :, None]
    q[..., 2, :] = (arm.sign3 * (elbow - arm.elbow_zero))[:, :, None]
    q[..., 3:, :] = turned.q
    singular[..., 0, :] = (np.abs(place[1]) < SINGULAR * arm.length)[:, None, None]
    singular[..., 1, :] = ((bend < SINGULAR) | (np.pi - bend < SINGULAR))[:, None, None]
    singular[..., 2, :] = turned.singular[..., None, :]
    # What comes first on the way from the base counts, so it is written last.
    np.copyto(reason, Reason.ORIENTATION, where=turned.out[..., None, :], casting="unsafe")
    np.copyto(reason, Reason.TOO_NEAR, where=(abs(upper - fore) - distance > margin)[:, None, None], casting="unsafe")
    np.copyto(reason, Reason.TOO_FAR, where=(distance - upper - fore > margin)[:, None, None], casting="unsafe")
    np.copyto(reason, Reason.SHOULDER, where=np.abs(across) - radius > margin, casting="unsafe")


def _seen(angle: Array, v: Array) -> Array:
    """Vectors (3, ...) as seen from axes turned by angles (...) about z."""
    cos, sin = np.cos(angle), np.sin(angle)
    out = np.empty((3, *angle.shape))
    out[0], out[1], out[2] = cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]
    return out


def _in_basis(R: Array, v: Array) -> Array:
    """``R v`` for one rotation (3, 3) and vectors (3, ...)."""
    return np.asarray((R @ v.reshape(3, -1)).reshape(v.shape))


def times(R: Array, v: Array) -> Array:
    """``R v`` for rotations (3, 3, k) and one vector (3,)."""
    return np.asarray(R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2])
