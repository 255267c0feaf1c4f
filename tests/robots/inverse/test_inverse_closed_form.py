"""Closed-form inverse kinematics: every solution maps back, no branch is lost, names mean what they say."""

from __future__ import annotations

import dataclasses

import numpy as np
import oracles
import pytest
from inverse_cases import DATA, MAPS_BACK, apart, chain, random_arm, tool_frames, within_limits, worst_error
from pinocchio_chains import pinocchio_chain, raw
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

from robots import (
    BRANCHES,
    InverseSolutions,
    Robot,
    branch_of,
    bundled_names,
    forward_kinematics,
    inverse_kinematics,
    load_robot,
    read_urdf,
    why_no_closed_form,
)
from robots.arrays import Array
from robots.inverse.quartic import quartic_roots
from robots.inverse.search import search
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical
from robots.robot import robot_from

# Rounding of 1e-15 grows by the inverse Jacobian; poses drawn at random come within 1e-4 of singular.
SAME_POSE = 1e-8


def check(robot: Robot, q: Array) -> None:
    """All solutions map back, and the pose that the target came from is the one in its own branch."""
    targets = tool_frames(robot, q)
    solutions = inverse_kinematics(robot, targets)
    assert worst_error(solutions, targets) < MAPS_BACK
    own = branch_of(robot, q)
    assert apart(solutions.q[np.arange(len(q)), own], q).max() < SAME_POSE
    i, j = np.nonzero(solutions.reached)
    np.testing.assert_array_equal(branch_of(robot, solutions.q[i, j]), j)
    np.testing.assert_array_equal(solutions.valid[i, j], robot.reachable(solutions.q[i, j]))
    assert solutions.valid[np.arange(len(q)), own][robot.reachable(q)].all()
    assert solutions.sure.all()


def nothing_else_is_found(solutions: InverseSolutions, targets: Array, rng: np.random.Generator, starts: int) -> None:
    """A search from many random starts ends at solutions that are known, and at most of these."""
    robot = solutions.robot
    flange = targets @ np.linalg.inv(robot.T_flange_tool)
    found = search(robot, flange, rng, starts=starts, most_starts=starts)
    i, j = np.nonzero(found.hits)
    # A search ends 1e-11 from the target, so next to a singularity up to 3e-6 off.
    assert np.nanmin(apart(solutions.q[i], found.q[i, j, None]), axis=1).max() < 1e-5
    # It does not get everywhere, but this check would be void if it got nowhere.
    assert (found.hits > 0).sum() > 0.9 * solutions.reached.sum()


