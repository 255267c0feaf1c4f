"""Singular and unreachable targets, and the distance to singularities."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from inverse_cases import MAPS_BACK, apart, chain, random_arm, tool_frames, within_limits, worst_error
from refusals import refuses
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from robots import Reason, Robot, inverse_kinematics, jacobian, load_robot, singularity_distance
from robots.arrays import Array

RIGHT = np.pi / 2
# A spherical wrist behind a shoulder with a lateral offset of 0.1 m.
LATERAL = chain(
    np.array([0, -RIGHT, 0, -RIGHT, RIGHT, -RIGHT]),
    np.array([0, 0.2, 0.8, 0.1, 0, 0]),
    np.array([0, 0.1, 0, 0.7, 0, 0]),
)


def wrist_at(robot: Robot, points: Array, rng: np.random.Generator) -> Array:
    """Tool frames of a KUKA-like robot whose wrist centre is at points (n, 3), turned at random."""
    T = np.tile(np.eye(4), (len(points), 1, 1))
    T[:, :3, :3] = Rotation.random(len(points), random_state=rng).as_matrix()
    T[:, :3, 3] = points + T[:, :3, :3] @ robot.T_last_flange[:3, 3]
    return T


# --- wrist


@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701"])
def test_a_straight_wrist_keeps_the_preferred_joint_4(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = within_limits(robot, rng, 50)
    q[:, 4] = 0.0
    targets = tool_frames(robot, q)
    near = within_limits(robot, rng, 50)
    solutions = inverse_kinematics(robot, targets, near=near)
    assert worst_error(solutions, targets) < MAPS_BACK
    straight = solutions.singular[:, :, 2] & (np.abs(solutions.q[:, :, 4]) < 1e-6)
    assert (straight.sum(axis=1) >= 2).all()
    i, j = np.nonzero(straight)
    np.testing.assert_allclose(solutions.q[i, j, 3], near[i, 3], rtol=0, atol=1e-12)
    # The two flips are one pose there, counted once.
    assert (solutions.twin & straight)[:, 1::2].sum() == straight.sum() / 2
    assert solutions.sure.all()
    assert "singular: wrist" in " ".join(solutions.explain(0))


@pytest.mark.parametrize("bend", [1e-2, 1e-4, 1e-6, 1e-8, 1e-9])
def test_next_to_the_straight_wrist_nothing_is_rounded_away(bend: float, rng: np.random.Generator) -> None:
    """An arccosine would lose joint 5 below 1e-8 rad."""
    robot = load_robot("kr60-3")
    q = within_limits(robot, rng, 200)
    q[:, 4] = bend
    targets = tool_frames(robot, q)
    solutions = inverse_kinematics(robot, targets)
    assert worst_error(solutions, targets) < MAPS_BACK
    nearest = np.nanmin(np.abs(solutions.q[:, :, 4] - bend), axis=1)
    # Rounding of the target's matrix, and of a chain of six rotations.
    assert nearest.max() < 1e-14
    assert solutions.singular[:, :, 2].any(axis=1).all() == (bend < 1e-7)


# --- shoulder


def test_a_wrist_above_axis_1_keeps_the_preferred_joint_1(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    targets = wrist_at(robot, np.array([[0.0, 0.0, 1.7], [0.0, 0.0, 1.9]]), rng)
    near = np.radians([70.0, -90.0, 0.0, 0.0, 0.0, 0.0])
    solutions = inverse_kinematics(robot, targets, near=near)
    assert worst_error(solutions, targets) < MAPS_BACK
    assert solutions.reached.all()
    assert solutions.singular[:, :, 0].all()
    np.testing.assert_allclose(np.degrees(solutions.q[:, :4, 0]), 70.0)
    np.testing.assert_allclose(np.degrees(solutions.q[:, 4:, 0]) % 360.0, 250.0)
    np.testing.assert_allclose(singularity_distance(robot, solutions.q[0]).shoulder_m, 0.0, atol=1e-12)


@pytest.mark.parametrize("off_m", [1e-3, 1e-6, 1e-9])
def test_next_to_axis_1_targets_are_still_met(off_m: float, rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    points = off_m * rng.normal(size=(50, 3)) + [0.0, 0.0, 1.8]
    targets = wrist_at(robot, points, rng)
    assert worst_error(inverse_kinematics(robot, targets), targets) < MAPS_BACK


def test_inside_the_lateral_offset_nothing_is_reached(rng: np.random.Generator) -> None:
    points = np.array([[0.0, 0.0, 0.9], [0.0999, 0.0, 0.9], [0.1, 0.0, 0.9], [0.1001, 0.0, 0.9]])
    robot = dataclasses.replace(LATERAL, T_last_flange=np.eye(4))
    targets = wrist_at(robot, points, rng)
    solutions = inverse_kinematics(robot, targets)
    assert (solutions.reason[:2] == Reason.SHOULDER).all()
    assert "lateral offset" in solutions.explain(0)[0]
    assert solutions.reached[2:].all()
    # On the edge front and back are one.
    assert solutions.twin[2].sum() == 4
    assert solutions.singular[2, :, 0].all()
    assert not solutions.singular[3].any()
    assert worst_error(solutions, targets) < MAPS_BACK


# --- elbow and reach


def test_the_stretched_arm_and_beyond(rng: np.random.Generator) -> None:
    """By the data sheet's figures: the wrist centre reaches 0.35 + 0.85 + sqrt(0.145^2 + 0.82^2) m from axis 1."""
    robot = load_robot("kr60-3")
    reach = 0.35 + 0.85 + np.hypot(0.145, 0.82)
    over = np.array([-1e-6, -1e-9, 0.0, 1e-12, 1e-6, 1.0])
    points = np.column_stack([reach + over, np.zeros(6), np.full(6, 0.815)])
    targets = wrist_at(robot, points, rng)
    solutions = inverse_kinematics(robot, targets)
    front, back = solutions.reason[:, :4], solutions.reason[:, 4:]
    assert (back == Reason.TOO_FAR).all()
    assert (front[4:] == Reason.TOO_FAR).all()
    assert np.isin(front[:4], [Reason.FOUND, Reason.LIMITS]).all()
    assert worst_error(solutions, targets) < MAPS_BACK
    assert solutions.singular[2:4, :4, 1].all()
    assert not solutions.singular[0, :4, 1].any()
    assert solutions.twin[2, 2:4].all()
    assert "farther from axis 2 than the stretched arm" in " ".join(solutions.explain(5))


