"""Leave-one-pose-out by updates: the same errors as fits anew, at bounds and across them, and fast enough for many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe.certainty import left_out
from doe.certainty.folds import SAME_rad, folds_of, pose_numbers
from doe.certainty.left_out import leave_one_pose_out
from doe.certainty.predictive import Coverage
from doe.estimation.estimate import Estimate, estimate, estimate_at
from doe.estimation.least_squares import minimise
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from fem.free.kinds import LAW
from fem.free.parameters import Parameter
from robots.arrays import Array
from tests.doe.plain_problems import PlainModel, linear, problem_of


def _refitted(e: Estimate, k: int) -> Array:
    """Errors of pose k by a fit to all readings of the other poses, with their share of the same covariance."""
    p = e.problem
    mine = p.pose == k
    rest = p.take(~mine)
    V = rest.blocks.covariance(e.covariance.variance[~mine], e.noise.common(p, e.prediction)[~mine])
    u = minimise(rest, V, e.u)[0]
    return p.value[mine] - p.evaluate(u)[0][mine]


def _drawn(seed: int, poses: int = 15, ranges: tuple[tuple[float, float], ...] | None = None) -> Problem:
    rng = np.random.default_rng(seed)
    pose = np.repeat(np.arange(poses), 3)
    A = rng.normal(size=(len(pose), 4))
    value = (
        A @ np.array([1.0, 0.02, -0.03, 2.0]) + 0.1 * rng.normal(size=len(pose)) + 0.2 * rng.normal(size=poses)[pose]
    )
    return linear(A, value, pose, ranges)


@pytest.mark.parametrize("seed", range(5))
def test_updates_are_fits_anew(seed: int) -> None:
    e = estimate(_drawn(seed), (1e-3, 1e-3))
    error, _, reasons = leave_one_pose_out(e)
    assert not reasons
    for k in range(len(e.problem.poses)):
        # Both are exact; differences are rounding.
        np.testing.assert_allclose(error[e.problem.pose == k], _refitted(e, k), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_all_at_once_are_those_one_by_one(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors, intervals and reasons by matrices of all poses; none of a plain problem is taken by itself."""
    whole = left_out._Whole.all_without
    for p in (_drawn(seed), _drawn(seed, ranges=((-9.0, 9.0), (0.0, 9.0), (-9.0, 0.0), (-9.0, 9.0)))):
        e = estimate(p, (1e-3, 1e-3))
        together = leave_one_pose_out(e)
        with monkeypatch.context() as context:
            context.setattr(left_out._Whole, "all_without", lambda *a: (whole(*a)[0] & False, *whole(*a)[1:]))
            apart = leave_one_pose_out(e)
        for one, other in zip(together[:2], apart[:2], strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-13)
        assert together[2] == apart[2]

    def alone(*_: object) -> None:
        raise AssertionError("a pose left out by itself")

    monkeypatch.setattr(left_out._Whole, "step_without", alone)
    assert np.isfinite(leave_one_pose_out(estimate(_drawn(seed), (1e-3, 1e-3)))[0]).all()


@pytest.mark.parametrize("seed", [2, 4, 7, 8])
def test_bounds_that_are_met_or_left_without_a_pose(seed: int) -> None:
    """Two parameters whose best values lie about their bounds: with some poses left out they stand there, or not."""
    p = _drawn(seed, ranges=((-9.0, 9.0), (0.0, 9.0), (-9.0, 0.0), (-9.0, 9.0)))
    e = estimate(p, (1e-3, 1e-3))
    error, _, _ = leave_one_pose_out(e)
    stand = []
    for k in range(len(p.poses)):
        np.testing.assert_allclose(error[p.pose == k], _refitted(e, k), rtol=1e-9, atol=1e-12)
        rest = p.take(p.pose != k)
        common = e.noise.common(p, e.prediction)[p.pose != k]
        u = minimise(rest, rest.blocks.covariance(e.covariance.variance[p.pose != k], common), e.u)[0]
        stand.append(tuple(u[1:3] == 0.0))
    assert len(set(stand)) > 1, "no bound was met or left: the case tests nothing"


def test_the_weights_of_outliers_stay() -> None:
    p = _drawn(3)
    p = replace(p, value=p.value + np.where(np.arange(len(p)) == 7, 5.0, 0.0))
    e = estimate(p, (1e-3, 1e-3))
    assert e.weight[7] < 0.1
    error, _, _ = leave_one_pose_out(e)
    for k in (0, 2, 5):
        np.testing.assert_allclose(error[p.pose == k], _refitted(e, k), rtol=1e-9, atol=1e-12)


