"""Rapid moves across the part below the height to which the tool was last drawn back: what shows without the part.

Looked at is where the joints of the program lead, all along each move. A retract is a rapid move up along the tool or
along z, or a way back at feed from a cut to where it was entered. From then on a rapid move that changes x or y, other
than along the tool, may not be below that height, along the tool axis in the part frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from machining.verification.courses import PIECES, Courses
from robots.arrays import Array, Bools, Integers


@dataclass(frozen=True)
class LowRapid:
    """Move ``move`` is at ``height`` m after ``share`` of it, below the last retract at ``retract`` m.

    ``beside``: where the move ends is not the fault of it, but that it does not go there straight.
    """

    move: int
    share: float
    height: float
    retract: float
    beside: bool


def low_rapids(courses: Courses, known: Bools, tolerance: float) -> Iterator[LowRapid]:
    """Rapid moves across and below the last retract, by more than ``tolerance`` m; the lowest of each source move.

    ``known`` (n,): points where the joints lead to the program's. A move between two others has no height to judge.
    """
    motions, points = courses.program.motions, courses.reached[:, :3, 3]
    rapid = motions.rapid & ~motions.changes
    rapid[:1] = False
    rows = np.flatnonzero(rapid)
    if not len(rows):
        return
    way = _ways(courses, rows)
    place = np.cumsum(rapid) - 1
    # Where the program begins, and where a tool comes from the changer, it has been drawn back to.
    fresh = np.append(0, np.flatnonzero(motions.changes))
    retract = entered = points[0]
    behind = 0
    for first, last in _groups(courses, rows):
        begun = int(fresh[np.searchsorted(fresh, first, side="right") - 1])
        if begun > behind:
            retract = entered = points[begun]
            behind = begun
        start, axis = points[first - 1], -courses.reached[first - 1, :3, 2]
        lowest = (points[behind:first] @ axis).min()
        if first - 1 > behind and (start - entered) @ axis > -tolerance and lowest < start @ axis - tolerance:
            retract = start
        samples, end = way[place[first] : place[last] + 1], points[last]
        height, level = samples @ axis, float(retract @ axis)
        along = not _across(end - start, axis, tolerance)
        if _across(samples - start, axis, tolerance) and height.min() < level - tolerance:
            k, piece = np.unravel_index(int(height.argmin()), height.shape)
            beside = _beside(points[first - 1 : last + 1], axis, level, along, tolerance)
            if known[first - 1] or known[last]:
                yield LowRapid(first + int(k), float(piece) / PIECES, float(height.min()), level, beside)
        elif not along:
            retract = end - max(0.0, float(end @ axis) - level) * axis
        if along and (end - start) @ axis > tolerance:
            retract = end
        entered, behind = end, last


def _across(steps: Array, axis: Array, tolerance: float) -> bool:
    """Whether any of steps (..., 3) m is off the tool axis and changes x or y."""
    off = steps - (steps @ axis)[..., None] * axis
    return bool(min(np.linalg.norm(off, axis=-1).max(), np.linalg.norm(steps[..., :2], axis=-1).max()) > tolerance)


def _ways(courses: Courses, moves: Integers) -> Array:
    """Tips (m, pieces + 1, 3) m in the part frame on moves (m,), at even shares from 0 to 1."""
    values, _ = courses.sampled(moves)
    frames = courses.frames(values.reshape(-1, values.shape[2]), np.repeat(moves, PIECES + 1))
    return np.asarray(frames[:, :3, 3].reshape(len(moves), PIECES + 1, 3))


def _groups(courses: Courses, rows: Integers) -> Iterator[tuple[int, int]]:
    """First and last of the rapid moves ``rows`` that one move of the source has become."""
    inserted = courses.program.inserted
    first = -1
    for k, move in enumerate(rows.tolist()):
        first = move if first < 0 else first
        if not inserted[move] or k + 1 == len(rows) or rows[k + 1] != move + 1:
            yield first, move
            first = -1


def _beside(points: Array, axis: Array, level: float, along: bool, tolerance: float) -> bool:
    """Whether only the last point put in is off the way between both ends of ``points`` (k, 3) m, and the way is free.

    Such a point makes all joints turn one way to a target. Joint motion without points put in is bent along the tool.
    """
    start, end = points[0], points[-1]
    way = (end - start) / np.linalg.norm(end - start)
    steps = points[1:-1] - start
    off = np.linalg.norm(steps - (steps @ way)[:, None] * way, axis=1) > tolerance
    if not along and min(start @ axis, end @ axis) < level - tolerance:
        return False
    return not off[:-1].any() and (bool(off[-1]) if len(off) else along)
