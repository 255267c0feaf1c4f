"""How long moves take, and the speeds and accelerations that the feed asks of each axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.verification.courses import PIECES, Courses, MovingAxes
from robots.arrays import Array, Bools, Integers, in_blocks

# Shorter ways of the tip (m) count as none: the feed says nothing about turning on the spot.
NO_WAY = 1e-9
# Moves that are sampled at once.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Timing:
    """Times and rates of n moves and a axes.

    Attributes
    ----------
    time : (n,) s, what the move takes; NaN where neither feed nor axis speeds say. Move 0 takes none
    asked : (n,) s, what the feed asks for; NaN for rapid moves and without a feed
    speed : (n, a) greatest rate at the asked time, rad/s or m/s; NaN where there is none
    acceleration : (n, a) greatest within the move's time, at feeds; NaN where times are not known
    corners : (m,) moves that begin at a corner asking for too much, ``corner_axis`` (m,) and ``corner_rate`` (m,)
    """

    time: Array
    asked: Array
    speed: Array
    acceleration: Array
    corners: Integers
    corner_axis: Integers
    corner_rate: Array

    @property
    def total(self) -> float:
        """Time of the whole program, s, without dwells; NaN if any move's is not known."""
        return float(self.time.sum())


def timing_of(courses: Courses, smoothing: float) -> Timing:
    """Times from the feed for cutting moves, from the axes' limits for rapid ones.

    A cutting move takes as long as the feed asks, or as long as the slowest axis needs at its greatest speed. A rapid
    move starts and ends at rest; every axis runs up, along and down at its greatest rates, and the slowest one sets
    the time. Where accelerations are not known the ramps are left out.

    Accelerations at feeds: the course of each axis is taken to be averaged over ``smoothing`` seconds, as controllers
    blend corners. Position is piecewise linear in time, so the acceleration is
    ``(v(t + smoothing / 2) - v(t - smoothing / 2)) / smoothing`` with v the unsmoothed speed. At rests (rapid moves,
    dwells, the start and the end) nothing is asked for: the controller ramps the whole path there, and all axes with
    it. Real controllers blend otherwise; this is a measure of corners, not their planner.
    """
    program, axes = courses.program, courses.axes
    motions, n = program.motions, program.n
    pieces = PIECES if courses.straight.any() else 1
    steps = np.zeros((n, pieces, axes.count))
    way = np.zeros(n)
    way[1:] = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)
    asked = np.where(motions.cutting & (way > NO_WAY), way / motions.feed, np.nan)
    time, speed = np.zeros(n), np.full((n, axes.count), np.nan)
    for rows in in_blocks(n, BLOCK):
        moves = np.arange(max(rows.start, 1), rows.stop)
        steps[moves] = np.diff(courses.sampled(moves, pieces)[0], axis=1)
        ways = np.abs(steps[rows])
        # The fastest piece sets the pace of a move at an even feed.
        permitted = _longest(pieces * ways.max(axis=1), axes.speed)
        own = np.where(motions.rapid[rows], _rapid(ways.sum(axis=1), axes), permitted)
        time[rows] = np.where(np.isnan(asked[rows]), own, np.fmax(asked[rows], permitted))
        with np.errstate(invalid="ignore"):
            speed[rows] = pieces * ways.max(axis=1) / asked[rows, None]
    time[:1] = 0.0
    acceleration, corner = _accelerations(courses, steps, time, smoothing)
    return Timing(time, asked, speed, acceleration, *corner)


def _longest(way: Array, rate: Array) -> Array:
    """Time (n,) of the slowest axis over ways (n, a); NaN where an axis without a known speed moves."""
    with np.errstate(invalid="ignore"):
        time = np.where(way > 0.0, np.where(np.isinf(rate), np.nan, way / rate), 0.0)
    return np.asarray(time.max(axis=1, initial=0.0))


def _rapid(way: Array, axes: MovingAxes) -> Array:
    """Time (n,) from rest to rest over ways (n, a): ramp, even speed, ramp, or two ramps."""
    v, a = axes.speed, axes.acceleration
    with np.errstate(invalid="ignore"):
        ramp = np.where(np.isinf(a), 0.0, v / a)
        time = np.where(way >= v * ramp, way / v + ramp, 2.0 * np.sqrt(way / a))
    return np.asarray(np.where(way > 0.0, np.where(np.isinf(v), np.nan, time), 0.0).max(axis=1, initial=0.0))