def test_too_near_to_the_shoulder_in_front_but_not_from_behind(rng: np.random.Generator) -> None:
    """Upper arm 850 mm, forearm 833 mm: nearer than 17 mm to axis 2 the front branches end."""
    robot = load_robot("kr60-3")
    targets = wrist_at(robot, np.array([[0.36, 0.0, 0.815]]), rng)
    solutions = inverse_kinematics(robot, targets)
    assert (solutions.reason[0, :4] == Reason.TOO_NEAR).all()
    assert solutions.reached[0, 4:].all()


def test_equal_arms_folded_onto_axis_2_keep_the_preferred_joint_2(rng: np.random.Generator) -> None:
    robot = chain(
        np.array([0, -RIGHT, 0, -RIGHT, RIGHT, -RIGHT]), np.array([0, 0.2, 0.7, 0, 0, 0]), np.r_[0, 0, 0, 0.7, 0, 0]
    )
    robot = dataclasses.replace(robot, T_last_flange=np.eye(4))
    targets = wrist_at(robot, np.array([[0.2, 0.0, 0.0]]), rng)
    near = np.array([0.0, 0.6, 0.0, 0.0, 0.0, 0.0])
    solutions = inverse_kinematics(robot, targets, near=near)
    assert worst_error(solutions, targets) < MAPS_BACK
    assert solutions.singular[0, :4, 1].all()
    np.testing.assert_allclose(solutions.q[0, :4, 1], 0.6)


def test_a_skew_wrist_says_when_it_cannot_turn_that_far(rng: np.random.Generator) -> None:
    """Axes 4, 5 and 5, 6 at 60 deg: axis 6 stays within 120 deg of axis 4."""
    skew = np.array([0, -RIGHT, 0, -RIGHT, np.pi / 3, -np.pi / 3])
    robot = chain(skew, np.array([0, 0.2, 0.8, 0.1, 0, 0]), np.array([0, 0, 0, 0.7, 0, 0]))
    q = rng.uniform(-2.0, 2.0, (100, 6))
    targets = tool_frames(robot, q)
    assert apart(np.nan_to_num(inverse_kinematics(robot, targets).q, nan=9.0), q[:, None]).min(axis=1).max() < 1e-8
    # The same wrist centres, hands turned over.
    targets[:, :3, :3] = Rotation.random(100, random_state=rng).as_matrix()
    solutions = inverse_kinematics(robot, targets)
    refused = solutions.reason == Reason.ORIENTATION
    # Directions beyond 120 deg are a quarter of the sphere.
    assert 0.15 < refused[solutions.reason <= Reason.ORIENTATION].mean() < 0.35
    assert worst_error(solutions, targets) < MAPS_BACK


