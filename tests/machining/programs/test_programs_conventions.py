"""What controllers call a pose: joint signs, flange and base frames, S and T, confdata, config; against own chains."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from program_cases import PLAIN, cell_of, posed, program_of, rail, random_poses, turntable
from refusals import refuses
from rigid_frames import rigid_frame

from machining.programs.convention import Convention, convention_for
from machining.programs.formats import parse_options, write_program
from machining.programs.job import ToolData, job_of, tools_of_job
from machining.programs.languages.krl import Krl
from machining.programs.languages.rapid import Rapid
from machining.programs.languages.val3 import Val3
from machining.programs.orientation import (
    from_quaternions,
    from_xyz_degrees,
    from_zyx_degrees,
    quaternions,
    xyz_degrees,
    zyx_degrees,
)
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions
from robots import Robot, forward_kinematics, inverse_kinematics, load_robot
from robots.arrays import Array

KRL, RAPID, VAL3 = Krl(), Rapid(), Val3()


def turn(axis: str, degrees: float) -> Array:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def shift(x: float, y: float, z: float) -> Array:
    return rigid_frame((x, y, z))


def kuka_kr60(A: Array) -> tuple[Array, Array]:
    """Flange and wrist centre of the KR60 as KUKA counts: at zero the arm lies forward; from its data sheet."""
    wrist = (
        turn("z", -A[0])
        @ shift(0.35, 0, 0.815)
        @ turn("y", A[1])
        @ shift(0.85, 0, 0)
        @ turn("y", A[2])
        @ shift(0.82, 0, 0.145)
        @ turn("x", -A[3])
        @ turn("y", A[4])
    )
    return wrist @ turn("x", -A[5]) @ shift(0.17, 0, 0) @ turn("y", 90.0), wrist[:3, 3]


def staubli_tx200(j: Array) -> tuple[Array, Array]:
    """Flange and wrist centre of the TX200 as VAL3 counts: at zero the arm stands straight up."""
    wrist = (
        turn("z", j[0])
        @ shift(0.25, 0, 0.642)
        @ turn("y", j[1])
        @ shift(0, 0, 0.95)
        @ turn("y", j[2])
        @ shift(0, 0, 0.8)
        @ turn("z", j[3])
        @ turn("y", j[4])
    )
    return wrist @ turn("z", j[5]) @ shift(0, 0, 0.194), wrist[:3, 3]


CHAINS = {"kr60-3": ("krl", kuka_kr60), "tx200": ("val3", staubli_tx200)}


@pytest.fixture(params=CHAINS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


def test_conventions_give_the_controllers_own_kinematics(robot: Robot, rng: np.random.Generator) -> None:
    language, chain = CHAINS[robot.name]
    convention = convention_for(robot, 0, language, None)
    q = random_poses(robot, 40, rng)
    found = forward_kinematics(robot, q)
    for i, angles in enumerate(convention.controller_deg(q)):
        ours = rigid_frame(found.p_flange[i], found.R_flange[i])
        np.testing.assert_allclose(ours @ convention.T_flange, chain(angles)[0], atol=1e-12)
    np.testing.assert_allclose(convention.radians(convention.controller_deg(q)), q, atol=1e-14)


def tools(program: JointProgram, convention: Convention) -> tuple[ToolData, ...]:
    """Data of the program's one tool."""
    return tools_of_job(program, convention, WriteOptions(), lambda number, place: f"tool_{number}_{place}")


def test_kuka_base_times_target_is_the_flange_times_tool() -> None:
    program = program_of(n=5)
    convention = convention_for(program.robot, 0, "krl", None)
    job = job_of(program, "cartesian", WriteOptions(), convention, tools(program, convention))
    assert job.T_base is not None
    for angles, target in zip(convention.controller_deg(program.q), program.T_part_tool, strict=True):
        np.testing.assert_allclose(kuka_kr60(angles)[0] @ job.first_tool.T, job.T_base @ target, atol=1e-12)


def test_base_of_a_robot_that_does_not_stand_in_the_world_frame() -> None:
    stand = shift(0.4, -0.1, 0.2) @ turn("z", 30.0)
    cell = cell_of(T_world_base0=stand, linear_axes=(rail(),))
    travel = np.linspace(-0.2, 0.2, 5)[:, None]
    program = program_of(n=5, cell=cell, travel=travel)
    convention = convention_for(program.robot, 1, "krl", None)
    job = job_of(program, "cartesian", WriteOptions(), convention, tools(program, convention))
    assert job.T_base is not None
    np.testing.assert_allclose(stand @ job.T_base, cell.T_world_part0, atol=1e-12)


