"""Where an arm must not be, where a load must not hang, and the usual directions and point of a table."""

from __future__ import annotations

import numpy as np

from doe.planning.protocol import usual_directions, usual_point
from doe.planning.zones import HANG, Zone
from robots import forward_kinematics, load_robot, tool_position


def test_a_load_hangs_free_where_there_is_room_below_it() -> None:
    robot = load_robot("kr60-3")
    low, high = robot.limits.T
    q = np.random.default_rng(0).uniform(low, high, (500, robot.dof))
    tool = tool_position(robot, forward_kinematics(robot, q))
    free = Zone(floor=0.0).hangs_free(robot, q)
    np.testing.assert_array_equal(free, tool[:, 2] >= HANG)
    box = ((0.5, -0.5, 0.0), (2.5, 0.5, 1.0))
    off = Zone(None, (box,)).hangs_free(robot, q)
    over = (
        (np.abs(tool[:, 1]) < 0.5) & (tool[:, 0] > 0.5) & (tool[:, 0] < 2.5) & (tool[:, 2] > 0.1) & (tool[:, 2] < 1.0)
    )
    assert over.any()
    assert not off[over].any()
    # Above the box by more than the load needs.
    assert off[tool[:, 2] > 1.0 + HANG].all()


def test_a_load_does_not_hang_in_the_base() -> None:
    robot = load_robot("kr60-3")
    low, high = robot.limits.T
    q = np.random.default_rng(0).uniform(low, high, (2000, robot.dof))
    tool = tool_position(robot, forward_kinematics(robot, q))
    beside = (np.hypot(tool[:, 0], tool[:, 1]) < 0.3) & (tool[:, 2] < 0.7) & (tool[:, 2] > 0.1)
    assert beside.any()
    assert not Zone(own=0.35).hangs_free(robot, q)[beside].any()


def test_a_load_at_a_point_of_its_own_hangs_from_there() -> None:
    robot = load_robot("kr60-3")
    q = np.array([[0.0, -1.0, 1.0, 0.0, 0.6, 0.0]])
    tool = tool_position(robot, forward_kinematics(robot, q))[0, 2]
    floor = Zone(floor=tool - HANG - 0.01)
    assert floor.hangs_free(robot, q)[0]
    R = forward_kinematics(robot, q).R_flange[0]
    lower = robot.T_flange_tool[:3, 3] - 0.1 * R[2]
    assert not floor.hangs_free(robot, q, lower)[0]


def test_usual_directions_are_those_of_the_forces() -> None:
    force = np.array([[0.0, 0.0, -150.0], [0.0, 0.0, 0.0], [0.0, 0.0, -650.0], [100.0, 0.0, 0.0]])
    np.testing.assert_allclose(usual_directions(force), [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(usual_directions(np.zeros((0, 3))), [[0.0, 0.0, -1.0]])
    rng = np.random.default_rng(0)
    many = usual_directions(np.array([0.0, 0.0, -100.0]) + rng.normal(size=(40, 3)))
    np.testing.assert_array_equal(many, [[0.0, 0.0, -1.0]])


def test_usual_point_is_that_of_most_readings() -> None:
    own, tool = np.array([0.05, 0.0, 0.2]), np.zeros(3)
    points = np.vstack([np.tile(own, (3, 1)), np.zeros((2, 3))])
    assert usual_point(points, tool) == (0.05, 0.0, 0.2)
    assert usual_point(points[2:], tool) is None
    assert usual_point(np.full((4, 3), np.nan), tool) is None
    assert usual_point(np.zeros((0, 3)), tool) is None
