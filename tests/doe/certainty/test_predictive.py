"""Predictive intervals: they hold nine in ten to 98 % of readings not used, also where the model misses something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe.certainty.left_out import leave_one_pose_out
from doe.certainty.predictive import Coverage
from doe.estimation.estimate import estimate
from doe.estimation.problem import Problem
from robots.arrays import Array
from tests.doe.plain_problems import linear

GAUGE = (1e-3, 1e-3)


def _campaign(seed: int, poses: int, each: int, hidden: float, setup: float = 0.0) -> Problem:
    """Four parameters; ``hidden``: size of a bent law of the pose that these do not follow; ``setup``: scatter."""
    rng = np.random.default_rng([seed, poses, each])
    pose = np.repeat(np.arange(poses), each)
    A = rng.normal(size=(poses, 4))[pose] * (1.0 + np.tile(np.arange(each), poses))[:, None]
    effect = hidden * np.sin(3.0 * A[:, 0]) * np.cos(2.0 * A[:, 1])
    value = A @ np.array([1.0, 2.0, -1.0, 0.5]) + effect + 0.1 * rng.normal(size=len(pose))
    return linear(A, value + setup * rng.normal(size=poses)[pose], pose)


def _coverage(cases: list[Problem]) -> float:
    inside = readings = 0
    for p in cases:
        error, half, _ = leave_one_pose_out(estimate(p, GAUGE, robust=False))
        one = Coverage.of(error, half)
        inside, readings = inside + one.inside, readings + one.readings
    return inside / readings


@pytest.mark.slow
@pytest.mark.parametrize(
    ("poses", "each", "hidden", "setup"),
    [(40, 1, 0.0, 0.0), (40, 1, 0.5, 0.0), (10, 1, 0.0, 0.0), (20, 3, 0.0, 0.3), (20, 3, 0.5, 0.0)],
    ids=["plain", "hidden effect", "few readings", "set-ups scatter", "hidden effect, several loads"],
)
def test_intervals_hold_readings_at_poses_left_out(poses: int, each: int, hidden: float, setup: float) -> None:
    share = _coverage([_campaign(seed, poses, each, hidden, setup) for seed in range(30)])
    assert 0.90 <= share <= 0.98


def test_without_the_scatter_of_what_is_missing_they_would_not() -> None:
    """Half widths by the gauge's noise alone hold few readings: the lack of fit is what carries them."""
    p = _campaign(1, 40, 1, 0.5)
    error, half, _ = leave_one_pose_out(estimate(p, GAUGE, robust=False))
    assert Coverage.of(error, np.full_like(half, 0.196)).share < 0.6 < Coverage.of(error, half).share


def test_few_readings_take_students_quantile() -> None:
    """One parameter: the textbook's interval of a new reading without the one left out."""
    rng = np.random.default_rng(3)
    A, value = np.ones((6, 1)), 1.0 + 0.1 * rng.normal(size=6)
    error, half, _ = leave_one_pose_out(estimate(linear(A, value, np.arange(6)), GAUGE, robust=False))
    for k in range(6):
        rest = np.delete(value, k)
        assert error[k] == pytest.approx(value[k] - rest.mean(), rel=1e-6)
        # t of 4 degrees of freedom at 97.5 %.
        assert half[k] == pytest.approx(2.776445 * rest.std(ddof=1) * np.sqrt(1.0 + 1.0 / 5.0), rel=0.02)


@pytest.mark.parametrize("given", [0.1, 0.02])
def test_given_sigmas_are_kept_unless_the_residuals_are_larger(given: float) -> None:
    p = _campaign(2, 60, 1, 0.0)
    p = replace(p, sigma=np.full(len(p), given))
    error, half, _ = leave_one_pose_out(estimate(p, GAUGE, robust=False))
    assert 0.85 <= Coverage.of(error, half).share <= 1.0
    assert np.median(half) == pytest.approx(0.2, rel=0.2)


def test_a_pose_that_alone_tells_something_has_no_interval() -> None:
    rng = np.random.default_rng(5)
    A = np.zeros((12, 2))
    A[:, 0], A[3, 1] = 1.0, 1.0
    error, half, reasons = leave_one_pose_out(estimate(linear(A, rng.normal(size=12), np.arange(12)), GAUGE))
    assert len(reasons) == 1
    assert np.isnan(error[3])
    assert np.isnan(half[3])
    assert Coverage.of(error, half).readings == 11


def test_nothing_predicted_has_no_share() -> None:
    nothing: Array = np.full(3, np.nan)
    assert np.isnan(Coverage.of(nothing, nothing).share)
