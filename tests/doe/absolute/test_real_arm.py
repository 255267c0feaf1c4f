"""Where a calibrated arm's tool is, how sure that is, and by what its weight turns it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from doe.absolute.readings import Payload
from doe.absolute.real_arm import RealArm
from fem import ArmModel, build_model
from robots import forward_kinematics, load_description
from robots.arrays import Array
from robots.frames import frame_mm_deg
from robots.joint_errors import JointErrors

TOOL = frame_mm_deg([50.0, 20.0, 180.0, 10.0, 40.0, -20.0])
NAMES = ("j2.frame.x", "j3.zero", "j4.frame.rx", "j5.ratio", "j2.stiffness")
SD = np.array([3e-4, 2e-4, 4e-4, 1e-4, 2e-8])


def poses(model: ArmModel, n: int = 8) -> Array:
    rng = np.random.default_rng(2)
    low, high = np.clip(model.robot.limits, -2.0, 2.0).T
    return rng.uniform(low, high, (n, model.robot.dof))


def with_errors(model: ArmModel, **more: object) -> ArmModel:
    rng = np.random.default_rng(1)
    errors = JointErrors(
        5e-4 * rng.normal(size=(6, 5)),
        np.zeros(6),
        np.diag(3e-4 * rng.normal(size=6)),
        np.zeros((6, 0)),
        np.zeros((6, 0)),
        (None,) * 6,
    )
    return replace(model, robot=replace(model.robot, errors=replace(errors, **more)))


def test_without_errors_and_weight_it_is_the_arm_as_designed() -> None:
    model = build_model(load_description("kr60-3"), "rigid")
    q = poses(model)
    R, p = RealArm(model).rigid.frames(q, TOOL)
    expected = forward_kinematics(model.robot, q).T_flange @ TOOL
    assert_allclose(p, expected[:, :3, 3], atol=1e-12)
    assert_allclose(R, expected[:, :3, :3], atol=1e-12)
    assert_allclose(RealArm(model).rigid.angles(q), q, atol=1e-15)


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_axes_stay_axes_where_weight_bends_the_arm(name: str) -> None:
    description = load_description(name)
    model = with_errors(build_model(description, "rigid"))
    model = replace(model, base=np.diag([0, 0, 0, 1e-7, 2e-7, 0.0]))
    load = Payload(50.0, np.array([0.0, 0.0, 0.2]))
    R, p = RealArm(model, load).frames(poses(model), TOOL)
    # One step to the nearest rotation leaves the square of half the square of a turn of milliradians.
    assert_allclose(R @ np.swapaxes(R, 1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-9)
    _, bare = RealArm(model).frames(poses(model), TOOL)
    assert np.linalg.norm(p - bare, axis=1).max() > 1e-5


def test_arms_whose_joints_turn_alone_need_one_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    model = with_errors(build_model(load_description("kr60-3"), "rigid"))
    arm = RealArm(model, Payload(50.0, np.array([0.0, 0.0, 0.2])))
    short = arm.frames(poses(model), TOOL)
    monkeypatch.setattr(RealArm, "_only_turns", property(lambda _: False))
    long = arm.frames(poses(model), TOOL)
    for one, other in zip(short, long, strict=True):
        assert_allclose(one, other, atol=1e-12)


def moved(model: ArmModel, change: Array) -> ArmModel:
    """The arm with its parameters, as in ``NAMES``, changed."""
    errors = model.robot.errors
    assert errors is not None
    frames, turn = errors.frames.copy(), errors.turn.copy()
    frames[1, 0] += change[0]
    frames[3, 3] += change[2]
    turn[4, 4] += change[3]
    offset = model.robot.offset + model.robot.sign * np.array([0, 0, change[1], 0, 0, 0])
    (j2,) = (j for j in model.joints if j.name == "j2")
    c = float(j2.axial.compliance(np.zeros((1, 6)))[0])
    robot = replace(model.robot, errors=replace(errors, frames=frames, turn=turn), offset=offset)
    return replace(model, robot=robot).with_springs({"j2": 1.0 / (c + change[4])})


def test_doubt_is_what_the_covariance_moves_the_tool_by() -> None:
    rng = np.random.default_rng(5)
    A = rng.normal(size=(5, 5))
    V = A @ A.T / 5.0 * np.outer(SD, SD)
    model = with_errors(build_model(load_description("kr60-3"), "rigid"), parameters=NAMES, covariance=V)
    q, load = poses(model, 4), Payload(20.0, np.zeros(3))
    place, turn = RealArm(model, load).doubt(q, TOOL)
    away, turned = np.zeros(4), np.zeros(4)
    # Any root of the covariance will do: each column is a direction that the parameters are open in.
    for column in np.linalg.cholesky(V).T:
        (R, p), (S, o) = (RealArm(moved(model, sign * column), load).frames(q, TOOL) for sign in (1.0, -1.0))
        away += 0.25 * np.sum((p - o) ** 2, axis=1)
        turned += 0.125 * np.sum((R - S) ** 2, axis=(1, 2))
    # Derivatives leave out that torques move a little with angles: a thousandth.
    assert_allclose(np.sqrt(away), place, rtol=2e-3)
    assert_allclose(np.sqrt(turned), turn, rtol=2e-3)


def test_no_covariance_is_no_doubt_said() -> None:
    model = with_errors(build_model(load_description("kr60-3"), "rigid"))
    place, turn = RealArm(model).doubt(poses(model), TOOL)
    assert not place.any()
    assert not turn.any()
