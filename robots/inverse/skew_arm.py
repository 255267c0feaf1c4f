"""Inverse kinematics of arms with a spherical wrist whose axes 2 and 3 are not parallel: by a quartic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools
from robots.inverse.axis_lines import AxisLines, axis_lines, nearest_point
from robots.inverse.branches import Reason
from robots.inverse.closed_form import ClosedForm, times
from robots.inverse.quartic import line_roots, quartic_roots
from robots.inverse.spherical_wrist import DEGENERATE, NEARLY_LENGTH, why_no_spherical_wrist
from robots.inverse.wrist import BOUNDARY, SINGULAR, Wrist, root, solve_wrist, wrist_from
from robots.kept import once_for_each
from robots.robot import Robot

SKEW_NAMES = tuple(f"arm {i // 2 + 1}, {'flip' if i % 2 else 'no flip'}" for i in range(8))
# Axes 1 and 2 this close to meeting (share of the arm's length) or to parallel (sine) are taken to be so.
NEARLY_SPECIAL = 1e-5


@dataclass(frozen=True)
class SkewArm:
    """First three axes in any position, then a spherical wrist; base frame, q = 0.

    ``a``, ``p`` (3, 3): unit directions and points of axes 1 to 3; the points on 1 and 2 are the feet of their
    common normal. ``centre`` (3,) m: the wrist centre. ``meeting``, ``parallel``: axes 1 and 2 are taken to do
    so. ``deviation`` (m or rad): by how much the real axes miss this picture. ``length``: the arm stretched (m).
    """

    a: Array
    p: Array
    centre: Array
    meeting: bool
    parallel: bool
    wrist: Wrist
    deviation: float
    length: float


@once_for_each
def skew_arm(robot: Robot) -> SkewArm | None:
    """Reduce a robot to such an arm; None where it has no spherical wrist or its axes 1 to 3 are degenerate."""
    if why_no_spherical_wrist(robot) is not None:
        return None
    lines = axis_lines(robot)
    centre, miss = nearest_point(lines.direction[3:], lines.point[3:])
    a, p = lines.direction[:3].copy(), lines.point[:3].copy()
    sine = float(np.linalg.norm(np.cross(a[0], a[1])))
    parallel = sine < NEARLY_SPECIAL
    if parallel:
        p[1] -= ((p[1] - p[0]) @ a[0]) * a[0]
        apart = float(np.linalg.norm(p[1] - p[0]))
        meeting, off = False, sine
        a[1] = np.sign(a[0] @ a[1]) * a[0]
    else:
        middle, distance = nearest_point(a[:2], p[:2])
        p[:2] = p[:2] + a[:2] * np.einsum("ij,ij->i", a[:2], middle - p[:2])[:, None]
        meeting, apart = 2.0 * distance < NEARLY_SPECIAL * lines.length, np.inf
        off = 2.0 * distance if meeting else 0.0
        if meeting:
            p[:2] = middle
    arm = SkewArm(a, p, centre, meeting, parallel, wrist_from(lines, centre), max(miss, off), lines.length)
    # Joints that cannot move the wrist centre in all directions anywhere leave a target no or endless solutions.
    return arm if apart > NEARLY_LENGTH * lines.length and _moves_freely(arm, lines) else None


def _moves_freely(arm: SkewArm, lines: AxisLines) -> bool:
    angle = np.array([[0.3, 1.1, -2.0, 2.7], [0.7, -1.3, 2.2, -0.4]])
    best = 0.0
    for q2, q3 in angle.T:
        at3 = _turn(arm.a[2], np.full(1, q3), (arm.centre - arm.p[2])[:, None]) + arm.p[2][:, None]
        at2 = _turn(arm.a[1], np.full(1, q2), at3 - arm.p[1][:, None])[:, 0] + arm.p[1]
        a3, p3 = (_turn(arm.a[1], np.full(1, q2), v[:, None])[:, 0] for v in (arm.a[2], arm.p[2] - arm.p[1]))
        columns = [np.cross(arm.a[0], at2 - arm.p[0]), np.cross(arm.a[1], at2 - arm.p[1])]
        columns.append(np.cross(a3, at2 - arm.p[1] - p3))
        best = max(best, abs(float(np.linalg.det(np.array(columns) / lines.length))))
    return best > DEGENERATE


def solve_skew_arm(arm: SkewArm, T_base_flange: Array, near: Array) -> ClosedForm:
    """Up to four positions of joints 1 to 3, each with two wrists, for n flange frames (n, 4, 4).

    Columns are as in ``SKEW_NAMES``, arms in the order of joint 3's angle. ``near`` (n, 6) as in
    :func:`robots.inverse.closed_form.closed_form`. Accuracy is that of a quartic's roots, about 1e-12 away from
    singularities: refine the result on the robot.

    Notes
    -----
    Pieper's reduction (see :func:`robots.inverse.closed_form.closed_form`), without coordinates: the wrist centre on
    the circle about axis 3, p(q3), has to lie on the circle about axis 2 through a point u which lies on the
    circle about axis 1 through the target. Distances and ways along the axes give three equations linear in u and
    in cos q3, sin q3; what remains is |u| and a quartic for q3. Where axes 1 and 2 meet or are parallel one of the
    three gives q3 alone, and |u| two points u for each.
    """
    n = len(T_base_flange)
    q = np.full((8, 6, n), np.nan)
    reason = np.zeros((8, n), dtype=np.int8)
    singular = np.zeros((8, 3, n), dtype=np.bool_)
    T = np.moveaxis(T_base_flange, 0, -1)
    R = T[:3, :3]
    from_1 = T[:3, 3] + times(R, arm.wrist.centre_flange) - arm.p[0][:, None]
    hand = (times(R, arm.wrist.z6_flange), times(R, arm.wrist.x6_flange))
    across = np.linalg.norm(from_1 - np.outer(arm.a[0], arm.a[0] @ from_1), axis=0)
    q3s, points, double = _circles(arm, from_1)
    exists = np.isfinite(q3s)
    reason[:] = np.repeat(np.where(exists, Reason.FOUND, Reason.NO_SUCH), 2, axis=0)
    reason[:, ~exists.any(axis=0)] = Reason.OUT_OF_REACH
    margin = max(BOUNDARY, 100.0 * arm.deviation)
    for i in range(4):
        rows = slice(2 * i, 2 * i + 2)
        q3, v = np.where(exists[i], q3s[i], 0.0), np.where(exists[i], points[i], 0.0)
        q1 = np.where(across < BOUNDARY * arm.length, near.T[0], _angle_about(arm.a[0], v, from_1))
        from_2 = _turn(arm.a[2], q3, np.outer(arm.centre - arm.p[2], np.ones(n))) + (arm.p[2] - arm.p[1])[:, None]
        radius = np.linalg.norm(np.cross(arm.a[1], from_2.T), axis=1)
        to = v + (arm.p[0] - arm.p[1])[:, None]
        q2 = np.where(radius < BOUNDARY * arm.length, near.T[1], _angle_about(arm.a[1], from_2, to))
        seen = list(hand)
        for axis, angle in zip(arm.a, (q1, q2, q3), strict=True):
            seen = [_turn(axis, -angle, h) for h in seen]
        q[rows, 0], q[rows, 1], q[rows, 2] = q1, q2, q3
        singular[rows, 0] = across < SINGULAR * arm.length
        singular[rows, 1] = double[i]
        solve_wrist(
            arm.wrist, [arm.wrist.B4.T @ h for h in seen], near.T[3], margin, q[rows], reason[rows], singular[rows]
        )
    missing = reason != Reason.FOUND
    q.swapaxes(0, 1)[:, missing] = np.nan
    singular.swapaxes(0, 1)[:, missing] = False
    return ClosedForm(np.moveaxis(q, -1, 0), reason.T, np.moveaxis(singular, -1, 0))


def _circles(arm: SkewArm, target: Array) -> tuple[Array, Array, Bools]:
    """Angles q3 (4, k), NaN if missing, points v (4, 3, k) from ``p[0]`` on axis 1's circle, and double roots (4, k).

    ``target`` (3, k): the wrist centre from ``p[0]``.
    """
    a1, a2, a3 = arm.a
    d = arm.p[0] - arm.p[1]
    lever = arm.centre - arm.p[2]
    r0 = arm.p[2] - arm.p[1] + (a3 @ lever) * a3  # from p[1]
    r1 = lever - (a3 @ lever) * a3
    r2 = np.cross(a3, r1)
    K = (target**2).sum(axis=0)
    along_1 = a1 @ target
    # a2 . v and d . v as constant, cosine and sine terms; only the second has a constant that depends on the target.
    second = np.array([a2 @ (r0 - d), a2 @ r1, a2 @ r2])
    third = np.array([0.5 * (r0 @ r0 + r1 @ r1 - d @ d), r0 @ r1, r0 @ r2])
    if not (arm.meeting or arm.parallel):
        inverse = np.linalg.inv(np.array([a1, a2, d]))
        first = np.outer(inverse[:, 0], along_1) + np.outer(inverse[:, 2], -0.5 * K)
        v0 = first + (inverse[:, 1] * second[0] + inverse[:, 2] * third[0])[:, None]
        v1, v2 = (inverse[:, 1] * second[i] + inverse[:, 2] * third[i] for i in (1, 2))
        mixed = np.array([v1 @ v1, 2.0 * (v1 @ v2), v2 @ v2])
        q3, double = quartic_roots((v0**2).sum(axis=0) - K, 2.0 * (v1 @ v0), 2.0 * (v2 @ v0), mixed)
        v = v0 + v1[:, None] * np.cos(q3)[:, None] + v2[:, None] * np.sin(q3)[:, None]
        return q3, v, double
    if arm.meeting:
        single, double = line_roots(third[1], third[2], 0.5 * K - third[0])
    else:
        sense = a1 @ a2
        single, double = line_roots(second[1], second[2], sense * along_1 - second[0])
    q3 = np.repeat(single, 2, axis=0)
    cos, sin = np.cos(q3), np.sin(q3)
    if arm.meeting:
        normal = np.cross(a1, a2)
        cross = a1 @ a2
        along_2 = second[0] + second[1] * cos + second[2] * sin
        x, y = along_1 - cross * along_2, along_2 - cross * along_1
        flat = (a1[:, None] * x[:, None] + a2[:, None] * y[:, None]) / (normal @ normal)
        normal = normal / np.linalg.norm(normal)
    else:
        normal = np.cross(a1, d) / np.linalg.norm(d)
        towards = third[0] + third[1] * cos + third[2] * sin - 0.5 * K
        flat = np.outer(a1, along_1) + d[:, None] * towards[:, None] / (d @ d)
    rest = K - (flat**2).sum(axis=1)
    q3[rest < -BOUNDARY * arm.length**2] = np.nan
    height = root(rest) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    double = np.repeat(double, 2, axis=0) | (np.abs(height) < SINGULAR * arm.length)
    return q3, flat + normal[:, None] * height[:, None], double


def _turn(axis: Array, angle: Array, v: Array) -> Array:
    """Rotate v (3, k) about an axis (3,) by angles (k,)."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(cos * v + sin * np.cross(axis, v.T).T + (1.0 - cos) * np.outer(axis, axis @ v))


def _angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Angle (k,) about an axis that takes start to end, (3, k) each."""
    turned = axis @ np.cross(start.T, end.T).T
    return np.asarray(np.arctan2(turned, (start * end).sum(axis=0) - (axis @ start) * (axis @ end)))