def brute_sides(robot: Robot, controller: Array) -> tuple[bool, bool, bool]:
    """Behind axis 1, elbow backwards, axis 5 negative: by points in the plane that turns with axis 1."""
    language, chain = CHAINS[robot.name]
    first = -controller[0] if language == "krl" else controller[0]
    shoulder = np.array([0.35, 0, 0.815]) if language == "krl" else np.array([0.25, 0, 0.642])
    length, upright = (0.85, 90.0) if language == "krl" else (0.95, 0.0)
    centre = (turn("z", -first) @ np.append(chain(controller)[1], 1.0))[:3]
    lean = np.radians(controller[1] + upright)
    arm = length * np.array([np.sin(lean), 0.0, np.cos(lean)])
    beyond = centre - (shoulder + arm)
    # Forwards of the upper arm, where the arm stands up: to +x.
    forwards = beyond[0] * arm[2] - beyond[2] * arm[0]
    return bool(centre[0] < 0.0), bool(forwards < 0.0), bool(controller[4] < 0.0)


def test_sides_of_random_poses(robot: Robot, rng: np.random.Generator) -> None:
    convention = convention_for(robot, 0, CHAINS[robot.name][0], None)
    q = random_poses(robot, 400, rng)
    deg = convention.controller_deg(q)
    kuka, abb, val3 = (rule.configuration(robot, q, deg) for rule in (KRL, RAPID, VAL3))
    seen = set()
    for i in range(len(q)):
        behind, backward, negative = brute_sides(robot, deg[i])
        seen.add((behind, backward, negative))
        assert kuka[i, 0] == int(behind) + 2 * int(not backward) + 4 * int(negative)
        assert kuka[i, 1] == sum(1 << k for k in range(6) if deg[i, k] < 0.0)
        assert abb[i, 3] == 4 * int(behind) + 2 * int(backward) + int(negative)
        for cf, angle in zip(abb[i, :3], deg[i, [0, 3, 5]], strict=True):
            assert 90.0 * cf <= angle < 90.0 * (cf + 1)
        assert val3[i][0] == ("righty" if behind else "lefty")
        assert tuple(val3[i][1:]) == (
            "enegative" if backward else "epositive",
            "wnegative" if negative else "wpositive",
        )
    assert len(seen) == 8


def test_kuka_home_and_elbow_offset() -> None:
    """KUKA's home is S 2 (S 'B010'); bit 1 changes where the wrist is in line: atan(145 / 820) for the KR60."""
    robot = load_robot("kr60-3")
    convention = convention_for(robot, 0, "krl", None)
    home = np.array([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0], [0.0, -90.0, 90.0, 0.0, 30.0, 0.0]])
    assert KRL.configuration(robot, convention.radians(home), home).tolist() == [[2, 2], [2, 2]]
    in_line = np.degrees(np.arctan2(0.145, 0.82))
    near = np.array([[0.0, -45.0, in_line + d, 10.0, 20.0, -30.0] for d in (-0.01, 0.01)])
    assert KRL.configuration(robot, convention.radians(near), near)[:, 0].tolist() == [0, 2]


def test_s_and_t_say_which_of_all_solutions_is_meant(robot: Robot, rng: np.random.Generator) -> None:
    """All branches of a target, in all turns within limits, differ in S or T: so these select the pose."""
    convention = convention_for(robot, 0, CHAINS[robot.name][0], None)
    q = random_poses(robot, 60, rng)
    frames = forward_kinematics(robot, q)
    T = np.zeros((len(q), 4, 4))
    T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = frames.R_flange, frames.p_flange, 1.0
    turns = inverse_kinematics(robot, T).turns()
    words = KRL.configuration(robot, turns.q, convention.controller_deg(turns.q)).tolist()
    own = KRL.configuration(robot, q, convention.controller_deg(q)).tolist()
    for i in range(len(q)):
        these = [k for k in range(len(turns.q)) if turns.target[k] == i and words[k] == own[i]]
        np.testing.assert_allclose(turns.q[these], [q[i]], atol=1e-6)


def test_orientations_by_their_definitions(rng: np.random.Generator) -> None:
    for a, b, c in rng.uniform(-180.0, 180.0, (20, 3)):
        kuka = (turn("z", a) @ turn("y", b) @ turn("x", c))[None, :3, :3]
        val3 = (turn("x", a) @ turn("y", b) @ turn("z", c))[None, :3, :3]
        np.testing.assert_allclose(from_zyx_degrees(np.array([[a, b, c]])), kuka, atol=1e-14)
        np.testing.assert_allclose(from_xyz_degrees(np.array([[a, b, c]])), val3, atol=1e-14)
        np.testing.assert_allclose(from_zyx_degrees(zyx_degrees(kuka)), kuka, atol=1e-13)
        np.testing.assert_allclose(from_xyz_degrees(xyz_degrees(val3)), val3, atol=1e-13)
        np.testing.assert_allclose(from_quaternions(quaternions(kuka)), kuka, atol=1e-13)
    half = np.array([[np.cos(0.2), 0.0, 0.0, np.sin(0.2)]])
    np.testing.assert_allclose(quaternions(turn("z", np.degrees(0.4))[None, :3, :3]), half, atol=1e-15)


