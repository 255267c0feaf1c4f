"""Forward kinematics and Jacobian: against pinocchio, closed forms and finite differences."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import oracles
import pytest
import tomlkit
from pinocchio_chains import pinocchio_chain, raw
from refusals import refuses

from robots import Robot, bundled_names, forward_kinematics, jacobian, load_robot, tool_position
from robots.arrays import Array
from robots.library.models import parse_description
from robots.robot import robot_from

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
