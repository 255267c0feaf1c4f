"""The moves of a program as curves of all axes, as a controller would run them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from machining.programs.program import JointProgram, tool_in_part
from machining.verification.demands import Interpolation
from machining.verification.moving_axes import MovingAxes, moving_axes
from robots.arrays import Array, Bools, Integers
from robots.frames import inverse
from robots.inverse.search import refine

# Pieces of a move on which rates, singularities and the straight line are looked at. Joint motion of a short move
# leaves the line by nearly a parabola, whose top lies in the middle: eight pieces see it to 2 %.
PIECES = 8


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
        before = np.maximum(move - 1, 0)
        a, b = self.points[before], self.points[move]
        values = a + share[:, None] * (b - a)
        followed = np.ones(len(move), dtype=np.bool_)
        rows = np.flatnonzero(self.straight[move] & (share > 0.0) & (share < 1.0))
        if len(rows):
            targets = self._flange(move[rows], share[rows], values[rows])
            q, met = refine(self.program.robot, values[rows, : self.axes.dof], targets)
            values[rows[met], : self.axes.dof] = q[met]
            followed[rows] = met
        # The last digit of a + 1 (b - a) is not that of b.
        values[share == 1.0] = b[share == 1.0]
        return values, followed

    def sampled(self, moves: Integers, pieces: int = PIECES) -> tuple[Array, Bools]:
        """Coordinates (m, pieces + 1, a) of moves at even shares from 0 to 1, and whether they could be followed."""
        share = np.tile(np.linspace(0.0, 1.0, pieces + 1), len(moves))
        values, followed = self.at(np.repeat(moves, pieces + 1), share)
        shape = len(moves), pieces + 1
        return values.reshape(*shape, -1), np.asarray(followed.reshape(shape).all(axis=1))

    def frames(self, values: Array) -> Array:
        """Tool frames (m, 4, 4) in the part frame at coordinates (m, a)."""
        return tool_in_part(self.program.robot, self.program.cell, *self.axes.parts(values))

    def _flange(self, move: Integers, share: Array, values: Array) -> Array:
        """Flange frames (m, 4, 4) in the base on straight moves."""
        cell = self.program.cell
        _, travel, table = self.axes.parts(values)
        T = frames_between(self.reached[move - 1], self.reached[move], share)
        return np.asarray(cell.T_base_part(travel, table) @ T @ inverse(cell.tool.T_flange_tool))


def courses_of(program: JointProgram, interpolation: Interpolation) -> Courses:
    """The moves of a program under one of the interpretations of :class:`machining.verification.Demands`."""
    axes = moving_axes(program.robot, program.cell)
    straight = np.full(program.n, interpolation == "linear")
    if interpolation == "mixed":
        straight = program.motions.cutting
    straight[:1] = False
    return Courses(program, axes, axes.of(program), straight)


def frames_between(A: Array, B: Array, share: Array) -> Array:
    """Frames (m, 4, 4) on the way from A to B (m, 4, 4): origins straight, axes turned evenly the short way."""
    T = A.copy()
    T[:, :3, 3] += share[:, None] * (B[:, :3, 3] - A[:, :3, 3])
    turn = Rotation.from_matrix(np.swapaxes(A[:, :3, :3], 1, 2) @ B[:, :3, :3]).as_rotvec()
    T[:, :3, :3] = A[:, :3, :3] @ Rotation.from_rotvec(share[:, None] * turn).as_matrix()
    return T
