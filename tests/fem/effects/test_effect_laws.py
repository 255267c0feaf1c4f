"""Creep, slip, stick-slip and warming against closed forms; what rocks, pulls or takes half of a way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arms import LENGTH, ROUND_OFF, SPRINGS, STIFFNESS, angle_of, extra, lever_loads, of, torque, with_weight

from fem import ArmModel, build_model, deflection
from fem.effects import History, catalogue, observed, plain_history
from fem.effects.history import BETWEEN
from fem.statics.loads import LoadedPoses
from robots import ModelDescription, load_description

STANDING = np.radians([10.0, 10.0, 80.0, 15.0, 40.0, 0.0])


@pytest.fixture(scope="module")
def lever(boom: Callable[..., ModelDescription]) -> ArmModel:
    return build_model(boom(LENGTH, stiffness=STIFFNESS), links="rigid")


@pytest.fixture(scope="module")
def xr701() -> tuple[ArmModel, ModelDescription]:
    description = load_description("xr701")
    return build_model(description, "rigid").with_springs(SPRINGS), description


def at_times(seconds: list[float], cycle: list[int]) -> History:
    n, cycles = len(seconds), np.array(cycle, dtype=np.intp)
    order = np.array([k - cycle.index(c) for k, c in enumerate(cycle)], dtype=np.intp)
    clock = np.array(seconds) / max(seconds)
    return History(cycles, order, clock, is_known=True, seconds=np.array(seconds), temperature=np.full(n, 20.0))


def test_creep_under_a_steady_load_is_one_less_exp(lever: ArmModel) -> None:
    seconds = np.arange(0.0, 1200.0, 20.0)
    at = lever_loads(0.0, *np.full(len(seconds), 400.0))
    then = at_times(seconds.tolist(), [0] * len(seconds))
    grown = angle_of(extra(lever, at, of(lever, "creep:j1", share=0.2, time=300.0), then), at)
    # The first load hangs for half of the usual pause before it is read.
    np.testing.assert_allclose(grown, 0.2 * torque(at) / STIFFNESS * (1.0 - np.exp(-(seconds + 10.0) / 300.0)))


def test_creep_recovers_between_cycles_and_is_zeroed_with_the_gauge(lever: ArmModel) -> None:
    at = lever_loads(0.0, 400.0, 400.0, 400.0, 400.0)
    effect = of(lever, "creep:j1", share=0.2, time=300.0)
    full = 0.2 * torque(at)[0] / STIFFNESS
    soon, late = (
        angle_of(extra(lever, at, effect, at_times([0.0, 20.0, t, t + 20.0], [0, 0, 1, 1])), at) for t in (60.0, 1e6)
    )
    np.testing.assert_allclose(late[2:], late[:2], rtol=1e-9)
    left = full * (1.0 - np.exp(-30.0 / 300.0)) * np.exp(-30.0 / 300.0)
    grown = full + (left - full) * np.exp(-10.0 / 300.0) - left
    assert soon[2] == pytest.approx(grown, rel=1e-9)
    # Without times each cycle starts recovered, and readings come half a minute apart.
    unknown = replace(at_times([0.0, 1.0, 2.0, 3.0], [0, 0, 1, 1]), seconds=np.full(4, np.nan))
    plain = angle_of(extra(lever, at, effect, unknown), at)
    np.testing.assert_allclose(plain, np.tile(full * (1.0 - np.exp(-np.array([0.5, 1.5]) * BETWEEN / 300.0)), 2))


def test_creep_over_a_spectrum_of_times_goes_with_the_logarithm(lever: ArmModel) -> None:
    seconds = np.concatenate([[0.0], np.geomspace(20.0, 2000.0, 9)])
    at = lever_loads(0.0, *np.full(10, 300.0))
    crept = {
        spread: angle_of(
            extra(lever, at, of(lever, "creep:j1", share=0.3, time=200.0, spread=spread), at_times(seconds, [0] * 10)),
            at,
        )
        for spread in (0.0, 1.5)
    }
    # Once the load has hung for a while equal steps of the logarithm creep by equal amounts, within a third (a few
    # elements stand for a spectrum); a single time does most of it in one decade.
    steps = {spread: np.diff(turned[4:]) for spread, turned in crept.items()}
    assert steps[1.5].max() < 1.33 * steps[1.5].min()
    assert steps[0.0].max() > 4.0 * steps[0.0].min()


def test_a_gauge_that_is_zeroed_once_sees_what_creeps_and_slips_from_cycle_to_cycle(lever: ArmModel) -> None:
    at = lever_loads(0.0, 400.0, 400.0, 400.0)
    then = replace(at_times([0.0, 40.0, 200.0], [0, 0, 1]), stay=np.zeros(3, dtype=np.intp))
    each, once = (
        angle_of(extra(lever, at, of(lever, "creep:j1", share=0.2, time=300.0, zeroed=k), then), at) for k in (0.0, 1.0)
    )
    assert once[:2] == pytest.approx(each[:2])
    assert once[2] > 1.5 * each[2]
    limit = 0.5 * torque(at)[0]
    for lasting in (0.0, 1.0):
        slipped = angle_of(
            extra(lever, at, of(lever, "slip:j1", angle=1e-4, torque=limit, lasting=lasting, zeroed=1.0), then), at
        )
        np.testing.assert_allclose(slipped, 1e-4, atol=1e-18)
    moved = replace(then, stay=np.array([0, 0, 1]))
    apart = angle_of(extra(lever, at, of(lever, "creep:j1", share=0.2, time=300.0, zeroed=1.0), moved), at)
    np.testing.assert_allclose(apart, each, atol=1e-18)


def test_what_has_slipped_stays(lever: ArmModel) -> None:
    at = lever_loads(0.0, 100.0, 400.0, 100.0, 400.0, 100.0)
    tau = torque(at)
    limit = 0.5 * tau[1]
    then = at_times([0.0, 20.0, 40.0, 60.0, 80.0], [0, 0, 0, 1, 1])
    again, once = (
        angle_of(extra(lever, at, of(lever, "slip:j1", angle=1e-4, torque=limit, lasting=k), then), at)
        for k in (0.0, 1.0)
    )
    np.testing.assert_allclose(again, [0.0, 1e-4, 1e-4, 1e-4, 1e-4], atol=1e-18)
    # The gauge is zeroed where the joint has slipped to.
    np.testing.assert_allclose(once, [0.0, 1e-4, 1e-4, 0.0, 0.0], atol=1e-18)
    other = LoadedPoses(at.q, -at.wrench, at.point)
    back = angle_of(extra(lever, other, of(lever, "slip:j1", angle=1e-4, torque=limit), then), other)
    np.testing.assert_allclose(back, -again, atol=1e-18)


@pytest.mark.parametrize("place", ["base", "tool"])
def test_a_fixture_slips_the_way_it_is_pulled(place: str, xr701: tuple[ArmModel, ModelDescription]) -> None:
    model, description = xr701
    effect = catalogue(model, description)[f"slip:{place}"]
    amount, limit, *_ = effect.parameters
    at = LoadedPoses(np.tile(STANDING, (3, 1)), np.zeros((3, 6)), np.tile(model.robot.T_flange_tool[:3, 3], (3, 1)))
    load = 4.0 * limit.upper
    at.wrench[:, 2] = [-0.01 * load, -load, -0.01 * load]
    placed = effect.placed({amount.name: 1e-4, limit.name: limit.lower})
    d = extra(model, at, placed, at_times([0.0, 20.0, 40.0], [0, 0, 0]))
    assert not d[0].any()
    assert d[1, 2] < 0.0
    np.testing.assert_allclose(d[2], d[1], atol=1e-15)
    if place == "tool":
        assert d[1, 2] == pytest.approx(-1e-4 * (load / limit.lower - 1.0))
        assert not d[1, 3:].any()


def test_what_sticks_lets_go_in_jumps(lever: ArmModel) -> None:
    at = lever_loads(0.0, 100.0, 200.0, 300.0, 200.0, 100.0)
    tau = torque(at)
    effect = of(lever, "stick-slip:j1", share=1.0, torque=1.5 * tau[0], kept=0.5)
    turned = angle_of(observed(lever, at, [effect], at_times([0.0, 1.0, 2.0, 3.0, 4.0], [0] * 5)), at)
    # 100: sticks; 200: jumps to 200 - 75; 300: 175 beyond, jumps to 225; on the way back 125 away: sticks.
    np.testing.assert_allclose(turned * STIFFNESS / tau[0], [0.0, 1.25, 2.25, 2.25, 2.25], atol=1e-12)


def test_warming_follows_the_clock_of_each_session_or_the_temperature(lever: ArmModel) -> None:
    at = lever_loads(0.0, *np.full(5, 300.0))
    then = replace(plain_history(5), clock=np.linspace(0.0, 1.0, 5))
    cold = torque(at) / STIFFNESS
    straight = angle_of(extra(lever, at, of(lever, "warming:j1", share=0.2, settling=10.0), then), at)
    np.testing.assert_allclose(straight, 0.2 * cold * np.linspace(0.0, 1.0, 5), rtol=0.05, atol=1e-9)
    days = replace(then, session=np.array([0, 0, 0, 1, 1]))
    twice = angle_of(extra(lever, at, of(lever, "warming:j1", share=0.2, settling=10.0), days), at)
    assert twice[3] == 0.0
    assert twice[4] == pytest.approx(straight[1])
    read = replace(then, temperature=np.array([20.0, 25.0, 30.0, 30.0, 20.0]))
    felt = angle_of(extra(lever, at, of(lever, "warming:j1", share=0.2, settling=0.0), read), at)
    np.testing.assert_allclose(felt, 0.2 * cold * np.array([0.0, 0.5, 1.0, 1.0, 0.0]), atol=1e-18)


def test_a_loose_base_tips_with_the_moment_and_by_its_gap_at_most(lever: ArmModel) -> None:
    at = lever_loads(0.0, 10.0, 400.0, 4e4, -4e4)
    tipped = angle_of(extra(lever, at, of(lever, "loose-base", gap=2e-4, closing=300.0)), at)
    np.testing.assert_allclose(tipped, 2e-4 * np.tanh(torque(at) / 300.0), rtol=1e-9)
    assert tipped[2:] == pytest.approx([2e-4, -2e-4])


def test_half_of_a_load_path_lies_between_the_two(xr701: tuple[ArmModel, ModelDescription]) -> None:
    model, description = xr701
    known = catalogue(model, description)
    at = LoadedPoses(np.tile(STANDING, (2, 1)), np.zeros((2, 6)), np.zeros((2, 3)))
    at.wrench[:, 2], at.wrench[:, 0] = [-300.0, -600.0], 50.0
    all_of_it = extra(model, at, known["load-path"].placed({}))
    for share, factor in ((0.0, 0.0), (1.0, 1.0)):
        placed = known["partial-load-path"].placed({"share": share})
        np.testing.assert_allclose(extra(model, at, placed), factor * all_of_it, atol=1e-15)
    half = extra(model, at, known["partial-load-path"].placed({"share": 0.5}))
    assert (np.abs(half[:, 2]) < np.abs(all_of_it[:, 2])).all()
    # Where all of it goes the other way, a share that does not brings so much back.
    both = [known["load-path"].placed({}), known["partial-load-path"].placed({"share": 0.5})]
    plain = observed(model, at, [])
    np.testing.assert_allclose(observed(model, at, both) - plain, half, atol=1e-15)
    assert known["load-path"].family == known["partial-load-path"].family


def test_cables_hold_the_wrist_where_they_are_wound_up(xr701: tuple[ArmModel, ModelDescription]) -> None:
    model, description = xr701
    middle = model.robot.limits.mean(axis=1)
    wound = middle.copy()
    wound[[3, 4]] = model.robot.limits[[3, 4], 1]
    at = LoadedPoses(np.array([middle, wound]), np.zeros((2, 6)), np.tile([0.1, 0.2, 0.0], (2, 1)))
    at.wrench[:, :3] = [200.0, 300.0, -500.0]
    springs = model.with_springs({"j4": 2e5, "j5": 3e5})
    d = extra(springs, at, of(springs, "cable-package", description, share=0.5, power=2.0))
    assert not d[0].any()
    stiffer = observed(springs.with_springs({"j4": 3e5, "j5": 4.5e5}), at, []) - observed(springs, at, [])
    np.testing.assert_allclose(d[1], stiffer[1], rtol=1e-9)


def test_ranges_go_by_the_arm() -> None:
    crossing, sizes = {}, {}
    for name in ("kr60-3", "xr701"):
        description = load_description(name)
        known = catalogue(build_model(description, "rigid"), description)
        crossing[name] = known["backlash:j2"].parameters[1].upper
        sizes[name] = known["payload"].parameters[0].upper
    # 60 kg at 2 m, and 130 kg at 3 m.
    assert 100.0 < crossing["kr60-3"] < 200.0 < crossing["xr701"] < 400.0
    assert sizes["kr60-3"] / sizes["xr701"] == pytest.approx(60.0 / 132.5)


def test_axes_say_where_readings_must_differ(xr701: tuple[ArmModel, ModelDescription]) -> None:
    known = catalogue(*xr701)
    axes = {
        "pose": (
            "base-tilt",
            "load-point-offset",
            "cable-package",
            "gear-ripple:j2",
            "wrist-coupling",
            "angle-sign:j2",
        ),
        "load": ("hardening:j2", "backlash:j3", "payload", "gauge-scale", "loose-base"),
        "load history": ("friction:j2", "creep:j2", "slip:base", "stick-slip:j3"),
        "clock": ("drift", "warming:j2"),
        "direction": ("turned-frame",),
    }
    assert {code: known[code].axis for codes in axes.values() for code in codes} == {
        code: axis for axis, codes in axes.items() for code in codes
    }


# ------------------------------------------------------------
# Varying springs, loads and gauges on one joint and one lever, against their formulas

TEETH = 40.0


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


# ------------------------------------------------------------
# Springs that are not linear, on one joint and one lever, against their laws written out by hand

UP_AND_DOWN = (100.0, 300.0, 600.0, 300.0, 100.0)


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


# ------------------------------------------------------------
# The play operator over load cycles against closed forms


def test_play_against_its_closed_form_up_and_down() -> None:
    x = np.array([1.0, 3.0, 6.0, 3.0, 1.0, 0.0])
    h = History(np.zeros(6, dtype=np.intp), np.arange(6), np.full(6, np.nan), is_known=True)
    r = 2.0
    # Up: x - r above zero; down: the largest until x + r falls below it.
    np.testing.assert_allclose(h.play(x, r), [0.0, 1.0, 4.0, 4.0, 3.0, 2.0])


def test_cycles_do_not_know_one_another() -> None:
    x = np.array([5.0, 1.0, 5.0, 1.0])
    apart = History(np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]), np.full(4, np.nan), is_known=True)
    np.testing.assert_allclose(apart.play(x, 1.0), [4.0, 0.0, 4.0, 2.0])


def test_rows_in_any_order_give_the_same(rng: np.random.Generator) -> None:
    x, cycle, order = rng.normal(size=40), np.repeat(np.arange(5), 8), np.tile(np.arange(8), 5)
    whole = History(cycle, order, np.full(40, np.nan), is_known=True)
    mixed = rng.permutation(40)
    shuffled = History(cycle[mixed], order[mixed], np.full(40, np.nan), is_known=True)
    np.testing.assert_array_equal(whole.play(x, 0.3)[mixed], shuffled.play(x[mixed], 0.3))


def test_play_is_odd_and_scales(rng: np.random.Generator) -> None:
    x = rng.normal(size=30)
    h = History(np.zeros(30, dtype=np.intp), np.arange(30), np.full(30, np.nan), is_known=True)
    y = h.play(x, 0.4)
    np.testing.assert_allclose(h.play(-x, 0.4), -y)
    np.testing.assert_allclose(h.play(3.0 * x, 1.2), 3.0 * y, rtol=1e-12)
    assert np.abs(x - y).max() <= 0.4 + 1e-15


def test_plain_history_is_a_dead_zone() -> None:
    x = np.array([-3.0, -0.5, 0.5, 2.0])
    np.testing.assert_allclose(plain_history(4).play(x, 1.0), [-2.0, 0.0, 0.0, 1.0])


def test_whole_cycles_taken_out_keep_what_they_remember() -> None:
    x = np.array([4.0, 1.0, 7.0, 2.0])
    h = History(np.array([3, 3, 8, 8]), np.array([0, 1, 0, 1]), np.linspace(0.0, 1.0, 4), is_known=True)
    rows = np.array([2, 3])
    assert h.take(rows).play(x[rows], 1.0) == pytest.approx(h.play(x, 1.0)[rows])
    np.testing.assert_array_equal(h.take(rows).clock, h.clock[rows])
