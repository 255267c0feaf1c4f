"""Distributions over grids: against brute force, statistics in closed form, best gamma, regions, out of reach."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from posture_cases import spindle
from refusals import refuses
from rigid_frames import rigid_frame

import fem
from machining import Objective, Task, stiffness_index, tool_path
from machining.stiffness.distribution import Distribution, best_gamma, distribution, trade_off, why_not_reached
from machining.stiffness.grid import in_box, in_polygon
from machining.sweep_parts import sweep_parts
from robots import InputError, inverse_kinematics
from robots.arrays import Array
from surrogate.maps.data import Layout
from surrogate.maps.layouts import own_points, plane_or_box

NAN = np.nan
# Points x angles; the last point is reached by none, the second not by the third angle.
VALUE = np.array([[4.0, 1.0, 6.0], [2.0, 3.0, NAN], [6.0, 2.0, 9.0], [NAN, NAN, NAN]])


def found(quantity: str = "k_fs", value: Array = VALUE) -> Distribution:
    force = np.array([0.0, 0.0, 1.0]) if "displacement" in quantity else None
    return Distribution(Objective(quantity, force), np.radians([-30.0, 0.0, 30.0]), value)


def box_grid(x: object, y: object, z: object, frame: Array | None = None) -> Layout:
    """A plane or box by values in m."""
    x, y, z = (1e3 * np.asarray(values, dtype=np.float64) for values in (x, y, z))
    return plane_or_box(x, y, z, frame)


def grid_task(grid: Layout, tool: Array, *, normal: ArrayLike = (0.0, 0.0, 1.0), axis: Array | None = None) -> Task:
    """``normal`` and ``axis`` in the grid's frame."""
    return Task(tool_path(own_points(grid), normal, axis), tool, np.eye(4) if grid.frame is None else grid.frame)


def part_frame(turn: float, x: float = 1.1, y: float = 0.1, z: float = 0.6) -> Array:
    """Turned about base z, then tilted about its own x by 0.2 rad."""
    c, s, ct, st = np.cos(turn), np.sin(turn), np.cos(0.2), np.sin(0.2)
    return rigid_frame(
        (c * x - s * y, s * x + c * y, z),
        np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ [[1.0, 0, 0], [0, ct, -st], [0, st, ct]],
    )


# --- values -----------------------------------------------------------------------------------------------------


def test_every_value_is_the_best_branch_of_a_direct_inverse(kr60: fem.ArmModel) -> None:
    T = part_frame(0.3)
    grid = box_grid([-0.3, 0.0, 0.3], [-0.5, 0.0, 0.5], [0.0, 0.4], T)
    normal, axis, gamma = np.array([0.1, 0.2, 1.0]), np.array([0.0, -0.2, 1.0]), np.radians([-120.0, 10.0, 75.0])
    made = distribution(kr60, grid_task(grid, spindle(), normal=normal, axis=axis), None, gamma)
    up = axis / np.linalg.norm(axis)
    # The part's x axis is across the tool axis: gamma counts from it.
    side = np.cross(up, [1.0, 0.0, 0.0])
    for i, p in enumerate(own_points(grid)):
        for j, g in enumerate(gamma):
            x = np.cos(g) * np.array([1.0, 0.0, 0.0]) + np.sin(g) * side
            target = rigid_frame(T[:3, :3] @ p + T[:3, 3], T[:3, :3] @ np.stack([x, np.cross(-up, x), -up], axis=1))
            solved = inverse_kinematics(kr60.robot, target[None], T_flange_tool=spindle())
            q = solved.q[0][solved.valid[0]]
            if not len(q):
                assert np.isnan(made.value[i, j])
                continue
            k = stiffness_index(kr60, q, T[:3, :3] @ normal, spindle()[:3, 3])
            # The same formulas in another order: rounding, larger next to a singularity.
            np.testing.assert_allclose(made.value[i, j], k.max(), rtol=1e-8)
    assert 0.0 < made.reached.mean() < 1.0
    assert made.sure


def test_turning_the_part_about_axis_1_changes_nothing(kr60: fem.ArmModel) -> None:
    """Axis 1 of this arm turns through more than a whole turn, and stands along base z."""
    gamma = np.radians([-60.0, 0.0, 60.0])
    grids = [box_grid([-0.2, 0.2], [-0.2, 0.0, 0.2], 0.0, part_frame(turn)) for turn in (0.0, 2.0)]
    one, other = (distribution(kr60, grid_task(grid, spindle()), None, gamma).value for grid in grids)
    np.testing.assert_allclose(one, other, rtol=1e-9)
    assert np.isfinite(one).any()


