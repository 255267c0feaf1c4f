"""Parameters and noise from made-up readings: exact recovery, closed forms, outliers, bounds, trade-offs."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses
from table_cases import THREE_WAYS, Arm, campaign, plain_arm, spoilt

from doe.certainty.identifiability import trade_offs, unseen
from doe.certainty.lack_of_fit import lack_of_fit, outliers
from doe.certainty.uncertainty import bootstrap, certainty
from doe.diagnosis.diagnose import state_of
from doe.diagnosis.setting import setting_of
from doe.diagnosis.where import spread
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.noise import MOST_SHARE, Noise, fit_noise, likelihood, origin, within_readings
from doe.estimation.problem import Problem, problem
from doe.tables.measurements import Measurements
from doe.tables.reading import bundled_data, read_measurements
from fem import ArmModel, build_model
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import parameter
from robots import load_description

TRUTH = {"j1": 3e6, "j2": 1.2e6, "j3": 8e5, "j4": 3e5, "j5": 2e5, "j6": 1e5}
SPRINGS = tuple(f"{joint}.stiffness" for joint in TRUTH)
GAUGE = (1e-6, 1e-6)


@cache
def _arm(robot: str):  # type: ignore[no-untyped-def]
    return build_model(load_description(robot))


def made_up(
    names: tuple[str, ...] = SPRINGS,
    truth: dict[str, float] | None = None,
    *,
    robot: str = "kr60-3",
    poses: int = 12,
    loads: tuple[float, ...] = (200.0, 400.0, 600.0),
    repeats: int = 2,
    components: tuple[int, ...] = (0, 1, 2),
    seed: int = 0,
    vertical: bool = False,
) -> tuple[Problem, np.ndarray]:
    """A problem with exact readings, and the true variables."""
    rng = np.random.default_rng(seed)
    model = _arm(robot)
    low, high = model.robot.limits.T
    q = rng.uniform(0.8 * low, 0.8 * high, (poses, model.robot.dof))
    pose, load = (
        a.ravel() for a in np.meshgrid(np.arange(poses), np.repeat(np.arange(len(loads)), repeats), indexing="ij")
    )
    way = rng.normal(size=(poses, len(loads), 3))
    way = np.broadcast_to([0.0, 0.0, -1.0], way.shape) if vertical else way / np.linalg.norm(way, axis=2, keepdims=True)
    wrench = np.hstack([way[pose, load] * np.array(loads)[load, None], np.zeros((len(pose), 3))])
    # Off the last axis, or that joint would carry nothing.
    at = LoadedPoses(q[pose], wrench, np.tile([0.1, 0.0, 0.1], (len(pose), 1)))
    free = FreeModel(model, tuple(parameter(model, n) for n in names), at)
    values = truth or {f"{j}.stiffness": k for j, k in TRUTH.items()}
    u = np.array([p.inner(values.get(p.name, p.value)) for p in free.parameters])
    row, component = np.repeat(np.arange(len(pose)), len(components)), np.tile(components, len(pose))
    value = free.evaluate(u)[0][row, component]
    group = 6 * (len(loads) * pose + load)[row] + component
    p = Problem(
        free,
        value,
        row,
        component,
        pose[row],
        tuple(f"P{k}" for k in range(poses)),
        np.unique(group, return_inverse=True)[1],
        np.full(len(row), np.nan),
    )
    return p, u


def test_exact_readings_give_the_parameters_back() -> None:
    p, u = made_up()
    found = estimate(p, GAUGE)
    # Readings are exact; what is left is the condition number times rounding.
    np.testing.assert_allclose(found.u, u, rtol=1e-9)
    assert found.settled


def test_other_robots_and_the_parallelogram_too() -> None:
    for robot in ("xr701", "tx200"):
        p, u = made_up(robot=robot)
        found = estimate(p, GAUGE)
        seen = found.seen
        np.testing.assert_allclose(found.u[seen], u[seen], rtol=1e-8)


def test_geometry_and_springs_together() -> None:
    names = (*SPRINGS[1:4], "j2.zero", "load.x")
    truth = {"j2.stiffness": 1.2e6, "j3.stiffness": 8e5, "j4.stiffness": 3e5, "j2.zero": 0.02, "load.x": 0.03}
    p, u = made_up(names, truth)
    found = estimate(p, GAUGE)
    # Non-linear: the trust region stops at a relative step of 1e-10.
    np.testing.assert_allclose(found.u, u, rtol=1e-5)


def test_white_noise_alone_is_ordinary_least_squares() -> None:
    p, u = made_up()
    rng = np.random.default_rng(1)
    p = replace(p, value=p.value + rng.normal(size=len(p)) * 1e-5)
    found = estimate(p, GAUGE, fixed_noise=Noise((1e-5, 1e-5)), robust=False)
    f, J = p.evaluate(np.zeros(6) + p.bounds[0])
    expected = p.bounds[0] + np.linalg.lstsq(J, p.value - f, rcond=None)[0]
    np.testing.assert_allclose(found.u, expected, rtol=1e-8)
    sure = certainty(found, profiles=False)
    covariance = 1e-10 * np.linalg.inv(J.T @ J)
    np.testing.assert_allclose(sure.covariance, covariance, rtol=1e-6)
    assert np.all(np.abs(found.u - u) < 5.0 * np.sqrt(np.diag(covariance)))


def test_whitening_is_that_of_the_full_covariance() -> None:
    p, u = made_up(poses=4)
    noise = Noise((1e-5, 2e-5), 0.02, (4e-6, 0.0), 0.03)
    f, _ = p.evaluate(u)
    variance, common = noise.variance(p, f), noise.common(p, f)
    key = 6 * p.pose + p.component
    V = np.diag(variance) + (common @ common.T) * (key[:, None] == key)
    of = p.blocks.covariance(variance, common)
    white, log_det = of.whiten(np.eye(len(p))), of.log_det
    np.testing.assert_allclose(white @ V @ white.T, np.eye(len(p)), atol=1e-9)
    assert log_det == pytest.approx(np.linalg.slogdet(V)[1], rel=1e-12)
    inverse = of.solve(np.eye(len(p)))
    np.testing.assert_allclose(inverse @ V, np.eye(len(p)), atol=1e-8)


def _scattered(p: Problem, u: np.ndarray, noise: Noise, seed: int) -> Problem:
    rng = np.random.default_rng(seed)
    f, _ = p.evaluate(u)
    common = noise.common(p, f)
    draw = rng.normal(size=(len(p.poses), 6, 2))[p.pose, p.component]
    return replace(p, value=f + rng.normal(size=len(p)) * np.sqrt(noise.variance(p, f)) + np.sum(common * draw, axis=1))


def test_variances_come_back() -> None:
    p, u = made_up(poses=40, repeats=3)
    truth = Noise((8e-6, 1e-6), 0.02, (0.0, 0.0), 0.04)
    found = []
    for seed in range(8):
        one = _scattered(p, u, truth, seed)
        f, J = one.evaluate(u)
        found.append(fit_noise(one, f, J, one.value - f, Noise(GAUGE), GAUGE, np.ones(len(one))))
    # Means over eight sets of 40 set-ups x 3 components: the standard errors are 1 %, 2 % and 3 %.
    assert np.mean([n.white[0] for n in found]) == pytest.approx(8e-6, rel=0.06)
    assert np.mean([n.share for n in found]) == pytest.approx(0.02, rel=0.1)
    assert np.mean([n.pose_share for n in found]) == pytest.approx(0.04, rel=0.12)


def test_slope_and_information_of_the_restricted_likelihood() -> None:
    p, u = made_up(poses=4, components=(0, 1, 3))
    p = _scattered(p, u, Noise((1e-5, 1e-5), 0.02, (5e-6, 0.0), 0.03), 0)
    f, J = p.evaluate(u)
    names = ("white0", "share", "pose1", "pose_share", "white1", "pose0")
    of = likelihood(p, names, Noise(GAUGE), f, J, p.value - f, 1.0 - 0.5 * (np.arange(len(p)) % 7 == 0))
    t = np.array([1.3e-5, 0.015, 3e-6, 0.02, 1e-5, 4e-6]) ** 2
    slope, information = of.at(t).slope(), of.at(t).information()
    steps = 1e-4 * np.diag(t)
    loss = [(of.at(t + h).loss - of.at(t - h).loss) / (2.0 * h.sum()) for h in steps]
    np.testing.assert_allclose(slope, -np.array(loss), rtol=1e-5)
    # The same by the matrices themselves.
    same = of.blocks.number[:, None] == of.blocks.number
    V_i = [np.outer(x.pattern, x.pattern) * same if x.common else np.diag(x.pattern) for x in of.terms]
    V = np.linalg.inv(np.einsum("i,iab->ab", t, np.array(V_i)))
    P = V - V @ of.basis @ np.linalg.inv(of.basis.T @ V @ of.basis) @ of.basis.T @ V
    expected = [[0.5 * np.trace(P @ a @ P @ b) for b in V_i] for a in V_i]
    np.testing.assert_allclose(information, expected, rtol=1e-9)


def test_outliers_lose_their_weight_and_are_named() -> None:
    p, u = made_up(repeats=3)
    p = _scattered(p, u, Noise((1e-5, 1e-5)), 2)
    value = p.value.copy()
    bad = [7, 100, 211]
    value[bad] += 3e-4
    plain = estimate(replace(p, value=value), GAUGE, robust=False)
    robust = estimate(replace(p, value=value), GAUGE)
    assert set(outliers(robust)) == set(bad)
    clean = estimate(p, GAUGE)
    # Thirty standard deviations off each, they pull like readings 0.3 off; good ones change weight a little too.
    shift, plain_shift = (float(np.linalg.norm((e.u - clean.u) / clean.u)) for e in (robust, plain))
    assert shift < 0.4 * plain_shift


def test_a_rigid_joint_ends_at_its_bound_and_says_so() -> None:
    truth = {f"{j}.stiffness": k for j, k in TRUTH.items()} | {"j5.stiffness": 1e9}
    p, u = made_up(truth=truth)
    sure = certainty(estimate(_scattered(p, u, Noise((1e-5, 1e-5)), 1), GAUGE))
    j5 = sure.estimates[4]
    assert j5.status in ("at bound", "one-sided")
    assert j5.interval[1] == math.inf
    assert 1e5 < j5.interval[0] < math.inf


def test_under_vertical_loads_the_first_joint_is_not_identified() -> None:
    p, u = made_up(robot="xr701", vertical=True, components=(2,))
    found = estimate(_scattered(p, u, Noise((1e-5, 1e-5)), 1), GAUGE)
    assert "j1.stiffness" in unseen(found)
    first = certainty(found).estimates[0]
    assert first.status == "not identified"
    assert math.isnan(first.value)


def test_twins_are_reported_as_a_sum() -> None:
    # The base's turn about the vertical and joint 1's are the same turn.
    names = ("j1.stiffness", "base.rz", "j2.stiffness", "j3.stiffness")
    truth = {"j1.stiffness": 2e6, "base.rz": 2e6, "j2.stiffness": 1e6, "j3.stiffness": 8e5}
    p, u = made_up(names, truth)
    found = estimate(_scattered(p, u, Noise((1e-5, 1e-5)), 1), GAUGE)
    sure = certainty(found)
    assert {e.parameter.name: e.status for e in sure.estimates}["j2.stiffness"] == "determined"
    assert {sure.estimates[0].status, sure.estimates[1].status} == {"not identified"}
    (twin,) = trade_offs(found, sure)
    assert twin.parameters == ("j1.stiffness", "base.rz")
    np.testing.assert_allclose(twin.weights, 1.0, rtol=1e-3)
    assert twin.best.value == pytest.approx(1e-6, rel=0.05)
    assert "sum" in twin.words


def test_a_prior_determines_what_the_readings_do_not() -> None:
    p, u = made_up(robot="xr701", vertical=True, components=(2,))
    p = _scattered(p, u, Noise((1e-5, 1e-5)), 1)
    known = tuple(
        replace(q, prior=(math.log(2e6), 0.3)) if q.name in ("j1.stiffness", "j6.stiffness") else q
        for q in p.parameters
    )
    p = replace(p, free=replace(p.free, parameters=known))
    found = estimate(p, GAUGE)
    first = certainty(found).estimates[0]
    assert first.value == pytest.approx(2e6, rel=1e-3)
    assert first.status == "determined"
    assert first.interval[0] == pytest.approx(2e6 * math.exp(-0.3 * 1.98), rel=0.1)


def test_lack_of_fit_is_seen_and_noise_is_not() -> None:
    p, u = made_up(repeats=3)
    p = _scattered(p, u, Noise((1e-5, 1e-5)), 3)
    assert lack_of_fit(estimate(p, GAUGE)).p_value > 0.01
    # Without joint 3's spring the rest cannot follow.
    short = replace(p, free=FreeModel(p.free.model, tuple(q for q in p.parameters if q.place != "j3"), p.free.at))
    found = lack_of_fit(estimate(short, GAUGE, fixed_noise=Noise((1e-5, 1e-5))))
    assert found.p_value < 1e-6
    assert found.pure_error_m == pytest.approx(1e-5, rel=0.15)


def test_bootstrap_over_poses_agrees_with_the_covariance() -> None:
    p, u = made_up(SPRINGS[1:4], poses=30)
    p = _scattered(p, u, Noise((1e-5, 1e-5)), 4)
    found = estimate(p, GAUGE)
    values = bootstrap(found, np.random.default_rng(0), 60)
    sd = np.nanstd(1.0 / values, axis=0)
    expected = np.sqrt(np.diag(certainty(found, profiles=False).covariance))
    # Sixty draws of thirty poses: some 10 % each.
    np.testing.assert_allclose(sd, expected, rtol=0.5)


def test_too_few_readings_are_refused() -> None:
    p, _ = made_up()
    refuses("C001", "cannot determine 6", estimate, p.take(np.arange(len(p)) < 5), GAUGE)
    refuses("C001", "no reading", estimate, p.take(np.zeros(len(p), dtype=bool)), GAUGE)


# ------------------------------------------------------------
# No noise is larger than the readings can hold, and it is called noise only where something tells it

# Rounding of sums of squares.
ROUNDING = 1.0 + 1e-9


def freed(model: ArmModel, data: Measurements, joints: tuple[str, ...] = ("j2", "j3", "j5")) -> Problem:
    return problem(model, data, [parameter(model, f"{j}.stiffness") for j in joints])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def assert_held(e: Estimate) -> None:
    p = e.problem
    for kind, floor in zip((p.component < 3, p.component >= 3), GAUGE, strict=True):
        if kind.any():
            assert rms(e.noise.spread(p, e.prediction)[kind]) <= max(rms(p.value[kind]), floor) * ROUNDING
    assert max(e.noise.share, e.noise.pose_share) <= MOST_SHARE


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    how=st.sampled_from(["rows flipped", "cells flipped", "random", "shuffled", "upside down", "as it is"]),
    layout=st.sampled_from(
        [
            {"poses": 9},
            {"poses": 3, "loads": (300.0,), "components": (0, 1, 2)},
            {"poses": 8, "components": (2, 4)},
            {"poses": 6, "loads": (150.0, 600.0), "ways": THREE_WAYS, "components": (0, 1, 2)},
            {"poses": 2, "loads": (100.0, 200.0, 400.0, 800.0)},
        ]
    ),
    noise=st.sampled_from([0.0, 0.3, 3.0]),
)
def test_noise_is_never_larger_than_the_readings(seed: int, how: str, layout: dict[str, object], noise: float) -> None:
    data = campaign(seed, noise=noise, **layout)  # type: ignore[arg-type]
    data = data if how == "as it is" else spoilt(data, how, seed)
    assert_held(estimate(freed(plain_arm("kr60-3"), data), GAUGE))


def test_flipped_readings_of_the_xr701_hold_no_noise_beyond_them(arm: Arm) -> None:
    """Springs at their rigid end predict next to nothing: a share of that once became 12 mm for 1.2 mm read."""
    model = arm()
    data = spoilt(read_measurements(bundled_data("xr701"), model.robot), "rows flipped")
    assert_held(estimate(freed(model, data, ("j2", "j3", "j4", "j5")), GAUGE))
    s = setting_of(load_description("xr701"), model, data)
    state = state_of(s, Noise(white=(5e-7, 5e-7), share=16.0), np.ones(len(s.data)))
    read = 1e3 * rms(s.data.value)
    assert state.noise_floor_mm <= read * ROUNDING
    assert 1e3 * rms(spread(s, Noise(white=(5e-7, 5e-7), share=1e6))) <= read * ROUNDING


def test_the_estimate_of_real_noise_is_left_as_it_is() -> None:
    p = freed(plain_arm("kr60-3"), campaign(0, poses=20, noise=0.2))
    f = p.evaluate(p.free.start)[0]
    noise = Noise((0.2 * rms(p.value), 1e-6), 0.1, (1e-5, 0.0), 0.02)
    held = within_readings(p, f, noise, GAUGE)
    np.testing.assert_allclose(held.white, noise.white, rtol=1e-12)
    assert (held.share, held.pose, held.pose_share) == (noise.share, noise.pose, noise.pose_share)


def test_sigmas_that_came_with_the_readings_are_left_alone() -> None:
    data = campaign(0, poses=8)
    p = freed(plain_arm("kr60-3"), replace(data, sigma=np.full(data.n, 1.0)))
    # Their white noise is the sigmas; the one beside it is of no reading.
    noise = Noise((1.0, 1.0), pose=(2e-5, 0.0))
    assert within_readings(p, p.value, noise) == noise


def test_only_repeats_and_sigmas_tell_noise_from_the_residual() -> None:
    model = plain_arm("kr60-3")
    single, double = campaign(0), campaign(0, loads=(300.0, 300.0))
    assert origin(freed(model, single)) == "residual"
    assert origin(freed(model, double)) == "repeats"
    assert origin(freed(model, replace(single, sigma=np.full(single.n, 1e-5)))) == "given"
    # Two repeats of one set-up do not tell a noise.
    few = double.select(np.arange(double.n) < double.n // 2 + 2)
    assert origin(freed(model, few)) == "residual"
    assert origin(freed(model, single), given=True) == "given"


def test_other_loads_are_no_repeats() -> None:
    p = freed(plain_arm("kr60-3"), campaign(0, poses=4, loads=(100.0, 200.0, 300.0)))
    assert origin(p) == "residual"
    assert pytest.approx(len(p)) == len(np.unique(p.replicate))
