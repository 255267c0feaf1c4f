"""Creep, slip, stick-slip and warming against closed forms; what rocks, pulls or takes half of a way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from effect_arms import LENGTH, SPRINGS, STIFFNESS, angle_of, extra, lever_loads, of, torque

from fem import ArmModel, build_model
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
