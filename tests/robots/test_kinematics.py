"""Forward kinematics and Jacobian: against pinocchio, closed forms and finite differences."""

from __future__ import annotations

import copy
import itertools
import math
import tomllib
from typing import Any

import numpy as np
import oracles
import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pinocchio_chains import pinocchio_chain, raw
from refusals import refuses

from robots import (
    Robot,
    bundled_names,
    content_hash,
    forward_kinematics,
    jacobian,
    load_description,
    load_robot,
    tool_position,
)
from robots.arrays import Array
from robots.frames import rotation_rpy, rpy_of
from robots.joint_errors import designed, joint_errors
from robots.library.models import parse_description, to_toml
from robots.robot import LIMIT_TOLERANCE_RAD, as_designed, robot_from
from robots.urdf.writing import real_frame

# Lengths are near 3 m and a frame is some 20 products long: round-off is about 1e-14. A figure
# wrong by a micrometre or a microradian is a million times over this.
ROUND_OFF = 1e-12


def random_poses(robot: Robot, rng: np.random.Generator, n: int) -> Array:
    return rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (n, robot.dof))


def crooked() -> dict[str, Any]:
    """A robot with skew axes, rolled frames, an axis along -z and a tool: what no bundled robot has."""
    data = copy.deepcopy(raw("xr701"))
    data["load_path"] = "serial"
    data.pop("parallelogram")
    axes = [[0.2, -0.4, 0.9], [0, 1, 0], [1, 2, -2], [0, 0, -1], [-1, 0, 0], [0.1, 0.1, -0.9]]
    for i, (joint, axis) in enumerate(zip(data["joint"], axes, strict=True)):
        joint["frame"]["axis"] = axis
        joint["frame"]["rpy"] = {"value": [10 * i, -20, 35 - i], "unit": "deg", "source": "assumed"}
    data["flange"]["rpy"] = {"value": [5, 15, -25], "unit": "deg", "source": "assumed"}
    data["tool"] = {
        "xyz": {"value": [40, -30, 120], "unit": "mm", "source": "assumed"},
        "rpy": {"value": [0, 30, 90], "unit": "deg", "source": "assumed"},
    }
    return data


