"""Limits, rates, singularities, branches, straightness: planted faults at their lines, figures by arithmetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from verification_cases import ARM, SPEED, cell, line, motions, program, zigzag

from machining.cell import LinearAxis, Turntable, arm_of
from machining.programs.program import JointProgram
from machining.verification import Demands, Kind, Severity, verify
from machining.verification.courses import courses_of
from machining.verification.timing import timing_of
from robots import inverse_kinematics
from robots.arrays import Array
from robots.inverse.singularities import branch_of

ROBOT = ARM.robot
LOOSE = Demands(tolerance=1.0, axis_tolerance=9.0)


def by_joints(q: Array, rapid: bool = False, feed: float = 0.05, **more: object) -> JointProgram:
    """A program that wants what the joints q (n, 6) rad reach, in an empty cell; line i + 11 is move i's."""
    empty = replace(cell(), part=None, fixtures=(), floor=None, **more)  # type: ignore[arg-type]
    base = program(np.repeat([[0.0, 0.0, 0.1]], len(q), axis=0), where=empty)
    made = replace(base, q=q, branch=branch_of(ROBOT, q))
    T = made.reached()
    given = motions(T[:, :3, 3], np.full(len(q), rapid), feed, -T[:, :3, 2])
    return replace(made, T_part_tool=T, motions=given)


HOME = np.radians([10.0, -70.0, 60.0, 20.0, 50.0, 30.0])


def course(n: int, joint: int, start: float, end: float, home: Array = HOME) -> Array:
    """n poses (n, 6) rad in which one joint goes from start to end, deg."""
    q = np.tile(home, (n, 1))
    q[:, joint] = np.radians(np.linspace(start, end, n))
    return q


def only(found_kind: Kind, given: JointProgram, demands: Demands = LOOSE) -> int:
    """Line of the first offence of a kind; no other kind is an error before it."""
    found = verify(given, ARM, demands)
    first = found.errors[0]
    assert first.kind is found_kind, [(o.kind, o.line, o.what) for o in found.errors]
    return first.line


def test_a_clean_program_has_no_offence() -> None:
    found = verify(program(zigzag(5, 60)), ARM, replace(LOOSE, tolerance=1e-3))
    assert found.offences == ()
    assert found.clean
    assert found.not_looked_at == (
        "Commands to spindle, coolant and tool changer: the program has none.",
        "The way to the first point and from the last: the cell file has no home in [moves].",
        "Collisions of pedestal with upper-arm: they overlap at home.",
    )


def test_a_joint_beyond_its_limit() -> None:
    # q5 may go to 119 deg: point 9 of steps of 1 deg from 110.5 deg is 119.5 deg.
    given = by_joints(course(12, 4, 110.5, 121.5), rapid=True)
    assert only(Kind.LIMIT, given) == 9 + 11
    offence = verify(given, ARM, LOOSE).errors[0]
    assert (offence.axis, offence.unit, offence.moves) == ("q5", "rad", 3)
    assert offence.value == pytest.approx(np.radians(121.5))
    assert offence.limit == pytest.approx(np.radians(119.0))


@pytest.mark.parametrize("axis", ["rail", "turntable"])
def test_external_axes_beyond_their_limits(axis: str) -> None:
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0]))
    table = Turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([-1.0, 1.0]))
    base = by_joints(np.tile(HOME, (8, 1)), rapid=True, linear_axes=(rail,), turntable=table)
    steps = np.linspace(0.0, 1.4, 8)
    moved = replace(base, travel=steps[:, None]) if axis == "rail" else replace(base, table=steps)
    T = moved.reached()
    given = replace(moved, T_part_tool=T, motions=replace(base.motions, points=T[:, :3, 3], axes=-T[:, :3, 2]))
    assert only(Kind.LIMIT, given) == 6 + 11
    assert verify(given, ARM, LOOSE).errors[0].axis == axis


