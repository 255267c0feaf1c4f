"""What the tests of programs share: joint programs of KR60 and TX200 on short paths, by inverse kinematics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from posture_cases import dome, part, spindle

from machining.cell import Cell, LinearAxis, Tool, Turntable
from machining.programs.program import JointProgram, tool_in_part
from machining.toolpaths.motions import Event, Motions
from machining.toolpaths.motions import Tool as Cutter
from robots import Robot, inverse_kinematics, load_robot
from robots.arrays import Array

# A KUKA, ABB or any other controller that counts as this project does.
PLAIN: dict[str, Any] = {"sign": (1,) * 6, "offset_deg": (0.0,) * 6, "base": {}}


def cell_of(robot: str = "kr60-3", **more: Any) -> Cell:
    """The part before the robot, the spindle across its flange."""
    place = part(x=1.2, y=0.2, z=0.6) if robot == "kr60-3" else part(x=1.3, y=0.2, z=0.5)
    return Cell(T_world_part0=place, tool=Tool(spindle()), **more)


def rail(name: str = "rail") -> LinearAxis:
    return LinearAxis(name, np.array([0.3, 1.0, 0.0]), np.array([-5.0, 5.0]))


def turntable() -> Turntable:
    return Turntable(np.array([1.2, 0.3, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([-7.0, 7.0]))


def program_of(
    robot_name: str = "kr60-3",
    n: int = 12,
    cell: Cell | None = None,
    travel: Array | None = None,
    table: Array | None = None,
    **more: Any,
) -> JointProgram:
    """A program along the dome; the first valid branch at its start is kept. ``more``: fields of the motions."""
    robot = load_robot(robot_name)
    cell = cell or cell_of(robot_name)
    path = dome(n, length=0.4)
    travel = np.zeros((n, len(cell.linear_axes))) if travel is None else travel
    table = np.zeros(n) if table is None else table
    base_part = np.linalg.inv(cell.T_world_base(travel)) @ cell.T_world_part(table)
    for gamma in np.linspace(0.0, 2.0 * np.pi, 24):
        T = _frames(path.points, path.axes, gamma)
        found = inverse_kinematics(robot, base_part @ T, T_flange_tool=cell.tool.T_flange_tool)
        column = int(np.argmax(found.valid.all(axis=0)))
        if found.valid[:, column].all():
            break
    else:
        raise AssertionError("no branch reaches all points")
    return JointProgram(
        robot=robot,
        cell=cell,
        motions=motions_of(path.points, path.axes, **more),
        T_part_tool=T,
        q=np.unwrap(found.q[:, column], axis=0),
        travel=travel,
        table=table,
        gamma=np.zeros(n),
        branch=np.full(n, column),
        names=found.names,
        inserted=np.zeros(n, dtype=np.bool_),
    )


def _frames(points: Array, axes: Array, gamma: float) -> Array:
    z = -axes
    x = np.cross([np.sin(gamma), np.cos(gamma), 0.0], z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    T = np.zeros((len(points), 4, 4))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = x, np.cross(z, x), z
    T[:, :3, 3], T[:, 3, 3] = points, 1.0
    return T


def motions_of(points: Array, axes: Array, **more: Any) -> Motions:
    n = len(points)
    plain: dict[str, Any] = {
        "points": points,
        "axes": axes,
        "rapid": np.arange(n) < 2,
        "feed": np.where(np.arange(n) < 2, np.nan, 0.02),
        "line": np.arange(10, 10 + n),
        "tool": np.zeros(n, dtype=np.int64),
        "spindle": np.zeros(n),
        "dwell": np.zeros(n),
        "operation": np.zeros(n, dtype=np.int64),
        "source": "dome.apt",
    }
    return Motions(**(plain | more))


def busy(n: int = 12, hostile: str = "") -> JointProgram:
    """Feeds, tools, spindle, dwell, operations and events that change; ``hostile`` in every text."""
    feed = np.where(np.arange(n) < 2, np.nan, np.linspace(0.01, 0.05, n))
    later = (np.arange(n) >= n // 2).astype(np.int64)
    return program_of(
        n=n,
        feed=feed,
        tool=later,
        operation=later,
        spindle=np.where(later, 1256.6370614359173, -1047.1975511965977),
        dwell=np.where(np.arange(n) == 4, 1.5, 0.0),
        tools=(Cutter(3, "ball" + hostile, 0.012), Cutter(4, "flat" + hostile)),
        operations=("rough" + hostile, "finish" + hostile),
        events=(Event(12, 2, "COOLNT" + hostile, "ON" + hostile), Event(99, n, "END" + hostile, hostile)),
        source="dome.apt" + hostile,
    )


def posed(robot: Robot, q: Array, cell: Cell | None = None) -> JointProgram:
    """A program whose frames are where joint angles q (n, 6) rad put the tool."""
    cell = cell or Cell(tool=Tool(spindle()))
    n = len(q)
    travel, table = np.zeros((n, len(cell.linear_axes))), np.zeros(n)
    T = tool_in_part(robot, cell, q, travel, table, cell.tool.T_flange_tool)
    motions = motions_of(np.ascontiguousarray(T[:, :3, 3]), -T[:, :3, 2], rapid=np.zeros(n, dtype=np.bool_))
    motions = replace(motions, feed=np.full(n, 0.02))
    zeros = np.zeros(n, dtype=np.int64)
    return JointProgram(robot, cell, motions, T, q, travel, table, np.zeros(n), zeros, ("any",), zeros > 0)


def random_poses(robot: Robot, n: int, rng: np.random.Generator) -> Array:
    return np.asarray(rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (n, robot.dof)))
