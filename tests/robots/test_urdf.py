"""Robots from URDF: the same frames as pinocchio's, limits, meshes in the bodies' frames, bad files in plain words."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import oracles
import pytest
from rigid_frames import rigid_frame

from robots import (
    InputError,
    InputErrors,
    content_hash,
    forward_kinematics,
    load_description,
    read_urdf,
    save_description,
)
from robots.arrays import Array
from robots.frames import rotation_rpy, rpy_of
from robots.library.models import parse_description, to_toml
from robots.robot import Robot, robot_from
from robots.urdf.reading import Primitive, UrdfRobot, Visual
from robots.urdf.shapes import find_mesh

DATA = Path(__file__).parent / "data"
SIX_AXIS, CROOKED, TWO_ARMS = (DATA / f"{name}.urdf" for name in ("six_axis", "crooked", "two_arms"))

# A few products of rotations and lengths of about 1 m.
ROUND_OFF = 1e-14


def refused(path: Path, **options: str) -> InputError:
    with pytest.raises(InputError) as caught:
        read_urdf(path, **options)
    return caught.value


def one(shapes: dict[str, tuple[Visual, ...]], body: str) -> Visual:
    (shape,) = shapes[body]
    return shape


@pytest.fixture(scope="module")
def six_axis() -> UrdfRobot:
    return read_urdf(SIX_AXIS)


# --- kinematics


def frames_by_link(path: Path, robot: Robot, links: list[str], q: Array, order: list[str]) -> list[Array]:
    """T_base_link (4, 4) of each link by pinocchio; ``order``: joints of q."""
    pin = oracles.load("pinocchio")
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    full = pin.neutral(model)
    for name, angle in zip(order, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        full[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
    pin.framesForwardKinematics(model, data, full)
    return [np.array(data.oMf[model.getFrameId(link)].homogeneous) for link in links]


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("path", "tip", "order", "links"),
    [
        (
            SIX_AXIS,
            None,
            [f"joint_{i}" for i in range(1, 7)],
            ["base_link", *(f"link_{i}" for i in range(1, 7)), "tool0", "tool0"],
        ),
        (
            SIX_AXIS,
            "gripper",
            [f"joint_{i}" for i in range(1, 7)],
            ["base_link", *(f"link_{i}" for i in range(1, 7)), "tool0", "gripper"],
        ),
        (
            CROOKED,
            None,
            ["turn table/A 1", "turn table A 1", "base", "w"],
            ["world", "turntable", "arm", "hand", "wrist", "left_flange", "probe_tip"],
        ),
        (
            TWO_ARMS,
            "left_hand",
            ["trunk_joint", "l1", "l2"],
            ["floor", "trunk", "left_1", "left_2", *["left_hand"] * 2],
        ),
    ],
)
def test_all_frames_are_pinocchios(
    path: Path, tip: str | None, order: list[str], links: list[str], rng: np.random.Generator
) -> None:
    robot = robot_from(read_urdf(path, tip=tip).description)
    # Inside half a turn: more would test pinocchio's cosines.
    q = rng.uniform(np.maximum(robot.limits[:, 0], -np.pi), np.minimum(robot.limits[:, 1], np.pi), (8, robot.dof))
    frames = forward_kinematics(robot, q)
    for i, pose in enumerate(q):
        *bodies, flange, tool = frames_by_link(path, robot, links, pose, order)
        for k, T in enumerate(bodies):
            np.testing.assert_allclose(frames.R[i, k], T[:3, :3], rtol=0, atol=1e-12)
            np.testing.assert_allclose(frames.p[i, k], T[:3, 3], rtol=0, atol=1e-12)
        ours = rigid_frame(frames.p_flange[i], frames.R_flange[i])
        np.testing.assert_allclose(ours, flange, rtol=0, atol=1e-12)
        np.testing.assert_allclose(ours @ robot.T_flange_tool, tool, rtol=0, atol=1e-12)


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, 1.5708, -1.5707, np.pi / 2 - 1e-9, 2.0])
def test_angles_give_their_rotation_back(pitch: float, rng: np.random.Generator) -> None:
    for roll, yaw, *other in rng.uniform(-np.pi, np.pi, (20, 5)):
        # There and back: a rotation whose entries have errors of their own, as after fixed joints.
        turn = rotation_rpy(np.array(other))
        R = rotation_rpy(np.array([roll, pitch, yaw])) @ turn @ turn.T
        np.testing.assert_allclose(rotation_rpy(rpy_of(R)), R, rtol=0, atol=ROUND_OFF)


def test_limits_are_in_degrees(six_axis: UrdfRobot) -> None:
    limits = [joint.limits.value for joint in six_axis.description.joint]
    assert limits[0] == (-170.0, 170.0)
    assert limits[1] == (-90.0, pytest.approx(np.degrees(2.4), abs=1e-12))
    assert limits[5] == (-360.0, 360.0)
    assert {joint.limits.source for joint in six_axis.description.joint} == {"urdf"}


def test_joints_without_end_get_a_turn_each_way_and_say_so() -> None:
    read = read_urdf(CROOKED)
    first = read.description.joint[0]
    assert first.limits.value == (-360.0, 360.0)
    assert first.limits.source == "assumed"
    assert "no limits, +-360 deg taken: turn_table_A_1" in read.notes


def test_names_are_made_safe_and_unique() -> None:
    read = read_urdf(CROOKED)
    names = ["turn_table_A_1", "turn_table_A_1_2", "base_2", "w"]
    assert [joint.name for joint in read.description.joint] == names
    assert [joint.coordinate for joint in read.description.joint] == [f"{name}_deg" for name in names]
    assert "joint turn table/A 1 is called turn_table_A_1 here" in read.notes
    assert read.description.name == "crooked_arm"


# --- what goes where


def test_fixed_links_are_merged_and_the_gripper_is_left_out(six_axis: UrdfRobot) -> None:
    assert six_axis.description.tool is None
    assert "fixed joints merged: cover, elbow_offset" in six_axis.notes
    assert "flange: link tool0; tool point: link tool0" in six_axis.notes
    assert "left out of the last body, as the tool: links gripper, left_finger, right_finger" in six_axis.notes
    assert "joint_6" not in six_axis.visuals


def test_a_gripper_without_a_plate_is_named(tmp_path: Path) -> None:
    path = edited(tmp_path, lambda text: text.replace("tool0", "x").replace('"flange"', '"y"'))
    read = read_urdf(path)
    assert "flange: link gripper; tool point: link gripper" in read.notes
    assert "left out: joint left (prismatic) with links left_finger" in read.notes
    assert "left out: joint right (prismatic, coupled to left) with links right_finger" in read.notes
    gripper = one(read.visuals, "joint_6")
    assert gripper.source == Primitive("box", (0.1, 0.1, 0.1))
    # 0.05, 0, 0.01 to the plate, whose z axis is along x, and 0.02 on along that.
    np.testing.assert_allclose(gripper.T_body_visual[:3, 3], [0.07, 0.0, 0.01], rtol=0, atol=ROUND_OFF)
    # The gripper is link 6's now: 1.5 + 3 kg.
    assert read.masses["joint_6"].si == 4.5


def test_the_tool_past_the_flange_is_the_tool_point() -> None:
    read = read_urdf(SIX_AXIS, tip="gripper")
    assert read.description.tool is not None
    assert read.description.tool.xyz.value == (0.0, 0.0, 0.02)
    assert "flange: link tool0; tool point: link gripper" in read.notes


def test_masses_are_the_files(six_axis: UrdfRobot) -> None:
    masses = {body: mass.si for body, mass in six_axis.masses.items()}
    expected = [120.0, 95.5, 70.0 + 2.25, 40.0, 20.0, 8.0, 1.5]
    assert masses == dict(zip(["base", *(f"joint_{i}" for i in range(1, 7))], expected, strict=True))
    assert six_axis.description.mass is not None
    assert six_axis.description.mass.si == sum(expected)


def test_a_mass_missing_somewhere_leaves_the_whole_unknown() -> None:
    read = read_urdf(CROOKED)
    assert read.description.mass is None
    assert any(note.endswith("the whole mass is not known") for note in read.notes)


def test_shapes_stand_in_the_bodies_frames(six_axis: UrdfRobot) -> None:
    mesh = one(six_axis.visuals, "base")
    assert mesh.source == (DATA / "meshes" / "pyramid.stl").resolve()
    assert mesh.scale.tolist() == [0.001, 0.001, -0.002]
    assert mesh.T_body_visual[:3, 3].tolist() == [0.0, 0.0, 0.1]
    cylinder, second = six_axis.visuals["joint_1"]
    assert cylinder.source == Primitive("cylinder", (0.15, 0.4))
    assert second.source == mesh.source
    assert second.scale.tolist() == [0.001, 0.001, 0.001]
    assert one(six_axis.collisions, "base").source == Primitive("box", (0.5, 0.6, 0.2))


def test_shapes_of_merged_links_are_moved_along(six_axis: UrdfRobot) -> None:
    cover = one(six_axis.visuals, "joint_2")
    joint, origin = np.eye(4), np.eye(4)
    joint[:3, :3], joint[:3, 3] = rotation_rpy(np.array([0.3, 0.2, 0.1])), (0.01, 0.02, 0.03)
    origin[:3, :3], origin[:3, 3] = rotation_rpy(np.array([0.1, -0.2, 0.3])), (0.1, 0.2, 0.3)
    np.testing.assert_allclose(cover.T_body_visual, joint @ origin, rtol=0, atol=ROUND_OFF)
    assert cover.link == "link_2_cover"


def test_meshes_that_are_not_there_are_named(six_axis: UrdfRobot) -> None:
    ((link, note),) = [one for found in six_axis.missing.values() for one in found]
    assert link == "link_2"
    assert note.startswith("link link_2: mesh not found: package://nowhere/meshes/upper_arm.stl")
    assert "link link_2_cover: a visual left out (its geometry holds capsule)" in six_axis.notes


def test_meshes_are_found_by_path_and_by_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    urdf = tmp_path / "ws" / "my_robot" / "urdf" / "my.urdf"
    meshes = {
        "own": tmp_path / "ws" / "my_robot" / "meshes" / "own.stl",
        "sibling": tmp_path / "ws" / "arm_parts" / "sibling.stl",
        "ros1": tmp_path / "elsewhere" / "tools" / "ros1.stl",
        "itself": tmp_path / "elsewhere" / "tools" / "itself.stl",
        "ros2": tmp_path / "opt" / "share" / "tools2" / "ros2.stl",
    }
    for path in (urdf, *meshes.values()):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert find_mesh("package://my_robot/meshes/own.stl", urdf) == meshes["own"].resolve()
    assert find_mesh("package://arm_parts/sibling.stl", urdf) == meshes["sibling"].resolve()
    assert find_mesh("../meshes/own.stl", urdf) == meshes["own"].resolve()
    assert find_mesh(f"file://{meshes['own']}", urdf) == meshes["own"].resolve()
    assert find_mesh("package://tools/ros1.stl", urdf) is None
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'none'}:{tmp_path / 'elsewhere'}")
    assert find_mesh("package://tools/ros1.stl", urdf) == meshes["ros1"].resolve()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "elsewhere" / "tools"))
    assert find_mesh("package://tools/itself.stl", urdf) == meshes["itself"].resolve()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "opt"))
    assert find_mesh("package://tools2/ros2.stl", urdf) == meshes["ros2"].resolve()
    assert find_mesh("https://example.org/own.stl", urdf) is None
    assert find_mesh("a" * 5000, urdf) is None


# --- as a model


def test_every_figure_names_the_file(six_axis: UrdfRobot) -> None:
    digest = hashlib.sha256(SIX_AXIS.read_bytes()).hexdigest()
    assert six_axis.description.sources == {"urdf": f"six_axis.urdf, SHA-256 {digest}"}


@pytest.mark.parametrize("path", [SIX_AXIS, CROOKED])
def test_a_urdf_is_a_model_that_can_be_saved(path: Path, tmp_path: Path, rng: np.random.Generator) -> None:
    description = load_description(path)
    assert description == read_urdf(path).description
    save_description(description, tmp_path / "model.toml")
    again = load_description(tmp_path / "model.toml")
    assert again == description
    assert content_hash(again) == content_hash(description)
    q = rng.uniform(-1.0, 1.0, (3, len(description.joint)))
    frames = [forward_kinematics(robot_from(d), q).p_flange for d in (description, again)]
    np.testing.assert_array_equal(*frames)


def test_a_urdf_is_known_by_its_first_sign(tmp_path: Path) -> None:
    other = tmp_path / "robot.xml"
    other.write_bytes(b"\xef\xbb\xbf\n" + SIX_AXIS.read_bytes().removeprefix(b'<?xml version="1.0"?>'))
    assert load_description(other).name == "six_axis"


def test_the_same_file_elsewhere_is_the_same_model(tmp_path: Path) -> None:
    copy = tmp_path / "six_axis.urdf"
    copy.write_bytes(SIX_AXIS.read_bytes())
    assert content_hash(load_description(copy)) == content_hash(load_description(SIX_AXIS))


def test_a_nameless_robot_is_called_after_its_file(tmp_path: Path) -> None:
    path = edited(tmp_path, lambda text: text.replace('<robot name="six_axis">', "<robot>"))
    read = read_urdf(path)
    assert read.description.name == "edited"
    assert read.notes[0] == "the robot has no name in the file: called edited"
    assert parse_description(to_toml(read.description), "again") == read.description


# --- which arm


def test_two_arms_ask_for_a_choice() -> None:
    error = refused(TWO_ARMS)
    assert "the arm goes on from trunk through l1, rail" in str(error)
    assert "--tip" in str(error)
    assert "left_hand, right_hand" in str(error)


def test_a_slide_on_the_way_is_refused_and_the_way_past_it_said() -> None:
    error = refused(TWO_ARMS, tip="right_hand")
    assert "joint rail on the way to the tip: got 'prismatic'" in str(error)
    assert "tip=trunk" in str(error)
    assert "base=slide" in str(error)
    read = read_urdf(TWO_ARMS, base="slide")
    assert [joint.name for joint in read.description.joint] == ["r1", "r2"]
    assert "left out: all that does not hang on link slide" in read.notes


def test_the_arm_that_is_not_chosen_is_left_out() -> None:
    notes = read_urdf(TWO_ARMS, tip="left_hand").notes
    assert "left out: joint rail (prismatic) with links slide, right_1, right_2, right_hand" in notes


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tip": "nose"}, ["tip: got 'nose'", "a link: floor"]),
        ({"base": "nose"}, ["base: got 'nose'", "a link: floor"]),
        ({"tip": "left_hand", "base": "slide"}, ["a link below slide: right_1, right_2, right_hand"]),
        ({"tip": "floor"}, ["no revolute joint between floor and floor"]),
    ],
)
def test_bad_ends(options: dict[str, str], words: list[str]) -> None:
    error = refused(TWO_ARMS, **options)
    for word in words:
        assert word in str(error)
    assert error.remedy


def chain_of(*joints: str) -> str:
    """A URDF of links 0, 1, ... with joints ``parent child type [mimic]``."""
    rows = [joint.split() for joint in joints]
    links = dict.fromkeys(name for row in rows for name in row[:2])
    body = "".join(f'<link name="{name}"/>' for name in links)
    for parent, child, kind, *mimic in rows:
        coupled = f'<mimic joint="{mimic[0]}"/>' if mimic else ""
        body += (
            f'<joint name="j{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{coupled}'
            '<origin xyz="0.1 0 0.2"/><limit lower="-1" upper="1"/></joint>'
        )
    return f'<robot name="r">{body}</robot>'


@pytest.mark.parametrize(
    ("joints", "moving", "flange"),
    [
        # A two-finger gripper driven by one finger; the others follow it.
        (("0 1 revolute", "1 2 revolute", "2 3 revolute", "2 4 revolute j3"), ["j1", "j2"], "2"),
        # A camera on two axes half way; the arm is longer.
        (("0 1 revolute", "1 2 revolute", "2 3 revolute", "3 4 revolute", "1 c revolute", "c d revolute"), None, "4"),
        # Slides are no joints of an arm, however many.
        (("0 1 revolute", "1 2 revolute", "1 a prismatic", "a b prismatic"), ["j1", "j2"], "2"),
        # The bar of a parallelogram follows joint 2.
        (("0 1 revolute", "1 2 revolute", "1 bar revolute j2", "2 3 revolute"), ["j1", "j2", "j3"], "3"),
        # Several ends, one of them the mounting plate.
        (("0 1 revolute", "1 camera fixed", "1 tool0 fixed"), ["j1"], "tool0"),
        (("0 1 revolute", "1 my_flange fixed", "my_flange a fixed", "my_flange b fixed"), ["j1"], "my_flange"),
        # A gripper on the plate, with a camera beside it; and one that turns a jaw.
        (("0 1 revolute", "1 flange fixed", "flange camera fixed", "flange finger prismatic"), ["j1"], "flange"),
        (("0 1 revolute", "1 2 revolute", "2 tool0 fixed", "tool0 jaw revolute"), ["j1", "j2"], "tool0"),
        # The plate of a turntable that carries the arm ends nothing.
        (("0 1 revolute", "1 tool0 fixed", "tool0 2 revolute", "2 3 revolute"), ["j1", "j2", "j3"], "3"),
    ],
)
def test_the_arm_is_found(joints: tuple[str, ...], moving: list[str] | None, flange: str, tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(chain_of(*joints), encoding="utf-8")
    read = read_urdf(path)
    assert [joint.name for joint in read.description.joint] == (moving or ["j1", "j2", "j3", "j4"])
    assert f"flange: link {flange}; tool point: link {flange}" in read.notes


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        # A SCARA's quill or a gripper's only finger: the reader cannot know.
        (("0 1 revolute", "1 2 prismatic"), ["joint j2 on the way", "'prismatic'", "tip=1"]),
        (("0 1 prismatic", "1 2 revolute"), ["joint j1 on the way", "'prismatic'", "base=1"]),
        (("0 1 revolute", "1 2 revolute j1", "2 3 revolute"), ["j2", "coupled to j1", "revolute, continuous or fixed"]),
        (("0 1 floating", "1 2 revolute"), ["j1", "'floating'"]),
        (("0 1 revolute", "1 a fixed", "1 b fixed"), ["several ends", "a, b", "--tip"]),
        (("0 1 fixed", "1 2 fixed"), ["no revolute joint between 0 and 2"]),
        (("0 1 prismatic", "0 2 prismatic"), ["no revolute joint"]),
    ],
)
def test_no_arm_is_guessed(joints: tuple[str, ...], words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(chain_of(*joints), encoding="utf-8")
    error = refused(path)
    for word in words:
        assert word in str(error)
    assert error.remedy


# --- bad files


def edited(tmp_path: Path, edit: Callable[[str], str], name: str = "edited.urdf") -> Path:
    text = SIX_AXIS.read_text(encoding="utf-8")
    changed = edit(text)
    assert changed != text
    path = tmp_path / name
    path.write_text(changed, encoding="utf-8")
    return path


def swap(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new, 1)


BAD: dict[str, tuple[Callable[[str], str], list[str]]] = {
    "no XML": (lambda _: "robot = 'six_axis'", ["is no XML"]),
    "empty": (lambda _: " ", ["is no XML"]),
    "a tag left open": (swap("</link>", ""), ["is no XML", "line "]),
    "a document type": (swap("<robot", '<!DOCTYPE robot [<!ENTITY x "y">]>\n<robot'), ["<!DOCTYPE>"]),
    "another root": (lambda _: '<sdf version="1.6"/>', ["outermost element: got 'sdf'; allowed: robot"]),
    "xacro elements": (
        swap("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot><robot'),
        ["is no XML"],
    ),
    "xacro": (
        lambda _: '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">\n<xacro:include filename="a"/></robot>',
        ["edited.urdf is a xacro file, line 2", "xacro edited.urdf > edited.urdf"],
    ),
    "xacro's figures": (swap('upper="2.4"', 'upper="${radians(137)}"'), ["is a xacro file, line "]),
    "a mesh alone": (
        lambda _: (
            '<robot name="r"><link name="a"><visual><geometry><sphere radius="1"/></geometry></visual></link></robot>'
        ),
        ["has no joints: a mesh alone is no robot"],
    ),
    "nothing in it": (lambda _: '<robot name="r"/>', ["has no joints"]),
    "several roots": (swap("<joint", '<link name="lost"/><joint'), ["several roots: got 'base_link, lost'"]),
    "a cycle": (
        swap('<parent link="base_link"/><child link="link_1"/>', '<parent link="link_6"/><child link="link_1"/>'),
        ["links in a cycle"],
    ),
    "nothing but a cycle": (
        lambda _: chain_of("0 1 revolute", "1 0 revolute"),
        ["links in a cycle: got '0, 1'"],
    ),
    "a closed loop": (
        swap("<joint", '<joint name="bar" type="fixed"><parent link="link_1"/><child link="link_5"/></joint><joint'),
        ["link link_5 hangs on two joints, bar and joint_5"],
    ),
    "an axis without length": (swap('<axis xyz="0 -1 0"/>', '<axis xyz="0 0 0"/>'), ["joint joint_3: axis", "[0.0, 0"]),
    "no limits": (
        swap('<limit effort="0" velocity="2" lower="-3.5" upper="1.2"/>', ""),
        ["joint joint_3 has no limits"],
    ),
    "one limit": (swap(' upper="1.2"', ""), ["joint joint_3 has no limits", "lower=... upper=..."]),
    "limits that meet": (swap('lower="-3.5"', 'lower="1.2"'), ["joint joint_3: limits: got '1.2 to 1.2 rad'"]),
    "a number that is none": (swap('xyz="0.2 0 0.1"', 'xyz="0.2 O 0.1"'), ["joint joint_4: origin xyz", "'0.2 O 0.1'"]),
    "NaN": (swap('xyz="0.2 0 0.1"', 'xyz="nan 0 0.1"'), ["joint joint_4: origin xyz", "3 finite numbers"]),
    "two numbers": (swap('xyz="0.2 0 0.1"', 'xyz="0.2 0.1"'), ["joint joint_4: origin xyz", "3 finite numbers"]),
    "millimetres": (swap('xyz="0.5 0 0"', 'xyz="500 0 0"'), ["joint joint_5: origin: got '500 m", "lengths in m"]),
    "a mass below zero": (swap('value="40"', 'value="-40"'), ["link link_3: mass: got -40.0"]),
    "a scale of zero": (swap('scale="0.001"', 'scale="0"'), ["link link_1: mesh scale", "other than zero"]),
    "an unknown link": (
        swap('child link="link_4"', 'child link="link_9"'),
        ["joint joint_4: child link: got 'link_9'"],
    ),
    "no parent": (swap('<parent link="link_3"/>', ""), ["joint joint_4: parent link: got 'none'"]),
    "an unknown type": (
        swap('"joint_4" type="revolute"', '"joint_4" type="hinge"'),
        ["joint joint_4: type", "'hinge'"],
    ),
    "no type": (swap('"joint_4" type="revolute"', '"joint_4"'), ["joint joint_4: type: got 'none'"]),
    "two joints of one name": (swap('"joint_4"', '"joint_3"'), ["joint name used twice: got 'joint_3'"]),
    "two links of one name": (
        swap('<link name="base"/>', '<link name="elbow"/>'),
        ["link name used twice: got 'elbow'"],
    ),
    "a link without a name": (swap('<link name="base"/>', "<link/>"), ["link at line ", "has no name"]),
}


@pytest.mark.parametrize("slip", BAD)
def test_bad_files_are_refused_in_plain_words(slip: str, tmp_path: Path) -> None:
    edit, words = BAD[slip]
    error = refused(edited(tmp_path, edit))
    for word in words:
        assert word in str(error)
    assert "To fix it: " in str(error)


def test_a_xacro_file_is_refused_by_its_name(tmp_path: Path) -> None:
    error = refused(edited(tmp_path, swap("six", "6"), "arm.urdf.xacro"))
    assert "xacro arm.urdf.xacro > arm.urdf" in str(error)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    assert "cannot be read (it does not exist)" in str(refused(tmp_path / "none.urdf"))


def test_all_faults_come_at_once(tmp_path: Path) -> None:
    def edit(text: str) -> str:
        text = swap('<axis xyz="0 -1 0"/>', '<axis xyz="0 0 0"/>')(text)
        return swap('lower="-3.1"', 'lower="3.2"')(text)

    error = refused(edited(tmp_path, edit))
    assert isinstance(error, InputErrors)
    assert [re.sub(r":.*", "", str(e).split("joint ")[1]) for e in error.errors] == ["joint_3", "joint_4"]
    faulty = edited(tmp_path, lambda text: text.replace('type="fixed"', 'type="glued"'), "b.urdf")
    error = refused(faulty)
    assert isinstance(error, InputErrors)
    # base, cover, elbow, flange, tool0, gripper
    assert len(error.errors) == 6


def test_a_gripper_may_have_what_an_arm_may_not(tmp_path: Path) -> None:
    """Only the arm's joints are judged: fingers that simulators need are often locked."""
    path = edited(tmp_path, swap('lower="0" upper="0.04"', 'lower="0"'))
    assert len(read_urdf(path).description.joint) == 6