def test_straight_moves_that_bulge_beyond_a_limit() -> None:
    """Both ends are inside, the straight line between them is not: the elbow stretches on the way past the base."""
    points = np.array([[0.0, -0.5, 0.3], [0.0, -0.5, 0.3], [0.0, 0.5, 0.3]])
    given = program(points, np.ones(3), where=replace(cell(), part=None, fixtures=()))
    inside = verify(given, ARM, LOOSE)
    assert Kind.LIMIT not in {o.kind for o in inside.offences}
    middle, _ = courses_of(given, "linear").at(np.array([2]), np.array([0.5]))
    peak = float(middle[0, 2])
    limits = ROBOT.limits.copy()
    ends = given.q[1:, 2]
    assert peak > ends.max() + 0.05
    limits[2, 1] = 0.5 * (peak + ends.max())
    narrow = replace(ROBOT, limits=limits)
    tight = replace(given, robot=narrow)
    found = verify(tight, replace(ARM, robot=narrow), replace(LOOSE, interpolation="linear"))
    limit = next(o for o in found.errors if o.kind is Kind.LIMIT)
    assert (limit.line, limit.axis, limit.at) == (13, "q3", pytest.approx(0.5, abs=0.13))


def test_a_pass_through_the_wrist_singularity() -> None:
    # q5 crosses 0 between points 5 and 6, in steps of 2 deg; within asin(0.02) = 1.15 deg of it at those two points.
    given = by_joints(course(12, 4, 11.0, -11.0))
    found = verify(given, ARM, LOOSE)
    singular = next(o for o in found.errors if o.kind is Kind.SINGULARITY)
    jump = next(o for o in found.errors if o.kind is Kind.BRANCH_JUMP)
    assert singular.line == 5 + 11
    assert singular.value == 0.0
    assert (jump.line, jump.text) == (6 + 11, "wrist changes sides")


def test_a_course_that_grazes_a_singularity_between_points() -> None:
    """Points keep off the wrist singularity; on the straight line between them the wrist comes near it."""
    given = by_joints(np.vstack([course(4, 4, 40.0, 30.0), course(4, 4, 0.7, 30.0)]))
    assert only(Kind.SINGULARITY, given, replace(LOOSE, jump=9.0)) == 4 + 11


def test_rapid_joint_moves_may_pass_singularities() -> None:
    found = verify(by_joints(course(12, 4, 11.0, -11.0), rapid=True), ARM, LOOSE)
    assert found.clean
    assert [(o.kind, o.severity) for o in found.offences] == [(Kind.BRANCH_JUMP, Severity.WARNING)]


def test_feed_beyond_a_joint_speed() -> None:
    # About the tip's own way: joint 1 at 1.5 m reach. Feeds rise from move to move; the first too fast one is known.
    q = course(10, 0, -10.0, 8.0)
    given = by_joints(q)
    way = np.linalg.norm(np.diff(given.motions.points, axis=0), axis=1)
    permitted = way / (np.radians(2.0) / SPEED[0])
    feed = np.concatenate([[1.0], permitted * np.array([0.2, 0.5, 0.8, 0.9, 0.95, 0.99, 1.01, 1.2, 0.5])])
    given = replace(given, motions=replace(given.motions, feed=feed))
    smooth = replace(LOOSE, smoothing=10.0)
    assert only(Kind.SPEED, given, smooth) == 7 + 11
    offence = verify(given, ARM, smooth).errors[0]
    assert (offence.axis, offence.unit, offence.moves) == ("q1", "rad/s", 2)
    assert offence.value == pytest.approx(1.2 * SPEED[0], rel=1e-9)
    timing = timing_of(courses_of(given, "joint"), 10.0)
    # The controller slows the two down to the joint's speed.
    np.testing.assert_allclose(timing.time[1:], way / np.minimum(feed[1:], permitted), rtol=1e-9)


def test_times_of_rapid_moves() -> None:
    # Joint 1 over 90 deg: up to 128 deg/s at 600 deg/s^2, along, down; and 2 deg: two ramps.
    q = np.tile(HOME, (3, 1))
    q[1, 0] += np.radians(90.0)
    q[2, 0] += np.radians(92.0)
    given = by_joints(q, rapid=True)
    time = timing_of(courses_of(given, "joint"), 0.05).time
    np.testing.assert_allclose(time, [0.0, 90.0 / 128.0 + 128.0 / 600.0, 2.0 * np.sqrt(2.0 / 600.0)], rtol=1e-12)
    ramps_unknown = replace(given, cell=replace(given.cell, joint_acceleration=None))
    time = timing_of(courses_of(ramps_unknown, "joint"), 0.05).time
    np.testing.assert_allclose(time, [0.0, 90.0 / 128.0, 2.0 / 128.0], rtol=1e-12)
    unknown = replace(ramps_unknown, cell=replace(ramps_unknown.cell, joint_speed=None))
    assert np.isnan(timing_of(courses_of(unknown, "joint"), 0.05).time[1:]).all()
    assert any("Speeds of q1" in text for text in verify(unknown, ARM, LOOSE).not_looked_at)