def test_a_whole_turn_of_gamma_changes_nothing(kr60: fem.ArmModel) -> None:
    task = grid_task(box_grid([0.9, 1.1], [-0.2, 0.2], 0.6), spindle())
    made = distribution(kr60, task, None, np.array([0.4, 0.4 + 2.0 * np.pi, 0.4 - 2.0 * np.pi]))
    np.testing.assert_allclose(made.value, np.tile(made.value[:, :1], 3), rtol=1e-9)


def test_parts_of_a_sweep_make_the_whole(kr60: fem.ArmModel) -> None:
    """Also with a force of its own at each point, and the reference of gamma that the whole path has."""
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.9, 0.0, 0.5], [0.9, 0.0, 0.5], [0.0, 0.9, 1.0]])
    path = tool_path(np.linspace([0.9, -0.2, 0.6], [1.1, 0.2, 0.6], 5), [0.0, 0.0, 1.0], axes)
    task = Task(path, spindle(), np.eye(4))
    force = np.arange(15.0).reshape(5, 3) + 1.0
    gamma, seen = np.radians([-50.0, 20.0]), []
    whole = next(sweep_parts(kr60, task, Objective("nspi", force), gamma))[2]
    parts = list(
        sweep_parts(
            kr60,
            task,
            Objective("nspi", force),
            gamma,
            targets=4,
            progress=lambda done, total: seen.append((done, total)),
        )
    )
    assert [rows for rows, _, _ in parts] == [slice(0, 2), slice(2, 4), slice(4, 5)]
    assert seen == [(2, 5), (4, 5), (5, 5)]
    np.testing.assert_allclose(np.concatenate([s.value for _, _, s in parts]), whole.value, rtol=1e-12)
    assert whole.valid.any()


@pytest.mark.parametrize("gamma", [np.zeros(0), np.zeros((2, 2)), np.array([np.nan])])
def test_angles_that_are_none_are_refused(kr60: fem.ArmModel, gamma: Array) -> None:
    refuses(
        "B001", "gamma", distribution, kr60, grid_task(box_grid([0.9, 1.1], [-0.2, 0.2], 0.6), spindle()), None, gamma
    )


def test_a_map_too_large_to_hold_is_refused(kr60: fem.ArmModel) -> None:
    grid = box_grid(np.linspace(0.0, 1.0, 300), np.linspace(0.0, 1.0, 300), 0.6)
    refuses(
        "S011",
        "90000 points x 360 angles",
        distribution,
        kr60,
        grid_task(grid, spindle()),
        None,
        np.linspace(0.0, 6.0, 360),
    )


def test_a_grid_out_of_reach_has_no_values_and_says_why(kr60: fem.ArmModel) -> None:
    task = grid_task(box_grid([8.0, 8.1], [0.0, 0.1], 0.6), spindle())
    made = distribution(kr60, task, None, [0.0])
    assert np.isnan(made.value).all()
    assert "100 % of the branches out of reach: the wrist centre is farther" in why_not_reached(kr60, task, [0.0])
    assert np.isnan(made.statistics().mean).all()
    assert np.isnan(made.statistics().peak_to_valley).all()
    assert made.statistics().points.tolist() == [0]


# --- statistics -------------------------------------------------------------------------------------------------


def test_statistics_over_the_points_that_each_gamma_reaches() -> None:
    s = found().statistics()
    np.testing.assert_allclose(s.mean, [4.0, 2.0, 7.5])
    # Deviations 0, -2, 2; -1, 1, 0; -1.5, 1.5.
    np.testing.assert_allclose(s.standard_deviation, [np.sqrt(8 / 3), np.sqrt(2 / 3), 1.5])
    np.testing.assert_allclose(s.smallest, [2.0, 1.0, 6.0])
    np.testing.assert_allclose(s.peak_to_valley, [4.0, 2.0, 3.0])
    np.testing.assert_allclose(s.share, [0.75, 0.75, 0.5])
    assert s.points.tolist() == [3, 3, 2]


def test_statistics_over_the_points_that_every_gamma_reaches() -> None:
    s = found(value=VALUE[:3]).statistics("common")
    np.testing.assert_allclose(s.mean, [5.0, 1.5, 7.5])
    np.testing.assert_allclose(s.standard_deviation, [1.0, 0.5, 1.5])
    np.testing.assert_allclose(s.peak_to_valley, [2.0, 1.0, 3.0])
    np.testing.assert_allclose(s.share, [1.0, 1.0, 2 / 3])
    assert s.points.tolist() == [2, 2, 2]
    np.testing.assert_array_equal(found().common, [True, False, True, False])
    none = found(value=np.array([[1.0, NAN, 2.0], [NAN, 1.0, 1.0]])).statistics("common")
    assert none.points.tolist() == [0, 0, 0]
    assert np.isnan([none.mean, none.standard_deviation, none.smallest, none.peak_to_valley]).all()


