"""A cell file and neutral programs in it for the tests of `verify` and of the replay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.cell import (
    Body,
    Cell,
    Fixture,
    LinearAxis,
    Turntable,
    arm_of,
    box,
    read_cell,
    sphere,
)
from machining.programs.formats import write_program
from machining.programs.program import JointProgram, tool_in_part
from machining.toolpaths.motions import Motions
from machining.verification import Demands, Verification, verify
from robots import inverse_kinematics
from robots.arrays import Array
from robots.inverse.branches import BRANCH_NAMES
from robots.robot import middle_pose

CELL = """
schema = "stiffarm-cell/1"
name = "test <cell>"
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
joint_acceleration_deg_s2 = 600
[tool]
position_mm = [300, 0, 80]
z_axis = [1, 0, 0]
x_axis = [0, 0, -1]
[[tool.body]]
name = "spindle"
shape = { kind = "box", size_mm = [100, 100, 100] }
position_mm = [150, 0, 30]
[[tool.body]]
name = "mill"
cutter = true
shape = { kind = "cylinder", diameter_mm = 8, length_mm = 100 }
position_mm = [200, 0, 80]
z_axis = [1, 0, 0]
x_axis = [0, 0, 1]
[part]
position_mm = [1300, 100, 600]
shape = { kind = "box", size_mm = [400, 300, 100] }
[floor]
height_mm = -100
[[fixture]]
name = "clamp"
position_mm = [1350, 100, 600]
shape = { kind = "box", size_mm = [40, 40, 130] }
"""


def cell_file(folder: Path) -> Path:
    file = folder / "cell.toml"
    file.write_text(CELL, encoding="utf-8")
    return file


def points(n: int, height: float) -> Array:
    """n points along x at a height over the part's foot; the part is 100 mm high, the clamp 130 mm."""
    x = np.linspace(-0.15, 0.15, n)
    return np.stack([x, np.full(n, 0.002), np.full(n, height)], axis=1)


def program_at(cell: Path, n: int, height: float, feed: float = 0.05) -> JointProgram:
    """The tool straight down along :func:`points`; line i + 11 is move i's.

    In steps of 5 mm (n = 61) the mill meets the clamp's side at x = 50 - 20 - 4 mm: move 36, line 47.
    """
    given, robot = read_cell(cell), arm_of("kr60-3").robot
    T = np.tile(np.diag([-1.0, 1.0, -1.0, 1.0]), (n, 1, 1))
    T[:, :3, 3] = points(n, height)
    found = inverse_kinematics(robot, given.T_base_part() @ T, T_flange_tool=given.tool.T_flange_tool)
    q = np.unwrap(found.q[:, 0], axis=0)
    none = np.zeros(n, dtype=np.int64)
    motions = Motions(
        points=T[:, :3, 3],
        axes=-T[:, :3, 2],
        rapid=np.arange(n) == 0,
        feed=np.full(n, feed),
        line=np.arange(n) + 11,
        tool=none,
        spindle=np.zeros(n),
        dwell=np.zeros(n),
        operation=none,
        source="plate <b>.nc",
    )
    return JointProgram(
        robot,
        given,
        motions,
        T,
        q,
        np.zeros((n, 0)),
        np.zeros(n),
        np.zeros(n),
        none,
        BRANCH_NAMES,
        np.zeros(n, dtype=np.bool_),
    )


def program_file(folder: Path, program: JointProgram, kind: str = "json") -> Path:
    file = folder / f"program.{kind}"
    write_program(program, kind).files[0].write(file)
    return file


def verified(folder: Path, n: int = 61, height: float = 0.102) -> Verification:
    """A program verified in the test cell; by default it runs into the clamp."""
    return verify(program_at(cell_file(folder), n, height), arm_of("kr60-3"), Demands(tolerance=1e-3))


def many_moves(folder: Path, n: int) -> Verification:
    """A long clean program."""
    given = program_at(cell_file(folder), 200, 0.15)
    index = np.abs((np.arange(n) % 398) - 199)
    motions = replace(
        given.motions,
        **{
            name: getattr(given.motions, name)[index]
            for name in ("points", "axes", "rapid", "feed", "tool", "spindle", "dwell", "operation")
        },
        line=np.arange(n),
    )
    arrays = {
        name: getattr(given, name)[index]
        for name in ("T_part_tool", "q", "travel", "table", "gamma", "branch", "inserted")
    }
    return verify(replace(given, motions=motions, **arrays), arm_of("kr60-3"), Demands(tolerance=1e-3))


def parallelogram_program() -> JointProgram:
    """Four poses of an arm with crank and bar, on a rail, with a turntable; no path in particular."""
    rail = LinearAxis(
        "rail", np.array([0.6, 0.8, 0.0]), np.array([-1.0, 3.0]), carriage=Body("trolley", (box([1.0] * 3),))
    )
    table = Turntable(np.array([2.0, 0.5, 0.0]), np.array([0.0, 0.6, 0.8]))
    base = np.eye(4)
    base[:3, 3] = 0.1, 0.2, 1.0
    clamp = Fixture(Body("clamp", (sphere(0.1),)), on_turntable=True)
    cell = Cell(T_world_base0=base, linear_axes=(rail,), turntable=table, fixtures=(clamp,))
    robot = arm_of("xr701").robot
    q = middle_pose(robot) + 0.1 * np.arange(4.0)[:, None] * np.array([1.0, -1.0, 0.5, 1.0, -1.0, 2.0])
    travel, turned = np.linspace(0.0, 0.9, 4)[:, None], np.linspace(0.0, 1.2, 4)
    T = tool_in_part(robot, cell, q, travel, turned, cell.tool.T_flange_tool)
    none = np.zeros(4, dtype=np.int64)
    motions = Motions(
        points=T[:, :3, 3],
        axes=-T[:, :3, 2],
        rapid=np.ones(4, dtype=np.bool_),
        feed=np.full(4, np.nan),
        line=np.arange(4) + 1,
        tool=none,
        spindle=np.zeros(4),
        dwell=np.zeros(4),
        operation=none,
    )
    return JointProgram(
        robot, cell, motions, T, q, travel, turned, np.zeros(4), none, BRANCH_NAMES, np.zeros(4, dtype=np.bool_)
    )