def test_a_sharp_corner_asks_for_acceleration() -> None:
    # Joint 1 goes on evenly at w, then back at w: 2 w over the smoothing time. Start and stop ask for half of that.
    q = np.concatenate([course(40, 0, 0.0, 39.0), course(40, 0, 38.0, -1.0)])
    given = by_joints(q, joint_speed=np.radians(500.0), joint_acceleration=np.radians(1000.0))
    way = np.linalg.norm(given.motions.points[1] - given.motions.points[0])
    w = np.radians(25.5)
    given = replace(given, motions=replace(given.motions, feed=np.full(80, way / (np.radians(1.0) / w))))
    demands = replace(LOOSE, smoothing=0.05)
    found = verify(given, ARM, demands)
    (offence,) = found.errors
    # The point of return is 39; move 40 leads away from it.
    assert (offence.kind, offence.line, offence.axis) == (Kind.ACCELERATION, 40 + 11, "q1")
    assert offence.value == pytest.approx(2.0 * w / 0.05, rel=1e-6)
    np.testing.assert_allclose(found.timing.acceleration[1, 0], w / 0.05, rtol=1e-6)
    assert verify(given, ARM, replace(demands, smoothing=0.06)).clean


def test_smoothing_spans_short_moves() -> None:
    """A speed that rises evenly over many short moves is an acceleration of its slope, whatever the points."""
    n, a, dt = 200, np.radians(300.0), 0.004
    t = np.arange(n) * dt
    q = np.tile(HOME, (n, 1))
    q[:, 0] = 0.5 * a * t**2
    given = by_joints(q)
    way = np.linalg.norm(np.diff(given.motions.points, axis=0), axis=1)
    feed = np.concatenate([[1.0], way / dt])
    given = replace(given, motions=replace(given.motions, feed=feed))
    fast = replace(given, cell=replace(given.cell, joint_speed=100.0))
    timing = timing_of(courses_of(fast, "joint"), 0.05)
    # Away from start and stop; a window of 12.5 moves sees 12 or 13 steps of speed.
    assert np.abs(timing.acceleration[20:-20, 0] / a - 1.0).max() < 1.0 / 12.0


def test_a_branch_jump() -> None:
    # The same tool path, from point 20 on with the wrist flipped.
    points = line(40, (-0.1, 0.0, 0.0), (0.1, 0.0, 0.0))
    a, b = program(points), program(points, column=1)
    q = np.where(np.arange(40)[:, None] < 20, a.q, b.q)
    given = replace(a, q=q)
    found = verify(given, ARM, LOOSE)
    jumps = [o for o in found.errors if o.kind is Kind.BRANCH_JUMP]
    assert [(o.line, o.moves) for o in jumps] == [(20 + 11, 1)]
    assert "wrist changes sides" in jumps[0].text
    assert "steps while the tool hardly moves" in jumps[0].text


def test_a_full_turn_of_a_joint_is_a_jump() -> None:
    points = line(40, (-0.1, 0.0, 0.0), (0.1, 0.0, 0.0))
    base = program(points)
    q = base.q.copy()
    # Joint 4 stands near -174 deg; 186 deg is within its limits too.
    q[20:, 3] += 2.0 * np.pi
    assert only(Kind.BRANCH_JUMP, replace(base, q=q), replace(LOOSE, smoothing=5.0)) == 20 + 11


def test_long_moves_are_no_jumps() -> None:
    points = np.array([[-0.4, -0.2, 0.2], [0.0, -0.4, 0.2], [0.0, 0.4, 0.2]])
    found = verify(program(points, where=replace(cell(), part=None, fixtures=())), ARM, LOOSE)
    assert Kind.BRANCH_JUMP not in {o.kind for o in found.offences}


