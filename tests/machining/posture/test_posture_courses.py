"""Dynamic programming over layers against every course there is."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from machining.posture.courses import Gap, Layers, Links, cheapest_course, course_cost, highest_floor

N, DOF = 5, 3


def problem(rng: np.random.Generator, step: float, gamma_step: float = np.inf) -> tuple[Layers, Links]:
    """Five layers of 4 to 6 random states; costs of links as large as costs of states."""
    sizes = rng.integers(4, 7, N)
    k = int(sizes.sum())
    layers = Layers(
        np.concatenate([[0], np.cumsum(sizes)]),
        rng.uniform(-1.0, 1.0, (k, DOF)),
        rng.uniform(-np.pi, np.pi, k),
        rng.uniform(0.0, 1.0, k),
        rng.uniform(0.0, 1.0, k),
    )
    allowed = step * rng.uniform(0.8, 1.2, (N - 1, DOF))
    return layers, Links(allowed, gamma_step, np.where(np.isfinite(allowed), allowed, 1.0), 0.7)


def every_course(layers: Layers, links: Links) -> list[tuple[float, float, tuple[int, ...]]]:
    """Cost, lowest merit and states of every course that keeps the links, by plain enumeration."""
    found = []
    for course in product(*(range(layers.start[i], layers.start[i + 1]) for i in range(N))):
        cost = sum(layers.cost[s] for s in course)
        for i in range(N - 1):
            dq = layers.q[course[i + 1]] - layers.q[course[i]]
            turn = abs(layers.gamma[course[i + 1]] - layers.gamma[course[i]])
            if (abs(dq) > links.step[i]).any() or min(turn, 2.0 * np.pi - turn) > links.gamma_step:
                break
            cost += links.weight * sum((dq[j] / links.unit[i, j]) ** 2 for j in range(DOF)) / DOF
        else:
            found.append((float(cost), float(min(layers.merit[s] for s in course)), course))
    return found


@pytest.mark.parametrize("gamma_step", [np.inf, 2.5])
@pytest.mark.parametrize("step", [1.2, np.inf])
@pytest.mark.parametrize("seed", range(4))
def test_the_cheapest_course_is_the_cheapest_of_all(seed: int, step: float, gamma_step: float) -> None:
    layers, links = problem(np.random.default_rng(seed), step, gamma_step)
    courses = every_course(layers, links)
    found = cheapest_course(layers, links)
    floor = highest_floor(layers, links)
    if not courses:
        assert isinstance(found, Gap)
        assert isinstance(floor, Gap)
        return
    assert not isinstance(found, Gap)
    cost, _, states = min(courses)
    assert tuple(found.tolist()) == states
    assert course_cost(links, layers.q[found], layers.cost[found]) == pytest.approx(
        cost, rel=1e-13
    )  # sums in another order
    assert floor == max(lowest for _, lowest, _ in courses)


def test_some_of_these_are_constrained() -> None:
    """Else the test above would say little."""
    share = []
    for seed in range(4):
        layers, links = problem(np.random.default_rng(seed), 1.2, 2.5)
        share.append(len(every_course(layers, links)) / np.prod(np.diff(layers.start)))
    assert 0.0 < max(share) < 0.2


def test_equal_poses_are_linked_and_exact_steps_allowed() -> None:
    q = np.array([[0.0], [0.0], [0.1]])
    layers = Layers(np.array([0, 1, 2, 3]), q, np.zeros(3), np.zeros(3), np.zeros(3))
    links = Links(np.full((2, 1), 0.1), 0.0, np.full((2, 1), 0.1), 1.0)
    assert np.array_equal(cheapest_course(layers, links), [0, 1, 2])


def test_a_gap_names_the_nearest_pair() -> None:
    q = np.array([[0.0, 0.0], [0.0, 5.0], [1.0, 0.0], [0.3, 0.1], [0.3, 0.0]])
    layers = Layers(np.array([0, 2, 4, 5]), q, np.zeros(5), np.zeros(5), np.zeros(5))
    links = Links(np.full((2, 2), 0.1), np.inf, np.full((2, 2), 0.1), 1.0)
    gap = cheapest_course(layers, links)
    assert isinstance(gap, Gap)
    assert gap.after == 0
    assert np.array_equal(gap.poses, q[[0, 3]])
    assert gap.excess == pytest.approx(3.0)
