"""Poses of designs: all can be taken, none below the floor or in a box, as many as asked."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

from doe.planning.pose_designs import METHODS, pose_design
from doe.planning.zones import Zone
from robots import bundled_names, forward_kinematics, load_robot, tool_position


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
