"""Ends of intervals by profile likelihood against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_problems import PlainModel, linear, problem_of

from doe.certainty.profile_likelihood import PRECISE, profile_end, rise_of
from doe.certainty.uncertainty import certainty
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from fem.free.kinds import LAW
from fem.free.parameters import Parameter

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
