"""Varying springs, loads and gauges on one joint and one lever, against their formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arms import LENGTH, ROUND_OFF, SPRINGS, STIFFNESS, angle_of, extra, lever_loads, of, torque

from fem import ArmModel, build_model, deflection
from fem.effects import History, observed, plain_history
from fem.statics.loads import LoadedPoses
from robots import ModelDescription, load_description

TEETH = 40.0


@pytest.fixture(scope="module")
def lever(boom: Callable[..., ModelDescription]) -> ArmModel:
    return build_model(boom(LENGTH, stiffness=STIFFNESS), links="rigid")


def swing(*degrees: float) -> LoadedPoses:
    q = np.radians(np.array(degrees))[:, None]
    wrench = np.zeros((len(q), 6))
    wrench[:, 2] = -500.0
    return LoadedPoses(q, wrench, np.zeros((len(q), 3)))


def test_angle_dependent_stiffness(lever: ArmModel) -> None:
    at = swing(-60.0, -10.0, 0.0, 35.0)
    q = at.q[:, 0]
    values = {"cos1": 0.2, "sin1": -0.1, "cos2": 0.05, "sin2": 0.08}
    theta = angle_of(observed(lever, at, [of(lever, "angle-dependent-stiffness:j1", **values)]), at)
    varied = 1.0 + 0.2 * np.cos(q) - 0.1 * np.sin(q) + 0.05 * np.cos(2 * q) + 0.08 * np.sin(2 * q)
    np.testing.assert_allclose(theta, torque(at) / STIFFNESS * varied, rtol=1e-11)


def test_gear_ripple_turns_with_the_teeth(lever: ArmModel) -> None:
    at = swing(0.0, 360.0 / TEETH, 180.0 / TEETH, 90.0 / TEETH)
    theta = angle_of(observed(lever, at, [of(lever, "gear-ripple:j1", cos=0.2, sin=0.1, teeth=TEETH)]), at)
    # A whole tooth, half a tooth, a quarter on.
    ripple = np.array([1.2, 1.2, 0.8, 1.1])
    np.testing.assert_allclose(theta, torque(at) / STIFFNESS * ripple, rtol=1e-10)


def test_gravity_compensator_stiffens_the_upright_upper_arm() -> None:
    d = load_description("xr701")
    arm = build_model(d, links="rigid").with_springs(SPRINGS)
    only = arm.with_springs({name: np.inf for name in SPRINGS if name != "j2"})
    q = np.zeros((3, 6))
    q[:, 1], q[:, 2] = np.radians([0.0, 40.0, -30.0]), np.radians(80.0)
    q[:, 0] = 0.4
    wrench = np.tile([-100.0, 50.0, -650.0, 0, 0, 0], (3, 1))
    at = LoadedPoses(q, wrench, np.tile(arm.robot.T_flange_tool[:3, 3], (3, 1)))
    placed = of(only, "gravity-compensator:j2", share=0.3, phase=0.0)
    plain = np.linalg.norm(deflection(only, at.q, at.wrench, at.point), axis=1)
    ratio = np.linalg.norm(observed(only, at, [placed]), axis=1) / plain
    g = 0.5 * (1.0 + np.cos(np.radians([0.0, 40.0, -30.0])))
    np.testing.assert_allclose(ratio, 1.0 / (1.0 + 0.3 * g), rtol=1e-10)
    # With a phase, forward and backward lean differ: the sign of the angle is that of joint 2.
    tilted = of(only, "gravity-compensator:j2", share=0.3, phase=np.radians(40.0))
    ratio = np.linalg.norm(observed(only, at, [tilted]), axis=1) / plain
    assert ratio[1] == pytest.approx(1.0 / 1.3, rel=1e-10)
    assert ratio[2] == pytest.approx(1.0 / (1.0 + 0.15 * (1.0 + np.cos(np.radians(70.0)))), rel=1e-10)


def test_payload_is_an_intercept(lever: ArmModel) -> None:
    at = lever_loads(25.0, 100.0, 200.0, 400.0, -100.0)
    theta = angle_of(observed(lever, at, [of(lever, "payload", force=50.0)]), at)
    arm = LENGTH * np.cos(np.radians(25.0))
    np.testing.assert_allclose(theta, np.array([150.0, 250.0, 450.0, -150.0]) * arm / STIFFNESS, rtol=1e-12)
    slope, intercept = np.polyfit([100.0, 200.0, 400.0], theta[:3], 1)
    assert intercept / slope == pytest.approx(50.0, rel=1e-9)


def test_load_point_offset_is_a_longer_lever(lever: ArmModel) -> None:
    at = lever_loads(30.0, 500.0)
    theta = angle_of(observed(lever, at, [of(lever, "load-point-offset", x=0.04, y=0.0, z=0.02)]), at)
    # Flange axes: x along the lever, which points down by 30 deg, and z across it.
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    assert theta[0] == pytest.approx(500.0 * ((LENGTH + 0.04) * c + 0.02 * s) / STIFFNESS, rel=1e-11)


def test_load_misalignment_turns_the_force(lever: ArmModel) -> None:
    at = lever_loads(30.0, 500.0)
    tilt = np.radians(3.0)
    theta = angle_of(observed(lever, at, [of(lever, "load-misalignment", tilt_x=0.0, tilt_y=tilt)]), at)
    # Turned about +y, a downward force points to -x; torque about y is z fx - x fz.
    fx, fz = -500.0 * np.sin(tilt), -500.0 * np.cos(tilt)
    x, z = LENGTH * np.cos(np.radians(30.0)), -LENGTH * np.sin(np.radians(30.0))
    assert theta[0] == pytest.approx((z * fx - x * fz) / STIFFNESS, rel=1e-11)


def test_joint_zero_offset_stands_elsewhere(lever: ArmModel) -> None:
    at = lever_loads(30.0, 500.0)
    found = observed(lever, at, [of(lever, "joint-zero-offset:j1", angle=np.radians(2.0))])
    there = replace(at, q=at.q + np.radians(2.0))
    np.testing.assert_allclose(found, deflection(lever, there.q, there.wrench, there.point), rtol=ROUND_OFF)


def test_gauge_zero_and_scale(lever: ArmModel) -> None:
    at = lever_loads(0.0, 100.0, 500.0)
    zero = extra(lever, at, of(lever, "gauge-zero", x=1e-5, y=-2e-5, z=3e-5))
    np.testing.assert_allclose(zero, np.tile([1e-5, -2e-5, 3e-5, 0, 0, 0], (2, 1)), atol=1e-17)
    plain = deflection(lever, at.q, at.wrench, at.point)
    np.testing.assert_allclose(extra(lever, at, of(lever, "gauge-scale", share=0.03)), 0.03 * plain, atol=1e-17)


def test_drift_follows_the_clock_not_the_pose(lever: ArmModel) -> None:
    at = lever_loads(0.0, 100.0, 500.0, 300.0)
    h = History(np.arange(3), np.zeros(3, dtype=np.intp), np.array([0.0, 0.5, 1.0]), is_known=False)
    slow = extra(lever, at, of(lever, "drift", x=0.0, y=0.0, z=1e-4, settling=1e4), h)
    np.testing.assert_allclose(slow[:, 2], [0.0, 0.5e-4, 1e-4], rtol=1e-3, atol=1e-15)
    fast = extra(lever, at, of(lever, "drift", x=0.0, y=0.0, z=1e-4, settling=0.1), h)
    np.testing.assert_allclose(fast[:, 2], 1e-4 * (1 - np.exp([0.0, -5.0, -10.0])) / (1 - np.exp(-10.0)), atol=1e-15)
    unknown = extra(lever, at, of(lever, "drift", x=0.0, y=0.0, z=1e-4, settling=0.1), plain_history(3))
    assert not unknown.any()