@pytest.mark.parametrize("bad", [VALUE[0], np.full((2, 3), np.inf), np.zeros((0, 3))])
def test_values_that_do_not_fit_are_refused(bad: Array) -> None:
    refuses("S012", "distribution", found, value=bad)


# --- best gamma -------------------------------------------------------------------------------------------------


def test_the_best_of_each_point() -> None:
    best = found().best_at_points()
    assert best.column.tolist() == [2, 1, 2, -1]
    np.testing.assert_allclose(best.value, [6.0, 3.0, 9.0, NAN])
    np.testing.assert_allclose(np.degrees(best.gamma), [30.0, 0.0, 30.0, NAN])
    least = found("displacement").best_at_points()
    assert least.column.tolist() == [1, 0, 1, -1]
    np.testing.assert_allclose(least.value, [1.0, 2.0, 2.0, NAN])


@pytest.mark.parametrize("quantity", ["k_fs", "displacement"])
@pytest.mark.parametrize("aim", ["mean", "worst"])
def test_the_best_gamma_of_a_region_by_brute_force(quantity: str, aim: Any, rng: np.random.Generator) -> None:
    for _ in range(30):
        value = np.where(rng.uniform(size=(6, 5)) < 0.1, NAN, rng.uniform(1.0, 2.0, (6, 5)))
        inside = rng.uniform(size=6) < 0.6
        inside[0] = True
        minimised = quantity == "displacement"
        worst: Any = max if minimised else min
        scores = {
            j: (np.mean if aim == "mean" else worst)(value[inside, j].tolist())
            for j in range(5)
            if np.isfinite(value[inside, j]).all()
        }
        made = Distribution(found(quantity).objective, np.arange(5.0), value)
        if not scores:
            with pytest.raises(InputError, match="no gamma reaches all of it"):
                best_gamma(made, inside, aim=aim)
            continue
        expected = (min if minimised else max)(scores, key=lambda j: scores[j])
        choice = best_gamma(made, inside, aim=aim)
        assert (choice.column, choice.gamma) == (expected, float(expected))
        np.testing.assert_allclose(choice.value, scores[expected])
        assert set(np.flatnonzero(np.isfinite(choice.score))) == set(scores)


def test_a_gamma_that_loses_points_wins_only_if_asked() -> None:
    inside = np.array([True, True, True, False])
    assert best_gamma(found(), inside).column == 0
    assert best_gamma(found(), inside, partly=True).column == 2
    refuses("S012", "at most 75 % of it, at -30 deg", best_gamma, found())
    refuses("S012", "no gamma reaches any point of it", best_gamma, found(), ~inside, partly=True)


@pytest.mark.parametrize(("quantity", "few"), [("k_fs", 3.0), ("displacement", 1.0 / 3.0)])
def test_a_few_points_at_the_rim_do_not_decide_and_many_do(quantity: str, few: float) -> None:
    """A point that is missed counts as one without stiffness; the first angle reaches all and is worth 2 (or 1/2)."""
    value = np.full((100, 3), 2.0 if few > 1.0 else 0.5)
    value[:, 1:] = few
    value[:2, 1], value[:50, 2] = np.nan, np.nan
    made = found(quantity, value)
    assert best_gamma(made).column == 0
    # 98 points of worth 3 are more than 100 of worth 2; 50 are not.
    assert best_gamma(made, partly=True).column == 1
    assert best_gamma(Distribution(made.objective, made.gamma[[0, 2]], value[:, [0, 2]]), partly=True).column == 0


def test_of_equally_good_angles_the_first_is_taken() -> None:
    value = np.array([[3.0, 3.0 * (1.0 + 1e-13), 2.0]])
    assert best_gamma(found(value=value)).column == 0
    assert found(value=value).best_at_points().column.tolist() == [0]
    assert found(value=value * [1.0, 1.001, 1.0]).best_at_points().column.tolist() == [1]


@pytest.mark.parametrize("bad", [np.zeros(4, dtype=bool), np.ones(3, dtype=bool), np.ones(4)])
def test_regions_that_do_not_fit_are_refused(bad: NDArray[Any]) -> None:
    refuses("S012", "region", best_gamma, found(), bad)


# --- grids and regions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: box_grid([0.0, 0.1, 0.3], [0.0, 1.0], 0.0), "values of x"),
        (lambda: box_grid([0.1, 0.0], [0.0, 1.0], 0.0), "ascending"),
        (lambda: box_grid([0.0, 0.1], 0.0, 0.0), "at least two"),
        (lambda: box_grid([0.0, np.nan], [0.0, 1.0], 0.0), "finite"),
    ],
)
def test_grids_that_make_no_sense_are_refused(make: Any, words: str) -> None:
    refuses("B001 S011", words, make)


