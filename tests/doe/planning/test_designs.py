"""Designs: balanced factorials, grids, and the paper's 81 poses in the paper's order."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from refusals import refuses

from doe import Campaign, factorial_poses, level_grid, two_level_factorial
from doe.estimation.study_plan import Factorial
from robots import Robot


@pytest.mark.parametrize("factors", [1, 2, 4, 6])
def test_a_two_level_factorial_is_orthogonal_and_complete(factors: int) -> None:
    design = two_level_factorial(factors)
    assert design.shape == (2**factors, factors)
    # Sums of +-1 are exact in floating point: no tolerance.
    assert np.array_equal(design.T @ design, 2**factors * np.eye(factors))
    assert np.array_equal(design.sum(axis=0), np.zeros(factors))
    assert len({tuple(row) for row in design}) == 2**factors


def test_products_of_factors_are_orthogonal_to_the_factors() -> None:
    # Otherwise main effects would be mixed with two-factor interactions.
    design = two_level_factorial(4)
    for a, b in itertools.combinations(range(4), 2):
        assert np.array_equal(design.T @ (design[:, a] * design[:, b]), np.zeros(4))


def test_standard_order_changes_the_first_factor_fastest() -> None:
    assert two_level_factorial(2).tolist() == [[-1, -1], [1, -1], [-1, 1], [1, 1]]


def test_a_level_grid_changes_the_last_factor_fastest() -> None:
    grid = level_grid([np.array([1.0, 2.0]), np.array([10.0, 20.0, 30.0])])
    assert grid.tolist() == [[1, 10], [1, 20], [1, 30], [2, 10], [2, 20], [2, 30]]


def test_the_adjusted_factorial_has_81_reachable_runs(xr701: Robot, scheme: Campaign) -> None:
    q = factorial_poses(xr701, scheme.beside.factorial)
    assert q.shape == (81, 6)
    assert xr701.reachable(q).all()
    assert len({tuple(row) for row in q}) == 81
    assert not q[:, [0, 5]].any()


@pytest.mark.parametrize(
    ("pose", "angles_deg"),
    [(3, (-35, 40, -200, 100)), (5, (-35, 40, 0, 0)), (41, (5, 77.5, 0, 0)), (77, (45, 115, 0, 0))],
)
def test_rows_are_numbered_as_in_the_paper(
    xr701: Robot, scheme: Campaign, pose: int, angles_deg: tuple[float, ...]
) -> None:
    q = factorial_poses(xr701, scheme.beside.factorial)[pose - 1]
    # The degrees go to radians and back: round-off alone.
    np.testing.assert_allclose(np.degrees(q[1:5]), angles_deg, atol=1e-12)


def test_levels_are_adjusted_only_where_q2_is_low(xr701: Robot, scheme: Campaign) -> None:
    q = np.round(np.degrees(factorial_poses(xr701, scheme.beside.factorial)), 9)
    levels = {q2: sorted(set(q[q[:, 1] == q2, 2])) for q2 in (-35, 5, 45)}
    assert levels == {-35: [40, 60, 77.5], 5: [40, 77.5, 115], 45: [40, 77.5, 115]}


def test_without_the_adjustment_the_run_and_the_limit_are_named(xr701: Robot, scheme: Campaign) -> None:
    plain = scheme.beside.factorial.model_copy(update={"adjust": ()})
    # q2 = -35 with q3real = 115: after 2 x 9 runs at that q2, the 19th is the first.
    refuses("A005", r"factorial run 19 .*forearm_deg = 30 is outside 65 to 190", factorial_poses, xr701, plain)


def test_an_unknown_coordinate_is_named(xr701: Robot) -> None:
    refuses("B003", "q9_deg", factorial_poses, xr701, Factorial(inputs=("q9_deg",), levels_deg=((0.0,),)))
