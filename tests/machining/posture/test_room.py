"""Arms without springs are posed by room: elbow up, far from limits and singularities; constant gamma in 2.5-D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_frames import rigid_frame

import fem
from machining import Drive, GammaRange, Objective, Task, optimise_path, tool_path
from machining.posture.drive import limit_distance, singular_distance
from machining.posture.long_path import optimise_long_path
from machining.posture.points import postures_at
from machining.posture.room import LIMIT_ROOM, SINGULAR_ROOM, elbow_up, room
from machining.stiffness.objective import ROOM
from robots import forward_kinematics, inverse_kinematics, load_description, load_robot
from robots.robot import trial_poses

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