def test_a_pose_that_alone_determines_a_parameter_is_not_predicted() -> None:
    rng = np.random.default_rng(1)
    A = rng.normal(size=(20, 2))
    A[2:, 1] = 0.0
    p = linear(A, A @ [1.0, 2.0] + 0.01 * rng.normal(size=20), np.arange(20) // 2)
    e = estimate(p, (1e-3, 1e-3))
    error, _, reasons = leave_one_pose_out(e)
    assert list(reasons) == ["P0"]
    assert "x1" in reasons["P0"]
    assert np.isnan(error[:2]).all()
    assert np.isfinite(error[2:]).all()
    # The same where another pose tells it, next to nothing though that is: it is found, by a fit anew.
    A[19, 1] = 1e-2
    p = linear(A, A @ [1.0, 2.0] + 0.01 * rng.normal(size=20), np.arange(20) // 2)
    e = estimate(p, (1e-3, 1e-3))
    error, _, reasons = leave_one_pose_out(e)
    assert not reasons
    np.testing.assert_allclose(error[:2], _refitted(e, 0), rtol=1e-6)


def test_as_many_readings_as_parameters_leave_nothing_to_predict() -> None:
    e = estimate(linear(np.eye(2), np.array([1.0, 2.0])), (1e-3, 1e-3))
    error, _, reasons = leave_one_pose_out(e)
    assert np.isnan(error).all()
    assert set(reasons) == {"P0", "P1"}


def test_curved_predictions_are_stepped_or_fitted_anew() -> None:
    """exp(u0 x) + u1: a linear step where a pose moves little, a fit where it moves much; to 1e-4 deviations."""
    rng = np.random.default_rng(4)
    pose = np.repeat(np.arange(40), 3)
    x = rng.uniform(-1.0, 1.0, len(pose))
    x[:3] = 3.0

    def work(u: Array) -> tuple[Array, Array]:
        return np.exp(u[0] * x) + u[1], np.stack([x * np.exp(u[0] * x), np.ones_like(x)], axis=1)

    parameters = [Parameter(f"x{k}", LAW, "base", (k,), "", 0.0, -9.0, 9.0, "linear") for k in range(2)]
    model = PlainModel(parameters, np.zeros(2), work)
    model.is_linear = False

    value = np.exp(0.5 * x) + 0.2 + 0.05 * rng.normal(size=len(x))
    p = problem_of(model, value, pose)
    noise = Noise((0.05, 0.05))
    e = estimate(p, (1e-3, 1e-3), fixed_noise=noise, robust=False)
    error, _, reasons = leave_one_pose_out(e)
    assert not reasons
    for k in range(40):
        np.testing.assert_allclose(error[pose == k], _refitted(e, k), atol=1e-4 * noise.white[0])


@pytest.mark.slow
def test_twenty_thousand_poses_are_no_twenty_thousand_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """One small solve a pose, none of them a fit anew."""
    e = estimate_at(
        _drawn(0, 20_000), np.array([1.0, 0.02, -0.03, 2.0]), Noise((0.1, 0.1)), np.ones(60_000), settled=True
    )
    monkeypatch.setattr(left_out, "_fitted_anew", lambda *_: pytest.fail("a fit anew"))
    said: list[tuple[int, int]] = []
    error, _, _ = leave_one_pose_out(e, lambda k, n: said.append((k, n)))
    assert 1 <= len(said) <= 100
    assert np.isfinite(error).all()


def test_parameters_that_no_reading_moves_with_leave_the_readings_themselves() -> None:
    e = estimate(linear(np.zeros((6, 2)), np.arange(1.0, 7.0)), (1e-3, 1e-3))
    error, _, reasons = leave_one_pose_out(e)
    assert not reasons
    np.testing.assert_allclose(error, np.arange(1.0, 7.0))


# ------------------------------------------------------------
# Predictive intervals: they hold nine in ten to 98 % of readings not used, also where the model misses something

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


# ------------------------------------------------------------
# Readings of one pose are left out together: repeats that an encoder scatters, but not what lies along a path


def test_readings_of_a_pose_that_an_encoder_scatters_are_one_pose() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (30, 6))
    read = np.repeat(q, 4, axis=0) + rng.uniform(-0.2, 0.2, (120, 6)) * SAME_rad
    order = rng.permutation(120)
    number = pose_numbers(read[order])
    assert len(set(number)) == 30
    for k in range(30):
        assert len(set(number[order // 4 == k])) == 1


def test_poses_along_a_path_stay_apart() -> None:
    q = np.linspace(0.0, 1.0, 5000)[:, None] * np.ones(6)
    assert len(set(pose_numbers(q).tolist())) == 5000


def test_folds_take_groups_whole_and_few_groups_one_at_a_time() -> None:
    group = np.repeat(np.arange(25), 3)
    fold = folds_of(group, 10, 0)
    assert all(len(set(fold[group == k])) == 1 for k in range(25))
    assert int(folds_of(group, 10, 0, split=40).max()) == 24
