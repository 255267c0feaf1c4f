"""Degrees of freedom where theory gives them exactly: white noise, balanced groups."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plain_problems import linear
from scipy.stats import t as student

from doe.certainty.uncertainty import certainty, degrees_of_freedom
from doe.estimation.estimate import Estimate, estimate, estimate_at
from doe.estimation.noise import Noise

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
