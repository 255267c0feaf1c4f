"""Long paths: gamma at knots loses next to nothing, and every single point keeps the limits."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from posture_cases import ALONG_Y, SPEED, dome, dome_task, part, spindle
from refusals import refuses

import fem
from machining.posture.drive import Drive
from machining.posture.long_path import optimise_long_path
from machining.posture.path import optimise_path
from machining.posture.points import GammaRange
from machining.posture.stretches import GivenGamma, course_at
from machining.stiffness.objective import Objective
from machining.task import Task, ToolPath, tool_path
from machining.toolpaths.path_error import PathError
from robots import forward_kinematics
from robots.arrays import Array, Integers


def test_with_a_knot_at_every_point_it_is_the_search_of_short_paths(kr60: fem.ArmModel) -> None:
    task, gammas, drive = dome_task(8, 0.2), GammaRange(count=24), Drive(speed=SPEED)
    short = optimise_path(kr60, task, gammas=gammas, drive=drive, passes=2).course
    long = optimise_long_path(kr60, task, gammas=gammas, drive=drive, passes=2)
    np.testing.assert_array_equal(long.knots, np.arange(8))
    # Ends of the path count half as much in the mean over knots, so the courses need not be the same.
    assert long.course.mean == pytest.approx(short.mean, rel=1e-3)


@pytest.mark.slow
def test_few_knots_lose_next_to_nothing_and_every_point_keeps_the_limits(kr60: fem.ArmModel) -> None:
    task, gammas, drive = dome_task(400, 0.5, feed=0.05), GammaRange(count=36), Drive(speed=SPEED)
    short = optimise_path(kr60, task, gammas=gammas, drive=drive, passes=2).course
    found = optimise_long_path(kr60, task, gammas=gammas, drive=drive, knots=40, passes=3)
    course, robot = found.course, kr60.robot
    assert len(found.knots) <= 40
    assert course.mean > 0.999 * short.mean
    assert course.smoothness.undrivable == ()
    assert robot.reachable(course.q).all()
    speed = np.abs(np.diff(course.q, axis=0)) / task.path.times[:, None]
    assert (speed <= SPEED * (1.0 + 1e-8)).all()
    frames = forward_kinematics(robot, course.q)
    tip = frames.p_flange + frames.R_flange @ spindle()[:3, 3]
    np.testing.assert_allclose(tip, task.path.points + task.T_base_part[:3, 3], atol=1e-12)


def test_knots_crowd_where_the_tool_turns(kr60: fem.ArmModel) -> None:
    u = np.linspace(0.0, 1.0, 200)
    tilt = 0.5 * np.clip(10.0 * (u - 0.5), 0.0, 1.0)
    axes = np.stack([np.sin(tilt), 0.0 * u, np.cos(tilt)], axis=1)
    path = tool_path(np.stack([0.2 * u, 0.0 * u, 0.0 * u], axis=1), axes)
    task = Task(path, spindle(), part(), ALONG_Y)
    found = optimise_long_path(kr60, task, gammas=GammaRange(-0.5, 0.5, 11), knots=30)
    turning = ((found.knots >= 100) & (found.knots < 120)).sum()
    # A tenth of the way, but more than half of what counts.
    assert turning > 0.4 * len(found.knots)


def test_gamma_given_is_followed(kr60: fem.ArmModel) -> None:
    task = dome_task(50, 0.3)
    followed = course_at(kr60, task, 0.3, drive=Drive(speed=SPEED))
    np.testing.assert_array_equal(followed.gamma, 0.3)
    varied = course_at(kr60, task, np.linspace(0.0, 0.4, 50))
    np.testing.assert_allclose(varied.gamma, np.linspace(0.0, 0.4, 50))


def test_rapid_moves_may_be_long(kr60: fem.ArmModel) -> None:
    """Two patches far apart: no joint may step so far while milling, but it may on the move between them."""
    near = dome(20, 0.1)
    shift = np.array([-0.3, 0.9, 0.1])
    path = ToolPath(
        np.vstack([near.points, near.points + shift]),
        np.vstack([near.normals, near.normals]),
        np.vstack([near.axes, near.axes]),
        np.full(40, np.nan),
    )
    task, gammas = Task(path, spindle(), part(1.2, -0.4, 0.6), ALONG_Y), GammaRange(count=24)
    refuses("G003", "between points 19 and 20", optimise_long_path, kr60, task, gammas=gammas)
    free = np.zeros(39, dtype=np.bool_)
    free[19] = True
    course = optimise_long_path(kr60, task, gammas=gammas, free=free).course
    assert course.smoothness.undrivable == ()
    step = np.abs(np.diff(course.q, axis=0)).max(axis=1)
    assert step[19] > np.radians(20.0)
    assert np.delete(step, 19).max() < np.radians(20.0)
    refuses("G004", "free segments", optimise_long_path, kr60, task, gammas=gammas, free=free[:5])


def test_the_tool_may_turn_on_the_spot_but_not_stand_still(kr60: fem.ArmModel) -> None:
    tilt = np.linspace(0.0, 0.2, 5)
    axes = np.stack([np.sin(tilt), 0.0 * tilt, np.cos(tilt)], axis=1)
    on_the_spot = tool_path(np.zeros((5, 3)), axes, feed=0.1)
    assert np.isnan(on_the_spot.times).all()
    course = optimise_long_path(kr60, Task(on_the_spot, spindle(), part()), gammas=GammaRange(count=24)).course
    assert course.smoothness.undrivable == ()
    refuses("P009", "repeats", tool_path, np.zeros((2, 3)), [0.0, 0.0, 1.0])


def test_a_force_at_each_point_goes_with_its_point(kr60: fem.ArmModel) -> None:
    """Reversing the path and its forces reverses the course."""
    task, gammas = dome_task(60, 0.3), GammaRange(-0.6, 0.6, 13)
    force = np.stack([np.linspace(50.0, 200.0, 60), np.full(60, 80.0), np.linspace(-100.0, 90.0, 60)], axis=1)
    there = optimise_long_path(kr60, task, Objective("displacement", force), gammas, knots=60)
    path = task.path
    back = replace(task, path=ToolPath(path.points[::-1], path.normals[::-1], path.axes[::-1], path.feed))
    reversed_ = optimise_long_path(kr60, back, Objective("displacement", force[::-1]), gammas, knots=60)
    assert reversed_.course.mean == pytest.approx(there.course.mean, rel=1e-4)


def test_branch_and_turns_near_given_postures_are_taken(kr60: fem.ArmModel) -> None:
    """The wrist flipped all along: as stiff to rounding, but asked for."""
    task = dome_task(30, 0.2)
    plain = course_at(kr60, task, 0.3)
    flipped = plain.q.copy()
    flipped[:, 3] += -np.pi if flipped[0, 3] > 0.0 else np.pi
    flipped[:, 4] *= -1.0
    # One turn for all points: the angle passes zero.
    flipped[:, 5] += -np.pi if flipped[0, 5] > 0.0 else np.pi
    found = course_at(kr60, task, 0.3, near=flipped + 0.01)
    np.testing.assert_allclose(found.q, flipped, atol=1e-9)
    assert (found.branch != plain.branch).all()


def test_clearance_may_depend_on_the_path_point(kr60: fem.ArmModel) -> None:
    """Something stands in the way of the usual posture in the middle of the path only."""
    task, gammas = dome_task(60, 0.3), GammaRange(count=36)
    free = optimise_long_path(kr60, task, gammas=gammas, knots=20).course
    blocked = np.zeros(60, dtype=np.bool_)
    blocked[25:35] = True

    def clearance(q: Array, point: Integers) -> Array:
        near = np.abs(np.sin(0.5 * (q - free.q[point]))).max(axis=1)
        return np.where(blocked[point], near, 1.0)

    drive = Drive(clearance_at=clearance, clearance_least=0.05, clearance_zone=0.1)
    found = optimise_long_path(kr60, task, gammas=gammas, drive=drive, knots=20).course
    assert clearance(found.q, np.arange(60)).min() >= 0.05
    assert clearance(free.q, np.arange(60)).min() < 1e-9


# ------------------------------------------------------------
# A path followed stretch by stretch is followed as if it were looked at as a whole

N = 60
GAMMA = np.linspace(0.0, 0.4, N)


def short(monkeypatch: pytest.MonkeyPatch, points: int) -> None:
    """Stretches of so many points, of a path whose sweep is not kept."""
    monkeypatch.setattr("machining.posture.stretches.POINTS", points)
    monkeypatch.setattr("machining.posture.stretches.KEPT", 0)


@pytest.mark.parametrize("points", [1, 7, 20, N - 1])
@pytest.mark.parametrize("aim", ["mean", "worst"])
def test_stretches_make_no_difference(
    kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch, points: int, aim: Literal["mean", "worst"]
) -> None:
    task, objective, drive = dome_task(N, 0.3), Objective(aim=aim), Drive(speed=SPEED, motion=0.3)
    whole = course_at(kr60, task, GAMMA, objective, drive)
    short(monkeypatch, points)
    parts = course_at(kr60, task, GAMMA, objective, drive)
    # The compiled loops take points in groups, whose sums differ in the last digits.
    np.testing.assert_allclose(parts.q, whole.q, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(parts.branch, whole.branch)
    assert parts.cost == pytest.approx(whole.cost, rel=1e-12)
    assert parts.smoothness.undrivable == ()


def test_forces_and_postures_wanted_go_with_their_points(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    task = dome_task(N, 0.3)
    force = np.stack([np.linspace(50.0, 200.0, N), np.full(N, 80.0), np.linspace(-100.0, 90.0, N)], axis=1)
    objective = Objective("displacement", force)
    wanted = course_at(kr60, task, GAMMA, objective).q + 0.01
    wanted[:, 3] += np.pi
    wanted[:, 4] *= -1.0
    wanted[:, 5] -= np.pi
    whole = course_at(kr60, task, GAMMA, objective, near=wanted)
    short(monkeypatch, 13)
    parts = course_at(kr60, task, GAMMA, objective, near=wanted)
    np.testing.assert_allclose(parts.q, whole.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(parts.value, whole.value, rtol=1e-12)


def test_a_gap_is_told_at_its_point(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gamma turns by half a turn at once between points 24 and 25, the ends of two stretches, or within one."""
    task, gamma = dome_task(N, 0.3), np.where(np.arange(N) < 25, 0.0, 2.0)
    said = set()
    for points in (N, 25, 10):
        short(monkeypatch, points)
        with pytest.raises(PathError, match="from point 24 to 25") as caught:
            course_at(kr60, task, gamma, drive=Drive(speed=SPEED))
        assert caught.value.point == 24
        said.add(str(caught.value))
    assert len(said) == 1


