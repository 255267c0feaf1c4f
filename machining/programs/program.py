"""A machining program in joint and Cartesian coordinates at once: what is written for controllers, and replayed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from machining.cell import Cell
from machining.tooling import tool_frames
from machining.toolpaths.motions import Motions
from robots import Robot, forward_kinematics
from robots.arrays import Array, Bools, Integers, finite, in_blocks
from robots.frames import inverse

# The branch's name in programs that a controller's file alone says.
REPLAYED = "as the file says"
# Joint angles (rad) that are those of home but for the decimals of a file.
HOME = 1e-6
# Poses whose frames are held at once.
BLOCK = 8_192


@dataclass(frozen=True)
class Fault:
    """What is wrong with the file of a program at a move, in words; ``place``: it leads to another place."""

    move: int
    text: str
    place: bool = False


@dataclass(frozen=True, eq=False)
class JointProgram:
    """n moves; move i leads from point i - 1 to point i.

    Attributes
    ----------
    robot, cell : what carries the tool, and where
    motions : the tool path, feeds, tools, source lines, events; with points put in between where ``inserted`` says so
    T_part_tool : (n, 4, 4) m, wanted tool frames in the part frame: the Cartesian program
    q : (n, dof) rad, joint coordinates: the joint program
    travel : (n, k) m of the cell's k linear axes
    table : (n,) rad of its turntable, 0 without one
    gamma : (n,) rad about the tool axis (see :class:`machining.Task`)
    branch : (n,) index into ``names`` of the inverse kinematics' branches
    inserted : (n,) points that the source does not have
    file_lines : (n,) lines of the file that the program was read from; None: of none, or not a line a move
    faults : what is wrong with that file itself

    Raises
    ------
    InputError
        Shapes that do not fit, or numbers that are not finite.
    """

    robot: Robot
    cell: Cell
    motions: Motions
    T_part_tool: Array
    q: Array
    travel: Array
    table: Array
    gamma: Array
    branch: Integers
    names: tuple[str, ...]
    inserted: Bools
    file_lines: Integers | None = None
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        n = self.motions.n
        shapes = {
            "T_part_tool": (n, 4, 4),
            "q": (n, self.robot.dof),
            "travel": (n, len(self.cell.linear_axes)),
            "table": (n,),
            "gamma": (n,),
            "branch": (n,),
            "inserted": (n,),
            **({} if self.file_lines is None else {"file_lines": (n,)}),
        }
        for name, shape in shapes.items():
            finite(f"joint program, {name}", getattr(self, name), shape)

    @property
    def n(self) -> int:
        """Number of moves."""
        return self.motions.n

    @cached_property
    def at_home(self) -> Bools:
        """Points (n,) at the home of a cell whose programs begin and end there."""
        home = self.cell.home if self.cell.moves.home else None
        if home is None:
            return np.zeros(self.n, dtype=np.bool_)
        return np.asarray(np.abs(self.q - home).max(axis=1) < HOME)

    @cached_property
    def loose(self) -> Bools:
        """Moves (n,) that are joint moves whatever is asked: to another tool, and from and to home."""
        ends = self.at_home | np.append(np.zeros(min(1, self.n), dtype=np.bool_), self.at_home[:-1])
        return np.asarray(self.motions.changes | ends)

    def reached(self) -> Array:
        """Tool frames (n, 4, 4) in the part frame that the joint coordinates give, by forward kinematics."""
        return tool_in_part(self.robot, self.cell, self.q, self.travel, self.table, self.T_flange_tool)

    @cached_property
    def T_flange_tool(self) -> Array:  # noqa: N802 - letters of a matrix
        """Tool frames on the flange: (4, 4) m where all moves have one tool, else (n, 4, 4)."""
        return tool_frames(self.cell, self.motions)

    def tool_at(self, rows: slice | Integers) -> Array:
        """Tool frames on the flange at some moves: (4, 4) m where all moves have one tool, else (k, 4, 4)."""
        return self.T_flange_tool if self.T_flange_tool.ndim == 2 else self.T_flange_tool[rows]


def tool_in_part(robot: Robot, cell: Cell, q: Array, travel: Array, table: Array, T_flange_tool: Array) -> Array:
    """Tool frames (n, 4, 4) in the part frame at joint angles q (n, dof) rad, travels (n, k) m and table (n,) rad.

    ``T_flange_tool`` (4, 4) or (n, 4, 4) m.
    """
    frames = np.empty((len(q), 4, 4))
    fixed = not cell.linear_axes and cell.turntable is None
    # In blocks: the frames of all bodies are far more than what is kept.
    for rows in in_blocks(len(q), BLOCK):
        T = forward_kinematics(robot, q[rows]).T_flange
        # One frame for all where neither base nor part moves.
        at = slice(rows.start, rows.start + 1) if fixed else rows
        T_part_base = inverse(cell.T_base_part(travel[at], table[at]))
        tool = T_flange_tool if T_flange_tool.ndim == 2 else T_flange_tool[rows]
        frames[rows] = T_part_base @ T @ tool
    return frames


def frame_distance(A: Array, B: Array) -> tuple[Array, Array]:
    """Distance (n,) m of the origins and angle (n,) rad between the axes of frames (n, 4, 4)."""
    away = np.linalg.norm(A[:, :3, 3] - B[:, :3, 3], axis=1)
    # The chord keeps its digits near zero, where the cosine has lost them.
    chord = np.linalg.norm(A[:, :3, :3] - B[:, :3, :3], axis=(1, 2)) / np.sqrt(8.0)
    return away, np.asarray(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)))
