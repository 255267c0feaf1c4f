"""Arms with a spherical wrist: seen from the axis lines, and reduced to the figures of the closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from robots.inverse.axis_lines import axis_lines, basis, nearest_point
from robots.inverse.wrist import BOUNDARY, Wrist, wrist_from
from robots.kept import once_for_each
from robots.robot import Robot

# Axes that miss by less than this (m, rad) do so by rounding: the closed form is then as exact as the frames.
EXACT = 1e-11
# Above this share of the arm's length (lines) or this angle, an arm is another kind, not a rounded one.
NEARLY_LENGTH, NEARLY_RAD = 2e-3, 5e-3
# Below this (share of the arm's length, or sine of an angle) two axes are taken as one, or as parallel.
DEGENERATE = 1e-6


@dataclass(frozen=True)
class SphericalWristArm:
    """A 6R arm whose axes 4, 5, 6 meet in the wrist centre and whose axes 2 and 3 are parallel.

    Angles between axes 1 and 2, 4 and 5, 5 and 6 are free, and so are all lengths. Bases have their z along
    the axis of their number; all of them stand as at q = 0.

    Attributes
    ----------
    B1 : (3, 3) basis of axis 1 in the base frame; axis 2 lies in its xz plane
    p1 : (3,) m, a point on axis 1
    R_21, t_21 : (3, 3), (3,) m: ``x2 = R_21 x1 - t_21`` takes B1 coordinates about ``p1`` to B2 coordinates
        about axis 2; x of B2 points from axis 2 to axis 3
    R_42 : (3, 3): B2 coordinates to those of the wrist's B4
    sin12, cos12 : of the angle between axes 1 and 2
    along_2 : m, the wrist centre along axis 2, from ``p1`` (what the lateral offsets add up to)
    upper, fore : m, distance between axes 2 and 3, and from axis 3 to the wrist centre across axis 3
    elbow_zero : rad, angle from upper arm to forearm at q3 = 0 (0: stretched)
    sign3 : 1, or -1 where the coordinates 2 and 3 count against one another
    wrist : joints 4 to 6
    front : 1 or -1: the side of ``B1``'s y axis that is the arm's front
    elbow_up : 1 or -1: sign of the elbow's angle, times ``front``'s side, that is "up"
    deviation : m or rad, by how much the real axes miss this picture at most; 0 to ``EXACT`` is rounding
    length : m, the arm stretched out, flange included
    """

    B1: Array
    p1: Array
    R_21: Array
    t_21: Array
    R_42: Array
    sin12: float
    cos12: float
    along_2: float
    upper: float
    fore: float
    elbow_zero: float
    sign3: float
    wrist: Wrist
    front: float
    elbow_up: float
    deviation: float
    length: float

    @property
    def exact(self) -> bool:
        """Whether the closed form is the robot's own, not that of a neighbour within rounding of its file."""
        return self.deviation <= EXACT

    @property
    def margin_m(self) -> float:
        """How far (m) beyond the edge of reach a target still counts as on it."""
        return BOUNDARY * self.length if self.exact else 10.0 * self.deviation * (1.0 + self.length)

    @property
    def margin_rad(self) -> float:
        """The same for orientations (rad) that a skew wrist cannot take."""
        return BOUNDARY if self.exact else 100.0 * self.deviation


def why_no_spherical_wrist(robot: Robot) -> str | None:
    """Say in words why the robot is no six-joint arm with a spherical wrist; None if it is."""
    if robot.dof != 6:
        return f"it has {robot.dof} joints, not 6"
    lines = axis_lines(robot)
    _, miss = nearest_point(lines.direction[3:], lines.point[3:])
    if miss > NEARLY_LENGTH * lines.length:
        return f"axes 4, 5 and 6 miss one another by {miss * 1e3:.3g} mm"
    sine = _sines(lines.direction)
    for pair, names in ((3, "4 and 5"), (4, "5 and 6")):
        if sine[pair] < DEGENERATE:
            return f"axes {names} are parallel"
    return None