def test_all_points_out_of_reach_are_named(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    task = dome_task(N, 0.3)
    points = task.path.points.copy()
    lost = [5, 6, 31, 58]
    points[lost, 0] += 9.0
    path = ToolPath(points, task.path.normals, task.path.axes, task.path.feed)
    far = Task(path, task.T_flange_tool, task.T_base_part, task.reference)
    said = set()
    for size in (N, 7):
        short(monkeypatch, size)
        with pytest.raises(PathError, match=r"path point 5 \(and 3 more: 6, 31, 58\) cannot be reached") as caught:
            course_at(kr60, far, GAMMA)
        assert caught.value.points.tolist() == lost
        said.add(str(caught.value))
    assert len(said) == 1


def test_all_points_too_near_to_something_are_named(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    task, blocked = dome_task(N, 0.3), [3, 20, 21, 44]

    def clearance(q: Array, point: Integers) -> Array:
        return np.where(np.isin(point, blocked), 0.0, 1.0)

    drive = Drive(clearance_at=clearance, clearance_least=0.005)
    for size in (N, 10):
        short(monkeypatch, size)
        with pytest.raises(PathError, match=r"path point 3 \(4 of 60 points\): all postures are too near") as caught:
            course_at(kr60, task, GAMMA, drive=drive)
        assert caught.value.points.tolist() == blocked


def test_an_arm_that_is_searched_is_swept_once(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another search need not end on the same postures."""
    task = dome_task(N, 0.3)
    path = GivenGamma(kr60, task, Objective(), GAMMA, None)
    short(monkeypatch, 10)
    assert path.whole is None
    monkeypatch.setattr("machining.posture.stretches.why_not_spherical", lambda robot: "no wrist")
    searched = GivenGamma(kr60, task, Objective(), GAMMA, None)
    assert searched.whole is not None
    assert np.shares_memory(searched.sweep(slice(10, 20)).q, searched.whole.q)


def test_a_value_that_is_not_finite_is_told_at_its_point(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: Objective, value: Array, point: Integers) -> None:
        if len(point) and point[-1] == 3:
            raise self.not_finite(3)

    monkeypatch.setattr(Objective, "check_finite", broken)
    short(monkeypatch, 4)
    refuses("M005", "path point 3", course_at, kr60, dome_task(N, 0.3), GAMMA)
