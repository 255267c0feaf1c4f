"""Ends of intervals by profile likelihood against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plain_problems import PlainModel, linear, problem_of
from scipy.stats import t as student

from doe.certainty.profile_likelihood import PRECISE, profile_end, rise_of
from doe.certainty.uncertainty import certainty, degrees_of_freedom, law_band
from doe.estimation.estimate import Estimate, estimate, estimate_at
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from fem.free.kinds import LAW
from fem.free.parameters import FreeLaw, Parameter, TableBasis

QUANTILE = 2.0
UNIT = Noise((1.0, 1.0))


def _found(p: Problem) -> Estimate:
    return estimate(p, (1.0, 1.0), fixed_noise=UNIT, robust=False)


def _covariance(e: Estimate) -> np.ndarray:
    return certainty(e, profiles=False).covariance


def _end(e: Estimate, k: int, side: int, guess: float = 1.0) -> float:
    return profile_end(rise_of(e, k, _covariance(e)), float(e.u[k]), float(e.problem.bounds[side][k]), QUANTILE, guess)


@pytest.mark.parametrize("guess", [1e-3, 1.0, 50.0])
def test_a_linear_problem_has_a_parabola(guess: float) -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(20, 3))
    e = _found(linear(A, A @ [1.0, -2.0, 0.5] + rng.normal(size=20)))
    sd = np.sqrt(np.diag(np.linalg.inv(A.T @ A)))
    for k in range(3):
        for side, sign in ((0, -1.0), (1, 1.0)):
            # Ends are found to PRECISE of the quantile, and the rise is proportional to the way.
            assert _end(e, k, side, guess) == pytest.approx(e.u[k] + sign * QUANTILE * sd[k], abs=PRECISE * 2.0 * sd[k])


def _coupled(second: float, r: float) -> Estimate:
    """Two variables, normal matrix [[1, r], [r, 1]], at 0 and ``second``, which cannot fall below 0."""
    A = np.linalg.cholesky(np.array([[1.0, r], [r, 1.0]])).T
    A = np.vstack([A, np.zeros((1, 2))])
    return _found(linear(A, A @ [0.0, second], ranges=[(-100.0, 100.0), (0.0, 100.0)]))


def test_another_variable_at_its_bound_cannot_give_way_any_more() -> None:
    r, second = 0.9, 0.5
    e = _coupled(second, r)
    # Up, the second variable gives way until it meets zero; then (d, -second) costs d^2 - 2 r d second + second^2.
    beyond = r * second + math.sqrt((r * second) ** 2 - second**2 + QUANTILE**2)
    assert beyond < QUANTILE / math.sqrt(1.0 - r**2)
    assert _end(e, 0, 1) == pytest.approx(beyond, rel=2.0 * PRECISE)
    # Down, it is free.
    assert _end(e, 0, 0) == pytest.approx(-QUANTILE / math.sqrt(1.0 - r**2), rel=2.0 * PRECISE)


def test_an_estimate_at_its_bound_has_an_interval_to_one_side() -> None:
    r = 0.6
    A = np.linalg.cholesky(np.array([[1.0, r], [r, 1.0]])).T
    value = A @ [3.0, -1.0]
    e = _found(linear(A, value, ranges=[(-100.0, 100.0), (0.0, 100.0)]))
    assert e.u[1] == 0.0
    assert _end(e, 1, 0) == 0.0
    # Unbounded, the sum of squares is (1 - r^2) (x + 1)^2 with the first variable free.
    slope = 1.0 - r**2
    expected = math.sqrt((QUANTILE**2 + slope) / slope) - 1.0
    assert _end(e, 1, 1) == pytest.approx(expected, rel=2.0 * PRECISE)


def test_a_range_shorter_than_the_interval_is_its_end() -> None:
    A = np.ones((4, 1))
    e = _found(linear(A, np.array([0.1, -0.1, 0.2, -0.2]), ranges=[(-0.5, 5.0)]))
    assert _end(e, 0, 0) == -0.5
    assert _end(e, 0, 1) == pytest.approx(1.0, rel=2.0 * PRECISE)


def test_a_logarithm_has_the_interval_of_its_value() -> None:
    y = np.array([3.1, 2.4, 3.6, 2.9])
    p = Parameter("wall", LAW, "link", (), "m", 1.0, 1e-3, 1e3, "log")

    def work(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.full(4, np.exp(u[0])), np.full((4, 1), np.exp(u[0]))

    e = _found(problem_of(PlainModel([p], np.array([0.0]), work), y))
    assert e.u[0] == pytest.approx(math.log(y.mean()), rel=1e-5)
    # Not a parabola in the logarithm: the mean of four gives or takes 2 / sqrt(4).
    for side, sign in ((0, -1.0), (1, 1.0)):
        assert _end(e, 0, side) == pytest.approx(math.log(y.mean() + sign), abs=5e-3)


@pytest.mark.parametrize("power", [0.3, 1.0, 3.0])
def test_any_rising_function_is_met(power: float) -> None:
    found = profile_end(lambda x: abs(x - 1.0) ** power, 1.0, 1e4, QUANTILE, 0.01)
    # PRECISE of the quantile, by the function's slope there.
    assert found - 1.0 == pytest.approx(QUANTILE ** (1.0 / power), rel=2.0 * PRECISE / power)


# ------------------------------------------------------------
# Bands of estimated laws: closed forms for a table whose nodes are read one by one

NODES = np.array([-1.0, 0.0, 1.0, 2.0])
VALUES = np.array([12.0, 13.0, 13.5])
SD = 0.1


def _q(angles: list[float]) -> np.ndarray:
    return np.column_stack([np.zeros(len(angles)), angles])


@pytest.mark.parametrize("first", [0, 1])
def test_a_table_read_node_by_node(first: int) -> None:
    # Another number goes before the law's; no reading moves with the last node.
    A = np.zeros((3 + first, 4 + first))
    A[np.arange(3 + first), np.arange(3 + first)] = 1.0
    p = linear(A, np.concatenate([np.full(first, 7.0), VALUES]))
    e = estimate(p, (1e-6, 1e-6), fixed_noise=Noise((SD, SD)), robust=False)
    band = law_band(e, certainty(e), FreeLaw("j2", TableBasis(1, NODES), first), _q([-1.0, 0.0, -0.5, 0.25, 1.0, 1.5]))
    log_k = np.array([12.0, 13.0, 12.5, 13.125, 13.5])
    sd = SD * np.array([1.0, 1.0, np.sqrt(0.5), np.hypot(0.75, 0.25), 1.0])
    np.testing.assert_allclose(band.stiffness[:5], np.exp(log_k), rtol=1e-9)
    # 1.95996: the normal distribution's quantile, for the noise was given.
    np.testing.assert_allclose(band.high[:5], np.exp(log_k + 1.959964 * sd), rtol=1e-6)
    np.testing.assert_allclose(band.low[:5], np.exp(log_k - 1.959964 * sd), rtol=1e-6)
    assert np.isnan([band.stiffness[5], band.low[5], band.high[5]]).all()


def test_nodes_seen_only_together_are_told_where_they_are_one() -> None:
    # Only the spring half way between the first two nodes is read.
    p = linear(np.array([[0.5, 0.5, 0.0, 0.0]] * 3), np.array([12.4, 12.5, 12.6]))
    e = estimate(p, (1e-6, 1e-6), fixed_noise=Noise((SD, SD)), robust=False)
    band = law_band(e, certainty(e), FreeLaw("j2", TableBasis(1, NODES), 0), _q([-0.5, -0.75]))
    assert band.stiffness[0] == pytest.approx(np.exp(12.5), rel=1e-9)
    assert band.high[0] == pytest.approx(np.exp(12.5 + 1.959964 * SD / np.sqrt(3.0)), rel=1e-6)
    assert np.isnan(band.stiffness[1])


# ------------------------------------------------------------
# Degrees of freedom where theory gives them exactly: white noise, balanced groups

GROUPS, REPEATS = 8, 5
POSE = np.repeat(np.arange(GROUPS), REPEATS)
N = len(POSE)


def _at(A: np.ndarray, noise: Noise, names: tuple[str, ...]) -> Estimate:
    """An estimate whose variances were found to be those of ``noise``."""
    p = linear(A, np.random.default_rng(0).normal(size=len(A)), POSE[: len(A)])
    e = estimate_at(p, np.zeros(A.shape[1]), noise, np.ones(len(p)), settled=True)
    return replace(e, estimated=names)


def _dof(e: Estimate) -> np.ndarray:
    covariance = np.linalg.inv(e.whitened.T @ e.whitened)
    return degrees_of_freedom(e, covariance, np.ones(len(e.u), dtype=bool))


@pytest.mark.parametrize("p", [1, 4, 11])
def test_white_noise_leaves_readings_less_parameters(p: int) -> None:
    A = np.random.default_rng(1).normal(size=(N, p))
    np.testing.assert_allclose(_dof(_at(A, Noise((0.3, 1.0)), ("white0",))), N - p, rtol=1e-9)


@pytest.mark.parametrize("between", [0.1, 1.0, 10.0])
def test_balanced_groups(between: float) -> None:
    # The mean of all has groups - 1 degrees of freedom, a slope within groups what is left within them.
    slope = np.tile(np.linspace(-1.0, 1.0, REPEATS), GROUPS)
    e = _at(np.column_stack([np.ones(N), slope]), Noise((1.0, 1.0), pose=(between, 0.0)), ("white0", "pose0"))
    np.testing.assert_allclose(_dof(e), [GROUPS - 1, GROUPS * (REPEATS - 1) - 1], rtol=1e-8)


def test_a_variance_found_to_be_zero_still_counts() -> None:
    e = _at(np.ones((N, 1)), Noise((1.0, 1.0)), ("white0", "pose0"))
    assert _dof(e)[0] == pytest.approx(GROUPS - 1, rel=1e-8)


def test_given_noise_is_certain_and_no_spare_reading_tells_nothing() -> None:
    assert _dof(_at(np.ones((N, 1)), Noise((1.0, 1.0)), ()))[0] == math.inf
    few = _at(np.random.default_rng(2).normal(size=(4, 4)), Noise((1.0, 1.0)), ("white0",))
    assert np.isnan(_dof(few)).all()


def test_intervals_are_students() -> None:
    rng = np.random.default_rng(3)
    A = np.column_stack([np.ones(7), np.arange(7.0)])
    y = A @ [1.0, 0.3] + 0.1 * rng.normal(size=7)
    found = certainty(estimate(linear(A, y), (1e-6, 1e-6), robust=False))
    best, (square,), _, _ = np.linalg.lstsq(A, y, rcond=None)
    half = student.ppf(0.975, 5) * np.sqrt(square / 5.0 * np.diag(np.linalg.inv(A.T @ A)))
    for k, one in enumerate(found.estimates):
        # The noise is found by one step of Fisher scoring from the last: to some 1e-3 (restricted_likelihood.LAST).
        np.testing.assert_allclose(one.interval, [best[k] - half[k], best[k] + half[k]], atol=3e-3 * half[k])
