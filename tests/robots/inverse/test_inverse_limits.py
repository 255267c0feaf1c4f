"""Turns beyond 180 deg, limits and couplings of the inverse kinematics."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from inverse_cases import tool_frames, within_limits
from refusals import refuses

from robots import CouplingLimit, Reason, Robot, inverse_kinematics, load_robot
from robots.arrays import Array
from robots.inverse.turns import TURN, every_turn, nearest_turn

ROUND_OFF_RAD = 1e-9  # sums of whole turns; limits themselves are kept to 1e-9


def by_brute_force(robot: Robot, q: Array) -> Array:
    """Every equivalent of one pose (dof,) with up to two turns either way in joints 1, 4 and 6."""
    out = []
    for k in itertools.product(range(-2, 3), repeat=3):
        other = q.copy()
        other[[0, 3, 5]] += TURN * np.array(k)
        out.append(other)
    poses = np.array(out)
    return poses[robot.reachable(poses)]


def coupled() -> Robot:
    """Joints 4 and 6 with ranges of more than two turns, and a coupling such as cables in a wrist ask for."""
    robot = load_robot("tx200")
    limits = robot.limits.copy()
    limits[[3, 5]] = np.radians([-400.0, 400.0])
    factors = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    limit = CouplingLimit("wrist", factors, 0.0, *np.radians([-190.0, 190.0]))
    return dataclasses.replace(robot, limits=limits, couplings=(limit,))


@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701", "coupled"])
def test_every_turn_equals_brute_force(name: str, rng: np.random.Generator) -> None:
    robot = coupled() if name == "coupled" else load_robot(name)
    poses = within_limits(robot, rng, 25)
    found = every_turn(robot, poses)
    assert robot.reachable(found.q).all()
    for i, pose in enumerate(poses):
        expected = by_brute_force(robot, pose)
        got = found.q[found.target == i]
        assert len(got) == len(expected)
        # Both lists in one order; no two of them are closer than a turn.
        order = [np.lexsort(several.round(6).T) for several in (got, expected)]
        np.testing.assert_allclose(got[order[0]], expected[order[1]], rtol=0, atol=ROUND_OFF_RAD)


@pytest.mark.parametrize("name", ["kr60-3", "xr701", "coupled"])
def test_the_nearest_turn_equals_brute_force(name: str, rng: np.random.Generator) -> None:
    robot = coupled() if name == "coupled" else load_robot(name)
    poses, near = within_limits(robot, rng, 25), within_limits(robot, rng, 25)
    turned, inside = nearest_turn(robot, poses + TURN * rng.integers(-3, 4, poses.shape), near)
    for i in range(25):
        expected = by_brute_force(robot, poses[i])
        assert bool(inside[i]) == (len(expected) > 0)
        if inside[i]:
            best = ((expected - near[i]) ** 2).sum(axis=1).min()
            assert abs(((turned[i] - near[i]) ** 2).sum() - best) < ROUND_OFF_RAD


def test_kr60_by_hand() -> None:
    """A1 +-185: 178 is -182 as well. A4 and A6 +-350: 30 is -330 as well, 40 is -320."""
    robot = load_robot("kr60-3")
    pose = np.radians([178.0, -60.0, 20.0, 30.0, 50.0, 40.0])
    solutions = inverse_kinematics(robot, tool_frames(robot, pose[None]), near=pose)
    own = solutions.names.index("front, elbow up, no flip")
    np.testing.assert_allclose(solutions.q[0, own], pose, rtol=0, atol=1e-12)
    turns = solutions.turns()
    got = np.degrees(turns.q[turns.column == own])
    np.testing.assert_allclose(sorted(set(got[:, 0].round(9))), [-182.0, 178.0])
    np.testing.assert_allclose(sorted(set(got[:, 3].round(9))), [-330.0, 30.0])
    np.testing.assert_allclose(sorted(set(got[:, 5].round(9))), [-320.0, 40.0])
    assert len(got) == 8
    # Asked for near the other side, that turn is the one returned.
    near = np.radians([-175.0, 0.0, 0.0, -300.0, 0.0, 0.0])
    other = np.degrees(inverse_kinematics(robot, tool_frames(robot, pose[None]), near=near).q[0, own])
    np.testing.assert_allclose(other, [-182.0, -60.0, 20.0, -330.0, 50.0, 40.0], rtol=0, atol=1e-9)


def test_joint_1_may_pass_180_deg_only_as_far_as_its_limit() -> None:
    """A1 at 186 is beyond +-185, but stands at -174 too; tx200's +-180 has both ends."""
    kr60, tx200 = load_robot("kr60-3"), load_robot("tx200")
    pose = np.radians([186.0, -60.0, 20.0, 30.0, 50.0, 40.0])
    solutions = inverse_kinematics(kr60, tool_frames(kr60, pose[None]), near=pose)
    assert solutions.valid[0, 0]
    np.testing.assert_allclose(np.degrees(solutions.q[0, 0, 0]), -174.0)
    assert len(every_turn(tx200, np.radians([[180.0, 0, 10, 0, 10, 0]])).q) == 2


