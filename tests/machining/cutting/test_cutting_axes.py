"""Feed, cross-feed and tool axis along a path, and constant forces given in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cutting_cases import wall_task
from posture_cases import dome_task, part, spindle
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cutting import ConstantForce, process_axes
from machining.cutting.process_axes import weights
from machining.task import Task, tool_path
from robots.arrays import Array


def task_of(points: object, axes: object = (0.0, 0.0, 1.0)) -> Task:
    return Task(tool_path(points, axes, axes), spindle(), part(), np.array([0.3, 0.2, 0.1]))  # type: ignore[arg-type]


def test_a_straight_path_has_the_axes_of_the_book() -> None:
    axes = process_axes(wall_task())
    np.testing.assert_allclose(axes.feed, np.tile([1.0, 0.0, 0.0], (7, 1)), atol=1e-15)
    np.testing.assert_allclose(axes.cross, np.tile([0.0, 1.0, 0.0], (7, 1)), atol=1e-15)
    assert not axes.corner.any()


def test_axes_are_right_handed_and_turn_with_the_part(rotation: Array) -> None:
    task = dome_task(15)
    axes = process_axes(task).columns
    np.testing.assert_allclose(np.swapaxes(axes, 1, 2) @ axes, np.tile(np.eye(3), (15, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, rtol=1e-13)
    T = rigid_frame(R=rotation)
    turned = process_axes(replace(task, T_base_part=T @ task.T_base_part))
    np.testing.assert_allclose(turned.columns, rotation @ axes, atol=1e-12)


def test_at_a_corner_the_feed_is_that_of_the_move_that_ends_there() -> None:
    axes = process_axes(task_of([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0.1, 0.2, 0.0]]))
    np.testing.assert_allclose(axes.feed, [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], atol=1e-15)
    assert axes.corner.tolist() == [False, True, False, False]


def test_on_a_circle_the_feed_is_tangent_but_for_the_ends() -> None:
    step, n = 0.05, 20
    angle = step * np.arange(n)
    axes = process_axes(task_of(np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)))
    tangent = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    np.testing.assert_allclose(axes.feed[1:-1], tangent[1:-1], atol=1e-13)
    # A chord leaves its end by half the step.
    turned = np.arccos(np.einsum("ni,ni->n", axes.feed, tangent)[[0, -1]])
    np.testing.assert_allclose(turned, 0.5 * step, rtol=1e-6)


def test_a_sloping_move_feeds_across_the_tool() -> None:
    axes = process_axes(task_of([[0, 0, 0], [0.1, 0, -0.1]]))
    np.testing.assert_allclose(axes.feed, [[1, 0, 0], [1, 0, 0]], atol=1e-15)


def test_a_path_of_one_point_has_no_feed_but_takes_a_force_in_other_axes() -> None:
    task = task_of([[0.0, 0.0, 0.0]])
    refuses("K007", "path of 2 points or more", process_axes, task)
    for axes in ("base", "part"):
        assert ConstantForce(np.array([1.0, 2.0, 3.0]), axes).along(task).force.shape == (1, 3)  # type: ignore[arg-type]


def test_a_plunge_is_named() -> None:
    refuses("K007", "path point 2", process_axes, task_of([[0, 0, 0], [0.1, 0, 0], [0.1, 0, -0.1], [0.1, 0.0, -0.2]]))


def test_a_constant_force_is_expressed_in_its_axes(rotation: Array) -> None:
    task = dome_task(9)
    T = rigid_frame(R=rotation)
    task = replace(task, T_base_part=task.T_base_part @ T)
    F = np.array([10.0, -20.0, 5.0])
    np.testing.assert_allclose(ConstantForce(F).along(task).force, np.tile(F, (9, 1)), atol=1e-14)
    np.testing.assert_allclose(ConstantForce(F, "part").along(task).force, np.tile(rotation @ F, (9, 1)), atol=1e-12)
    axes, along = process_axes(task), ConstantForce(F, "process").along(task)
    expected = 10.0 * axes.feed - 20.0 * axes.cross + 5.0 * axes.tool
    np.testing.assert_allclose(along.force, expected, atol=1e-12)
    assert along.names == ("F_feed", "F_cross", "F_axis")


def test_weights_are_the_trapezoidal_rule() -> None:
    path = tool_path([[0, 0, 0], [0.1, 0, 0], [0.4, 0, 0]], [0, 0, 1])
    np.testing.assert_allclose(path.arc_length, [0.0, 0.1, 0.4])
    np.testing.assert_allclose(weights(path), [0.125, 0.5, 0.375])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"components": np.zeros(3)}, "not all zero"),
        ({"components": np.array([1.0, np.nan, 0.0])}, "finite"),
        ({"components": np.ones(2)}, "3 finite"),
        ({"components": np.ones(3), "axes": "tool"}, "base, part, process"),
        ({"components": np.ones(3), "relative_sd": np.inf}, "standard deviation"),
        ({"components": np.ones(3), "covariance": np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]])}, "negative variance"),
        ({"components": np.ones(3), "covariance": np.eye(2)}, "shape"),
    ],
)
def test_bad_forces_are_named(options: dict[str, object], words: str) -> None:
    refuses("K005", words, ConstantForce, **options)
