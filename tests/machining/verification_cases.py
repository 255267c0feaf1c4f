"""A KR60 cell and programs in it, clean ones and such with planted faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rigid_frames import rigid_frame

from machining.cell import ArmBodies, Body, Cell, Fixture, Tool, arm_of, box, capsule
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Motions
from robots import inverse_kinematics
from robots.arrays import Array
from robots.inverse.singularities import branch_of

ARM = arm_of("kr60-3")
SPEED = np.radians([128.0, 102.0, 128.0, 260.0, 245.0, 322.0])


def placed(body: Body, x: float, y: float, z: float) -> Body:
    T = rigid_frame((x, y, z))
    return body.moved(T)


def tool() -> Tool:
    """A spindle across the flange; its mill, 8 mm thick, sticks out by 80 mm."""
    T = rigid_frame((0.3, 0.0, 0.08), [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    spindle = placed(Body("spindle", (box((0.1, 0.1, 0.1)),)), 0.15, 0.0, 0.03)
    bracket = placed(Body("bracket", (box((0.25, 0.08, 0.03)),)), 0.075, 0.0, 0.0)
    mill = Body("mill", (capsule((0.2, 0.0, 0.08), (0.296, 0.0, 0.08), 0.004),))
    return Tool(T, (bracket, spindle), (mill,))


def cell(*fixtures: Body, safety: float = 0.0, **more: object) -> Cell:
    """The part's top, 400 x 300 mm, is z = 0 of its frame, in whose middle the origin is."""
    T = rigid_frame((1.3, 0.1, 0.6))
    part = placed(Body("part", (box((0.4, 0.3, 0.1)),)), 1.3, 0.1, 0.5)
    table = placed(Body("table", (box((0.8, 0.8, 0.45)),)), 1.3, 0.1, 0.04)
    given = Cell(
        T_world_part0=T,
        tool=tool(),
        part=part,
        fixtures=(Fixture(table), *(Fixture(body) for body in fixtures)),
        floor=-0.1,
        joint_speed=SPEED,
        joint_acceleration=np.radians(600.0) * np.ones(6),
        safety=safety,
    )
    return replace(given, **more)  # type: ignore[arg-type]


def pillar(x: float, y: float, height: float, side: float = 0.02) -> Body:
    """A thin pillar on the part's level, at x, y in the part frame."""
    return placed(Body("pillar", (box((side, side, height)),)), 1.3 + x, 0.1 + y, 0.6)


def motions(points: Array, rapid: Array | None = None, feed: float = 0.05, axes: Array | None = None) -> Motions:
    """Moves to points (n, 3) m; line i + 11 is the source of move i."""
    n = len(points)
    fast = np.zeros(n, dtype=np.bool_) if rapid is None else np.asarray(rapid, dtype=np.bool_)
    none = np.zeros(n, dtype=np.int64)
    return Motions(
        points=points,
        axes=np.tile([0.0, 0.0, 1.0], (n, 1)) if axes is None else axes,
        rapid=fast,
        feed=np.where(fast, np.nan, feed),
        line=np.arange(n) + 11,
        tool=none,
        spindle=np.zeros(n),
        dwell=np.zeros(n),
        operation=none,
        source="test.nc",
    )


def frames(points: Array, gamma: Array | float = 0.0) -> Array:
    """Tool frames (n, 4, 4) with the tool straight down; at gamma = 0 the wrist is in the middle of its range."""
    g = np.broadcast_to(np.pi + np.asarray(gamma), len(points))
    T = np.zeros((len(points), 4, 4))
    T[:, 0, 0], T[:, 1, 0] = np.cos(g), np.sin(g)
    T[:, 0, 1], T[:, 1, 1] = np.sin(g), -np.cos(g)
    T[:, 2, 2], T[:, 3, 3] = -1.0, 1.0
    T[:, :3, 3] = points
    return T


def program(
    points: Array,
    rapid: Array | None = None,
    *,
    where: Cell | None = None,
    feed: float = 0.05,
    gamma: Array | float = 0.0,
    column: int = 0,
    arm: ArmBodies = ARM,
) -> JointProgram:
    """A program through points (n, 3) m of the part frame on one branch."""
    where = where or cell()
    n, robot = len(points), arm.robot
    T = frames(points, gamma)
    zero = np.zeros(n)
    travel = np.zeros((n, len(where.linear_axes)))
    target = where.T_base_part(travel, zero) @ T
    found = inverse_kinematics(robot, target, T_flange_tool=where.tool.T_flange_tool)
    # One branch without jumps: neighbouring angles in neighbouring turns.
    q = np.unwrap(found.q[:, column], axis=0)
    assert np.isfinite(q).all()
    names = found.names
    return JointProgram(
        robot,
        where,
        motions(points, rapid, feed),
        T,
        q,
        travel,
        zero,
        zero + gamma,
        branch_of(robot, q),
        names,
        np.zeros(n, dtype=np.bool_),
    )


def line(n: int, start: tuple[float, float, float], end: tuple[float, float, float]) -> Array:
    """n points (n, 3) m, evenly from start to end."""
    return np.linspace(start, end, n)


def zigzag(rows: int, each: int, width: float = 0.3, depth: float = 0.2) -> Array:
    """Points (rows * each, 3) m over the part, row by row."""
    x = np.concatenate([np.linspace(-1.0, 1.0, each)[:: 1 if r % 2 == 0 else -1] for r in range(rows)])
    y = np.repeat(np.linspace(-1.0, 1.0, rows), each)
    return np.stack([0.5 * width * x, 0.5 * depth * y, np.zeros(len(x))], axis=1)
