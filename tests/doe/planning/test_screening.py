"""Screening against known answers: SALib's own test function, additive models, exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from doe.planning.screening import derivative_shares, evaluate_runs, inner, screen
from fem import build_model
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import parameter
from robots import load_description


@pytest.fixture(scope="module")
def free() -> FreeModel:
    model = build_model(load_description("kr60-3"))
    rng = np.random.default_rng(0)
    low, high = model.robot.limits.T
    q = rng.uniform(low, high, (4, 6))
    names = [f"j{k}.stiffness" for k in range(1, 6)]
    given = tuple(parameter(model, n).between(1e5, 1e6) for n in names)
    return FreeModel(model, given, LoadedPoses(q, np.tile([0, 0, -500.0, 0, 0, 0], (4, 1)), np.zeros((4, 3))))


def test_a_sum_has_no_interactions_and_known_indices(free: FreeModel) -> None:
    found = screen(free, 2, samples=2048)
    # Deflection is a sum over compliances 1/k, k log-uniform: the variance of each term is known.
    _, J = free.evaluate(free.start)
    span = np.log(10.0)
    mean, square = (1e-5 - 1e-6) / span, (1e-10 - 1e-12) / (2.0 * span)
    variance = J[:, 2] ** 2 * (square - mean**2)
    expected = variance / variance.sum(axis=1, keepdims=True)
    # Sampling error of 2048 base points: some 2 %.
    np.testing.assert_allclose(found.first, expected, atol=0.05)
    np.testing.assert_allclose(found.total, expected, atol=0.05)
    # Joint 1 carries nothing under a vertical load.
    assert np.all(np.abs(found.total[:, 0]) < 1e-9)
    assert np.all(found.mean_effect[:, 0] < 1e-12 * found.mean_effect.max())


def test_the_seed_decides_the_intervals_too(free: FreeModel) -> None:
    # SALib takes a seed of 0, our default, for none.
    a, b = screen(free, 2, samples=64), screen(free, 2, samples=64)
    np.testing.assert_array_equal(a.total_conf, b.total_conf)


def test_morris_ranks_as_the_exact_spans_do(free: FreeModel) -> None:
    found = screen(free, 2, samples=8, trajectories=60)
    _, J = free.evaluate(free.start)
    exact = np.abs(J[:, 2]) * (1e-5 - 1e-6)
    for row, size in zip(found.mean_effect, exact, strict=True):
        assert np.argmax(row) == np.argmax(size)


def test_derivative_shares_are_exact(free: FreeModel) -> None:
    share = derivative_shares(free, 2)
    _, J = free.evaluate(inner(free.parameters, np.full((1, 5), 0.5))[0])
    np.testing.assert_allclose(share, np.abs(J[:, 2]) / np.abs(J[:, 2]).sum(axis=1, keepdims=True), rtol=1e-12)


def test_runs_at_once_equal_runs_one_by_one(free: FreeModel) -> None:
    u = inner(free.parameters, np.random.default_rng(0).uniform(size=(7, 5)))
    expected = np.stack([free.evaluate(one)[0][:, 2] for one in u])
    np.testing.assert_allclose(evaluate_runs(free, u, 2), expected, rtol=1e-12)


def test_points_of_the_cube_cover_the_ranges(free: FreeModel) -> None:
    ends = inner(free.parameters, np.array([[0.0] * 5, [1.0] * 5]))
    np.testing.assert_allclose(ends, [[1e-5] * 5, [1e-6] * 5], rtol=1e-12)


def test_a_run_that_is_not_finite_never_becomes_a_zero(free: FreeModel) -> None:
    u = inner(free.parameters, np.full((3, 5), 0.5))
    u[1, 2] = np.nan
    refuses("S004", "run 1", evaluate_runs, free, u, 2)


def test_bad_input(free: FreeModel) -> None:
    refuses("M002", "power of two", screen, free, 2, samples=100)
    refuses("M001", "parameters", screen, replace(free, parameters=()), 2)
