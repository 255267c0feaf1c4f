"""Springs that are not linear, on one joint and one lever, against their laws written out by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from effect_arms import LENGTH, ROUND_OFF, STIFFNESS, angle_of, extra, lever_loads, of, torque, with_weight

from fem import ArmModel, build_model
from fem.effects import History, observed
from fem.statics.loads import LoadedPoses
from robots import ModelDescription

UP_AND_DOWN = (100.0, 300.0, 600.0, 300.0, 100.0)


@pytest.fixture(scope="module")
def lever(boom: Callable[..., ModelDescription]) -> ArmModel:
    return build_model(boom(LENGTH, stiffness=STIFFNESS), links="rigid")


def one_cycle(n: int) -> History:
    return History(np.zeros(n, dtype=np.intp), np.arange(n), np.full(n, np.nan), is_known=True)


def test_the_lever_itself(lever: ArmModel) -> None:
    at = lever_loads(30.0, 100.0, 650.0)
    np.testing.assert_allclose(angle_of(observed(lever, at, []), at), torque(at) / STIFFNESS, rtol=ROUND_OFF)


def test_hardening_has_two_slopes(lever: ArmModel) -> None:
    at = lever_loads(20.0, 0.1, 1e4, 1.1e4, -1e4)
    tau = torque(at)
    theta = angle_of(observed(lever, at, [of(lever, "hardening:j1", share=0.4, knee=300.0, power=1.0)]), at)
    # tanh is x - x^3/3 at first, and 1 to round-off thirty knees on.
    assert theta[0] == pytest.approx(tau[0] / STIFFNESS, rel=1e-6)
    assert (theta[2] - theta[1]) / (tau[2] - tau[1]) == pytest.approx(0.6 / STIFFNESS, rel=1e-9)
    assert theta[1] == pytest.approx((0.6 * tau[1] + 0.4 * 300.0) / STIFFNESS, rel=1e-9)
    assert theta[3] == pytest.approx(-theta[1], rel=ROUND_OFF)


def test_contact_that_grows_is_a_power_below_one(lever: ArmModel) -> None:
    at = lever_loads(20.0, 200.0, 800.0, -800.0)
    tau = torque(at)
    theta = angle_of(observed(lever, at, [of(lever, "hardening:j1", share=0.6, knee=500.0, power=0.65)]), at)
    power = 500.0 * np.sign(tau) * np.abs(tau / 500.0) ** 0.65
    np.testing.assert_allclose(theta, (0.4 * tau + 0.6 * power) / STIFFNESS, rtol=1e-11)


def test_softening_is_a_power(lever: ArmModel) -> None:
    at = lever_loads(-15.0, 200.0, 400.0, -400.0)
    tau = torque(at)
    theta = angle_of(observed(lever, at, [of(lever, "softening:j1", share=0.5, torque=300.0, power=2.0)]), at)
    np.testing.assert_allclose(theta, tau / STIFFNESS * (1.0 + 0.5 * (tau / 300.0) ** 2), rtol=ROUND_OFF)


def test_backlash_closes_half_the_gap_from_the_middle(lever: ArmModel) -> None:
    at = lever_loads(0.0, 5.0, 1e4, -1e4)
    gap = angle_of(extra(lever, at, of(lever, "backlash:j1", gap=6e-4, crossing=10.0, preload=0.0)), at)
    assert gap[0] == pytest.approx(3e-4 * np.tanh(5.0 * LENGTH / 10.0), rel=1e-9)
    np.testing.assert_allclose(gap[1:], [3e-4, -3e-4], rtol=1e-9)


def test_backlash_under_preload_opens_only_where_the_load_turns_the_torque(lever: ArmModel) -> None:
    kg, place = 40.0, 0.6
    heavy = with_weight(lever, kg, place)
    placed = of(heavy, "backlash:j1", gap=6e-4, crossing=5.0, preload=1.0)
    at = lever_loads(0.0, 1000.0, -1000.0)
    gap = angle_of(extra(heavy, at, placed), at)
    # 235 N m of weight, 47 crossings, hold the flanks closed: nothing downward, the whole gap upward.
    assert gap[0] == pytest.approx(0.0, abs=1e-12)
    assert gap[1] == pytest.approx(-6e-4, rel=1e-9)
    without = of(heavy, "backlash:j1", gap=6e-4, crossing=5.0, preload=0.0)
    assert angle_of(extra(heavy, at, without), at)[0] == pytest.approx(3e-4, rel=1e-9)


def test_friction_against_jenkins_element(lever: ArmModel) -> None:
    friction = 200.0
    at = lever_loads(10.0, *UP_AND_DOWN)
    tau = torque(at)
    placed = of(lever, "friction:j1", share=1.0, friction=friction)
    theta = angle_of(observed(lever, at, [placed], one_cycle(5)), at) * STIFFNESS
    up = np.maximum(tau[:3] - friction, 0.0)
    assert theta[:3] == pytest.approx(up, rel=1e-9, abs=1e-9)
    # Taking load off moves nothing until the friction has turned twice over.
    assert theta[3:] == pytest.approx(np.minimum(up[2], tau[3:] + friction), rel=1e-9)
    assert theta[4] > theta[0]


def test_area_of_the_friction_loop(lever: ArmModel) -> None:
    # Closed loop between -T and T: area 4 M (T - M) c for a spring behind dry friction M.
    friction, top = 150.0, 700.0
    newtons = np.concatenate([np.linspace(0, top, 400), np.linspace(top, -top, 800), np.linspace(-top, top, 800)])
    at = lever_loads(0.0, *newtons)
    tau = torque(at)
    theta = angle_of(
        observed(lever, at, [of(lever, "friction:j1", share=1.0, friction=friction)], one_cycle(len(newtons))), at
    )
    loop = slice(399, None)
    area = float(np.sum(0.5 * (theta[loop][1:] + theta[loop][:-1]) * np.diff(tau[loop])))
    T = top * LENGTH
    # The trapezoidal rule cuts four corners of a step each.
    assert abs(area) == pytest.approx(4.0 * friction * (T - friction) / STIFFNESS, rel=5e-3)


def test_without_history_every_reading_is_a_loading_from_zero(lever: ArmModel) -> None:
    at = lever_loads(0.0, *UP_AND_DOWN)
    theta = angle_of(observed(lever, at, [of(lever, "friction:j1", share=1.0, friction=100.0)]), at)
    np.testing.assert_allclose(theta[[3, 4]], theta[[1, 0]], rtol=ROUND_OFF)


def test_a_joint_feels_only_its_own_torque(lever: ArmModel) -> None:
    # A moment about x crosses the axis and moves no nonlinear spring.
    wrench = np.array([[0.0, 0.0, 0.0, 500.0, 0.0, 300.0]])
    at = LoadedPoses(np.zeros((1, 1)), wrench, np.zeros((1, 3)))
    for code, values in {
        "backlash:j1": {"gap": 1e-3, "crossing": 5.0, "preload": 0.0},
        "softening:j1": {"share": 0.5, "torque": 100.0, "power": 1.0},
        "hardening:j1": {"share": 0.5, "knee": 100.0, "power": 1.0},
    }.items():
        assert np.abs(extra(lever, at, of(lever, code, **values))).max() < 1e-15
