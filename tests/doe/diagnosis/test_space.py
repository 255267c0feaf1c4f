"""A diagnosis in space: gaps at the tool points, and what leaving an effect out costs where nothing was measured."""

from __future__ import annotations

import numpy as np
import pytest
from made_up import few, kr60, read, setting

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.diagnosis.space import cost_of_leaving_out, gaps
from fem.effects.catalogue import effect_of
from fem.effects.observed import observed
from fem.statics.loads import LoadedPoses
from robots import forward_kinematics, tool_position


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnose(few(setting(read({"payload": {"force": 40.0}}, poses=10, repeats=1, seed=1))))


def test_gaps_stand_at_the_tool_and_leave_unread_components_open(found: Diagnosis) -> None:
    g, robot = gaps(found), kr60()[1].robot
    np.testing.assert_allclose(g.point, tool_position(robot, forward_kinematics(robot, g.q)), atol=1e-12)  # round-off
    assert np.isnan(g.before[:, :2]).all()
    assert len(g.pose) == len(found.before.residual)
    np.testing.assert_array_equal(g.before[:, 2], found.before.residual)
    np.testing.assert_array_equal(g.after[:, 2], found.after.residual)
    np.testing.assert_allclose(g.measured[:, 2], found.before.setting.data.value, rtol=0)


def test_an_effect_of_the_measurement_costs_only_by_the_springs_it_bent(found: Diagnosis) -> None:
    model, rng = kr60()[1], np.random.default_rng(3)
    q = rng.uniform(-0.5, 0.5, (5, 6))
    at = LoadedPoses(
        q, np.tile([0.0, 0.0, -450.0, 0.0, 0.0, 0.0], (5, 1)), np.tile(model.robot.T_flange_tool[:3, 3], (5, 1))
    )
    cost = cost_of_leaving_out(found, at)
    springs = observed(found.after.setting.arm, at, ()) - observed(found.before.setting.arm, at, ())
    np.testing.assert_array_equal(cost, springs[:, :3])
    assert np.abs(cost).max() > 1e-6


def test_which_effects_go_on_acting() -> None:
    description, model = kr60()
    lasting = {
        "joint-zero-offset:j2": True,
        "backlash:j2": True,
        "base-tilt": True,
        "payload": False,
        "drift": False,
        "gauge-zero": False,
        "load-misalignment": False,
    }
    assert {code: effect_of(code, model, description).of_the_arm for code in lasting} == lasting