SQUARE = box_grid(np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 11), [0.2, 0.4])


def test_a_box_takes_its_rim_in() -> None:
    inside = in_box(SQUARE, [0.3, -np.inf, 0.4], [0.7, 0.1, 0.4])
    expected = {(x, y, 4) for x in (3, 4, 5, 6, 7) for y in (0, 1)}
    assert {tuple(p) for p in np.round(10 * own_points(SQUARE)[inside]).astype(int).tolist()} == expected
    refuses("S011", "no point of the grid inside", in_box, SQUARE, [0.31, 0.0, 0.0], [0.39, 1.0, 1.0])
    refuses("S011", "box", in_box, SQUARE, [1.0, 0.0, 0.0], [0.0, 1.0, 1.0])


def test_a_polygon_with_a_notch_goes_through_all_layers() -> None:
    """An L: what its notch cuts out is outside, its rim and inner corner are in; either way round."""
    corners = np.array([[0, 0], [8, 0], [8, 3], [3, 3], [3, 8], [0, 8]]) * 100.0
    p = np.round(10.0 * own_points(SQUARE)).astype(int)
    expected = (p[:, 0] <= 8) & (p[:, 1] <= 8) & ((p[:, 0] <= 3) | (p[:, 1] <= 3))
    np.testing.assert_array_equal(in_polygon(SQUARE, corners), expected)
    np.testing.assert_array_equal(in_polygon(SQUARE, corners[::-1]), expected)


def test_a_polygon_against_half_planes(rng: np.random.Generator) -> None:
    for _ in range(20):
        a, b, c = rng.uniform(-0.2, 1.2, (3, 2))
        x, y = own_points(SQUARE)[:, :2].T
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        expected = np.all(np.array(sides) > 0, axis=0) | np.all(np.array(sides) < 0, axis=0)
        corners = 1e3 * np.array([a, b, c])
        if expected.any():
            np.testing.assert_array_equal(in_polygon(SQUARE, corners), expected)
        else:
            refuses("S011", "polygon", in_polygon, SQUARE, corners)


# --- alike in neighbours, and what a choice costs ------------------------------------------------------------------


def test_a_gamma_within_the_price_of_the_best_is_alike_in_neighbours() -> None:
    # Two angles equally good but for 1 %, now the one ahead and now the other; the last point has one angle only.
    value = np.array(
        [[100.0, 50.0, 99.0], [99.0, 50.0, 100.0], [100.0, 50.0, 99.0], [60.0, 50.0, 100.0], [NAN, 7.0, NAN]]
    )
    made = found(value=value)
    assert made.best_at_points().column.tolist() == [0, 2, 0, 2, 1]
    steady = made.steady_at_points(0.02)
    assert steady.column.tolist() == [2, 2, 2, 2, 1]
    assert (steady.value >= 0.98 * made.best_at_points().value).all()
    # At no price it is the best itself.
    assert made.steady_at_points(0.0).column.tolist() == [0, 2, 0, 2, 1]
    unreached = found(value=np.vstack([value, np.full(3, NAN)])).steady_at_points()
    assert unreached.column[-1] == -1
    assert np.isnan(unreached.gamma[-1])


def test_what_is_small_where_good_is_steadied_too() -> None:
    value = np.array([[1.0, 2.0, 1.01], [1.01, 2.0, 1.0], [1.5, 2.0, 1.0]])
    assert found("displacement", value).steady_at_points(0.02).column.tolist() == [2, 2, 2]


def test_the_trade_off_is_what_no_other_gamma_beats_in_both() -> None:
    # Mean 225 over four points, 300 over two, 260 over three; 250 over two is beaten.
    value = np.array(
        [[225.0, 300.0, 260.0, 250.0], [225.0, 300.0, 260.0, 250.0], [225.0, NAN, 260.0, NAN], [225.0, NAN, NAN, NAN]]
    )
    made = Distribution(Objective(), np.radians([0.0, 10.0, 20.0, 30.0]), value)
    traded = trade_off(made)
    assert traded.front == (0, 2, 1)
    assert traded.points.tolist() == [4, 2, 3, 2]
    assert best_gamma(made).column == 0
    inside = np.array([True, True, False, False])
    assert trade_off(made, inside).front == (1,)
    least = Distribution(Objective("displacement", np.array([0.0, 0.0, 1.0])), made.gamma, 1.0 / value)
    assert trade_off(least).front == (0, 2, 1)
