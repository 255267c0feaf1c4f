"""Optimal choice of experiments against brute force and known answers."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from refusals import refuses

from doe.planning.optimal_choice import CRITERIA, choose, judge


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("seed", range(4))
def test_equals_brute_force_on_small_problems(criterion: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    experiments = rng.normal(size=(14, 2, 3)) * rng.uniform(0.2, 3.0, (14, 1, 1))
    known = 0.1 * np.eye(3)
    weight = np.diag([1.0, 2.0, 0.5]) if criterion == "I" else None
    found = choose(known, experiments, 3, criterion, weight=weight, rng=rng, starts=8)  # type: ignore[arg-type]
    every = [judge(known, experiments, np.array(c), criterion, weight).value for c in combinations(range(14), 3)]  # type: ignore[arg-type]
    assert found.value == pytest.approx(min(every), rel=1e-12)


def test_values_are_those_of_the_covariance() -> None:
    rng = np.random.default_rng(0)
    experiments, known = rng.normal(size=(10, 2, 4)), np.eye(4)
    found = choose(known, experiments, 4, "D")
    B = experiments[found.chosen].reshape(-1, 4)
    C = np.linalg.inv(known + B.T @ B)
    np.testing.assert_allclose(found.covariance, C, rtol=1e-10)
    assert found.value == pytest.approx(np.linalg.slogdet(C)[1], rel=1e-10)
    assert judge(known, experiments, found.chosen, "A").value == pytest.approx(np.trace(C), rel=1e-10)


def test_a_line_is_measured_at_its_ends() -> None:
    # The D-optimal design of a straight line has half its points at each end.
    x = np.linspace(-1.0, 1.0, 21)
    experiments = np.stack([np.ones_like(x), x], axis=1)[:, None, :]
    chosen = choose(1e-6 * np.eye(2), experiments, 2, "D").chosen
    assert sorted(x[chosen]) == [-1.0, 1.0]


def test_better_than_chance() -> None:
    rng = np.random.default_rng(1)
    experiments = rng.normal(size=(300, 3, 6)) * rng.lognormal(size=(300, 1, 6))
    known = 1e-3 * np.eye(6)
    best = choose(known, experiments, 6, "D", rng=rng).value
    random = [judge(known, experiments, rng.choice(300, 6, replace=False), "D").value for _ in range(50)]
    assert best < min(random)


def test_bad_input() -> None:
    experiments = np.ones((3, 1, 2))
    refuses("C005", "experiments to choose", choose, np.eye(2), experiments, 4)
    refuses("C005", "criterion", choose, np.eye(2), experiments, 1, "E")
    refuses("C004", "bound all parameters", choose, np.zeros((2, 2)), experiments, 1)
