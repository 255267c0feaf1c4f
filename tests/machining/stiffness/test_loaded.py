"""The arm under load: derivative of the Jacobian, K_C, and equilibrium found by iteration."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from refusals import refuses

import fem
import robots
from machining import (
    cartesian_stiffness,
    complementary_stiffness,
    jacobian_derivative,
    loaded_compliance,
    softest_share,
    spring_jacobian,
)
from robots import bundled_names, forward_kinematics, jacobian, load_robot, tool_position
from robots.arrays import Array

# Lengths near 3 m, some 20 products.
ROUND_OFF = 1e-12


@pytest.mark.parametrize("name", bundled_names())
def test_derivative_of_the_jacobian_equals_central_differences(
    name: str, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    robot, h = load_robot(name), 1e-5
    q, point = poses(robot, 20, rng), np.array([0.05, -0.08, 0.12])
    exact = jacobian_derivative(robot, q, point)
    for j in range(robot.dof):
        step = h * np.eye(robot.dof)[j]
        slope = (jacobian(robot, q + step, point) - jacobian(robot, q - step, point)) / (2 * h)
        # Truncation h^2/6 x 3 m = 5e-11, round-off 1e-15 x 3 m / h = 3e-10.
        np.testing.assert_allclose(exact[..., j], slope, rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", bundled_names())
def test_k_c_equals_differences_of_the_joint_torques(
    name: str, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    robot, h = load_robot(name), 1e-5
    q, w = poses(robot, 20, rng), np.array([200.0, -150.0, 300.0, 40.0, -25.0, 60.0])
    points = rng.normal(scale=0.2, size=(20, 3))
    K_C = complementary_stiffness(robot, q, w, points)
    for j in range(robot.dof):
        step = h * np.eye(robot.dof)[j]
        torque = [np.einsum("nki,k->ni", jacobian(robot, at, points), w) for at in (q + step, q - step)]
        # As above, times some 500 N.
        np.testing.assert_allclose(K_C[:, :, j], (torque[0] - torque[1]) / (2 * h), rtol=0, atol=1e-6)


def test_k_c_of_a_force_is_symmetric_and_of_a_moment_is_not(
    kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    q = poses(kr60.robot, 10, rng)
    force = complementary_stiffness(kr60.robot, q, np.array([200.0, 200.0, 200.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(force, np.swapaxes(force, 1, 2), rtol=0, atol=ROUND_OFF * 600.0)
    moment = complementary_stiffness(kr60.robot, q, np.array([0.0, 0.0, 0.0, 30.0, 20.0, 10.0]))
    assert (np.abs(moment - np.swapaxes(moment, 1, 2)).max(axis=(1, 2)) > 1.0).all()


@pytest.mark.parametrize("axis", [1, -1])
def test_planar_arm_by_hand(planar: Callable[..., fem.ArmModel], axis: int) -> None:
    l1, l2, k1, k2, fx, fy = 0.8, 0.6, 2e4, 1.5e4, -900.0, 400.0
    model = planar(l1, l2, k1, k2, axis)
    q1, q2 = 0.4, 1.1
    s1, c1, s12, c12 = math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2)
    J = np.array([[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]])
    a, b = -fx * l1 * c1 - fy * l1 * s1, -fx * l2 * c12 - fy * l2 * s12
    K_C = np.array([[a + b, b], [b, b]])
    q, w = np.array([[q1, q2]]), np.array([fx, fy, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(complementary_stiffness(model.robot, q, w)[0], K_C, rtol=ROUND_OFF)
    C = J @ np.linalg.inv(np.diag([k1, k2]) - K_C) @ J.T
    np.testing.assert_allclose(loaded_compliance(model, q, w)[0, :2, :2], C, rtol=1e-11)
    np.testing.assert_allclose(fem.compliance(model, q)[0, :2, :2], J @ np.diag([1 / k1, 1 / k2]) @ J.T, rtol=1e-12)


def test_an_upright_rod_buckles_at_eulers_load(planar: Callable[..., fem.ArmModel]) -> None:
    """A rigid rod of length L on a spring k: a push towards the foot softens it by L P, and k / L makes it buckle."""
    k, length = 1e4, 2.0
    model = planar(1.5, length - 1.5, k, 1e12)
    q, critical = np.zeros((1, 2)), k / length
    push = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for share in (-0.5, 0.25, 0.9):
        c = loaded_compliance(model, q, share * critical * push)[0, 1, 1]
        # The second spring is 1e8 times stiffer, not rigid.
        assert c == pytest.approx(length**2 / k / (1.0 - share), rel=1e-6)
    assert softest_share(model, q, 0.25 * critical * push)[0] == pytest.approx(0.25, rel=1e-6)
    refuses("M006", r"pose 0.*buckles", loaded_compliance, model, q, 1.01 * critical * push)


def settled(model: fem.ArmModel, rest: Array, w: Array, point: Array, start: Array) -> Array:
    """Spring turns at equilibrium under w, by Newton; ``rest``: turns of the unloaded springs."""
    k = 1.0 / np.concatenate([joint.axial.compliance(start[None]) for joint in model.joints])
    to_q = np.linalg.lstsq(jacobian(model.robot, start[None], point)[0], spring_jacobian(model, start[None], point)[0])
    B, psi = to_q[0], np.zeros(len(k))
    for _ in range(30):
        J = spring_jacobian(model, (start + B @ psi)[None], point)[0]
        psi = psi - (psi - rest - J.T @ w / k)
    return np.asarray(start + B @ psi)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_loaded_compliance_is_the_slope_of_the_equilibrium(
    name: str, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    """Load the arm, let it settle, add a little load, let it settle again; xr701 with its parallelogram."""
    model = fem.build_model(robots.load_description(name), links="rigid")
    model = model.with_springs(dict.fromkeys(model.robot.joint_names, 3e5))
    point = np.array([0.03, 0.05, 0.2])
    # Under 20 kN the loaded compliance is a tenth or so off the unloaded one: a missing K_C is seen.
    w = np.array([9e3, -8e3, -14e3, 300.0, 200.0, -400.0])
    for q in poses(model.robot, 5, rng):
        k = 1.0 / np.concatenate([joint.axial.compliance(q[None]) for joint in model.joints])
        rest = -spring_jacobian(model, q[None], point)[0].T @ w / k
        C = loaded_compliance(model, q[None], w, point)[0]
        unloaded = fem.compliance(model, q[None], point)[0]
        for direction in range(3):
            step = 20.0 * np.eye(6)[direction]
            ends = [settled(model, rest, w + s * step, point, q) for s in (1.0, -1.0)]
            tips = [tool_position(model.robot, forward_kinematics(model.robot, e[None]), point)[0] for e in ends]
            slope = (tips[0] - tips[1]) / 40.0
            # The fixed-point iteration and curvature over 20 N in 20 kN leave 1e-6.
            np.testing.assert_allclose(C[:3, direction], slope, rtol=0, atol=2e-6 * np.abs(C[:3, :3]).max())
        assert np.abs(C - unloaded)[:3, :3].max() > 0.01 * np.abs(unloaded[:3, :3]).max()


@pytest.mark.parametrize("links", ["rigid", "beam"])
def test_no_load_changes_nothing(links: fem.LinkKind, poses: Callable[..., Array], rng: np.random.Generator) -> None:
    model = fem.build_model(robots.load_description("kr60-3"), links=links)
    q = poses(model.robot, 5, rng)
    np.testing.assert_array_equal(loaded_compliance(model, q, np.zeros(6)), fem.compliance(model, q))


def test_loaded_stiffness_is_equation_1(kr60: fem.ArmModel, poses: Callable[..., Array]) -> None:
    q, w = poses(kr60.robot, 10, np.random.default_rng(3)), np.array([200.0, 200.0, 200.0, 5.0, 0.0, -5.0])
    K_theta = np.diag([1.0 / j.axial.compliance(q[:1])[0] for j in kr60.joints])
    J_inv = np.linalg.inv(jacobian(kr60.robot, q))
    K_C = complementary_stiffness(kr60.robot, q, w)
    expected = np.swapaxes(J_inv, 1, 2) @ (K_theta - K_C) @ J_inv
    # Two inverses of matrices with condition numbers up to 1e6 between them.
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(cartesian_stiffness(kr60, q, w) / size, expected / size, rtol=0, atol=1e-8)


def test_rigid_joints_carry_any_load(kr60: fem.ArmModel) -> None:
    model = kr60.with_springs({"j1": np.inf, "j4": np.inf})
    q = np.radians([[10.0, -60.0, 40.0, 20.0, 50.0, 0.0]])
    w = np.array([0.0, 0.0, -2e4, 0.0, 0.0, 0.0])
    C, stiff = loaded_compliance(model, q, w), kr60.with_springs({"j1": 1e15, "j4": 1e15})
    assert np.isfinite(C).all()
    # 1e15 N m/rad against some 1e5: as good as rigid to 1e-9.
    np.testing.assert_allclose(C, loaded_compliance(stiff, q, w), rtol=0, atol=1e-8 * np.abs(C).max())


@pytest.mark.parametrize("wrench", [np.zeros(3), np.full(6, np.nan)])
def test_bad_loads_are_refused(kr60: fem.ArmModel, wrench: Array) -> None:
    refuses("A006", "wrench array", complementary_stiffness, kr60.robot, np.zeros((2, 6)), wrench)