def test_a_target_out_of_the_world(rng: np.random.Generator) -> None:
    for robot in (load_robot("xr701"), random_arm(rng, parallel=False, right_angles=True)):
        far = tool_frames(robot, np.zeros((1, 6)))
        far[0, :3, 3] += 100.0
        solutions = inverse_kinematics(robot, far)
        assert not solutions.reached.any()
        assert solutions.count.tolist() == [0]
        assert "out of reach" in solutions.explain(0)[0]


# --- distances


def test_distances_are_those_of_the_geometry() -> None:
    robot = load_robot("tx200")
    # Upper arm upright, forearm level: wrist centre 0.25 + 0.8 m out, elbow at right angles, wrist bent by 30 deg.
    at = singularity_distance(robot, np.radians([[20.0, 0, 90, 15, 30, 5], [20.0, 0, 90, 15, 179, 5]]))
    np.testing.assert_allclose(at.shoulder_m, 1.05)
    np.testing.assert_allclose(np.degrees(at.elbow_rad), 90.0)
    np.testing.assert_allclose(np.degrees(at.wrist_rad), [30.0, 1.0])


def test_the_determinant_is_the_product_of_the_three(rng: np.random.Generator) -> None:
    """At the wrist centre the Jacobian is block-triangular: det = shoulder x (upper fore sin elbow) x sin wrist."""
    robot = load_robot("kr60-3")
    q = within_limits(robot, rng, 100)
    at = singularity_distance(robot, q)
    J = jacobian(robot, q, np.array([0.0, 0.0, -0.17]))
    expected = at.shoulder_m * 0.85 * np.hypot(0.145, 0.82) * np.sin(at.elbow_rad) * np.sin(at.wrist_rad)
    np.testing.assert_allclose(np.abs(np.linalg.det(J)), expected, rtol=1e-10, atol=1e-14)


def test_the_smallest_singular_value_by_its_definition(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    q = within_limits(robot, rng, 20)
    q[0, 4] = 0.0
    at = singularity_distance(robot, q, length_m=0.5)
    J = jacobian(robot, q)
    J[:, :3] /= 0.5
    np.testing.assert_allclose(at.sigma_min**2, np.linalg.eigvalsh(np.swapaxes(J, 1, 2) @ J)[:, 0], atol=1e-12)
    assert at.sigma_min[0] < 1e-12


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_length_that_is_none_is_refused(length: float) -> None:
    refuses(
        "B003", "length for the Jacobian", singularity_distance, load_robot("kr60-3"), np.zeros((1, 6)), length_m=length
    )


# --- bad input


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda T: T[0], r"shape \(4, 4\).*allowed: \(n, 4, 4\)"),
        (lambda T: T[:, :3], "shape"),
        (lambda T: T * [[[1.0], [1.0], [np.nan], [1.0]]], "target frames, number 0: .*finite"),
        (lambda T: T * [[[1.0], [1.0], [-1.0], [1.0]]], "number 0, is no rigid transform"),
        (lambda T: T * 1.001, "number 0, is no rigid transform"),
    ],
)
def test_frames_that_are_none_are_refused(change: object, words: str) -> None:
    refuses("B001", words, inverse_kinematics, load_robot("kr60-3"), change(np.eye(4)[None].copy()))


def test_rotations_rounded_by_a_file_are_made_whole(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    targets = tool_frames(robot, within_limits(robot, rng, 20))
    rounded = targets.copy()
    rounded[:, :3, :3] = rounded[:, :3, :3].round(7)
    solutions = inverse_kinematics(robot, rounded)
    # As near as the digits say; and exactly the nearest rotation (the polar factor).
    assert worst_error(solutions, targets) < 2e-7
    nearest = rounded.copy()
    nearest[:, :3, :3] = [polar(R)[0] for R in rounded[:, :3, :3]]
    assert np.abs(nearest - rounded).max() > 1e-8
    assert worst_error(solutions, nearest) < MAPS_BACK
