"""KRL, RAPID and LS by a second parser and second kinematics that share nothing with the writers: five programs each.

The joint program and the Cartesian program of the same moves are parsed, each from its own files. The joints go through
kinematics written here in the controller's own terms (its signs, its zeros, its world, its flange), with lengths of the
makers' sheets. They must put the tool where the Cartesian program says, with the configuration that it says.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from posture_cases import part, spindle
from program_cases import posed, random_poses
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

from machining.cell import Cell, Tool
from machining.cell.cell import Load
from machining.programs.formats import write_program
from machining.programs.write_options import WriteOptions
from robots import load_robot
from robots.arrays import Array

LOAD = Load(14.5, np.array([0.03, -0.02, 0.16]), np.array([0.11, 0.12, 0.05]))
# Texts have five decimals of a mm and seven of a degree; lengths of the arms reach 3 m.
NEAR_MM, NEAR_TURN = 2e-5, 2e-9


def about(axis: str, deg: float) -> Array:
    return np.asarray(Rotation.from_euler(axis, deg, degrees=True).as_matrix())


def frame(R: Array, p: Array) -> Array:
    return rigid_frame(p, R)


def kuka(a: list[float]) -> tuple[Array, Array]:
    """Flange in $WORLD of a KR 60-3, and the wrist centre; data sheet: 815, 350, 850, 145, 820, 170 mm."""
    forearm = about("z", -a[0]) @ about("y", a[1] + a[2])
    centre = np.array([0.0, 0.0, 815.0]) + about("z", -a[0]) @ (
        np.array([350.0, 0.0, 0.0]) + about("y", a[1]) @ [850.0, 0.0, 0.0]
    )
    centre = centre + forearm @ [820.0, 0.0, 145.0]
    wrist = forearm @ about("x", -a[3]) @ about("y", a[4]) @ about("x", -a[5])
    return frame(wrist @ about("y", 90.0), centre + wrist @ [170.0, 0.0, 0.0]), centre


def abb(j: list[float]) -> tuple[Array, Array]:
    """tool0 in the base frame of an IRB 4600-60/2.05: 495, 175, 900, 175, 960, 135 mm."""
    forearm = about("z", j[0]) @ about("y", j[1] + j[2])
    centre = about("z", j[0]) @ (np.array([175.0, 0.0, 495.0]) + about("y", j[1]) @ [0.0, 0.0, 900.0])
    centre = centre + forearm @ [960.0, 0.0, 175.0]
    wrist = forearm @ about("x", j[3]) @ about("y", j[4]) @ about("x", j[5])
    return frame(wrist @ about("y", 90.0), centre + wrist @ [135.0, 0.0, 0.0]), centre


def fanuc(j: list[float]) -> tuple[Array, Array]:
    """Flange of an R-2000iC/165F in its world, at the height of axis 2; J3 is the forearm over the horizontal."""
    forearm = about("z", j[0]) @ about("y", -j[2])
    centre = about("z", j[0]) @ (np.array([312.0, 0.0, 0.0]) + about("y", j[1]) @ [0.0, 0.0, 1075.0])
    centre = centre + forearm @ [1280.0, 0.0, 225.0]
    wrist = forearm @ about("x", -j[3]) @ about("y", -j[4]) @ about("x", -j[5])
    # All zeros: W 180, P -90, R 0.
    zero = about("y", -90.0) @ about("x", 180.0)
    return frame(wrist @ zero, centre + wrist @ [215.0, 0.0, 0.0]), centre


def numbers(text: str) -> list[float]:
    return [float(v) for v in re.findall(r"(?<![A-Za-z_\d])-?\d+\.?\d*(?:E-?\d+)?", text)]


def krl(texts: dict[str, str]) -> dict[str, Any]:
    main = next(text for name, text in texts.items() if not name.endswith("_001.src"))
    body = next(text for name, text in texts.items() if name.endswith("_001.src"))

    def xyzabc(line: str) -> Array:
        v = dict(re.findall(r"([A-Z]\d?) (-?[\d.]+)", line))
        return frame(
            about("z", float(v["A"])) @ about("y", float(v["B"])) @ about("x", float(v["C"])),
            np.array([float(v[k]) for k in "XYZ"]),
        )

    head = {k: line for line in main.splitlines() for k in ("$TOOL", "$BASE", "$LOAD") if line.startswith(f"{k} ")}
    moves = [line for line in body.splitlines() if line.startswith(("PTP {", "LIN {"))]
    axes = [dict(re.findall(r"(A\d) (-?[\d.]+)", line)) for line in moves]
    m, cm, inertia = re.fullmatch(r"\$LOAD = \{M ([\d.]+),CM \{(.*)\},J \{(.*)\}\}", head["$LOAD"]).groups()  # type: ignore[union-attr]
    return {
        "tool": xyzabc(head["$TOOL"]),
        "base": xyzabc(head["$BASE"]),
        "joints": [[float(a[f"A{i}"]) for i in range(1, 7)] for a in axes if len(a) == 6],
        "frames": [xyzabc(line) for line in moves if " S " in line or ",S " in line],
        "sides": [
            tuple(map(int, re.search(r",S (\d+),T (\d+)", line).groups()))  # type: ignore[union-attr]
            for line in moves
            if ",S " in line
        ],
        "load": (float(m), xyzabc(cm), numbers(re.sub(r"[XYZ]", "", inertia))),
    }


def rapid(texts: dict[str, str]) -> dict[str, Any]:
    main = next(text for name, text in texts.items() if name.endswith(".mod") and not name.endswith("_001.mod"))
    body = next(text for name, text in texts.items() if name.endswith("_001.mod"))

    def pose(v: list[float]) -> Array:
        return frame(np.asarray(Rotation.from_quat([*v[4:7], v[3]]).as_matrix()), np.array(v[:3]))

    tool = numbers(next(line for line in main.splitlines() if "PERS tooldata" in line).partition(":=")[2])
    base = numbers(next(line for line in main.splitlines() if "PERS wobjdata" in line).partition(":=")[2])
    rows = [line.strip() for line in body.splitlines() if line.strip().startswith("Move")]
    values = [numbers(line.replace("9E9", "9").partition(" ")[2].partition("],v")[0]) for line in rows]
    return {
        "tool": pose(tool[:7]),
        "base": pose(base[:7]),
        "joints": [v[:6] for line, v in zip(rows, values, strict=True) if line.startswith("MoveAbsJ")],
        "frames": [pose(v[:7]) for line, v in zip(rows, values, strict=True) if not line.startswith("MoveAbsJ")],
        "sides": [tuple(map(int, v[7:11])) for line, v in zip(rows, values, strict=True) if "AbsJ" not in line],
        "load": (tool[7], pose(tool[8:15]), tool[15:18]),
    }


def ls(texts: dict[str, str]) -> dict[str, Any]:
    main = next(text for name, text in texts.items() if not name.endswith("_001.LS"))
    body = next(text for name, text in texts.items() if name.endswith("_001.LS"))
    register, frames, tool_number = [0.0] * 6, {}, ""
    for line in main.splitlines():
        code = line.partition(":")[2].strip(" ;")
        if (found := re.fullmatch(r"PR\[90,(\d)\]=\(?(-?[\d.]+)\)?", code)) is not None:
            register[int(found[1]) - 1] = float(found[2])
        elif (found := re.fullmatch(r"(UTOOL|UFRAME)\[1\]=PR\[90\]", code)) is not None:
            frames[found[1]] = list(register)
        elif code.startswith("PAYLOAD["):
            tool_number = code

    def xyzwpr(v: list[float]) -> Array:
        return frame(about("z", v[5]) @ about("y", v[4]) @ about("x", v[3]), np.array(v[:3]))

    order = [int(i) for i in re.findall(r"^ *\d+:[JL] P\[(\d+)\] ", body, re.MULTILINE)]
    blocks = dict(re.findall(r"^P\[(\d+)\]\{(.*?)^\};", body, re.MULTILINE | re.DOTALL))
    joints, poses, sides = [], [], []
    for i in order:
        v = dict(re.findall(r"^\t([A-Z]\d?) = (-?[\d.]+) (?:mm|deg),?$", blocks[str(i)], re.MULTILINE))
        if "J1" in v:
            joints.append([float(v[f"J{k}"]) for k in range(1, 7)])
        else:
            poses.append(xyzwpr([float(v[k]) for k in ("X", "Y", "Z", "W", "P", "R")]))
            found = re.search(r"CONFIG : '([FN]) ([UD]) ([TB]), (-?\d), (-?\d), (-?\d)'", blocks[str(i)])
            assert found is not None
            sides.append((*found.groups()[:3], *map(int, found.groups()[3:])))
    assert "/POS\n" in body
    assert body.endswith("/END\n")
    lines = [int(n) for n in re.findall(r"^ *(\d+):", body, re.MULTILINE)]
    assert lines == list(range(1, len(lines) + 1))
    said = re.search(r"M 14\.5 CM ([\d. -]+)", " ".join(main.splitlines()))
    assert said is not None
    return {
        "tool": xyzwpr(frames["UTOOL"]),
        "base": xyzwpr(frames["UFRAME"]),
        "joints": joints,
        "frames": poses,
        "sides": sides,
        "payload": tool_number,
    }


def quarter(deg: float) -> int:
    return int(np.floor(deg / 90.0))


def kuka_sides(a: list[float], centre: Array) -> tuple[int, ...]:
    front = (about("z", a[0]) @ centre)[0] >= 0.0
    stretched = np.degrees(np.arctan(145.0 / 820.0))
    status = 1 * (not front) + 2 * (a[2] >= stretched) + 4 * (a[4] < 0.0)
    return status, sum(2**i for i in range(6) if a[i] < 0.0)


def abb_sides(j: list[float], centre: Array) -> tuple[int, ...]:
    behind = (about("z", -j[0]) @ centre)[0] < 0.0
    backward = j[2] < -90.0 + np.degrees(np.arctan(175.0 / 960.0))
    return quarter(j[0]), quarter(j[3]), quarter(j[5]), 4 * behind + 2 * backward + (j[4] < 0.0)


def fanuc_sides(j: list[float], centre: Array) -> tuple[str | int, ...]:
    behind = (about("z", -j[0]) @ centre)[0] < 0.0
    # J3 of the arm itself is that of the pendant and J2; stretched with the forearm in line with the upper arm.
    down = j[1] + j[2] > 90.0 - np.degrees(np.arctan(225.0 / 1280.0))
    turns = tuple(int(np.floor((v + 180.0) / 360.0)) for v in j[3:])
    return "N" if j[4] < 0.0 else "F", "D" if down else "U", "B" if behind else "T", *turns


CASES: dict[str, tuple[str, Callable[..., Any], Callable[..., Any], Callable[..., Any]]] = {
    "krl": ("kr60-3", krl, kuka, kuka_sides),
    "rapid": ("irb4600-60-205", rapid, abb, abb_sides),
    "fanuc": ("fanuc-r2000ic", ls, fanuc, fanuc_sides),
}


@pytest.mark.parametrize("language", CASES)
@pytest.mark.parametrize("seed", range(5))
def test_both_programs_lead_to_the_same_places(language: str, seed: int) -> None:
    name, parse, flange, sides = CASES[language]
    rng = np.random.default_rng([seed, len(language)])
    robot = load_robot(name)
    poses = random_poses(robot, 60, rng)
    poses = poses[robot.reachable(poses)][:9]
    cell = Cell(T_world_part0=part(x=1.1, y=-0.3, z=0.5), tool=Tool(spindle(), load=LOAD))
    program = posed(robot, poses, cell)
    o = WriteOptions(rapid="joint")
    joint, straight = (parse(write_program(program, language, kind, o).texts()) for kind in ("joint", "cartesian"))
    assert len(joint["joints"]) == len(straight["frames"]) == len(poses)
    np.testing.assert_array_equal(joint["tool"], straight["tool"])
    for angles, target, said in zip(joint["joints"], straight["frames"], straight["sides"], strict=True):
        T, centre = flange(angles)
        wanted, found = straight["base"] @ target, T @ straight["tool"]
        np.testing.assert_allclose(found[:3, 3], wanted[:3, 3], atol=5.0 * NEAR_MM)
        np.testing.assert_allclose(found[:3, :3], wanted[:3, :3], atol=10.0 * NEAR_TURN)
        assert said == sides(angles, centre), angles
    if language == "fanuc":
        assert joint["payload"] == "PAYLOAD[1]"
        return
    mass, at, inertia = joint["load"]
    assert mass == LOAD.mass
    # The tool's tip is where the model has it, so the centre has to be where it is from there.
    away = np.linalg.inv(spindle()) @ [*LOAD.centre, 1.0]
    np.testing.assert_allclose((np.linalg.inv(joint["tool"]) @ at)[:3, 3], away[:3] * 1e3, atol=2e-3)
    turned = at[:3, :3] @ np.diag(inertia) @ at[:3, :3].T
    R = joint["tool"][:3, :3] @ spindle()[:3, :3].T
    assert LOAD.inertia is not None
    np.testing.assert_allclose(turned, R @ np.diag(LOAD.inertia) @ R.T, atol=2e-6)


def test_a_second_parser_sees_a_number_that_was_changed() -> None:
    """The check above fails where J3 is written as the arm's own angle, without J2."""
    angles = [10.0, 20.0, -15.0, 30.0, -40.0, 50.0]
    right, _ = fanuc(angles)
    wrong, _ = fanuc([10.0, 20.0, -15.0 + 20.0, 30.0, -40.0, 50.0])
    assert np.linalg.norm(right[:3, 3] - wrong[:3, 3]) > 400.0
