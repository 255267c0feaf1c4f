"""How near a pose is to a singularity: zero at the ones that can be pointed at, the same in all units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robots import Robot, load_robot, singularity_distance
from robots.inverse.singularities import NEAR_SINGULAR
from robots.kinematics import jacobian

ROBOTS = ("xr701", "kr60-3", "tx200")


def singularity(robot: Robot, q: np.ndarray) -> np.ndarray:
    return singularity_distance(robot, q, point=np.zeros(3)).sigma_min


@pytest.mark.parametrize("name", ROBOTS)
def test_a_straight_wrist_is_singular(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (40, 6))
    q[:, 4] = 0.0
    # Axes 4 and 6 in line: round-off of the smallest singular value.
    assert singularity(robot, q).max() < 1e-12


@pytest.mark.parametrize("name", ROBOTS)
def test_it_grows_with_the_angle_of_the_wrist_and_is_flagged_within_some_degrees(
    name: str, rng: np.random.Generator
) -> None:
    robot = load_robot(name)
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (500, 6))
    found = {}
    for angle in (0.3, 0.75, 10.0, 45.0):
        q[:, 4] = np.radians(angle)
        found[angle] = singularity(robot, q)
    medians = [np.median(values) for values in found.values()]
    assert medians == sorted(medians)
    # Within three quarters of a degree at every pose, at ten degrees at few.
    assert found[0.75].max() < NEAR_SINGULAR
    assert np.median(found[10.0]) > NEAR_SINGULAR
    # In proportion to a small angle, unless the elbow is what is nearest to a singularity.
    assert np.median(found[0.75] / found[0.3]) == pytest.approx(2.5, rel=0.02)


def test_a_stretched_elbow_is_singular() -> None:
    robot = load_robot("kr60-3")
    q = np.tile(robot.limits.mean(axis=1), (20001, 1))
    low, high = robot.limits[2]
    q[:, 4], q[:, 2] = 1.2, np.linspace(low, high, 20001)
    found = singularity(robot, q)
    # A step of the scan is 0.014 deg; the sign of the determinant changes where the arm is stretched out.
    sign = np.linalg.det(jacobian(robot, q, np.zeros(3)))
    (crossings,) = np.nonzero(np.diff(np.sign(sign)))
    assert len(crossings) >= 1
    assert found[crossings].max() < 1e-4
    assert np.median(found) > NEAR_SINGULAR


def test_the_same_for_an_arm_ten_times_as_large(rng: np.random.Generator) -> None:
    robot = load_robot("tx200")
    T_pre, T_last = robot.T_pre.copy(), robot.T_last_flange.copy()
    T_pre[:, :3, 3] *= 10.0
    T_last[:3, 3] *= 10.0
    large = replace(robot, T_pre=T_pre, T_last_flange=T_last)
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (30, 6))
    np.testing.assert_allclose(singularity(large, q), singularity(robot, q), rtol=1e-9, atol=1e-14)


def test_neither_the_first_joint_nor_the_last_matters(rng: np.random.Generator) -> None:
    """They turn the base and the flange, not the arm."""
    robot = load_robot("xr701")
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (30, 6))
    turned = q.copy()
    turned[:, 0] += 1.0
    turned[:, 5] -= 0.7
    np.testing.assert_allclose(singularity(robot, turned), singularity(robot, q), rtol=1e-9, atol=1e-14)


def test_a_share_of_one(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    found = singularity(robot, rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (200, 6)))
    assert found.shape == (200,)
    assert found.min() >= 0.0
    assert found.max() < 1.0
    assert singularity(robot, np.empty((0, 6))).shape == (0,)
