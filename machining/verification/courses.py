"""All axes of a cell, and the moves of a program as curves of them, as a controller would run them.

Axes are columns of one table: joints, then linear axes, then the turntable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from machining.cell import Cell, LinearAxis, Turntable
from machining.programs.program import JointProgram, tool_in_part
from machining.verification.demands import Interpolation
from robots import Robot
from robots.arrays import Array, Bools, Integers, in_blocks
from robots.frames import frames_between, inverse
from robots.inverse.search import refine

# Pieces of a move on which rates, singularities and the straight line are looked at. Joint motion of a short move
# leaves the line by nearly a parabola, whose top lies in the middle: eight pieces see it to 2 %.
PIECES = 8
# Poses, or moves, that are looked at together.
BLOCK = 8_192


@dataclass(frozen=True, eq=False)
class MovingAxes:
    """Names and bounds of a axes: dof joints, k linear axes, and the turntable if there is one.

    ``lower``, ``upper`` (a,) rad or m; ``speed`` (a,) and ``acceleration`` (a,), inf where not known; ``linear`` (a,)
    says which are in m.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    speed: Array
    acceleration: Array
    linear: Bools
    dof: int
    travels: int

    @property
    def count(self) -> int:
        """Number of axes."""
        return len(self.names)

    def unit(self, axis: int, per: str = "") -> str:
        """Unit of an axis, as in "rad/s"."""
        return ("m" if self.linear[axis] else "rad") + per

    def table(self, q: Array, travel: Array, table: Array) -> Array:
        """Columns (n, a) of q (n, dof), travel (n, k) and table (n,)."""
        return np.concatenate([q, travel, table[:, None]], axis=1)[:, : self.count]

    def parts(self, values: Array) -> tuple[Array, Array, Array]:
        """Undo :meth:`table`; the turntable stands at 0 where there is none."""
        k = self.dof + self.travels
        table = values[:, k] if self.count > k else np.zeros(len(values))
        return values[:, : self.dof], values[:, self.dof : k], table

    def of(self, program: JointProgram) -> Array:
        """Coordinates (n, a) of all axes at a program's points."""
        return self.table(program.q, program.travel, program.table)


def moving_axes(robot: Robot, cell: Cell) -> MovingAxes:
    """Axes of a robot in its cell."""
    others: list[LinearAxis | Turntable] = [*cell.linear_axes, *([] if cell.turntable is None else [cell.turntable])]
    free = np.array([-np.inf, np.inf])
    limits = np.array([*robot.limits, *(free if axis.limits is None else axis.limits for axis in others)])
    return MovingAxes(
        names=(
            *(name.removesuffix("_deg") for name in robot.coordinates),
            *(axis.name for axis in cell.linear_axes),
            *(["turntable"] if cell.turntable else []),
        ),
        lower=limits[:, 0],
        upper=limits[:, 1],
        speed=_rates(cell.joint_speed, robot.dof, [axis.speed for axis in others]),
        acceleration=_rates(cell.joint_acceleration, robot.dof, [axis.acceleration for axis in others]),
        linear=np.repeat([False, True, False], [robot.dof, len(cell.linear_axes), cell.turntable is not None]),
        dof=robot.dof,
        travels=len(cell.linear_axes),
    )


def _rates(joints: ArrayLike | None, dof: int, others: Sequence[float | None]) -> Array:
    """Greatest rates (a,) of joints and other axes; inf where not known."""
    of_joints = np.broadcast_to(np.inf if joints is None else np.asarray(joints, dtype=np.float64), (dof,))
    return np.array([*of_joints, *(np.inf if rate is None else rate for rate in others)])


@dataclass(frozen=True, eq=False)
class Courses:
    """Axis coordinates at any share of any move; move i leads from point i - 1 to point i.

    ``axes``: the columns; ``points`` (n, a): coordinates at the program's points; ``straight`` (n,): moves of which
    the tool frame moves on a straight line between the frames that the joints reach, turning evenly about one axis.
    Linear axes and turntable move evenly in either case.
    """

    program: JointProgram
    axes: MovingAxes
    points: Array
    straight: Bools

    @cached_property
    def reached(self) -> Array:
        """Tool frames (n, 4, 4) in the part frame at the points."""
        return self.program.reached()

    def at(self, move: Integers, share: Array) -> tuple[Array, Bools]:
        """Coordinates (m, a) after ``share`` (m,), 0 to 1, of moves (m,), and whether the line could be followed.

        Straight moves start Newton's method from the joints moved evenly, so they stay on the branch of the two
        ends. Where it does not converge the joints moved evenly are given.
        """
        values = self.even(move, share)
        followed = np.ones(len(move), dtype=np.bool_)
        between = np.flatnonzero(self.straight[move] & (share > 0.0) & (share < 1.0))
        for some in in_blocks(len(between), BLOCK):
            rows = between[some]
            targets = self._flange(move[rows], share[rows], values[rows])
            q, met = refine(self.program.robot, values[rows, : self.axes.dof], targets)
            values[rows[met], : self.axes.dof] = q[met]
            followed[rows] = met
        return values, followed

    def even(self, move: Integers, share: Array) -> Array:
        """Coordinates (m, a) after ``share`` (m,), 0 to 1, of moves (m,) if all axes move evenly."""
        a, b = self.points[np.maximum(move - 1, 0)], self.points[move]
        # The last digit of a + 1 (b - a) is not that of b.
        return np.where(share[:, None] == 1.0, b, a + share[:, None] * (b - a))

    def sampled(self, moves: Integers, pieces: int = PIECES) -> tuple[Array, Bools]:
        """Coordinates (m, pieces + 1, a) of moves at even shares from 0 to 1, and whether they could be followed."""
        share = np.tile(np.linspace(0.0, 1.0, pieces + 1), len(moves))
        values, followed = self.at(np.repeat(moves, pieces + 1), share)
        shape = len(moves), pieces + 1
        return values.reshape(*shape, -1), np.asarray(followed.reshape(shape).all(axis=1))

    def frames(self, values: Array, move: Integers) -> Array:
        """Tool frames (m, 4, 4) in the part frame at coordinates (m, a), with the tools of moves (m,)."""
        program = self.program
        return tool_in_part(program.robot, program.cell, *self.axes.parts(values), program.tool_at(move))

    def _flange(self, move: Integers, share: Array, values: Array) -> Array:
        """Flange frames (m, 4, 4) in the base on straight moves."""
        cell = self.program.cell
        _, travel, table = self.axes.parts(values)
        T = frames_between(self.reached[move - 1], self.reached[move], share)
        return np.asarray(cell.T_base_part(travel, table) @ T @ inverse(self.program.tool_at(move)))


def courses_of(program: JointProgram, interpolation: Interpolation) -> Courses:
    """The moves of a program under one of the interpretations of :class:`machining.verification.Demands`."""
    axes = moving_axes(program.robot, program.cell)
    straight = np.full(program.n, interpolation == "linear")
    if interpolation == "mixed":
        straight = program.motions.cutting
    straight = straight & ~program.loose
    straight[:1] = False
    return Courses(program, axes, axes.of(program), straight)
