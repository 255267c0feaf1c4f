"""Moves of a program in the making: with points put in between, where linear axes stand, and gamma.

Points are put in so that straight joint motion stays on straight tool motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from machining.cell import Cell
from machining.task import REPEATED, Task, ToolPath
from machining.tooling import tool_frames
from machining.toolpaths.motions import Motions
from robots import InputError
from robots.arrays import Array, Bools, Integers


@dataclass(frozen=True, eq=False)
class PostState:
    """Moves of a cell with points put in, and where its axes stand.

    ``travel`` (n, k) m of the linear axes, ``table`` rad; ``reference`` (3,) as in :class:`machining.Task`;
    ``inserted`` (n,); ``gamma`` (n,) rad once it is chosen; ``near`` (n, dof) rad, postures wanted.
    """

    cell: Cell
    motions: Motions
    travel: Array
    table: float
    reference: Array | None
    inserted: Bools
    gamma: Array | None
    near: Array | None = None

    @cached_property
    def places(self) -> tuple[Integers, Integers]:
        """Moves (k,) that lead elsewhere, and the path point (n,) that each move leads to."""
        motions = self.motions
        still = np.zeros(motions.n, dtype=np.bool_)
        still[1:] = (np.linalg.norm(np.diff(motions.points, axis=0), axis=1) < REPEATED) & (
            np.linalg.norm(np.diff(motions.axes, axis=0), axis=1) < REPEATED
        )
        # The same point with another tool is another posture.
        still &= ~motions.changes
        return np.flatnonzero(~still), np.cumsum(~still) - 1

    @cached_property
    def task(self) -> Task:
        """The path as a task of the robot."""
        motions, (kept, _) = self.motions, self.places
        T_tool = tool_frames(self.cell, motions)
        # Linear axes shift the part against the base; they do not turn it.
        moving = self.travel[kept] if self.cell.linear_axes else None
        T = self.cell.T_base_part(moving, np.array([self.table]))
        path = ToolPath(motions.points[kept], motions.axes[kept], motions.axes[kept], motions.feed[kept])
        shift = T[:, :3, 3] - T[0, :3, 3]
        on_flange = T_tool if T_tool.ndim == 2 else T_tool[kept]
        return Task(path, on_flange, T[0], self.reference, shift if shift.any() else None)

    def tool_frames(self, gamma: Array) -> Array:
        """Tool frames (n, 4, 4) in the part frame at gamma (n,) rad."""
        kept, place = self.places
        in_part = Task(self.task.path, self.task.T_flange_tool, np.eye(4), self.task.reference)
        T = in_part.tool_frames(gamma[kept][:, None])[place, 0]
        T[:, :3, 3] = self.motions.points
        return np.asarray(T)

    def refined(self, pieces: Integers) -> PostState:
        """Split move i into ``pieces[i]`` equal ones; travel, gamma and postures go evenly."""
        motions, inserted, move, share = subdivided(self.motions, pieces)
        before = np.maximum(move - 1, 0)

        def between(values: Array) -> Array:
            share_ = share if values.ndim == 1 else share[:, None]
            return np.asarray(values[before] + share_ * (values[move] - values[before]))

        return replace(
            self,
            motions=motions,
            travel=between(self.travel),
            inserted=inserted | self.inserted[move],
            gamma=None if self.gamma is None else between(np.unwrap(self.gamma)),
            near=None if self.near is None else between(self.near),
        )


def subdivided(motions: Motions, pieces: Integers) -> tuple[Motions, Bools, Integers, Array]:
    """Split move i into ``pieces[i]`` equal ones; the first point has no move, so ``pieces[0]`` is 1.

    The tip moves straight, the tool axis turns evenly on the great circle.

    Returns
    -------
    motions, ``inserted`` (k,), ``move`` (k,): the move of the old motions that each new one belongs to, and ``share``
    (k,) of that, at its end

    Raises
    ------
    InputError
        Shape, counts below 1, or a tool axis that turns by half a turn in one move: it could go any way round.
    """
    n = motions.n
    if pieces.shape != (n,) or (pieces < 1).any() or (n and pieces[0] != 1):
        raise InputError(
            "pieces of moves", code="Q007", value=f"shape {pieces.shape}", allowed=f"({n},), 1 or more, 1 at the first"
        )
    move = np.repeat(np.arange(n), pieces)
    last = np.cumsum(pieces) - 1
    part = np.arange(len(move)) - (last - pieces + 1)[move] + 1
    share = part / pieces[move]
    before = np.maximum(move - 1, 0)
    points = motions.points[before] + share[:, None] * (motions.points[move] - motions.points[before])
    axes = _turned(motions.axes[before], motions.axes[move], share, motions.line[move], pieces[move] > 1)
    inserted = np.ones(len(move), dtype=np.bool_)
    inserted[last] = False
    # Given points stay what they are to the last digit.
    points[last], axes[last] = motions.points, motions.axes
    events = tuple(
        replace(event, move=int(last[event.move - 1]) + 1 if event.move > 0 else 0) for event in motions.events
    )
    return (
        replace(
            motions,
            points=points,
            axes=axes,
            rapid=motions.rapid[move],
            feed=motions.feed[move],
            line=motions.line[move],
            tool=motions.tool[move],
            spindle=motions.spindle[move],
            dwell=np.where(inserted, 0.0, motions.dwell[move]),
            operation=motions.operation[move],
            events=events,
        ),
        inserted,
        move,
        share,
    )


def _turned(a: Array, b: Array, share: Array, line: Integers, wanted: Bools) -> Array:
    """Unit vectors on the great circle from a to b (k, 3), at a share of the way."""
    cosine = np.einsum("ni,ni->n", a, b)
    opposite = wanted & (cosine < -1.0 + 1e-9)
    if opposite.any():
        raise InputError(
            f"line {int(line[np.argmax(opposite)])}: the tool axis turns by half a turn in one move",
            code="Q007",
            allowed="less than 180 deg a move",
            remedy="give a point in between",
        )
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), cosine)
    sine = np.sin(angle)
    small = sine < 1e-9
    safe = np.where(small, 1.0, sine)
    wa = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    wb = np.where(small, share, np.sin(share * angle) / safe)
    out = wa[:, None] * a + wb[:, None] * b
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def pieces_for(motions: Motions, tolerance: float, radius: float, *, only: Bools | None = None) -> Integers:
    """Pieces of each move (n,) so that arcs of ``radius`` m depart from their chords by less than ``tolerance`` m.

    A first guess: a point that swings about a joint ``radius`` away. What the arm really does is seen afterwards, by
    its forward kinematics. ``only`` (n,): moves that may be split.
    """
    step = np.sqrt(8.0 * radius * tolerance)
    length = np.zeros(motions.n)
    length[1:] = np.linalg.norm(np.diff(motions.points, axis=0), axis=1)
    turn = np.zeros(motions.n)
    turn[1:] = np.linalg.norm(np.diff(motions.axes, axis=0), axis=1) * radius
    pieces: Integers = np.maximum(1, np.ceil(np.maximum(length, turn) / step)).astype(np.int64)
    if only is not None:
        pieces[~only] = 1
    return pieces
