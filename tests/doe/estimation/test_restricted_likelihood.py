"""Restricted likelihood against the whole matrices, and its maximum against the analysis of variance."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from doe.estimation.blocks import Blocks
from doe.estimation.restricted_likelihood import Likelihood, Term, maximise

GROUPS, REPEATS = 9, 4
POSE = np.repeat(np.arange(GROUPS), REPEATS)
N = len(POSE)
# The last step's promise is below 1e-2 of the log-likelihood, and a step of Fisher scoring leaves a tenth or less of
# a variance's error: with standard errors of some 20 % here, a few parts in a thousand.
CLOSE = 5e-3


def _blocks() -> Blocks:
    return Blocks.of(POSE)


def _one_way(error: np.ndarray, fixed: float = 0.0, *, white: bool = True) -> Likelihood:
    terms = (Term("group", np.ones(N), common=True), *((Term("white", np.ones(N), common=False),) if white else ()))
    return Likelihood(_blocks(), terms, np.full(N, fixed), np.ones((N, 1)), error)


def _squares(y: np.ndarray) -> tuple[float, float]:
    """Mean squares between and within groups."""
    means = y.reshape(GROUPS, REPEATS).mean(axis=1)
    within = np.sum((y - means[POSE]) ** 2) / (N - GROUPS)
    return float(REPEATS * np.sum((means - y.mean()) ** 2) / (GROUPS - 1)), float(within)


def test_it_is_that_of_the_whole_matrices() -> None:
    rng = np.random.default_rng(0)
    blocks, X, e = _blocks(), rng.normal(size=(N, 3)), rng.normal(size=N)
    terms = (
        Term("white", rng.uniform(0.5, 2.0, N), common=False),
        Term("a", rng.normal(size=N), common=True, column=0),
        Term("share", rng.uniform(size=N), common=False),
        Term("b", rng.normal(size=N), common=True, column=1),
    )
    t, fixed = np.array([0.7, 0.4, 1.1, 0.2]), rng.uniform(0.1, 0.2, N)
    same = blocks.number[:, None] == blocks.number
    V = np.diag(fixed)
    for term, value in zip(terms, t, strict=True):
        V += value * (np.outer(term.pattern, term.pattern) * same if term.common else np.diag(term.pattern))
    W = np.linalg.inv(V)
    P = W - W @ X @ np.linalg.solve(X.T @ W @ X, X.T @ W)
    expected = 0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(X.T @ W @ X)[1] + e @ P @ e)
    at = Likelihood(blocks, terms, fixed, X, e).at(t)
    assert at.loss == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(at.Pe, P @ e, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_balanced_groups_give_the_analysis_of_variance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = 5.0 + 2.0 * rng.normal(size=GROUPS)[POSE] + rng.normal(size=N)
    between, within = _squares(y)
    assert between > within
    found, _ = maximise(_one_way(y), np.array([1e-3, 10.0]), np.zeros(2))
    # Searle, Casella and McCulloch, Variance Components (1992), section 4.6.
    np.testing.assert_allclose(found, [(between - within) / REPEATS, within], rtol=CLOSE)


def test_groups_that_differ_less_than_chance_get_no_variance() -> None:
    rng = np.random.default_rng(7)
    y = rng.normal(size=N)
    y -= 0.9 * y.reshape(GROUPS, REPEATS).mean(axis=1)[POSE]
    between, within = _squares(y)
    assert between < within
    found, _ = maximise(_one_way(y), np.ones(2), np.zeros(2))
    assert found[0] == 0.0
    assert found[1] == pytest.approx(np.var(y, ddof=1), rel=CLOSE)


def test_with_the_white_variance_known_the_rest_is_the_groups() -> None:
    rng = np.random.default_rng(3)
    y = rng.normal(size=GROUPS)[POSE] + 0.5 * rng.normal(size=N)
    (found,) = maximise(_one_way(y, 0.25, white=False), np.ones(1), np.zeros(1))[0]
    assert found == pytest.approx((_squares(y)[0] - 0.25) / REPEATS, rel=CLOSE)


def test_limits_are_kept() -> None:
    rng = np.random.default_rng(4)
    y = 0.1 * rng.normal(size=N)
    found, _ = maximise(_one_way(y), np.ones(2), np.array([0.0, 0.04]))
    assert found[1] == 0.04


def test_what_the_derivatives_follow_is_not_taken_for_noise() -> None:
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(N, 12)), rng.normal(size=N)
    of = Likelihood(_blocks(), (Term("white", np.ones(N), common=False),), np.zeros(N), X, y)
    residual = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    assert maximise(of, np.ones(1), np.zeros(1))[0][0] == pytest.approx(residual @ residual / (N - 12), rel=CLOSE)


def test_near_its_end_the_curvature_is_that_of_the_log_likelihood() -> None:
    rng = np.random.default_rng(2)
    of = _one_way(rng.normal(size=GROUPS)[POSE] + 0.5 * rng.normal(size=N))
    t, h = maximise(of, np.array([0.5, 0.5]), np.zeros(2))[0], 1e-4
    at = of.at(t)
    expected = at.information()
    slopes = [[of.at(t + s * h * e).slope() for s in (1, -1)] for e in np.eye(2)]
    differences = -np.array([(up - down) / (2.0 * h) for up, down in slopes])
    # Central differences of slopes: their third derivative times 1e-8.
    np.testing.assert_allclose(at.curvature(expected), differences, rtol=1e-5)


def test_a_point_of_the_likelihood_is_let_go_at_once() -> None:
    """It holds arrays as large as all readings; in a circle they pile up until the collector comes by."""
    at = _one_way(np.random.default_rng(3).normal(size=N)).at(np.array([0.5, 0.5]))
    at.curvature(at.information())
    kept = weakref.ref(at)
    gc.disable()
    try:
        del at
        assert kept() is None
    finally:
        gc.enable()