@pytest.mark.parametrize("off", [0.0, 1e-14, 1e-10, 3e-9, 1e-8, 1e-6])
def test_orientations_at_the_locked_middle_angle(off: float) -> None:
    """A tool that points down is B = 90: right there the first and last angle are one, whatever rounding says."""
    for sign, a, c in itertools.product((-1.0, 1.0), (10.0, 170.0), (-35.0, 120.0)):
        R = turn("z", a) @ turn("y", sign * (90.0 - np.degrees(off))) @ turn("x", c)
        back = from_zyx_degrees(zyx_degrees(R[None, :3, :3]))
        # 1e-9 rad is LOCKED, and rounding of 1e-16 over a sine of 1e-9 stays out of it by construction.
        np.testing.assert_allclose(back[0], R[:3, :3], atol=3e-9)
        R = turn("x", a) @ turn("y", sign * (90.0 - np.degrees(off))) @ turn("z", c)
        np.testing.assert_allclose(from_xyz_degrees(xyz_degrees(R[None, :3, :3]))[0], R[:3, :3], atol=3e-9)


@pytest.mark.parametrize("name", ["krl", "rapid", "val3", "sinumerik"])
def test_a_robot_whose_joint_signs_are_not_known_is_refused(name: str, rng: np.random.Generator) -> None:
    robot = load_robot("xr701")
    q = np.tile(robot.limits.mean(axis=1), (3, 1)) + 0.01 * np.arange(3)[:, None]
    program = posed(robot, q)
    error = refuses("Q003", "joint convention of xr701", write_program, program, name, "joint")
    assert "[arm]" in str(error)
    options = parse_options({"arm": PLAIN}, "options")
    assert len(write_program(program, name, "joint", options).files) > 1
    for neutral in ("json", "csv"):
        assert write_program(program, neutral, "joint").files[0].text()


def test_conventions_of_the_wrong_length_and_their_axes() -> None:
    robot = load_robot("kr60-3")
    for table, text in (
        ({"sign": (1,) * 5, "offset_deg": (0.0,) * 6}, "sign"),
        ({"sign": (1,) * 6, "offset_deg": (0.0,) * 7}, "offset_deg"),
        (PLAIN | {"external_sign": (1, 1)}, "external_sign"),
    ):
        given = parse_options({"arm": table}, "options").arm
        refuses("Q003", text, convention_for, robot, 1, "krl", given)
    refuses("F011", "sign", parse_options, {"arm": PLAIN | {"sign": [0, 1, 1, 1, 1, 1]}}, "options")
    turned = parse_options({"arm": PLAIN | {"external_sign": [-1], "external_offset": [250.0]}}, "options").arm
    convention = convention_for(robot, 1, "krl", turned)
    np.testing.assert_allclose(convention.external(np.array([[100.0]])), [[150.0]])
    np.testing.assert_allclose(convention.external_back(np.array([[150.0]])), [[100.0]])


def test_a_part_on_a_turntable_has_no_fixed_frame() -> None:
    cell = cell_of(turntable=turntable())
    program = program_of(n=4, cell=cell, table=np.linspace(0.0, 0.2, 4))
    written = write_program(program, "krl")
    main = written.texts()["part.src"]
    assert "$BASE = BASE_DATA[1]" in main
    assert any("turntable" in note for note in written.notes)


def test_signs_offsets_and_frames_by_their_definition() -> None:
    """A controller whose every joint, base and flange differ: its angle is sign times ours plus offset."""
    table = {
        "sign": [-1, 1, -1, 1, -1, 1],
        "offset_deg": [10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
        "base": {"position_mm": [100.0, 0.0, 642.0], "rpy_deg": [0.0, 0.0, 90.0]},
        "flange": {"position_mm": [0.0, 0.0, 50.0], "rpy_deg": [0.0, 90.0, 0.0]},
    }
    program = program_of("tx200", n=3)
    convention = convention_for(program.robot, 0, "val3", parse_options({"arm": table}, "options").arm)
    q = np.radians([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    np.testing.assert_allclose(convention.controller_deg(q), [[9.0, 22.0, 27.0, 44.0, 45.0, 66.0]], atol=1e-12)
    job = job_of(program, "cartesian", WriteOptions(), convention, tools(program, convention))
    assert job.T_base is not None
    own_base, own_flange = shift(0.1, 0.0, 0.642) @ turn("z", 90.0), shift(0.0, 0.0, 0.05) @ turn("y", 90.0)
    np.testing.assert_allclose(own_base @ job.T_base, program.cell.T_world_part0, atol=1e-12)
    np.testing.assert_allclose(own_flange @ job.first_tool.T, program.cell.tool.T_flange_tool, atol=1e-12)


def test_the_bundled_tx200_does_not_claim_to_know_the_controllers_world() -> None:
    written = write_program(program_of("tx200", n=3), "val3")
    assert '<Value key="0" fatherId="world[0]" />' in written.texts()["part.dtx"]
    # The robot must not run in the world frame: the application stops before the first motion.
    start = written.texts()["start.pgx"]
    assert start.index("wait(false)") < start.index("call p001()")
    assert any("set the part frame on the robot" in note for note in written.notes)
    known = write_program(program_of(n=3), "val3", options=parse_options({"arm": PLAIN}, "options"))
    assert "wait(false)" not in known.texts()["start.pgx"]
