"""Motions that hold the tool point: brought back onto limits and couplings, and uphill only."""

from __future__ import annotations

import numpy as np
import pytest

from robots import Robot, forward_kinematics, load_robot, tool_position
from robots.arrays import Array
from surrogate.maps.self_motion import THERE, brought_back, improve, self_motions

TIP = np.array([0.05, 0.0, 0.2])


def some_poses(robot: Robot, n: int, rng: np.random.Generator) -> Array:
    q = rng.uniform(*robot.limits.T, (4 * n, robot.dof))
    return q[robot.reachable(q)][:n]


def tip(robot: Robot, q: Array) -> Array:
    return tool_position(robot, forward_kinematics(robot, q), TIP)


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_self_motions_leave_the_tool_point_at_rest(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = some_poses(robot, 20, rng)
    for hold in (False, True):
        free = self_motions(robot, q, TIP, hold)
        assert free.shape == (20, 2 if hold else 3, 6)
        for k in range(free.shape[1]):
            # Second order in a step of 1e-6 rad on 2 m.
            moved = tip(robot, q + 1e-6 * free[:, k]) - tip(robot, q)
            assert np.abs(moved).max() < 1e-11
        assert (free[:, :, -1] == 0.0).all() or not hold


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
def test_poses_come_back_onto_limits_and_couplings_with_the_tool_point_held(
    name: str, rng: np.random.Generator
) -> None:
    robot = load_robot(name)
    start = some_poses(robot, 400, rng)
    # Onto a limit of one joint each, then a step along a self-motion that may leave it.
    joint = rng.integers(0, 5, len(start))
    start[np.arange(len(start)), joint] = robot.limits[joint, 0]
    start = start[robot.reachable(start)]
    move = np.einsum("kf,kfj->kj", rng.normal(size=(len(start), 3)), self_motions(robot, start, TIP))
    beyond = start + 0.05 * move / np.linalg.norm(move, axis=1, keepdims=True)
    q, kept = brought_back(robot, beyond, tip(robot, start), TIP)
    left = ~robot.reachable(beyond)
    assert left.sum() > 20
    assert robot.reachable(q[kept]).all()
    assert np.abs(tip(robot, q[kept]) - tip(robot, start)[kept]).max() < 3.0 * THERE  # the arm is 3 m long at most
    # Where limits leave no way it may fail; that is seldom so close to a pose that can be taken.
    assert kept[left].mean() > 0.9
    on_limit = (np.abs(q - robot.limits[:, 0]) < 1e-12).any(axis=1)
    assert on_limit[kept & left].mean() > 0.3


def test_poses_come_back_onto_a_coupling(rng: np.random.Generator) -> None:
    robot = load_robot("xr701")
    (coupling,) = robot.couplings
    start = some_poses(robot, 400, rng)
    # Joint 3 such that the forearm stands at the lower end of its range.
    start[:, 2] += (coupling.lower - coupling.offset - start @ coupling.factors) / coupling.factors[2]
    start = start[robot.reachable(start)]
    step = self_motions(robot, start, TIP)[:, 0]
    step *= 0.05 * np.where(step @ coupling.factors < 0.0, 1.0, -1.0)[:, None]
    beyond = start + step
    broken = coupling.offset + beyond @ coupling.factors < coupling.lower - 1e-4
    assert broken.sum() > 20
    q, kept = brought_back(robot, beyond, tip(robot, start), TIP)
    assert kept[broken].mean() > 0.8
    at_end = np.abs(coupling.offset + q @ coupling.factors - coupling.lower) < 1e-9
    assert at_end[kept & broken].mean() > 0.5


def test_a_climb_only_goes_up_and_reaches_a_known_top(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    q = some_poses(robot, 30, rng)
    target = tip(robot, q)

    def level(poses: Array) -> Array:
        # The cosine between the flange's z axis and straight down: 1 where the hand hangs.
        return -forward_kinematics(robot, poses).R_flange[:, 2, 2]

    top, value = improve(robot, level, q, level(q), TIP, rounds=80)
    assert (value >= level(q)).all()
    np.testing.assert_allclose(value, level(top))
    assert np.abs(tip(robot, top) - target).max() < 3.0 * THERE
    assert robot.reachable(top).all()
    # Hands that cannot hang stop at a limit, a few at the edge of reach.
    free = np.abs(value - 1.0) < 1e-5
    at_limit = (np.minimum(top - robot.limits[:, 0], robot.limits[:, 1] - top) < 1e-3).any(axis=1)
    assert free.sum() > 5
    assert (free | at_limit).mean() > 0.8


@pytest.mark.parametrize("name", ["kr60-3", "xr701"])
@pytest.mark.parametrize("hold", [False, True])
def test_compiled_loops_and_numpy_do_the_same(
    name: str, hold: bool, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = load_robot(name)
    start = some_poses(robot, 300, rng)
    beyond = start + rng.normal(scale=0.1, size=start.shape)
    compiled = brought_back(robot, beyond, tip(robot, start), TIP, hold)
    free = self_motions(robot, start, TIP, hold)
    monkeypatch.setattr("surrogate.maps.self_motion.loops", lambda: None)
    plain = brought_back(robot, beyond, tip(robot, start), TIP, hold)
    # Where a coupling is just met rounding decides whether it counts; of 1200 poses none to three.
    assert (compiled[1] == plain[1]).mean() > 0.99
    both = compiled[1] & plain[1]
    assert both.sum() > 150
    # The same Newton steps; their last one leaves 1e-11 of the arm's length.
    assert np.median(np.abs(compiled[0] - plain[0])[both]) < 1e-12
    assert np.quantile(np.abs(compiled[0] - plain[0])[both], 0.99) < 1e-8
    # Other directions, the same space: projections agree, but next to a singular pose.
    other = self_motions(robot, start, TIP, hold)
    off = np.abs(free.swapaxes(1, 2) @ free - other.swapaxes(1, 2) @ other).max(axis=(1, 2))
    assert np.quantile(off, 0.95) < 1e-9
