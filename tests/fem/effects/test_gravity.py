"""Torque of the arm's own weight against finite differences of its potential energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem import ArmModel, build_model
from fem.model import BodyMass
from fem.statics.loads import gravity_torque
from robots import load_description
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.kinematics import forward_kinematics

# Central differences of an energy of 1e4 J with a step of 1e-5: 1e-16 * 1e4 / 1e-5, and more in cancellation.
DIFFERENCE = 1e-5
MASSES = (
    BodyMass(1, 200.0, np.array([0.1, 0.05, -0.1])),
    BodyMass(2, 150.0, np.array([0.5, -0.04, 0.1])),
    BodyMass(3, 120.0, np.array([0.05, 0.3, 0.02])),
    BodyMass(4, 60.0, np.array([0.03, 0.02, 0.2])),
    BodyMass(6, 25.0, np.array([0.01, 0.04, 0.05])),
)


def energy(model: ArmModel, q: Array) -> Array:
    frames = forward_kinematics(model.robot, q)
    height = [(frames.p[:, m.body] + frames.R[:, m.body] @ m.centre)[:, 2] * m.kg for m in model.masses]
    return np.asarray(STANDARD_GRAVITY * np.sum(height, axis=0))


def slope(model: ArmModel, q: Array, way: Array) -> Array:
    """Derivative of the energy where the bodies turn by ``way`` (dof,) in joint angles of the open chain."""
    h = 1e-5
    return (energy(model, q + h * way) - energy(model, q - h * way)) / (2.0 * h)


def poses(model: ArmModel) -> Array:
    rng = np.random.default_rng(3)
    low, high = model.robot.limits.T
    q = rng.uniform(low, high, (100, 6))
    return np.asarray(q[model.robot.reachable(q)][:8])


def test_a_serial_arm() -> None:
    model = replace(build_model(load_description("kr60-3"), links="rigid"), masses=MASSES)
    q = poses(model)
    found = gravity_torque(model, q)
    # A coordinate may count against its joint's axis.
    signs = np.array([j.sign for j in load_description("kr60-3").joint])
    for k in range(6):
        np.testing.assert_allclose(found[:, k], -signs[k] * slope(model, q, np.eye(6)[k]), atol=DIFFERENCE)
    assert np.abs(found[:, 1]).min() > 10.0


def test_a_parallelogram_carries_the_forearm_past_joint_2() -> None:
    """By virtual work: turning the motor of joint 2 alone keeps the forearm's attitude, the elbow turns back."""
    d = load_description("xr701")
    model = replace(build_model(d, links="rigid"), masses=MASSES)
    q = poses(model)
    found = gravity_torque(model, q)
    assert model.robot.parallelogram is not None
    # q3real is the elbow's interior angle: with the bar held it grows as the upper arm leans forward.
    held = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(found[:, 1], -slope(model, q, held), atol=DIFFERENCE)
    elbow = slope(model, q, np.eye(6)[2])
    assert np.abs(np.abs(found[:, 2]) - np.abs(elbow)).max() < DIFFERENCE
    for k in (0, 3, 4, 5):
        np.testing.assert_allclose(np.abs(found[:, k]), np.abs(slope(model, q, np.eye(6)[k])), atol=DIFFERENCE)
    serial = gravity_torque(replace(model, bar=None, load_path="serial"), q)
    np.testing.assert_allclose(serial[:, 1], -slope(model, q, np.eye(6)[1]), atol=DIFFERENCE)


def test_no_masses_no_torque() -> None:
    model = replace(build_model(load_description("xr701"), links="rigid"), masses=())
    assert not gravity_torque(model, poses(model)).any()


@pytest.mark.parametrize("name", ["xr701", "kr60-3", "tx200"])
def test_masses_are_those_of_the_file(name: str) -> None:
    d = load_description(name)
    declared = [link.mass.si for link in d.link if link.mass is not None]
    assert [m.kg for m in build_model(d, links="rigid").masses] == pytest.approx(declared)