@pytest.mark.parametrize("name", bundled_names())
def test_bundled_robots(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    check(robot, within_limits(robot, rng, 2000))


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names())
def test_bundled_robots_over_1e5_poses(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    check(robot, within_limits(robot, rng, 100_000))


@pytest.mark.parametrize("right_angles", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_any_frames_signs_and_offsets(right_angles: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_arm(rng, parallel=True, right_angles=right_angles)
    assert spherical_wrist_arm(robot).exact
    check(robot, rng.uniform(-np.pi, np.pi, (300, 6)))


@pytest.mark.parametrize("kind", ["kr60-3", "xr701", "right angles", "skew"])
def test_a_search_from_many_starts_finds_nothing_else(kind: str, rng: np.random.Generator) -> None:
    robot = load_robot(kind) if kind in bundled_names() else random_arm(rng, parallel=True, right_angles=kind != "skew")
    targets = tool_frames(robot, rng.uniform(-np.pi, np.pi, (20, 6)))
    nothing_else_is_found(inverse_kinematics(robot, targets), targets, rng, starts=150)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names())
def test_a_search_finds_nothing_else_over_150_targets(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    targets = tool_frames(robot, within_limits(robot, rng, 150))
    nothing_else_is_found(inverse_kinematics(robot, targets), targets, rng, starts=300)


@pytest.mark.oracle
def test_pinocchio_puts_the_tool_at_the_targets(rng: np.random.Generator) -> None:
    pin = oracles.load("pinocchio")
    for name in bundled_names():
        robot = load_robot(name)
        targets = tool_frames(robot, within_limits(robot, rng, 40))
        solutions = inverse_kinematics(robot, targets)
        model, flange, sign, offset = pinocchio_chain(pin, raw(name))
        data = model.createData()
        for i, j in zip(*np.nonzero(solutions.reached), strict=True):
            pin.framesForwardKinematics(model, data, sign * solutions.q[i, j] + offset)
            tool = data.oMf[flange].homogeneous @ robot.T_flange_tool
            assert np.abs(tool - targets[i]).max() < MAPS_BACK


@pytest.mark.parametrize("seed", range(4))
def test_axes_2_and_3_not_parallel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_arm(rng, parallel=False, right_angles=bool(seed % 2))
    assert why_not_spherical(robot) is not None
    assert why_no_closed_form(robot) is None
    q = rng.uniform(-np.pi, np.pi, (200, 6))
    targets = tool_frames(robot, q)
    solutions = inverse_kinematics(robot, targets)
    assert worst_error(solutions, targets) < MAPS_BACK
    assert np.nanmin(apart(solutions.q, q[:, None]), axis=1).max() < SAME_POSE
    nothing_else_is_found(inverse_kinematics(robot, targets[:12]), targets[:12], rng, starts=150)


@pytest.mark.parametrize("special", ["meeting", "parallel"])
def test_axes_1_and_2_that_meet_or_are_parallel_under_a_skew_third(special: str, rng: np.random.Generator) -> None:
    robot = random_arm(rng, parallel=False, right_angles=False)
    T = robot.T_pre.copy()
    T[1, :3] = robot.R_post[0].T @ np.eye(4)[:3]
    T[1, :3, :3] = T[1, :3, :3] @ Rotation.from_rotvec([1.1 if special == "meeting" else 0.0, 0.0, 0.0]).as_matrix()
    T[1, :3, 3] = robot.R_post[0].T @ ([0.0, 0.0, 0.4] if special == "meeting" else [0.5, 0.2, 0.4])
    robot = dataclasses.replace(robot, T_pre=T)
    q = rng.uniform(-np.pi, np.pi, (200, 6))
    solutions = inverse_kinematics(robot, tool_frames(robot, q))
    assert worst_error(solutions, tool_frames(robot, q)) < MAPS_BACK
    assert np.nanmin(apart(solutions.q, q[:, None]), axis=1).max() < SAME_POSE


def test_a_urdf_arm_with_a_tilted_wrist(rng: np.random.Generator) -> None:
    robot = robot_from(read_urdf(DATA / "six_axis.urdf").description)
    q = within_limits(robot, rng, 300)
    solutions = inverse_kinematics(robot, tool_frames(robot, q))
    assert solutions.method == "closed form, refined"
    assert worst_error(solutions, tool_frames(robot, q)) < MAPS_BACK
    assert np.nanmin(apart(solutions.q, q[:, None]), axis=1).max() < SAME_POSE


@pytest.mark.parametrize("rounding", [1e-8, 1e-5])
def test_an_arm_spoilt_by_the_digits_of_its_file_is_met_exactly(rounding: float, rng: np.random.Generator) -> None:
    """As URDFs with 1.5708 for a right angle, or kinematics calibrated to the last digit."""
    robot = load_robot("kr60-3")
    T = robot.T_pre.copy()
    T[:, :3, :3] = Rotation.from_rotvec(rng.normal(scale=rounding, size=(6, 3))).as_matrix() @ T[:, :3, :3]
    T[:, :3, 3] += rng.normal(scale=rounding, size=(6, 3))
    robot = dataclasses.replace(robot, T_pre=T)
    q = within_limits(robot, rng, 500)
    targets = tool_frames(robot, q)
    solutions = inverse_kinematics(robot, targets)
    assert solutions.method == "closed form, refined"
    assert worst_error(solutions, targets) < MAPS_BACK
    lost = np.nanmin(apart(solutions.q, q[:, None]), axis=1) > SAME_POSE
    assert not (lost & solutions.sure).any()
    # Doubt is for singular poses: those within the square root of the rounding (0.3 %, some of eight branches).
    assert solutions.sure.mean() > 0.9
    found = search(robot, targets[:12], rng, starts=150, most_starts=150)
    sure = solutions.sure[:12]
    np.testing.assert_array_equal(solutions.reached[:12][sure].sum(axis=1), (found.hits > 0)[sure].sum(axis=1))


def test_one_axis_of_the_wrist_off_by_a_hair(rng: np.random.Generator) -> None:
    """The parallel axes are exact then; the wrist alone has to show that the picture is not."""
    robot = load_robot("tx200")
    T = robot.T_pre.copy()
    T[5, :3, 3] += [1e-5, 0.0, 0.0]
    robot = dataclasses.replace(robot, T_pre=T)
    targets = tool_frames(robot, within_limits(robot, rng, 100))
    solutions = inverse_kinematics(robot, targets)
    assert solutions.method == "closed form, refined"
    assert worst_error(solutions, targets) < MAPS_BACK


def test_a_spoilt_wrist_is_in_doubt_where_it_is_nearly_straight(rng: np.random.Generator) -> None:
    """There a wrist whose axes do not quite meet has up to twice as many solutions."""
    robot = load_robot("kr60-3")
    T = robot.T_pre.copy()
    T[:, :3, 3] += rng.normal(scale=1e-4, size=(6, 3))
    robot = dataclasses.replace(robot, T_pre=T)
    q = within_limits(robot, rng, 100)
    q[:, 4] = 2e-3  # the square root of the fault is 1e-2
    assert not inverse_kinematics(robot, tool_frames(robot, q)).sure.any()


def test_no_targets_no_solutions() -> None:
    solutions = inverse_kinematics(load_robot("kr60-3"), np.empty((0, 4, 4)))
    assert solutions.q.shape == (0, 8, 6)
    assert solutions.turns().q.shape == (0, 6)
    assert solutions.nearest(np.zeros(6))[0].shape == (0, 6)


def test_targets_of_the_flange_and_of_another_tool(rng: np.random.Generator) -> None:
    robot = random_arm(rng, parallel=True, right_angles=True)
    q = rng.uniform(-np.pi, np.pi, (20, 6))
    flange = tool_frames(robot, q) @ np.linalg.inv(robot.T_flange_tool)
    other = rigid_frame((0.1, 0.2, 0.3))
    expected = inverse_kinematics(robot, tool_frames(robot, q)).q
    for tool in (np.eye(4), other):
        np.testing.assert_allclose(
            inverse_kinematics(robot, flange @ tool, T_flange_tool=tool).q, expected, rtol=0, atol=SAME_POSE
        )


# --- names


def test_the_eight_names() -> None:
    assert [branch.name for branch in BRANCHES][:3] == [
        "front, elbow up, no flip",
        "front, elbow up, flip",
        "front, elbow down, no flip",
    ]
    assert len({branch.name for branch in BRANCHES}) == 8


@pytest.mark.parametrize(
    ("name", "q_deg", "branch"),
    [
        # Upper arm upright, forearm level to the front, hand bent: how such robots stand in a catalogue.
        ("kr60-3", [0, -90, 0, 0, 30, 0], "front, elbow up, no flip"),
        ("kr60-3", [0, -90, 0, 0, -30, 0], "front, elbow up, flip"),
        ("tx200", [0, 0, 90, 0, 30, 0], "front, elbow up, no flip"),
        # Leaning back over the base with the forearm folded to the front's side of the upper arm.
        ("tx200", [0, -90, -60, 0, 30, 0], "back, elbow up, no flip"),
        ("tx200", [0, -90, 60, 0, 30, 0], "back, elbow down, no flip"),
        # Upper arm level to the front, forearm up.
        ("tx200", [0, 90, -90, 0, 30, 0], "front, elbow down, no flip"),
        ("xr701", [0, 5, 77.5, 0, -30, 0], "front, elbow up, flip"),
    ],
)
def test_known_poses_have_the_names_a_user_gives_them(name: str, q_deg: list[float], branch: str) -> None:
    assert BRANCHES[int(branch_of(load_robot(name), np.radians([q_deg]))[0])].name == branch


@pytest.mark.parametrize("name", bundled_names())
def test_names_by_where_the_elbow_and_the_wrist_are(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    solutions = inverse_kinematics(robot, tool_frames(robot, within_limits(robot, rng, 300)))
    i, j = np.nonzero(solutions.reached)
    q = solutions.q[i, j]
    q[:, 0] = 0.0
    p = forward_kinematics(robot, q).p
    shoulder, elbow, wrist = p[:, 2], p[:, 3], p[:, 5]
    front = np.array([BRANCHES[k].shoulder == "front" for k in j])
    np.testing.assert_array_equal(front, wrist[:, 0] > 0.0)
    # Where the wrist is farther out than the shoulder: is the elbow above the line between them?
    out = np.where(front, wrist[:, 0] - shoulder[:, 0], shoulder[:, 0] - wrist[:, 0]) > 0.05
    share = (elbow[:, 0] - shoulder[:, 0]) / np.where(out, wrist[:, 0] - shoulder[:, 0], 1.0)
    above = elbow[:, 2] > shoulder[:, 2] + share * (wrist[:, 2] - shoulder[:, 2])
    up = np.array([BRANCHES[k].elbow == "up" for k in j])
    assert out.sum() > 200
    np.testing.assert_array_equal(up[out], above[out])
    np.testing.assert_array_equal([BRANCHES[k].wrist == "no flip" for k in j], q[:, 4] >= 0.0)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("name", bundled_names())
def test_names_do_not_hang_on_how_a_joint_counts(name: str, joint: int, rng: np.random.Generator) -> None:
    """The same arm with one coordinate counted the other way; only "flip" goes by the sign of joint 5."""
    robot = load_robot(name)
    other = np.where(np.arange(6) == joint, -1.0, 1.0)
    turned = dataclasses.replace(robot, sign=robot.sign * other)
    q = rng.uniform(-np.pi, np.pi, (200, 6))
    expected = branch_of(robot, q)
    np.testing.assert_array_equal(branch_of(turned, q * other), expected ^ 1 if joint == 4 else expected)


@pytest.mark.parametrize(("shoulder_m", "front"), [(0.3, 1.0), (0.0, 1.0), (-0.3, -1.0)])
def test_the_front_is_where_the_shoulder_sits_else_the_bases_x(shoulder_m: float, front: float) -> None:
    alpha = np.pi / 2 * np.array([0, -1, 0, -1, 1, -1])
    robot = chain(alpha, np.array([0, shoulder_m, 0.8, 0.1, 0, 0]), np.array([0, 0, 0, 0.7, 0, 0]))
    reach = np.radians([[0.0, -60.0, 30.0, 0.0, 20.0, 0.0], [0.0, -120.0, -210.0, 0.0, 20.0, 0.0]])
    x = forward_kinematics(robot, reach).p[:, 5, 0]
    assert x[0] > 0.0 > x[1]
    shoulders = [BRANCHES[k].shoulder for k in branch_of(robot, reach)]
    assert shoulders == ["front" if side * front > 0.0 else "back" for side in x]


def test_names_do_not_hang_on_where_a_frame_sits_on_its_axis(rng: np.random.Generator) -> None:
    """The point given on axis 3 slid along it, on an arm whose forearm is skew to it."""
    alpha = np.array([0.0, -1.5, 0.0, -0.6, 1.5, -1.5])
    robot = chain(alpha, np.array([0, 0.2, 0.8, 0.1, 0, 0]), np.array([0, 0, 0, 0.7, 0, 0]))
    q = rng.uniform(-np.pi, np.pi, (100, 6))
    for slide in (-5.0, 5.0):
        T = robot.T_pre.copy()
        T[2, 2, 3] += slide
        T[3, 2, 3] -= slide
        other = dataclasses.replace(robot, T_pre=T)
        np.testing.assert_allclose(tool_frames(other, q), tool_frames(robot, q), rtol=0, atol=1e-14)
        np.testing.assert_array_equal(branch_of(other, q), branch_of(robot, q))


def test_roots_of_the_quartic_are_those_it_was_made_of(rng: np.random.Generator) -> None:
    """Products of four half-angle sines, some with double roots or with two roots that are close."""
    samples = np.arange(8) * np.pi / 4
    for case in range(300):
        roots = rng.uniform(-np.pi, np.pi, 4)
        gap = (None, 0.0, 1e-7, 1e-3)[case % 4]
        if gap is not None:
            roots[1] = roots[0] + gap
        fourier = np.fft.rfft(np.prod(np.sin((samples[:, None] - roots) / 2), axis=1)) / 8
        (A0, A1, A2), (_, B1, B2) = (fourier[:3].real * [1, 2, 2], -2 * fourier[:3].imag)
        mixed = np.array([2 * A2, 2 * B2, 0.0])
        angle, double = quartic_roots(*(np.full(1, value) for value in (A0 - A2, A1, B1)), mixed)
        assert not np.isnan(angle).any()
        off = np.abs((angle - roots + np.pi) % (2 * np.pi) - np.pi)
        # Double roots are known to the square root of rounding, over the slope to the other two.
        assert max(off.min(axis=0).max(), off.min(axis=1).max()) < 1e-5
        assert double.any() or gap not in (0.0, 1e-7)
    none, _ = quartic_roots(np.full(1, 3.0), np.ones(1), np.ones(1), np.zeros(3))
    assert np.isnan(none).all()
