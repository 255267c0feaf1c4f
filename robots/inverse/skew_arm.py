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
    q2, q3 = np.array([[0.3, 1.1, -2.0, 2.7], [0.7, -1.3, 2.2, -0.4]])
    (a1, a2, a3), (p1, p2, p3) = arm.a[:, :, None], arm.p[:, :, None]
    from_2 = _turn(arm.a[1], q2, _turn(arm.a[2], q3, arm.centre[:, None] - p3) + p3 - p2)
    from_3 = from_2 - _turn(arm.a[1], q2, p3 - p2)
    levers = ((a1, from_2 + p2 - p1), (a2, from_2), (_turn(arm.a[1], q2, a3), from_3))
    moved = np.stack([np.cross(axis, lever, axis=0) for axis, lever in levers])
    return bool((np.abs(np.linalg.det(np.moveaxis(moved, -1, 0) / lines.length)) > DEGENERATE).any())


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
    R, p, near = np.moveaxis(T_base_flange[:, :3, :3], 0, -1), T_base_flange[:, :3, 3].T, near.T
    from_1 = p + times(R, arm.wrist.centre_flange) - arm.p[0][:, None]
    across = np.linalg.norm(from_1 - np.outer(arm.a[0], arm.a[0] @ from_1), axis=0)
    q3, v, double = _circles(arm, from_1)
    exists = np.isfinite(q3)
    q3, v = np.where(exists, q3, 0.0), np.where(exists, v, 0.0)
    q1 = np.where(across < BOUNDARY * arm.length, near[0], _angle_about(arm.a[0], v, from_1[:, None]))
    from_2 = _turn(arm.a[2], q3, (arm.centre - arm.p[2])[:, None, None]) + (arm.p[2] - arm.p[1])[:, None, None]
    radius = np.linalg.norm(np.cross(arm.a[1], from_2, axisb=0, axisc=0), axis=0)
    to = v + (arm.p[0] - arm.p[1])[:, None, None]
    q2 = np.where(radius < BOUNDARY * arm.length, near[1], _angle_about(arm.a[1], from_2, to))
    hand = [times(R, axis)[:, None] for axis in (arm.wrist.z6_flange, arm.wrist.x6_flange)]
    for axis, angle in zip(arm.a, (q1, q2, q3), strict=True):
        hand = [_turn(axis, -angle, h) for h in hand]
    seen = [np.tensordot(arm.wrist.B4.T, h, 1) for h in hand]
    turned = solve_wrist(arm.wrist, seen, near[3], max(BOUNDARY, 100.0 * arm.deviation))

    n = len(T_base_flange)
    q, singular = np.empty((4, 2, 6, n)), np.empty((4, 2, 3, n), dtype=np.bool_)
    reason = np.zeros((4, 2, n), dtype=np.int8)
    for joint, angle in enumerate((q1, q2, q3)):
        q[:, :, joint] = angle[:, None]
    q[:, :, 3:] = turned.q
    for place, mark in enumerate((across < SINGULAR * arm.length, double[:, None], turned.singular[:, None])):
        singular[:, :, place] = mark
    np.copyto(reason, Reason.ORIENTATION, where=turned.out[:, None], casting="unsafe")
    np.copyto(reason, Reason.NO_SUCH, where=~exists[:, None], casting="unsafe")
    np.copyto(reason, Reason.OUT_OF_REACH, where=~exists.any(axis=0), casting="unsafe")
    return ClosedForm.of(q.reshape(8, 6, n), reason.reshape(8, n), singular.reshape(8, 3, n))


def _circles(arm: SkewArm, target: Array) -> tuple[Array, Array, Bools]:
    """Angles q3 (4, k), NaN if missing, points v (3, 4, k) from ``p[0]`` on axis 1's circle, and double roots (4, k).

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
        v = v0[:, None] + np.multiply.outer(v1, np.cos(q3)) + np.multiply.outer(v2, np.sin(q3))
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
        flat = (np.multiply.outer(a1, x) + np.multiply.outer(a2, y)) / (normal @ normal)
        normal = normal / np.linalg.norm(normal)
    else:
        normal = np.cross(a1, d) / np.linalg.norm(d)
        towards = third[0] + third[1] * cos + third[2] * sin - 0.5 * K
        flat = np.outer(a1, along_1)[:, None] + np.multiply.outer(d, towards) / (d @ d)
    rest = K - (flat**2).sum(axis=0)
    q3[rest < -BOUNDARY * arm.length**2] = np.nan
    height = root(rest) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    double = np.repeat(double, 2, axis=0) | (np.abs(height) < SINGULAR * arm.length)
    return q3, flat + np.multiply.outer(normal, height), double


def _turn(axis: Array, angle: Array, v: Array) -> Array:
    """Rotate vectors v (3, ...) about an axis (3,) by angles (...)."""
    cos, sin = np.cos(angle), np.sin(angle)
    along = np.multiply.outer(axis, np.tensordot(axis, v, 1))
    return np.asarray(cos * v + sin * np.cross(axis, v, axisb=0, axisc=0) + (1.0 - cos) * along)


def _angle_about(axis: Array, start: Array, end: Array) -> Array:
    """Angle (...) about an axis that takes start to end, (3, ...) each."""
    turned = np.tensordot(axis, np.cross(start, end, axis=0), 1)
    along = np.tensordot(axis, start, 1) * np.tensordot(axis, end, 1)
    return np.asarray(np.arctan2(turned, (start * end).sum(axis=0) - along))