def _accelerations(
    courses: Courses, steps: Array, time: Array, smoothing: float
) -> tuple[Array, tuple[Integers, Integers, Array]]:
    """Greatest acceleration (n, a) of each move, and the corners that ask for too much."""
    n, _, count = steps.shape
    peak = np.full((n, count), np.nan)
    corners: dict[tuple[int, int], float] = {}
    motions, known = courses.program.motions, np.isfinite(time)
    if n > 1 and known[motions.cutting].any():
        # A move of unknown time is a rest so long that its neighbours do not meet.
        span = np.where(known, np.maximum(time, 1e-12), 2.0 * smoothing)
        starts = np.concatenate([[0.0], np.cumsum(span + motions.dwell)])
        for rows in in_blocks(n, BLOCK):
            # With the moves on either side that smoothing reaches.
            first = int(np.searchsorted(starts, starts[rows.start] - smoothing, side="right")) - 1
            last = int(np.searchsorted(starts, starts[rows.stop] + smoothing))
            around = slice(max(first, 0), min(last, n))
            top, found = _smoothed(courses, steps[around], span[around], known[around], around.start, rows, smoothing)
            peak[rows] = top
            for key, rate in found.items():
                corners[key] = max(corners.get(key, 0.0), rate)
        peak[~known] = np.nan
    keys = np.array(list(corners), dtype=np.int64).reshape(-1, 2)
    return peak, (keys[:, 0], keys[:, 1], np.array(list(corners.values())))


def _smoothed(
    courses: Courses, steps: Array, span: Array, known: Bools, first: int, wanted: slice, smoothing: float
) -> tuple[Array, dict[tuple[int, int], float]]:
    """Greatest acceleration (m, a) of the moves ``wanted``, and rates of corners by their move and axis.

    ``steps`` (k, pieces, a), ``span`` (k,) s and ``known`` (k,) of these moves and those around, from ``first`` on.
    """
    k, pieces, count = steps.shape
    motions, around = courses.program.motions, slice(first, first + k)
    still = motions.rapid[around] | ~known
    v = steps / (span / pieces)[:, None, None]
    v[still] = 0.0
    # Every move: its pieces, then its dwell if it has one.
    dwell = motions.dwell[around, None]
    length = np.concatenate([np.repeat(span[:, None] / pieces, pieces, axis=1), dwell], axis=1).ravel()
    v = np.concatenate([v, np.zeros((k, 1, count))], axis=1).reshape(-1, count)
    rest = np.ones((k, pieces + 1), dtype=np.bool_)
    rest[:, :pieces] = still[:, None]
    owner = first + np.repeat(np.arange(k), pieces + 1)
    real = length > 0.0
    length, v, owner, rest = length[real], v[real], owner[real], np.concatenate([[True], rest.ravel()[real], [True]])
    edge = np.concatenate([[0.0], np.cumsum(length)])
    # Speed on the piece before the first edge, between edges, and after the last.
    v = np.concatenate([np.zeros((1, count)), v, np.zeros((1, count))])
    change = np.unique(np.concatenate([edge - 0.5 * smoothing, edge + 0.5 * smoothing]))
    middle = 0.5 * (change[1:] + change[:-1])
    owner = np.append(owner, first + k - 1)
    move = owner[np.clip(np.searchsorted(edge, middle, side="right") - 1, 0, None)]
    inside = (move >= wanted.start) & (move < wanted.stop)
    middle, move = middle[inside], move[inside]
    ahead = np.searchsorted(edge, middle + 0.5 * smoothing, side="right")
    behind = np.searchsorted(edge, middle - 0.5 * smoothing, side="right")
    rate = np.abs(v[ahead] - v[behind]) / smoothing
    rate[rest[ahead] | rest[behind]] = 0.0
    top = np.zeros((wanted.stop - wanted.start, count))
    np.maximum.at(top, move - wanted.start, rate)
    corners: dict[tuple[int, int], float] = {}
    for row, axis in np.argwhere(rate > courses.axes.acceleration * (1.0 + 1e-6)):
        # Of the corners that the smoothing spans, the sharpest is to blame; it is where the next move begins.
        at = np.arange(behind[row], ahead[row])
        sharpest = int(at[np.argmax(np.abs(v[at + 1, axis] - v[at, axis]))])
        key = int(owner[sharpest]), int(axis)
        corners[key] = max(corners.get(key, 0.0), float(rate[row, axis]))
    return top, corners
