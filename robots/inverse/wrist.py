"""A spherical wrist: three axes through one point, and the angles that give a hand its direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools
from robots.inverse.axis_lines import AxisLines, basis

# A target this far out of reach (share of the arm's length; rad) is on the boundary, rounded.
BOUNDARY = 1e-10
# Flagged as singular: double roots spread a rounding of 1e-16 to its square root, 1e-8.
SINGULAR = 1e-7
# The two ways at a fork of the solutions, poses behind them: front and back, up and down, no flip and flip.
FORK = np.array([[1.0], [-1.0]])


@dataclass(frozen=True)
class Wrist:
    """Axes 4, 5, 6 through the wrist centre, at any angles, as they stand at q = 0.

    Attributes
    ----------
    B4 : (3, 3) basis of axis 4 (its z) in the base frame; axis 5 lies in its xz plane, on the side of -x
    alpha, beta : rad, angles between axes 4 and 5, 5 and 6
    zero : rad, angle between the planes of axes 4, 5 and 5, 6 at q5 = 0 (0: the wrist is straight)
    outward : 1, or -1 where axes 4 and 6 count as pointing one away from and one towards the flange; the wrist is
        then straight, as a user sees it, half a turn from ``zero``'s straight
    centre_flange : (3,) m, wrist centre in the flange frame
    z6_flange, x6_flange : (3,) axis 6 and a direction across it in the flange frame
    """

    B4: Array
    alpha: float
    beta: float
    zero: float
    outward: float
    centre_flange: Array
    z6_flange: Array
    x6_flange: Array


def wrist_from(lines: AxisLines, centre: Array) -> Wrist:
    """Figures of the wrist of a robot whose last three axes meet in ``centre`` (3,) m, base frame, q = 0."""
    a4, a5, a6 = lines.direction[3:]
    B5 = basis(a5, a4)
    z6 = B5.T @ a6
    zero = float(np.arctan2(z6[1], z6[0]))
    x6 = B5 @ np.array([np.cos(zero) * z6[2], np.sin(zero) * z6[2], -np.hypot(z6[0], z6[1])])
    R_home, p_home = lines.T_home[:3, :3], lines.T_home[:3, 3]
    return Wrist(
        B4=np.column_stack([np.cross(B5[:, 1], a4), B5[:, 1], a4]),
        alpha=_angle(a4, a5),
        beta=_angle(a5, a6),
        zero=zero,
        outward=_outward(lines, centre),
        centre_flange=R_home.T @ (centre - p_home),
        z6_flange=R_home.T @ a6,
        x6_flange=R_home.T @ x6,
    )


def _outward(lines: AxisLines, centre: Array) -> float:
    """Whether axis 4 points from the elbow to the wrist and axis 6 from the wrist to the flange, or both do not."""
    _, _, a3, a4, _, a6 = lines.direction
    forearm = centre - lines.point[2]
    forearm = forearm - (forearm @ a3) * a3
    hand = lines.T_home[:3, 3] - centre
    # A flange in the wrist centre: its z points outwards by custom.
    along = [forearm @ a4, hand @ a6 if abs(hand @ a6) > 1e-6 * lines.length else lines.T_home[:3, 2] @ a6]
    return float(np.prod([-1.0 if x < -1e-6 * lines.length else 1.0 for x in along]))


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


@dataclass(frozen=True)
class Turned:
    """Both ways to turn a wrist, no flip first, for targets (..., k).

    ``q`` (..., 2, 3, k) rad: joints 4, 5, 6. ``out`` (..., k): skew axes cannot take the orientation; ``singular``
    (..., k): the wrist is straight or folded to ``SINGULAR``.
    """

    q: Array
    out: Bools
    singular: Bools


def solve_wrist(wrist: Wrist, hand: Sequence[Array], near4: Array, margin: float) -> Turned:
    """Joints 4, 5, 6 turn axis 6 and the x beside it to given directions.

    Parameters
    ----------
    hand : two (3, ..., k): where axis 6 and that x have to point, seen from body 3, in ``B4`` coordinates
    near4 : (k,) rad, joint 4 where axes 4 and 6 fall into one line and leave it free
    margin : rad, an orientation out of reach by less counts as on the edge
    """
    z6, x6 = (v[..., None, :] for v in hand)
    alpha, beta = wrist.alpha, wrist.beta
    off_axis = np.hypot(z6[0], z6[1])
    between = np.arctan2(off_axis, z6[2])  # angle between axes 4 and 6
    nearest, farthest = abs(alpha - beta), min(alpha + beta, 2.0 * np.pi - alpha - beta)
    # Spherical triangle of axes 4, 5, 6: half the angle at axis 5 from its three sides.
    bend = 2.0 * np.arctan2(
        root(np.sin(0.5 * (between + alpha - beta)) * np.sin(0.5 * (between - alpha + beta))),
        root(np.sin(0.5 * (alpha + beta + between)) * np.sin(0.5 * (alpha + beta - between))),
    )
    cos5, sin5 = np.cos(bend), np.sin(bend)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    asked = np.arctan2(z6[1], z6[0])
    given = np.arctan2(sb * sin5, ca * sb * cos5 - sa * cb)
    sign = wrist.outward * FORK
    q4 = np.where(off_axis < BOUNDARY, near4, asked - sign * given)
    cos4, sin4 = np.cos(q4), np.sin(q4)
    x, y = cos4 * x6[0] + sin4 * x6[1], cos4 * x6[1] - sin4 * x6[0]
    x, z = ca * x + sa * x6[2], ca * x6[2] - sa * x
    x, y = cos5 * x + sign * sin5 * y, cos5 * y - sign * sin5 * x
    return Turned(
        np.stack([q4, sign * bend - wrist.zero, np.arctan2(y, cb * x - sb * z)], axis=-2),
        ((nearest - between > margin) | (between - farthest > margin))[..., 0, :],
        ((bend < SINGULAR) | (np.pi - bend < SINGULAR))[..., 0, :],
    )


def root(square: Array) -> Array:
    """Square root; what rounding made negative counts as zero."""
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))
