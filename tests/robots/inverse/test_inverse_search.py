"""The numerical search for arms without a closed form, and what it says of its own certainty."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from inverse_cases import DATA, MAPS_BACK, apart, chain, tool_frames, within_limits, worst_error
from refusals import refuses

from robots import (
    Reason,
    Robot,
    inverse_kinematics,
    load_robot,
    singularity_distance,
    why_no_closed_form,
)
from robots.inverse.search import Found, _judge, refine, residual_and_jacobian, search


def offset_wrist() -> Robot:
    return load_robot(DATA / "offset_wrist.urdf")


def test_a_urdf_arm_with_an_offset_wrist_goes_to_the_search(rng: np.random.Generator) -> None:
    robot = offset_wrist()
    assert "axes 4, 5 and 6 miss one another" in str(why_no_closed_form(robot))
    q = within_limits(robot, rng, 30)
    targets = tool_frames(robot, q)
    solutions = inverse_kinematics(robot, targets, generator=rng)
    assert solutions.method == "numerical search"
    assert solutions.names[0] == "solution 1"
    assert worst_error(solutions, targets) < MAPS_BACK
    sure = solutions.sure
    assert sure.mean() > 0.9
    # Where it is sure, the target's own pose is among them. Such arms have eight solutions at most.
    assert np.nanmin(apart(solutions.q, q[:, None]), axis=1)[sure].max() < 1e-6
    assert solutions.reached[sure].sum(axis=1).max() <= 8
    assert (solutions.reached[sure].sum(axis=1) % 2 == 0).all()
    i, j = np.nonzero(solutions.reached)
    np.testing.assert_array_equal(solutions.valid[i, j], robot.reachable(solutions.q[i, j]))


@pytest.mark.slow
def test_sure_is_seldom_wrong_for_general_arms(rng: np.random.Generator) -> None:
    """Against ten times as many starts, over arms with all figures at random (up to 16 solutions)."""
    wrong = total = 0
    for _ in range(3):
        robot = chain(rng.uniform(-np.pi, np.pi, 6), np.r_[0.0, rng.normal(size=5)], rng.normal(size=6))
        targets = tool_frames(robot, rng.uniform(-np.pi, np.pi, (50, 6)))
        found = search(robot, targets, rng)
        longer = search(robot, targets, rng, starts=800, most_starts=800)
        fewer = (found.hits > 0).sum(axis=1) < (longer.hits > 0).sum(axis=1)
        wrong, total = wrong + int((fewer & found.sure).sum()), total + int(found.sure.sum())
    assert total > 140
    # Statistics, not proof: one in a thousand was measured over other arms and targets.
    assert wrong <= 0.015 * total


def test_too_few_starts_are_not_sure(rng: np.random.Generator) -> None:
    robot = offset_wrist()
    targets = tool_frames(robot, within_limits(robot, rng, 10))
    found = search(robot, targets, rng, starts=8, most_starts=8)
    assert not found.sure.all()
    some = (found.hits == 1).any(axis=1)
    assert (found.unseen[some] > 0.0).all()
    assert not found.sure[some].any()
    # More starts for those targets only.
    more = search(robot, targets, rng, starts=8, most_starts=200)
    assert more.sure.mean() > found.sure.mean()
    assert len(set(more.starts)) > 1


@pytest.mark.parametrize(("joints", "count", "sure"), [(6, 4, True), (6, 3, False), (7, 4, False), (6, 0, False)])
def test_an_odd_number_of_solutions_or_of_joints_is_not_sure(joints: int, count: int, sure: bool) -> None:
    hits = np.where(np.arange(16) < count, 20, 0)[None]
    one = np.zeros(1)
    found = Found(np.zeros((1, 16, joints)), hits, one.astype(int), one.copy(), one.astype(bool), one.astype(bool))
    _judge(found, np.array([0]), joints)
    assert found.sure.tolist() == [sure]
    assert found.unseen.tolist() == [0.0 if count else 1.0]


def test_the_same_seed_gives_the_same_answer() -> None:
    robot = offset_wrist()
    targets = tool_frames(robot, within_limits(robot, np.random.default_rng(3), 5))
    first, second = (inverse_kinematics(robot, targets, generator=np.random.default_rng(0)) for _ in range(2))
    np.testing.assert_array_equal(first.q, second.q)


def test_a_search_needs_a_generator_and_says_why() -> None:
    refuses(
        "B003",
        r"needs a search, because axes 4, 5 and 6 miss.*default_rng",
        inverse_kinematics,
        offset_wrist(),
        np.eye(4)[None],
    )


def test_unreachable_for_certain_and_perhaps(rng: np.random.Generator) -> None:
    robot = offset_wrist()
    targets = np.tile(np.eye(4), (2, 1, 1))
    targets[0, :3, 3] = 50.0, 0.0, 0.0
    # Shorter than the way along the arm, but the stretched arm cannot have such a hand.
    targets[1, :3, 3] = 1.25, 0.0, 0.15
    solutions = inverse_kinematics(robot, targets, generator=rng)
    assert not solutions.reached.any()
    assert (solutions.reason[0] == Reason.TOO_FAR).all()
    assert (solutions.reason[1] == Reason.NOT_FOUND).all()
    assert solutions.sure.tolist() == [True, False]
    assert solutions.explain(1)[-1] == "0 found; not sure that these are all"


def test_a_singular_target_is_never_sure(rng: np.random.Generator) -> None:
    """Axes 4 and 6 in line: solutions without number."""
    robot = offset_wrist()
    q = within_limits(robot, rng, 1)
    q[:, 4] = 0.0
    assert singularity_distance(robot, q).sigma_min.max() < 1e-12
    assert np.isnan(singularity_distance(robot, q).wrist_rad).all()
    solutions = inverse_kinematics(robot, tool_frames(robot, q), generator=rng)
    assert not solutions.sure.any()
    assert worst_error(solutions, tool_frames(robot, q)) < MAPS_BACK


def test_arms_of_four_joints_are_searched_without_being_sure(rng: np.random.Generator) -> None:
    robot = load_robot(DATA / "crooked.urdf")
    assert why_no_closed_form(robot) == "it has 4 joints, not 6"
    q = within_limits(robot, rng, 2)
    solutions = inverse_kinematics(robot, tool_frames(robot, q), generator=rng)
    assert solutions.q.shape[2] == 4
    assert np.nanmin(apart(solutions.q, q[:, None]), axis=1).max() < 1e-6
    assert not solutions.sure.any()


def test_joints_that_move_the_wrist_in_a_plane_only_are_searched() -> None:
    robot = chain(np.array([0, 0, 0, 1.2, 1.5, -1.5]), np.array([0, 0.5, 0.4, 0.3, 0, 0]), np.r_[0.1, 0, 0, 0.2, 0, 0])
    assert "in all directions" in str(why_no_closed_form(robot))


def test_refinement_stops_where_the_target_is_not_met(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    q = within_limits(robot, rng, 10)
    targets = tool_frames(robot, q)
    better, met = refine(robot, q + rng.normal(scale=1e-3, size=q.shape), targets)
    assert met.all()
    assert np.abs(residual_and_jacobian(robot, better, targets)[0]).max() < MAPS_BACK
    targets[:, 0, 3] += 10.0
    assert not refine(robot, q, targets)[1].any()


def test_limits_apply_to_what_is_found(rng: np.random.Generator) -> None:
    robot = offset_wrist()
    q = within_limits(robot, rng, 10)
    narrow = dataclasses.replace(robot, limits=np.tile([-0.1, 0.1], (6, 1)))
    solutions = inverse_kinematics(narrow, tool_frames(robot, q), generator=rng)
    assert not solutions.valid.any()
    assert (solutions.reason[solutions.reached] == Reason.LIMITS).all()
