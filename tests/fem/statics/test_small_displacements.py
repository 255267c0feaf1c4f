"""The limit of linear statics: what it is off by there, and what is beyond."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses
from scipy.optimize import brentq

from fem import build_model, deflection
from fem.statics.small_displacements import LIMIT, beyond_small, refuse_beyond, turn, worst_turns
from robots import load_description
from robots.kinematics import stretched_length

SPRINGS = {f"j{k}": 1e6 for k in range(1, 7)}


@pytest.fixture(scope="module")
def arm():
    return build_model(load_description("xr701"), "rigid").with_springs(SPRINGS)


@pytest.mark.parametrize("angle", [0.0, 0.8, -0.8])
def test_linear_statics_is_off_by_as_much_as_the_arm_turns(angle: float) -> None:
    """An arm of 1 m on one spring, exactly: k t = F cos(angle + t), down is negative."""
    errors = []
    for t in (LIMIT / 4, LIMIT, 10.0 * LIMIT):
        load = t / np.cos(angle)
        exact = brentq(lambda x, load=load: x - load * np.cos(angle - x), 0.0, 3.0)
        errors.append(abs(t / exact - 1.0))
    # First order in the turn: tan(0.8) = 1.03 times it, with a quarter of room for the second order.
    assert errors[1] <= 1.25 * LIMIT
    assert errors[0] <= 1.25 * LIMIT / 4
    # Far beyond, the result is of no use.
    assert errors[2] > 2.0 * LIMIT


def test_turn_is_the_larger_of_rotation_and_displacement_over_length(arm) -> None:
    length = stretched_length(arm.robot)
    d = np.array([[0.1 * length, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.07, 0], [0, 0, 0.01 * length, 0.02, 0, 0]])
    np.testing.assert_allclose(turn(arm.robot, d), [0.1, 0.07, 0.02])
    assert beyond_small(arm.robot, d).tolist() == [True, True, False]
    # What was not read says nothing.
    assert turn(arm.robot, np.array([[np.nan, np.nan, 0.1 * length]])) == pytest.approx([0.1])


def test_the_worst_displacement_is_refused_with_what_is_allowed(arm) -> None:
    refuse_beyond(arm.robot, np.full((3, 6), 1e-3), "readings")
    info = refuses(
        "M006", "", refuse_beyond, arm.robot, np.array([[0, 0, 0.2, 0, 0, 0], [0, 0, -68.0, 0, 0, 0]]), "readings"
    )
    text = str(info)
    assert "6.8e+04 mm" in text
    assert f"up to {LIMIT:g} rad" in text


def test_worst_turns_are_those_of_the_worst_force(arm) -> None:
    """No direction among many turns the tool by more displacement; a tenth of the stiffness is ten times the turn."""
    least = worst_turns(arm).min()
    soft = worst_turns(arm.with_springs(dict.fromkeys(SPRINGS, 100000.0))).min()
    assert soft == pytest.approx(10.0 * least)
    rng = np.random.default_rng(0)
    q = np.radians([[0.0, 5.0, 77.5, 0.0, 0.0, 0.0]])
    force = rng.normal(size=(200, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    moved = deflection(arm, np.repeat(q, 200, axis=0), np.hstack([force, np.zeros_like(force)]))
    assert turn(arm.robot, moved).max() > least


def test_a_rigid_arm_turns_nowhere() -> None:
    assert not worst_turns(build_model(load_description("xr701"), "rigid")).any()
