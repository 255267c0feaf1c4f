"""Retracts: while a tool is at a place of the machine, the robot holds it above the path.

A file says neither where such a place is in the part nor how the tool gets there. The robot goes up along the tool axis
to a height, across at that height, and down at the next place in the part. A height is a distance from the origin of
the part along the tool axis: the highest point of the path along that axis and a clearance, or as the reader is told.
It is known once the whole path is, so moves are kept here by their numbers and placed at the end.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from robots.arrays import Array, Bools

# m above the highest point of the path.
CLEARANCE = 10e-3
# Cosine of a turn of the tool axis (0.08 deg) that is none, and of the largest (120 deg) that one corner is enough for.
TURNED, CORNER = 1.0 - 1e-6, -0.5
# m across the tool axis that is the same place.
SAME = 1e-9


class Retracts:
    """Moves of one file that are at the retract's height.

    ``height`` m along the tool axis, None: by the path. ``away``: the tool is at a place of the machine now; ``words``
    that sent it there; ``count`` of retracts, the first in ``line``. ``raised``: numbers of moves that end above a
    point. ``corners``: number of the first of two moves at which the tool turns, and of the raised moves before and
    behind.
    """

    def __init__(self, height: float | None) -> None:
        self.height = height
        self.away = False
        self.words: dict[str, None] = {}
        self.line = self.count = 0
        self.raised = array("q")
        self.corners: list[tuple[int, int, int]] = []
        # Of the last raised move: the point that it is above, tool axis and tool.
        self._point, self._axis, self._tool = np.zeros(3), np.zeros(3), -1

    def begin(self, line: int, word: str, point: Array) -> None:
        """A retract begins at a point (3,) m."""
        self.away = True
        self.words[word] = None
        self.line, self.count = self.line or line, self.count + 1
        self._point, self._tool = point, -1

    def steps(self, number: int, point: Array, axis: Array, tool: int) -> Iterator[Array]:
        """Tool axes (3,) of the moves, the next of them ``number``, that lead at the height to above a point (3,) m.

        Where the tool axis turns, the tool first goes to a place that is above the path along both axes, and turns
        there. A tool that has just been changed comes from the changer.
        """
        if self._tool == tool:
            start, axes = number - 1, list(_turn(self._axis, axis))
            for k, pair in enumerate(pairwise(axes)):
                self.corners.append((number + 2 * k, start, number + 2 * (len(axes) - 1)))
                yield from pair
            number += 2 * (len(axes) - 1)
        self.raised.append(number)
        self._point, self._axis, self._tool = point, axis, tool
        yield axis

    def above(self, point: Array, axis: Array, tool: int) -> bool:
        """Whether the last raised move has brought the tool above a point (3,) m."""
        off = point - self._point
        off = off - (off @ axis) * axis
        return tool == self._tool and bool(axis @ self._axis > TURNED) and bool(np.linalg.norm(off) < SAME)

    def level(self, point: Array, axis: Array) -> Array:
        """A point (3,) m moved along the axis to the height of the last one: its own height is not known."""
        return np.asarray(point + ((self._point - point) @ axis) * axis)

    def placed(self, points: Array, axes: Array, cutting: Bools) -> tuple[Array, Array, float]:
        """Points (n, 3) m with all moves at their heights, the heights (k,) m, and the least height allowed, m.

        ``axes`` (n, 3), unit vectors; ``cutting`` (n,): moves at feed. A stated height must not be below a point at
        which a move at feed begins or ends.
        """
        points, raised = points.copy(), np.array(self.raised, dtype=np.int64)
        first, start, end = np.array(self.corners, dtype=np.int64).reshape(-1, 3).T
        moved = np.concatenate([raised, first, first + 1])
        fixed = np.ones(len(points), dtype=np.bool_)
        fixed[moved] = False
        at_feed = fixed & (cutting | np.append(cutting[1:], False))
        tools, which = np.unique(np.round(axes[moved], 9), axis=0, return_inverse=True)
        which = which.ravel()
        heights, least = np.empty(len(tools)), -np.inf
        for k, axis in enumerate(tools):
            if self.height is None:
                heights[k] = (points[fixed] @ axis).max() + CLEARANCE
                continue
            # Above it already, the tool does not go down to the height.
            heights[k] = max(self.height, (points[raised[which[: len(raised)] == k]] @ axis).max(initial=-np.inf))
            least = max(least, float((points[at_feed] @ axis).max(initial=-np.inf)))
        height = np.zeros(len(points))
        height[moved] = heights[which]
        up = height[raised] - np.einsum("ni,ni->n", points[raised], axes[raised])
        points[raised] += up[:, None] * axes[raised]
        for i, before, behind in zip(first, start, end, strict=True):
            # The point nearest to the middle of the way that is at the height along both axes.
            middle, A = 0.5 * (points[before] + points[behind]), axes[i : i + 2]
            points[i : i + 2] = middle + A.T @ np.linalg.solve(A @ A.T, height[i : i + 2] - A @ middle)
        return points, heights, least


def _turn(a: Array, b: Array) -> Iterator[Array]:
    """Unit axes (3,) from a to b, with one between where they are far apart; a alone where they are the same."""
    yield a
    cosine = float(a @ b)
    if cosine > TURNED:
        return
    if cosine < CORNER:
        between = a + b if cosine > -TURNED else np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        yield between / np.linalg.norm(between)
    yield b
