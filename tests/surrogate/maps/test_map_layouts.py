"""Layouts of maps: where their points are, in which order, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from map_arms import box_layout, cylinder_layout, kr60, planar, slice_layout
from refusals import refuses

from surrogate.maps.layouts import joint_layout, points_of, poses_of, range_for, reach_of, step_for

ALL = slice(None)


def test_a_box_runs_along_x_fastest() -> None:
    grid = box_layout([0.0, 10.0, 20.0], [5.0], [1.0, 2.0])
    assert [axis.name for axis in grid.axes] == ["z", "y", "x"]
    wanted = [[x, 5.0, z] for z in (1.0, 2.0) for x in (0.0, 10.0, 20.0)]
    np.testing.assert_allclose(points_of(grid, ALL), 1e-3 * np.array(wanted), atol=1e-15)


@pytest.mark.parametrize(("plane", "held"), [("xz", 1), ("yz", 0), ("xy", 2)])
def test_a_slice_holds_the_third_coordinate(plane: str, held: int) -> None:
    grid = slice_layout(plane, [0.0, 10.0, 20.0], [100.0, 300.0], at_mm=7.0)
    p = 1e3 * points_of(grid, ALL)
    first, second = ("xyz".index(letter) for letter in plane)
    np.testing.assert_allclose(p[:, held], 7.0)
    np.testing.assert_allclose(p[:, first], [0, 10, 20, 0, 10, 20], atol=1e-12)
    np.testing.assert_allclose(p[:, second], [100] * 3 + [300] * 3)


def test_a_cylinder_is_about_the_z_axis() -> None:
    grid = cylinder_layout([0.0, 500.0], np.arange(-180.0, 181.0, 90.0), [100.0])
    p = points_of(grid, ALL).reshape(5, 2, 3)
    np.testing.assert_allclose(p[:, 0], [[0.0, 0.0, 0.1]] * 5, atol=1e-15)
    np.testing.assert_allclose(p[3, 1], [0.0, 0.5, 0.1], atol=1e-15)
    np.testing.assert_allclose(p[0, 1], p[-1, 1], atol=1e-15)


def test_rows_are_worked_out_alone() -> None:
    grid = box_layout(range_for(-1000, 1000, 10), range_for(-1000, 1000, 14), range_for(0, 2000, 20))
    assert grid.n > 1_000_000
    rows = slice(777_777, 777_787)
    np.testing.assert_array_equal(points_of(grid, rows), points_of(grid, slice(700_000, 800_000))[77_777:77_787])


def test_joint_sweeps_have_their_layers_first_and_the_other_joints_at_zero() -> None:
    robot = kr60().robot
    names = robot.coordinates
    grid = joint_layout(robot, names[1:3], 3, {names[3]: [-90.0, 0.0]})
    assert (grid.layers, grid.shape) == (1, (2, 3, 3))
    q = poses_of(grid, robot, ALL)
    assert (q[:, [0, 4, 5]] == 0.0).all()
    np.testing.assert_allclose(np.degrees(q[:9, 3]), -90.0)
    np.testing.assert_allclose(q[:3, 2], [*robot.limits[2, :1], robot.limits[2].mean(), robot.limits[2, 1]], atol=1e-12)


def test_reach_of_a_planar_arm() -> None:
    reach = reach_of(planar().robot)
    # The stretched arm is 0.9 m long; a sample comes within some thousandths of that.
    assert 0.895 < reach.radius <= 0.9 + 1e-12
    np.testing.assert_allclose(reach.upper[:2], 0.9, atol=5e-3)


def test_default_steps_are_round_and_give_the_points_asked_for() -> None:
    for length in np.geomspace(3.0, 30_000.0, 50):
        step = step_for(length, 40)
        assert 40 <= length / step <= 100
        assert f"{step:.0e}"[0] in "125" or step / 10 ** np.floor(np.log10(step)) == pytest.approx(2.5)
    np.testing.assert_allclose(range_for(-12.0, 31.0, 10.0), [-20, -10, 0, 10, 20, 30, 40])


def test_what_is_refused() -> None:
    robot = kr60().robot
    refuses("S011", "evenly spaced", box_layout, [0.0, 1.0, 3.0], [0.0], [0.0])
    refuses("S011", "evenly spaced", slice_layout, "xz", [0.0, -1.0], [0.0])
    refuses("S011", "radius", cylinder_layout, [-1.0, 0.0], [0.0], [0.0])
    refuses("S011", "at most one turn", cylinder_layout, [1.0], [0.0, 200.0, 400.0], [0.0])
    refuses("B001", "finite", box_layout, [np.nan], [0.0], [0.0])
    refuses("S011", "points of the map", box_layout, np.arange(2000.0), np.arange(2000.0), np.arange(2000.0))
    refuses("S011", "each once", joint_layout, robot, robot.coordinates[1:3], 3, {robot.coordinates[1]: [0.0]})
    refuses("B003", "q9_deg", joint_layout, robot, ["q9_deg"], 3)
