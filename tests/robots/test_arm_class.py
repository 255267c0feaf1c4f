"""The class of an arm: published springs lie within it, and it scales with what the arm carries."""

from __future__ import annotations

import numpy as np
import pytest

from robots import load_description
from robots.arm_class import MAIN_Nm_per_rad, WRIST_Nm_per_rad, arm_class, reach_of, usual_load
from robots.robot import robot_from


def test_published_springs_lie_within_three_times_the_class() -> None:
    """KR60-3: 2.2e6, 0.9e6, 1.1e6, 6.4e4, 2.5e4 and 2e4 N m/rad (Gao 2024)."""
    description = load_description("kr60-3")
    low, high = arm_class(description, robot_from(description)).allowed
    springs = np.array([2.1977e6, 0.8994e6, 1.1118e6, 6.44e4, 2.54e4, 2.0e4])
    assert (low < springs).all()
    assert (springs < high).all()


def test_the_class_of_100_to_270_kg_is_the_reference() -> None:
    description = load_description("xr701")
    of = arm_class(description, robot_from(description))
    # 132.5 kg at 3.0 m and 1450 kg: 8 % more torque than the reference arm has.
    np.testing.assert_allclose(of.low[[0, 5]], 1.08 * np.array([MAIN_Nm_per_rad[0], WRIST_Nm_per_rad[0]]), rtol=2e-3)
    assert of.size == "3 m reach, 132.5 kg payload, 1450 kg mass"


def test_reach_is_counted_from_axis_1_without_its_height() -> None:
    # 0.35 offset, 1.10 upper arm, 1.25 forearm, 0.30 wrist; 0.40 + 0.40 m of height do not reach.
    assert reach_of(robot_from(load_description("xr701"))) == pytest.approx(3.0)


def test_less_known_is_a_wider_class_around_the_same_middle() -> None:
    known = load_description("xr701")
    robot = robot_from(known)
    widths, middles = [], []
    for missing in ({}, {"mass": None}, {"payload": None}, {"mass": None, "payload": None}):
        of = arm_class(known.model_copy(update=missing), robot)
        widths.append(of.high[1] / of.low[1])
        middles.append(np.sqrt(of.high[1] * of.low[1]))
    np.testing.assert_allclose(widths, [10.0, 22.5, 22.5, 90.0])
    # Estimates of what is missing are rough: within the class's own half width, a factor of three.
    assert max(middles) / min(middles) < 3.0


def test_the_usual_load_is_the_payload_or_what_arms_of_this_reach_bear() -> None:
    description = load_description("xr701")
    robot = robot_from(description)
    assert usual_load(robot, description) == pytest.approx(132.5 * 9.80665)
    assert usual_load(robot) == pytest.approx(220.0 * 3.0**2.5)