def test_beyond_limits_the_angles_are_there_with_the_reason(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    solutions = inverse_kinematics(robot, tool_frames(robot, within_limits(robot, rng, 200)))
    beyond = solutions.reason == Reason.LIMITS
    assert beyond.sum() > 100
    assert np.isfinite(solutions.q[beyond]).all()
    assert not solutions.valid[beyond].any()
    i, j = (int(index[0]) for index in np.nonzero(beyond))
    (line,) = [line for line in solutions.explain(i) if line.startswith(solutions.names[j])]
    assert "beyond joint limits: q" in line
    assert "is outside" in line
    # No turn of these is within limits: else they would not be beyond.
    assert len(every_turn(robot, solutions.q[beyond]).q) == 0


def test_the_parallelograms_limit_is_kept() -> None:
    """The forearm of xr701 may not stand steeper than its coupled limit, though q2 and q3real are within theirs."""
    robot = load_robot("xr701")
    poses = np.radians([[0, -35, 77.5, 0, 20, 0], [0, -35, 115, 0, 20, 0]])
    solutions = inverse_kinematics(robot, tool_frames(robot, poses))
    own = solutions.names.index("front, elbow up, no flip")
    np.testing.assert_allclose(solutions.q[:, own], poses, rtol=0, atol=1e-12)
    assert solutions.valid[:, own].tolist() == [True, False]
    assert any("forearm_deg" in line for line in solutions.explain(1))


def test_the_nearest_solution_over_branches_and_turns(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    q = within_limits(robot, rng, 100)
    solutions = inverse_kinematics(robot, tool_frames(robot, q))
    best, column = solutions.nearest(q)
    np.testing.assert_allclose(best, q, rtol=0, atol=1e-8)
    assert (column >= 0).all()
    weight, wanted = np.array([3.0, 2.0, 2.0, 1.0, 1.0, 0.5]), within_limits(robot, rng, 100)
    best, column = solutions.nearest(wanted, weight)
    turns = solutions.turns()
    for i in range(100):
        cost = ((turns.q[turns.target == i] - wanted[i]) ** 2 * weight).sum(axis=1)
        assert ((best[i] - wanted[i]) ** 2 * weight).sum() == pytest.approx(cost.min(), abs=1e-12)


def test_nothing_valid_gives_nan_and_no_column() -> None:
    robot = load_robot("kr60-3")
    far = np.eye(4)[None].copy()
    far[0, 0, 3] = 10.0
    best, column = inverse_kinematics(robot, far).nearest(np.zeros(6))
    assert np.isnan(best).all()
    assert column.tolist() == [-1]


@pytest.mark.parametrize("weight", [np.ones(5), -np.ones(6), np.full(6, np.nan)])
def test_bad_weights_are_refused(weight: Array) -> None:
    robot = load_robot("kr60-3")
    refuses("B003", "weights of joints", inverse_kinematics(robot, np.empty((0, 4, 4))).nearest, np.zeros(6), weight)


@pytest.mark.parametrize("near", [np.zeros(5), np.zeros((3, 6)), np.full(6, np.inf)])
def test_bad_preferred_angles_are_refused(near: Array) -> None:
    refuses(
        "B001",
        "preferred joint angles for kr60-3",
        inverse_kinematics,
        load_robot("kr60-3"),
        np.eye(4)[None],
        near=near,
    )