def test_linearisation_error_of_a_joint_move() -> None:
    """Joint 1 alone moves the tip on an arc: its sagitta is r (1 - cos(half the angle))."""
    points = np.array([[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]])
    base = program(points)
    q = np.stack([base.q[0], base.q[0]])
    q[1, 0] = q[0, 0] + np.radians(8.0)
    given = by_joints(q)
    found = verify(given, ARM, Demands(smoothing=10.0))
    T = given.cell.T_world_part() @ given.reached()
    r = np.linalg.norm(T[0, :2, 3])
    sagitta = r * (1.0 - np.cos(np.radians(4.0)))
    assert found.path.line[1] == pytest.approx(sagitta, rel=1e-9)
    deviation = next(o for o in found.errors if o.kind is Kind.DEVIATION)
    assert (deviation.line, deviation.limit) == (12, 1e-4)
    assert deviation.value == pytest.approx(sagitta, rel=1e-9)
    straight = verify(given, ARM, Demands(interpolation="linear", smoothing=10.0))
    # Straight moves do not leave the line; the figure of joint moves is there all the same.
    assert Kind.DEVIATION not in {o.kind for o in straight.offences}
    assert straight.path.run_line[1] < 1e-9
    assert straight.path.line[1] == pytest.approx(sagitta, rel=1e-9)


def test_a_point_that_is_not_reached() -> None:
    base = program(line(20, (-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)))
    q = base.q.copy()
    q[7, 0] += np.radians(0.02)
    found = verify(replace(base, q=q), ARM, Demands(smoothing=10.0))
    first = found.errors[0]
    assert (first.kind, first.line) == (Kind.OTHER_POINT, 7 + 11)
    reach = np.hypot(1.3, 0.1)
    assert first.value == pytest.approx(reach * np.radians(0.02), rel=0.1)


def test_straight_moves_follow_one_branch() -> None:
    """At any share the joints of a straight move reach the straight line, and stay near the branch of its ends."""
    given = program(np.array([[-0.2, -0.3, 0.1], [0.2, 0.3, 0.3]]), where=replace(cell(), part=None, fixtures=()))
    courses = courses_of(given, "linear")
    s = np.linspace(0.0, 1.0, 21)
    values, followed = courses.at(np.ones(21, dtype=np.int64), s)
    assert followed.all()
    T = courses.frames(values, np.ones(21, dtype=np.int64))
    wanted = given.motions.points[0] + s[:, None] * (given.motions.points[1] - given.motions.points[0])
    np.testing.assert_allclose(T[:, :3, 3], wanted, atol=1e-10)
    target = given.cell.T_base_part() @ T
    closed = inverse_kinematics(ROBOT, target, T_flange_tool=given.cell.tool.T_flange_tool, near=values)
    np.testing.assert_allclose(values, closed.q[:, 0], atol=1e-8)


def test_a_straight_line_between_branches_cannot_be_followed() -> None:
    """The ends stand in different branches, so somewhere on the line the joints must jump."""
    points = line(6, (-0.1, 0.0, 0.1), (0.1, 0.0, 0.1))
    where = replace(cell(), part=None, fixtures=())
    a, b = program(points, where=where), program(points, where=where, column=1)
    given = replace(a, q=np.where(np.arange(6)[:, None] < 3, a.q, b.q))
    found = verify(given, ARM, replace(LOOSE, interpolation="linear", smoothing=10.0))
    assert [(o.line, o.moves) for o in found.errors if o.kind is Kind.UNFOLLOWED] == [(3 + 11, 1)]
    assert found.swept.proven[3] < 0.0
    assert (found.swept.proven[[0, 1, 2, 4, 5]] > 0.0).all()


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"tolerance": 0.0}, "tolerance"), ({"interpolation": "cubic"}, "interpolation"), ({"safety": -1.0}, "safety")],
)
def test_bad_demands(settings: dict[str, object], words: str) -> None:
    refuses("Q011", words, Demands, **settings)


def test_bad_input() -> None:
    given = program(zigzag(2, 5))
    refuses("B001", "file_lines", replace, given, file_lines=np.array([1, 2]))
    refuses("A010", "another robot", verify, given, arm_of("xr701"))


def test_lines_of_the_file_are_handed_on() -> None:
    given = replace(by_joints(course(12, 4, 110.5, 121.5), rapid=True), file_lines=np.arange(100, 112))
    found = verify(given, ARM, LOOSE)
    assert found.errors[0].nc_line == 109


@pytest.mark.slow
def test_ten_thousand_moves() -> None:
    found = verify(program(zigzag(100, 100)), ARM, Demands(tolerance=1e-3))
    assert found.clean
    # Points alone decide nearly all moves of 3 mm.
    assert found.swept.samples < 11000
