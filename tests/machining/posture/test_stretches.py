"""A path followed stretch by stretch is followed as if it were looked at as a whole."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from posture_cases import SPEED, dome_task
from refusals import refuses

import fem
from machining.posture.drive import Drive
from machining.posture.stretches import GivenGamma, course_at
from machining.stiffness.objective import Objective
from machining.task import Task, ToolPath
from machining.toolpaths.path_error import PathError
from robots.arrays import Array, Integers

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
