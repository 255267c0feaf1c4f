"""Arms whose elbow can turn: they follow a path, within limits, without jumps, by little motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigid_frames import rigid_frame

import fem
from machining import Drive, GammaRange, Objective, Task, optimise_path, tool_path
from machining.posture.axes_map import Zone, axes_map
from machining.posture.drive import limit_distance, singular_distance
from machining.posture.long_path import optimise_long_path
from machining.posture.points import postures_at
from machining.posture.problem import Course
from machining.posture.room import LIMIT_ROOM, SINGULAR_ROOM, elbow_up, room
from machining.posture.stretches import course_at
from machining.stiffness.objective import ROOM
from robots import InputError, Robot, forward_kinematics, inverse_kinematics, load_description, load_robot
from robots.arrays import Array
from robots.inverse.elbow_angle import elbow_angle
from robots.inverse.following import about, self_motion
from robots.robot import trial_poses
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


# ------------------------------------------------------------
# Arms without springs are posed by room: elbow up, far from limits and singularities; constant gamma in 2.5-D

TURN = GammaRange(count=36)


def task_on(reach: float, height: float, tilt: float = 0.0) -> Task:
    x = np.linspace(-0.06, 0.06, 7)
    points = np.stack([np.full(7, reach), x, np.full(7, height)], axis=1)
    angle = tilt * np.linspace(-1.0, 1.0, 7)
    axes = np.stack([np.sin(angle), np.zeros(7), np.cos(angle)], axis=1)
    T_tool = rigid_frame([0.1, 0.0, 0.08])
    return Task(tool_path(points, axes), T_tool, np.eye(4))


@pytest.mark.parametrize("name", ["kr16-2", "ur10e", "irb2600-12-165"])
def test_the_elbow_is_up_where_it_is_above_the_line_from_shoulder_to_wrist(name: str) -> None:
    robot = load_robot(name)
    q = trial_poses(robot, 200, 60)
    p = forward_kinematics(robot, q).p
    up = elbow_up(robot, q)
    for at, says in zip(p, up, strict=True):
        shoulder, elbow, wrist = at[2], at[3], at[robot.dof - 1]
        share = (elbow - shoulder) @ (wrist - shoulder) / ((wrist - shoulder) @ (wrist - shoulder))
        height = (elbow - shoulder - share * (wrist - shoulder))[2]
        assert says == (height >= 0.0) or abs(height) < 1e-9
    value = room(robot, q) - up
    limits = np.clip(limit_distance(robot, q) / LIMIT_ROOM, 0.0, 1.0)
    np.testing.assert_allclose(
        value, 0.5 * (limits + np.clip(singular_distance(robot, q) / SINGULAR_ROOM, 0.0, 1.0)), atol=1e-12
    )
    assert value.min() >= 0.0
    assert value.max() <= 1.0


def test_the_branch_with_most_room_is_taken() -> None:
    model = fem.build_model(load_description("kr16-2"), links="rigid")
    task = task_on(1.0, 0.5)
    found = postures_at(model, task, Objective(ROOM), 0.0)
    every = inverse_kinematics(model.robot, task.tool_frames([0.0])[:, 0], T_flange_tool=task.T_flange_tool)
    for k in range(task.path.n):
        q = every.q[k][every.valid[k]]
        assert found.value[k] == pytest.approx(room(model.robot, q).max(), abs=1e-12)
        assert elbow_up(model.robot, found.q[k : k + 1]).all()


def test_gamma_is_constant_unless_turning_gains_more_than_the_share() -> None:
    model = fem.build_model(load_description("kr16-2"), links="rigid")
    x = np.linspace(0.5, 1.2, 9)
    points = np.stack([x, 0.8 * (x - 0.85), np.full(9, 0.5)], axis=1)
    task = replace(task_on(1.0, 0.5), path=tool_path(points, np.tile([0.0, 0.0, 1.0], (9, 1))))
    objective, drive = Objective(ROOM), Drive(motion=0.0, jump=1.5)
    for seek in (
        lambda d: optimise_path(model, task, objective, TURN, d, passes=2).course,
        lambda d: optimise_long_path(model, task, objective, TURN, d).course,
    ):
        turning, kept = seek(drive), seek(replace(drive, turn_gain=1.0))
        assert np.ptp(turning.gamma) > 0.1
        assert turning.forgone is None
        assert np.ptp(kept.gamma) == 0.0
        gain = kept.forgone
        assert gain == pytest.approx(turning.mean / kept.mean - 1.0, abs=1e-9)
        assert gain > 0.0
        np.testing.assert_array_equal(seek(replace(drive, turn_gain=0.9 * gain)).gamma, turning.gamma)
        np.testing.assert_array_equal(seek(replace(drive, turn_gain=1.1 * gain)).gamma, kept.gamma)


def test_gamma_turns_where_the_tool_axis_does() -> None:
    model = fem.build_model(load_description("kr16-2"), links="rigid")
    drive = Drive(motion=0.0, jump=1.0)
    tilted = optimise_path(model, task_on(1.0, 0.5, tilt=0.2), Objective(ROOM), TURN, drive).course
    same = optimise_path(
        model, task_on(1.0, 0.5, tilt=0.2), Objective(ROOM), TURN, replace(drive, turn_gain=1.0)
    ).course
    np.testing.assert_array_equal(same.gamma, tilted.gamma)
    assert same.forgone is None
