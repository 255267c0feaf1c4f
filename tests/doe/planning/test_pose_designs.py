"""Poses of designs: all can be taken, none below the floor or in a box, as many as asked."""

from __future__ import annotations

import itertools
from itertools import permutations

import numpy as np
import pytest
from refusals import refuses

from doe import Campaign, factorial_poses, level_grid, two_level_factorial
from doe.estimation.study_plan import Factorial
from doe.planning.pose_designs import METHODS, length, pose_design, short_tour, travel
from doe.planning.zones import Zone
from robots import Robot, bundled_names, forward_kinematics, load_robot, tool_position


@pytest.mark.parametrize("name", bundled_names())
@pytest.mark.parametrize("method", ["latin", "sobol"])
def test_as_many_as_asked_and_all_can_be_taken(name: str, method: str) -> None:
    robot = load_robot(name)
    q = pose_design(robot, 100, method, rng=np.random.default_rng(0))  # type: ignore[arg-type]
    assert q.shape == (100, robot.dof)
    assert robot.reachable(q).all()
    assert len(np.unique(np.round(q, 9), axis=0)) == 100
    # Spread over the ranges: each quarter of each range is met.
    share = (q - robot.limits[:, 0]) / np.diff(robot.limits, axis=1)[:, 0]
    assert (np.histogram(share[:, 0], 4, (0, 1))[0] > 10).all()


def test_a_latin_hypercube_meets_every_stratum() -> None:
    robot = load_robot("tx200")
    q = pose_design(robot, 40, "latin", rng=np.random.default_rng(0))
    share = (q - robot.limits[:, 0]) / np.diff(robot.limits, axis=1)[:, 0]
    for column in share.T:
        assert sorted(np.floor(column * 40).astype(int)) == list(range(40))


def test_factorials_drop_what_the_parallelogram_forbids() -> None:
    robot = load_robot("xr701")
    names = ("q2_deg", "q3real_deg")
    q = pose_design(robot, 1, "factorial", coordinates=names, levels=3)
    assert 0 < len(q) < 9
    assert robot.reachable(q).all()
    assert (q[:, [0, 3, 4, 5]] == 0.0).all()
    free = pose_design(load_robot("tx200"), 1, "factorial", coordinates=("q1_deg", "q2_deg"), levels=3)
    assert len(free) == 9


def test_a_fraction_has_balanced_uncorrelated_columns() -> None:
    q = pose_design(load_robot("tx200"), 1, "fractional")
    assert len(q) == 8
    centred = q - q.mean(axis=0)
    product = centred.T @ centred
    np.testing.assert_allclose(product - np.diag(np.diag(product)), 0.0, atol=1e-12)


def test_nothing_below_the_floor_or_in_a_box() -> None:
    robot = load_robot("kr60-3")
    box = ((0.5, -0.5, 0.0), (3.0, 0.5, 1.0))
    q = pose_design(robot, 200, zone=Zone(0.3, (box,)), rng=np.random.default_rng(1))
    tool = tool_position(robot, forward_kinematics(robot, q))
    assert (tool[:, 2] >= 0.3).all()
    assert not np.all((tool > box[0]) & (tool < box[1]), axis=1).any()
    # The zone does something.
    free = pose_design(robot, 200, rng=np.random.default_rng(1))
    assert not Zone(0.3, (box,)).free(robot, free).all()


def test_the_same_seed_gives_the_same_poses() -> None:
    robot = load_robot("xr701")
    one, two = (pose_design(robot, 20, rng=np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_bad_input() -> None:
    robot = load_robot("xr701")
    refuses("C005", "design of poses", pose_design, robot, 5, "random")
    refuses("C005", "tried", pose_design, robot, 50, zone=Zone(floor=9.0))
    refuses("C005", "levels", pose_design, robot, 1, "factorial", levels=50)
    refuses("C005", "poses of a design", pose_design, robot, 0)
    assert set(METHODS) == {"factorial", "fractional", "latin", "sobol"}


def test_wrist_and_tool_keep_off_base_and_upper_arm() -> None:
    robot = load_robot("kr60-3")
    free = pose_design(robot, 400, rng=np.random.default_rng(1))
    kept = Zone(own=0.4).free(robot, free)
    assert 0 < kept.sum() < len(free)
    frames = forward_kinematics(robot, free)
    tool = tool_position(robot, frames)
    # The base stands on the z axis up to its first joint: nothing of the tool within 0.4 m of it.
    height = frames.p[0, 1, 2]
    beside = (tool[:, 2] > 0.0) & (tool[:, 2] < height)
    assert (np.hypot(*tool[kept & beside, :2].T) >= 0.4).all()
    shoulder, elbow = frames.p[:, 2], frames.p[:, 3]
    wrist = frames.p[:, 5]
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    apart = np.linalg.norm(wrist - (shoulder + share * (elbow - shoulder)), axis=2).min(axis=0)
    assert (apart[kept] >= 0.4 - 1e-9).all()


def test_no_pose_at_all_is_said_soon() -> None:
    refuses("C005", r"0 of 4\d{4} tried", pose_design, load_robot("xr701"), 50, zone=Zone(floor=9.0))


# ------------------------------------------------------------
# Designs: balanced factorials, grids, and the paper's 81 poses in the paper's order


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


# ------------------------------------------------------------
# Tours through poses: short, complete, and the shortest where that can be checked


@pytest.mark.parametrize("n", [0, 1, 2, 3, 40])
def test_every_pose_once(n: int) -> None:
    q = np.random.default_rng(n).normal(size=(n, 6))
    assert sorted(short_tour(q)) == list(range(n))


def test_poses_on_a_line_are_taken_in_order() -> None:
    x = np.random.default_rng(0).permutation(30)
    order = short_tour(np.outer(x, np.ones(3)))
    assert np.abs(np.diff(x[order])).tolist() == [1] * 29


@pytest.mark.parametrize("seed", range(5))
def test_close_to_the_shortest(seed: int) -> None:
    q = np.random.default_rng(seed).normal(size=(7, 6))
    way = travel(q)
    best = min(length(way, np.array(p)) for p in permutations(range(7)))
    # 2-opt from every start finds the shortest tour of seven nearly always; 5 % is the worst seen over 200 seeds.
    assert length(way, short_tour(q)) <= 1.05 * best


def test_shorter_than_as_it_comes() -> None:
    q = np.random.default_rng(3).uniform(-3.0, 3.0, size=(60, 6))
    way = travel(q)
    assert length(way, short_tour(q)) < 0.7 * length(way, np.arange(60))
