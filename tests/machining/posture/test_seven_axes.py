"""Arms whose elbow can turn: they follow a path, within limits, without jumps, by little motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rigid_frames import rigid_frame

import fem
from machining import Drive, GammaRange, Objective, Task, optimise_path, tool_path
from machining.posture.axes_map import Zone, axes_map
from machining.posture.problem import Course
from machining.posture.stretches import course_at
from robots import InputError, Robot, forward_kinematics
from robots.arrays import Array
from robots.inverse.elbow_angle import elbow_angle
from robots.inverse.following import about, self_motion
from robots.urdf.reading import read_urdf

HERE = Path(__file__).parent
# Where the part stands, m.
ARMS = {"seven_axis": (0.5, 0.0, 0.2), "offset_wrist": (0.45, 0.0, 0.15)}


@pytest.fixture(scope="module", params=ARMS)
def arm(request: pytest.FixtureRequest) -> tuple[fem.ArmModel, Array]:
    model = fem.build_model(read_urdf(HERE / f"{request.param}.urdf").description, "rigid")
    part = rigid_frame(ARMS[request.param])
    return model.with_springs(dict.fromkeys(model.robot.joint_names, 1e6)), part


def square(part: Array, points: int = 20, width: float = 0.06) -> Task:
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, 0.04], [0.0, 0.04], [0.0, 0.0]])
    along = np.linspace(0.0, 4.0, 4 * points + 1)
    flat = np.stack([np.interp(along, np.arange(5.0), c) for c in corners.T], axis=1)
    tool = rigid_frame((0.0, 0.0, 0.1))
    return Task(tool_path(np.column_stack([flat, 0.0 * along]), [0.0, 0.0, 1.0], feed=1.0 / 60.0), tool, part)


def check(robot: Robot, task: Task, course: Course, largest_step: float) -> None:
    wanted = task.tool_frames(course.gamma[:, None])[:, 0]
    reached = forward_kinematics(robot, course.q).T_flange @ task.T_flange_tool
    # Newton's method ends at rounding.
    assert np.abs(reached - wanted).max() < 1e-9
    assert robot.reachable(course.q).all()
    assert np.abs(np.diff(course.q, axis=0)).max() < largest_step


def test_a_square_at_one_gamma_is_followed_by_little_motion(arm: tuple[fem.ArmModel, Array]) -> None:
    model, part = arm
    task = square(part)
    course = course_at(model, task, 0.0, Objective(), generator=np.random.default_rng(0))
    # Half to one millimetre a point: a degree is far more than any joint needs.
    check(model.robot, task, course, np.radians(1.0))
    # A way of 200 mm: pinocchio's best of 30 starts needs 84 and 119 deg in all (benchmarks/shop/seven_axis_paths.py).
    assert course.smoothness.travel < np.radians(1.5 * 90.0)
    # Of the first arm 11.8 deg are what the elbow's joint cannot do without.
    assert np.ptp(course.q, axis=0).max() < np.radians(12.0 if model.robot.name == "seven" else 15.0)


def test_gamma_and_elbow_are_chosen_together(arm: tuple[fem.ArmModel, Array]) -> None:
    model, part = arm
    task, gammas = square(part, points=6), GammaRange.of_degrees(-40.0, 40.0, 10.0)
    found = optimise_path(model, task, Objective(), gammas, Drive(), generator=np.random.default_rng(0))
    check(model.robot, task, found.course, np.radians(5.0))
    single = course_at(model, task, 0.0, Objective(), generator=np.random.default_rng(0))
    assert found.course.mean > 0.9 * single.mean
    assert found.course.names[0].startswith("elbow ")
    made = axes_map(model, task, Objective(), Drive(), gammas.angles, generator=np.random.default_rng(0))
    assert (made.zone[:, 4] == Zone.OPEN).all()


def test_the_elbow_turns_and_the_flange_stands(arm: tuple[fem.ArmModel, Array]) -> None:
    model, part = arm
    robot, task = model.robot, square(part, points=1)
    q = course_at(model, task, 0.0, generator=np.random.default_rng(0)).q[:1]
    frames, offsets = forward_kinematics(robot, q).T_flange, np.radians([-5.0, 0.0, 5.0])
    turned, _ = about(robot, q, frames, offsets)
    assert np.abs(forward_kinematics(robot, turned[0]).T_flange - frames).max() < 1e-9
    elbow = elbow_angle(robot, turned[0])
    assert elbow is not None
    assert np.abs(np.diff(elbow)).min() > np.radians(1.0)
    # The direction is that of no motion of the flange, by differences.
    step = 1e-6 * self_motion(robot, q)
    moved = forward_kinematics(robot, q + step).T_flange - forward_kinematics(robot, q - step).T_flange
    assert np.abs(moved).max() < 1e-10


@pytest.mark.slow
def test_what_is_out_of_reach_is_said_with_the_point(arm: tuple[fem.ArmModel, Array]) -> None:
    model, part = arm
    with pytest.raises(InputError, match="path point") as error:
        course_at(model, square(part, width=1.5), 0.0, generator=np.random.default_rng(0))
    assert error.value.points[0] > 0  # type: ignore[attr-defined]