@pytest.mark.oracle
@pytest.mark.parametrize("name", ["kr60-3", "tx200", "xr701", "crooked"])
def test_frames_and_jacobian_equal_pinocchios(name: str, rng: np.random.Generator) -> None:
    pin = oracles.load("pinocchio")
    file = crooked() if name == "crooked" else raw(name)
    robot = robot_from(parse_description(tomlkit.dumps(file), name))
    model, flange, sign, offset = pinocchio_chain(pin, file)
    data = model.createData()
    poses = random_poses(robot, rng, 200)
    frames = forward_kinematics(robot, poses)
    at_flange = np.zeros(3)
    J = jacobian(robot, poses, at_flange)
    for i, q in enumerate(poses):
        theta = sign * q + offset
        pin.computeJointJacobians(model, data, theta)
        pin.updateFramePlacements(model, data)
        for body in range(robot.dof + 1):
            np.testing.assert_allclose(frames.R[i, body], data.oMi[body].rotation, rtol=0, atol=ROUND_OFF)
            np.testing.assert_allclose(frames.p[i, body], data.oMi[body].translation, rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(frames.R_flange[i], data.oMf[flange].rotation, rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(frames.p_flange[i], data.oMf[flange].translation, rtol=0, atol=ROUND_OFF)
        expected = pin.getFrameJacobian(model, data, flange, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED) * sign
        np.testing.assert_allclose(J[i], expected, rtol=0, atol=ROUND_OFF)


def test_kr60_reaches_the_listed_2033_mm() -> None:
    robot = load_robot("kr60-3")
    # Upper arm level, and the line elbow - wrist centre in line with it.
    straight = np.radians([[0.0, 0.0, -math.degrees(math.atan2(820, 145)), 0.0, 0.0, 0.0]])
    assert robot.reachable(straight).all()
    wrist = forward_kinematics(robot, straight).p[0, 5]
    by_hand = 0.350 + 0.850 + math.hypot(0.145, 0.820)
    np.testing.assert_allclose(wrist, [by_hand, 0.0, 0.815], rtol=0, atol=ROUND_OFF)
    # The data sheet rounds to a millimetre.
    assert abs(by_hand - 2.033) < 0.5e-3


def test_kr60_wrist_never_goes_beyond_the_reach(rng: np.random.Generator) -> None:
    robot = load_robot("kr60-3")
    wrist = forward_kinematics(robot, random_poses(robot, rng, 5000)).p[:, 5]
    distance = np.hypot(wrist[:, 0], wrist[:, 1])
    reach = 0.350 + 0.850 + math.hypot(0.145, 0.820)
    assert distance.max() <= reach
    # 5000 random poses come within 2 % of the boundary; a chain that is too short would not.
    assert distance.max() > 0.98 * reach


def test_tx200_upright_and_stretched() -> None:
    robot = load_robot("tx200")
    flange = forward_kinematics(robot, np.radians([[0, 0, 0, 0, 0, 0], [0, 90, 0, 0, 0, 0]])).p_flange
    np.testing.assert_allclose(flange[0], [0.250, 0.0, 0.642 + 0.950 + 0.800 + 0.194], rtol=0, atol=ROUND_OFF)
    np.testing.assert_allclose(flange[1], [2.194, 0.0, 0.642], rtol=0, atol=ROUND_OFF)


def xr701_by_hand(q2_deg: float, q3real_deg: float, q5_deg: float) -> tuple[float, float, float]:
    """Flange x and z (m) in the arm's plane, q4 = 0; the forearm's angle from the vertical (deg)."""
    forearm_deg = q2_deg + 180.0 - q3real_deg
    upper, fore, hand = (math.radians(a) for a in (q2_deg, forearm_deg, forearm_deg + q5_deg))
    x = 0.35 + 1.10 * math.sin(upper) + 1.25 * math.sin(fore) + 0.30 * math.sin(hand)
    z = 0.80 + 1.10 * math.cos(upper) + 1.25 * math.cos(fore) + 0.30 * math.cos(hand)
    return x, z, forearm_deg


@pytest.mark.parametrize(
    ("pose", "q2_deg", "q3real_deg", "q5_deg", "forearm_deg"),
    [
        (5, -35.0, 40.0, 0.0, 105.0),
        (41, 5.0, 77.5, 0.0, 107.5),
        (77, 45.0, 115.0, 0.0, 110.0),
        (40, 5.0, 77.5, -100.0, 107.5),
    ],
)
def test_xr701_flange_by_hand(pose: int, q2_deg: float, q3real_deg: float, q5_deg: float, forearm_deg: float) -> None:
    x, z, by_hand_deg = xr701_by_hand(q2_deg, q3real_deg, q5_deg)
    assert by_hand_deg == forearm_deg, f"pose {pose}"
    frames = forward_kinematics(load_robot("xr701"), np.radians([[0.0, q2_deg, q3real_deg, 0.0, q5_deg, 0.0]]))
    np.testing.assert_allclose(frames.p_flange[0], [x, 0.0, z], rtol=0, atol=ROUND_OFF)
    forearm = [math.sin(math.radians(forearm_deg)), 0.0, math.cos(math.radians(forearm_deg))]
    np.testing.assert_allclose(frames.R[0, 3] @ [0, 0, 1], forearm, rtol=0, atol=ROUND_OFF)


def test_xr701_reach_grows_over_poses_5_41_77() -> None:
    poses = np.radians([[0.0, -35.0, 40.0, 0, 0, 0], [0.0, 5.0, 77.5, 0, 0, 0], [0.0, 45.0, 115.0, 0, 0, 0]])
    x = forward_kinematics(load_robot("xr701"), poses).p_flange[:, 0]
    assert x[0] < x[1] < x[2]


@pytest.mark.parametrize("q2_q3real_deg", [(-35.0, 40.0), (5.0, 77.5), (45.0, 115.0)])
def test_xr701_negative_q5_raises_the_flange(q2_q3real_deg: tuple[float, float]) -> None:
    q5_deg = np.array([-30.0, 0.0, 30.0])
    poses = np.zeros((3, 6))
    poses[:, 1:3], poses[:, 4] = q2_q3real_deg, q5_deg
    z = forward_kinematics(load_robot("xr701"), np.radians(poses)).p_flange[:, 2]
    assert z[0] > z[1] > z[2]


@pytest.mark.parametrize("name", bundled_names())
def test_jacobian_equals_central_differences(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = random_poses(robot, rng, 20)
    point = np.array([0.05, -0.08, 0.12])
    J, R = jacobian(robot, q, point), forward_kinematics(robot, q).R_flange
    h = 1e-5
    for j in range(robot.dof):
        step = h * np.eye(robot.dof)[j]
        ahead, behind = forward_kinematics(robot, q + step), forward_kinematics(robot, q - step)
        v = (tool_position(robot, ahead, point) - tool_position(robot, behind, point)) / (2 * h)
        spin = (ahead.R_flange - behind.R_flange) @ np.swapaxes(R, 1, 2) / (2 * h)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
        # Truncation h^2/6 x 3 m = 5e-11, round-off 1e-15 x 3 m / h = 3e-10.
        np.testing.assert_allclose(J[:, :3, j], v, rtol=0, atol=2e-9)
        np.testing.assert_allclose(J[:, 3:, j], omega, rtol=0, atol=2e-9)


def test_jacobian_of_a_sign_minus_coordinate_follows_the_coordinate() -> None:
    """Opening the xr701's elbow (q3real up) lifts the forearm: the column is minus the axis's."""
    robot, q = load_robot("xr701"), np.radians([[0, 5, 77.5, 0, 0, 0]])
    elbow = robot.coordinate_index("q3real_deg")
    J = jacobian(robot, q)
    assert J[0, 2, elbow] > 0.0
    axis = forward_kinematics(robot, q).axis[0, elbow]
    np.testing.assert_allclose(J[0, 3:, elbow], -axis, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("name", bundled_names())
def test_a_batch_equals_its_poses_one_by_one(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = random_poses(robot, rng, 7)
    points = rng.normal(size=(7, 3))
    batch, J = forward_kinematics(robot, q), jacobian(robot, q, points)
    for i in range(len(q)):
        one = forward_kinematics(robot, q[i : i + 1])
        # Vectorised and scalar cosines may differ in the last bit.
        np.testing.assert_allclose(batch.p_flange[i], one.p_flange[0], rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(batch.R[i], one.R[0], rtol=0, atol=ROUND_OFF)
        np.testing.assert_allclose(J[i], jacobian(robot, q[i : i + 1], points[i])[0], rtol=0, atol=ROUND_OFF)


def test_no_poses_give_no_frames() -> None:
    robot = load_robot("xr701")
    assert jacobian(robot, np.empty((0, 6))).shape == (0, 6, 6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_not_finite_is_named(bad: float) -> None:
    q = np.zeros((4, 6))
    q[2, 3] = bad
    for function in (forward_kinematics, jacobian):
        caught = refuses("B001", r"pose 2 for kr60-3.*finite", function, load_robot("kr60-3"), q)
        assert caught.remedy


@pytest.mark.parametrize("shape", [(6,), (2, 5), (2, 7), (1, 2, 6)])
def test_a_pose_array_of_the_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    for function in (forward_kinematics, jacobian):
        refuses("B001", r"pose array for kr60-3.*\(n, 6\) in rad", function, load_robot("kr60-3"), np.zeros(shape))


# ------------------------------------------------------------
# Errors of joints in a model file: what they do to angles, and what is no error of an arm

RATIO = {"value": 2e-3, "unit": "1", "source": "assumed"}
CURVE = {
    "sin_mrad": (1.0, 0.0, 0.5),
    "cos_mrad": (0.0, -2.0, 0.0),
    "identified_deg": ((-90.0, 90.0),),
    "height_mrad": 1.0,
    "source": "assumed",
}


def text(error: dict[str, Any]) -> str:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["joint"][4]["error"] = error
    return tomlkit.dumps(data)


def test_ratio_coupling_and_curve() -> None:
    error = {"ratio": RATIO, "turns_with": ({"joint": "j4", "factor": RATIO | {"value": -0.01}},), "curve": CURVE}
    errors = joint_errors(parse_description(text(error), "kr60-3"))
    assert errors is not None
    q = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]])
    more = 2e-3 * 0.5 - 0.01 * 0.4 + 1e-3 * (np.sin(0.5) + 0.5 * np.sin(1.5) - 2.0 * np.cos(1.0))
    assert_allclose(errors.turned(q) - q, [[0, 0, 0, 0, more, 0]], atol=1e-15)
    assert errors.unread(np.array([[0, 0, 0, 0, 2.0, 0]])).tolist() == [[False, False, False, False, True, False]]


def test_a_frame_moves_in_its_own_axes_before_it_turns() -> None:
    mm, deg = {"unit": "mm", "source": "assumed"}, {"unit": "deg", "source": "assumed"}
    robot = robot_from(
        parse_description(text({"x": mm | {"value": 2.0}, "rx": deg | {"value": 90.0 / np.pi}}), "kr60-3")
    )
    off = np.linalg.inv(robot.T_pre[4]) @ real_frame(robot, 4)
    assert_allclose(off[:3, 3], [2e-3, 0.0, 0.0], atol=1e-15)
    cos, sin = np.cos(0.5), np.sin(0.5)
    assert_allclose(off[:3, :3], [[1, 0, 0], [0, cos, -sin], [0, sin, cos]], atol=1e-12)


def test_a_model_without_errors_keeps_its_hash_and_has_none() -> None:
    bare = load_description("kr60-3")
    assert robot_from(bare).errors is None
    assert content_hash(parse_description(text({"ratio": RATIO}), "kr60-3")) != content_hash(bare)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ({"x": {"value": 2.0, "unit": "m", "source": "assumed"}}, "at most 0.5 m"),
        ({"rx": {"value": 40.0, "unit": "deg", "source": "assumed"}}, "at most 0.5 rad"),
        ({"ratio": RATIO | {"value": 1.002}}, "of a turn"),
        ({"turns_with": ({"joint": "j9", "factor": RATIO},)}, "j9"),
        ({"curve": CURVE | {"cos_mrad": (0.0,)}}, "as many"),
        ({"curve": CURVE | {"identified_deg": ((90.0, -90.0),)}}, "identified_deg"),
        ({"curve": CURVE | {"sin_mrad": (1.0, 0.0, 500.0)}}, "200"),
        ({"curve": CURVE | {"source": "nobody"}}, "nobody"),
        ({"rz": {"value": 1.0, "unit": "deg", "source": "assumed"}}, "unknown key"),
        ({"x": {"value": 1.0, "unit": "deg", "source": "assumed"}}, "deg"),
    ],
)
def test_what_is_no_error_of_an_arm_is_refused(error: dict[str, Any], words: str) -> None:
    refuses("F011", words, parse_description, text(error), "kr60-3")


@pytest.mark.parametrize(
    ("covariance", "words"),
    [
        ([[1e-6, 0.0]], "a row and a column"),
        ([[1e-6, 0.0], [0.0]], "a row and a column"),
        ([[1e-6, 1e-7], [0.0, 1e-6]], "symmetric"),
        ([[1e-6, 2e-6], [2e-6, 1e-6]], "negative variances"),
        ([[-1e-6, 0.0], [0.0, 1e-6]], "negative variances"),
    ],
)
def test_what_is_no_covariance_is_refused(covariance: list[list[float]], words: str) -> None:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["positions"] = {
        "data": "x",
        "data_sha256": "0",
        "before_rms_mm": 1.0,
        "rms_mm": 0.1,
        "left_out_rms_mm": 0.1,
        "parameters": ["j2.zero", "j3.zero"],
        "covariance": covariance,
    }
    refuses("F011", words, parse_description, tomlkit.dumps(data), "kr60-3")


def test_the_arm_as_designed_is_the_described_one_without_what_positions_told() -> None:
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    data["positions"] = {"data": "x", "data_sha256": "0", "before_rms_mm": 1.0, "rms_mm": 0.1, "left_out_rms_mm": 0.1}
    data["joint"][1]["zero_error"] = {"value": 0.5, "unit": "deg", "source": "assumed"}
    data["joint"][1]["error"] = {"ratio": RATIO}
    description = parse_description(tomlkit.dumps(data), "kr60-3")
    plain = designed(description)
    assert plain == load_description("kr60-3")
    assert designed(plain) is plain
    assert_allclose(as_designed(robot_from(description)).offset, robot_from(plain).offset, atol=1e-15)


# ------------------------------------------------------------
# Rotations of a robot's frames


@pytest.mark.parametrize("pitch", [0.0, 0.7, -1.2, np.pi / 2.0, -np.pi / 2.0])
def test_roll_pitch_and_yaw_give_their_rotation_back(pitch: float) -> None:
    R = rotation_rpy(np.array([0.4, pitch, -2.5]))
    np.testing.assert_allclose(rotation_rpy(rpy_of(R)), R, rtol=0, atol=1e-15)
    assert abs(pitch) < 1.5 or rpy_of(R)[2] == 0.0


# ------------------------------------------------------------
# Which poses can be taken, and what is said about those that cannot


def xr701_pose(q2_deg: float, q3real_deg: float) -> np.ndarray:
    return np.radians([0.0, q2_deg, q3real_deg, 0.0, 0.0, 0.0])


def forearm_limits_deg() -> tuple[float, float]:
    """Read from the file as it stands: the paper only brackets them (30 is out, 67.5 and 185 are in)."""
    limits = load_description("xr701").coupling[0].limits
    assert limits.unit == "deg"
    assert isinstance(limits.value, tuple)
    lower, upper = limits.value
    assert 30.0 < lower <= 67.5
    assert upper >= 185.0
    return lower, upper


# The paper's Table 2, where bracketed q3real levels stand in for those that cannot be taken.
TABLE_2 = [
    (-35, 40, True),
    (-35, 60, True),
    (-35, 77.5, True),
    (-35, 115, False),
    *[(q2, q3real, True) for q2 in (5, 45) for q3real in (40, 77.5, 115)],
]


@pytest.mark.parametrize(("q2_deg", "q3real_deg", "exists"), TABLE_2)
def test_the_papers_table_2(q2_deg: float, q3real_deg: float, exists: bool) -> None:
    pose = xr701_pose(q2_deg, q3real_deg)
    assert load_robot("xr701").reachable(pose[None]).tolist() == [exists]


def test_the_81_poses_of_the_adjusted_factorial_exist() -> None:
    levels = {-35: (40, 60, 77.5), 5: (40, 77.5, 115), 45: (40, 77.5, 115)}
    poses = [
        [0, q2, q3real, q4, q5, 0]
        for q2, q3s in levels.items()
        for q3real, q4, q5 in itertools.product(q3s, (-200, 0, 200), (-100, 0, 100))
    ]
    assert load_robot("xr701").reachable(np.radians(poses)).tolist() == [True] * 81


def test_the_coupled_limit_is_explained_with_its_sum() -> None:
    lower_deg, upper_deg = forearm_limits_deg()
    messages = load_robot("xr701").violations(xr701_pose(-35, 115))
    # 180 - 35 - 115 = 30.
    assert messages == [
        f"forearm_deg = 30 is outside {lower_deg:g} to {upper_deg:g} deg (forearm_deg = 180 +1 q2_deg -1 q3real_deg)"
    ]


def test_every_broken_limit_is_named() -> None:
    messages = load_robot("kr60-3").violations(np.radians([186.0, 0.0, 69.0, 0.0, -120.0, 0.0]))
    assert [message.split(" = ")[0] for message in messages] == ["q1_deg", "q3_deg", "q5_deg"]
    assert messages[0] == "q1_deg = 186 is outside -185 to 185 deg"


@pytest.mark.parametrize("name", bundled_names())
def test_a_joint_limit_can_be_taken_and_a_step_beyond_cannot(name: str) -> None:
    robot = load_robot(name)
    home = np.radians([0.0, 5.0, 77.5, 0.0, 0.0, 0.0]) if name == "xr701" else np.zeros(robot.dof)
    assert robot.violations(home) == []
    # The tolerance is there for rounding; a thousand times of it is a real violation.
    beyond = 1e3 * LIMIT_TOLERANCE_RAD
    for joint, outwards in itertools.product(range(robot.dof), (-1, 1)):
        on_limit = home.copy()
        on_limit[joint] = robot.limits[joint, (outwards + 1) // 2]
        assert robot.violations(on_limit) == []
        assert robot.reachable(on_limit[None]).all()
        over = on_limit.copy()
        over[joint] += outwards * beyond
        assert not robot.reachable(over[None]).any()
        assert robot.coordinates[joint] in robot.violations(over)[0]


@pytest.mark.parametrize("name", ["kr60-3", "tx200"])
def test_without_couplings_every_corner_of_the_limits_is_reachable(name: str) -> None:
    robot = load_robot(name)
    assert robot.couplings == ()
    assert robot.reachable(np.array(list(itertools.product(*robot.limits)))).all()


@pytest.mark.parametrize("q2_deg", [-35.0, -33.3, -30.7, -76.0 / 3.0, -20.0])
def test_a_pose_on_the_coupled_limit_is_reachable(q2_deg: float) -> None:
    robot = load_robot("xr701")
    q3real_deg = 180.0 + q2_deg - forearm_limits_deg()[0]
    # On the limit by hand; the sum in radians need not round to it.
    assert robot.reachable(xr701_pose(q2_deg, q3real_deg)[None]).all()
    assert not robot.reachable(xr701_pose(q2_deg, q3real_deg + 1e-4)[None]).any()


# Where each coordinate stands in its range: inside, on the ends, or beyond them.
PLACES = st.lists(st.sampled_from([0.0, 1.0]) | st.floats(-0.05, 1.05), min_size=6, max_size=6)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names())
@given(places=PLACES)
def test_reachable_exactly_when_nothing_is_violated(name: str, places: list[float]) -> None:
    robot = load_robot(name)
    lower, upper = robot.limits.T
    q = lower + np.array(places) * (upper - lower)
    assert bool(robot.reachable(q[None])[0]) == (robot.violations(q) == [])


@pytest.mark.slow
@given(places=PLACES)
def test_reachable_means_inside_every_range(places: list[float]) -> None:
    """Worked out in degrees from the paper's ranges and the file's assumed ones."""
    forearm_lower, forearm_upper = forearm_limits_deg()
    lower = np.array([-160.0, -35.0, 40.0, -200.0, -100.0, -270.0])
    upper = np.array([160.0, 45.0, 115.0, 200.0, 100.0, 270.0])
    q_deg = lower + np.array(places) * (upper - lower)
    forearm_deg = 180.0 + q_deg[1] - q_deg[2]
    # How far the pose is inside the nearest limit; within 1e-6 deg of it rounding decides.
    to_ranges = min((q_deg - lower).min(), (upper - q_deg).min())
    margin = min(to_ranges, forearm_deg - forearm_lower, forearm_upper - forearm_deg)
    if abs(margin) > 1e-6:
        assert bool(load_robot("xr701").reachable(np.radians(q_deg)[None])[0]) == (margin > 0.0)


def test_nan_is_never_reachable_and_is_named() -> None:
    robot = load_robot("xr701")
    for joint, name in enumerate(robot.coordinates):
        pose = xr701_pose(5, 77.5)
        pose[joint] = np.nan
        assert not robot.reachable(pose[None]).any()
        assert any(message.startswith(f"{name} = nan") for message in robot.violations(pose))


@pytest.mark.parametrize("shape", [(6,), (3, 5)])
def test_reachable_refuses_the_wrong_shape(shape: tuple[int, ...]) -> None:
    refuses("B001", r"pose array for xr701.*\(n, 6\) in rad", load_robot("xr701").reachable, np.zeros(shape))


def test_an_unknown_coordinate_lists_the_known_ones() -> None:
    refuses("B003", r"'q3_deg'; allowed: q1_deg, q2_deg, q3real_deg", load_robot("xr701").coordinate_index, "q3_deg")
