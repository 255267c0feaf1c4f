"""Where the elbow of a seven-axis arm stands: its angle about the line from shoulder to wrist."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array
from robots.inverse.axis_lines import AxisLines, axis_lines, nearest_point
from robots.kept import once_for_each
from robots.kinematics import BodyFrames, forward_kinematics
from robots.robot import Robot

# Sine of the angle between the line and the base's z below which the elbow is seen from the base's x.
UPRIGHT = 1e-6
# Bodies that shoulder, elbow and wrist move with.
_BODIES = (1, 3, 5)


def elbow_angle(robot: Robot, q: Array) -> Array | None:
    """Angle (n,) rad of the elbow at poses q (n, 7) rad; None of an arm with another number of joints.

    Right-handed about the line from the shoulder (between axes 1 and 2) to the wrist (between axes 5 and 6); 0 where
    the elbow (on axis 4, next to axis 3) is on top. In arms whose axes meet there nothing else is left free by the
    flange's frame.
    """
    if robot.dof != 7:
        return None
    frames = forward_kinematics(robot, q)
    local = _points(robot)
    shoulder, elbow, wrist = (
        frames.p[:, body] + frames.R[:, body] @ point for body, point in zip(_BODIES, local, strict=True)
    )
    line = wrist - shoulder
    line = line / np.linalg.norm(line, axis=1, keepdims=True)
    top = np.where((np.hypot(line[:, 0], line[:, 1]) > UPRIGHT)[:, None], np.eye(3)[2], np.eye(3)[0])
    side = elbow - shoulder
    across = np.einsum("ni,ni->n", np.cross(top, side), line)
    along = np.einsum("ni,ni->n", top, side) - np.einsum("ni,ni->n", top, line) * np.einsum("ni,ni->n", side, line)
    return np.asarray(np.arctan2(across, along))


@once_for_each
def _points(robot: Robot) -> Array:
    """Shoulder, elbow and wrist (3, 3) m in the frames of their bodies."""
    lines = axis_lines(robot)
    home: BodyFrames = forward_kinematics(robot, np.zeros((1, robot.dof)))
    a, p = lines.direction, lines.point
    places = (nearest_point(a[:2], p[:2])[0], _elbow(lines), nearest_point(a[4:6], p[4:6])[0])
    return np.array([home.R[0, b].T @ (place - home.p[0, b]) for b, place in zip(_BODIES, places, strict=True)])


def _elbow(lines: AxisLines) -> Array:
    """The point (3,) m of axis 4 next to axis 3."""
    a, p = lines.direction, lines.point
    middle, _ = nearest_point(a[2:4], p[2:4])
    return np.asarray(p[3] + a[3] * (a[3] @ (middle - p[3])))
