"""Inverse kinematics of arms with a spherical wrist in closed form, for many targets at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Bools
from robots.inverse.branches import Reason
from robots.inverse.spherical_wrist import SphericalWristArm
from robots.inverse.wrist import BOUNDARY, SINGULAR, root, solve_wrist

# Targets a pass: the arrays of one pass then stay in the processor's cache.
CHUNK = 2048
# Up to this many targets the four wrists of a pass are solved at once: calls of numpy are what counts then.
FEW = 64


@dataclass(frozen=True)
class ClosedForm:
    """Angles of all eight branches for n targets, arrays (n, 8, ...), targets contiguous in memory.

    ``q`` (n, 8, 6) rad, not yet turned into limits, NaN where there is no solution; ``reason`` (n, 8) of the
    missing ones (FOUND or out of reach, limits are not looked at); ``singular`` (n, 8, 3).
    """

    q: Array
    reason: NDArray[np.int8]
    singular: Bools


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
    q = np.empty((8, 6, n))
    reason = np.zeros((8, n), dtype=np.int8)
    singular = np.zeros((8, 3, n), dtype=np.bool_)
    for start in range(0, n, CHUNK):
        part = slice(start, start + CHUNK)
        T = np.ascontiguousarray(np.moveaxis(T_base_flange[part], 0, -1))
        _solve(arm, T, near[part].T, q[:, :, part], reason[:, part], singular[:, :, part])
    missing = reason != Reason.FOUND
    q.swapaxes(0, 1)[:, missing] = np.nan
    singular.swapaxes(0, 1)[:, missing] = False
    return ClosedForm(np.moveaxis(q, -1, 0), reason.T, np.moveaxis(singular, -1, 0))


def _solve(arm: SphericalWristArm, T: Array, near: Array, q: Array, reason: NDArray[np.int8], singular: Bools) -> None:
    """One pass: T (4, 4, k), near (6, k), and views of the results, poses last."""
    R, p = T[:3, :3], T[:3, 3]
    x1, y1, z1 = arm.B1.T @ (p + times(R, arm.wrist.centre_flange) - arm.p1[:, None])
    # Axis 6 and the x beside it, in B1 coordinates: what the wrist has to bring about.
    hand = (arm.B1.T @ times(R, arm.wrist.z6_flange), arm.B1.T @ times(R, arm.wrist.x6_flange))
    margin = arm.margin_m
    radius = np.hypot(x1, y1)
    across = (arm.along_2 - arm.cos12 * z1) / arm.sin12
    swing = 2.0 * np.arctan2(root(radius - across), root(radius + across))
    free = (radius < BOUNDARY * arm.length) & (np.abs(across) < margin)
    straight = np.arctan2(y1, x1)
    reason[:, np.abs(across) - radius > margin] = Reason.SHOULDER
    hands: list[list[Array]] = []
    for back in (0, 1):
        side = arm.front * (1.0 - 2.0 * back)
        q1 = np.where(free, near[0] + np.pi * back, straight - side * swing)
        cos, sin = np.cos(q1), np.sin(q1)
        place = np.stack([cos * x1 + sin * y1, cos * y1 - sin * x1, z1])
        rows = slice(4 * back, 4 * back + 4)
        q[rows, 0] = q1
        singular[rows, 0] = np.abs(place[1]) < SINGULAR * arm.length
        turned = [arm.R_21 @ np.stack([cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]]) for v in hand]
        seen = (arm.R_21 @ place)[:2] - arm.t_21[:2, None]
        hands += _solve_elbow(arm, seen, turned, side * arm.front, near, q[rows], reason[rows], singular[rows])
    if T.shape[-1] <= FEW:
        _solve_wrists(arm, hands, near, q, reason, singular)
        return
    for i, turned in enumerate(hands):
        rows = slice(2 * i, 2 * i + 2)
        solve_wrist(arm.wrist, turned, near[3], arm.margin_rad, q[rows], reason[rows], singular[rows])


def _solve_wrists(
    arm: SphericalWristArm, hands: list[list[Array]], near: Array, q: Array, reason: NDArray[np.int8], singular: Bools
) -> None:
    """The wrists of all four arms in one call, side by side."""
    k = q.shape[-1]
    z6, x6 = (np.concatenate(parts, axis=1) for parts in zip(*hands, strict=True))
    # Rows (flip), columns (arm, target) of what solve_wrist reads and writes.
    side = reason.reshape(4, 2, k).swapaxes(0, 1).reshape(2, 4 * k)
    angles, marks = np.empty((2, 6, 4 * k)), np.zeros((2, 3, 4 * k), dtype=np.bool_)
    solve_wrist(arm.wrist, (z6, x6), np.tile(near[3], 4), arm.margin_rad, angles, side, marks)
    for flip in (0, 1):
        q[flip::2, 3:] = angles[flip, 3:].reshape(3, 4, k).swapaxes(0, 1)
        reason[flip::2] = side[flip].reshape(4, k)
        singular[flip::2, 2] = marks[flip, 2].reshape(4, k)


def _solve_elbow(
    arm: SphericalWristArm,
    wrist: Array,
    hand: list[Array],
    side: float,
    near: Array,
    q: Array,
    reason: NDArray[np.int8],
    singular: Bools,
) -> list[list[Array]]:
    """Joints 2 and 3 bring the wrist centre to ``wrist`` (2, k) across axis 2; returns what is left to the wrists."""
    margin = arm.margin_m
    upper, fore = arm.upper, arm.fore
    distance = np.hypot(wrist[0], wrist[1])
    stretch = (upper + fore - distance) * (upper + fore + distance)
    fold = (distance - abs(upper - fore)) * (distance + abs(upper - fore))
    reason[:, (distance - upper - fore > margin) & (reason[0] == 0)] = Reason.TOO_FAR
    reason[:, (abs(upper - fore) - distance > margin) & (reason[0] == 0)] = Reason.TOO_NEAR
    bend = 2.0 * np.arctan2(root(stretch), root(fold))
    towards = np.arctan2(wrist[1], wrist[0])
    free = distance < BOUNDARY * arm.length
    singular[:, 1] = (bend < SINGULAR) | (np.pi - bend < SINGULAR)
    hands = []
    for down in (0, 1):
        elbow = arm.elbow_up * side * (1.0 - 2.0 * down) * bend
        q2 = towards - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
        q2 = np.where(free, near[1], q2)
        rows = slice(2 * down, 2 * down + 2)
        q[rows, 1], q[rows, 2] = q2, arm.sign3 * (elbow - arm.elbow_zero)
        pitch = q2 + elbow - arm.elbow_zero
        cos, sin = np.cos(pitch), np.sin(pitch)
        hands.append([arm.R_42 @ np.stack([cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]]) for v in hand])
    return hands


def times(R: Array, v: Array) -> Array:
    """``R v`` for rotations (3, 3, k) and one vector (3,)."""
    return np.asarray(R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2])