@once_for_each
def why_not_spherical(robot: Robot) -> str | None:
    """Say in words why the robot is none of the arms of :class:`SphericalWristArm`; None if it is one."""
    reason = why_no_spherical_wrist(robot)
    if reason is not None:
        return reason
    lines = axis_lines(robot)
    a, p, sine, size = lines.direction, lines.point, _sines(lines.direction), lines.length
    if sine[1] > NEARLY_RAD:
        return f"axes 2 and 3 are {np.degrees(np.arctan2(sine[1], abs(a[1] @ a[2]))):.3g} deg from parallel"
    if sine[0] < DEGENERATE:
        return "axes 1 and 2 are parallel"
    centre, _ = nearest_point(a[3:], p[3:])
    for end, words in ((p[2] - p[1], "axes 2 and 3 are one"), (centre - p[2], "the wrist centre lies on axis 3")):
        if np.linalg.norm(np.cross(a[1], end)) < DEGENERATE * size:
            return words
    return None


@once_for_each
def spherical_wrist_arm(robot: Robot) -> SphericalWristArm:
    """Reduce a robot to the figures of the closed form; found from its axis lines, not from names.

    A robot whose axes miss the picture by a rounding of its file is taken all the same; ``deviation`` says so.

    Raises
    ------
    InputError
        The robot is of another kind; the message says in what.
    """
    reason = why_not_spherical(robot)
    if reason is not None:
        raise InputError(
            f"closed-form inverse kinematics of {robot.name}",
            code="R004",
            value=reason,
            allowed="six joints, axes 4 to 6 through one point, axes 2 and 3 parallel",
            remedy="use the numerical solver",
        )
    lines = axis_lines(robot)
    centre, miss = nearest_point(lines.direction[3:], lines.point[3:])
    a, p = lines.direction, lines.point
    sign3 = float(np.sign(a[1] @ a[2]))
    a2 = a[1] + sign3 * a[2]
    a2 = a2 / np.linalg.norm(a2)
    deviation = max(miss, float(np.linalg.norm(a[1] - a2)), float(np.linalg.norm(sign3 * a[2] - a2)))

    cos12, sin12 = float(a[0] @ a2), float(np.linalg.norm(np.cross(a[0], a2)))
    B1 = basis(a[0], a2)
    B2 = basis(a2, p[2] - p[1])
    to_fore = B2.T @ (centre - p[2])
    front = _front(B1, p[1] - p[0], lines.length)
    wrist = wrist_from(lines, centre)
    return SphericalWristArm(
        B1=B1,
        p1=p[0],
        R_21=B2.T @ B1,
        t_21=B2.T @ (p[1] - p[0]),
        R_42=wrist.B4.T @ B2,
        sin12=sin12,
        cos12=cos12,
        along_2=float(a2 @ (centre - p[0])),
        upper=float(np.linalg.norm((B2.T @ (p[2] - p[1]))[:2])),
        fore=float(np.hypot(to_fore[0], to_fore[1])),
        elbow_zero=float(np.arctan2(to_fore[1], to_fore[0])),
        sign3=sign3,
        wrist=wrist,
        front=front,
        elbow_up=_elbow_up(B1, a2, front),
        deviation=deviation,
        length=lines.length,
    )


def _sines(direction: Array) -> Array:
    """Sine of the angle between each axis and the next, (dof - 1,)."""
    return np.asarray(np.linalg.norm(np.cross(direction[:-1], direction[1:]), axis=1))


def _front(B1: Array, shoulder: Array, size: float) -> float:
    """Side of axis 1 (along +-y of B1, at q1 = 0) that joint 2 sits on; else the one nearest the base's x, or y."""
    y = B1[:, 1]
    for forward in (shoulder @ y / size, y[0], y[1], y[2]):
        if abs(forward) > 1e-3:
            return float(np.sign(forward))
    raise AssertionError("a unit vector has a component that is not small")


def _elbow_up(B1: Array, a2: Array, front: float) -> float:
    """Sign of the elbow's angle that has the elbow on top where the arm reaches out to its front.

    Top is the side of axis 1 that points away from the base's underside; where axis 1 is level, its own sense.
    """
    up = B1[:, 2] if B1[2, 2] > -1e-3 else -B1[:, 2]
    # Turning on about a2 at the elbow leaves the elbow on the right of the line from shoulder to wrist.
    elbow_side = -np.cross(a2, front * B1[:, 1])
    return float(np.sign(elbow_side @ up))
