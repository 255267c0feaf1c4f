"""Continuous collision check of moves: intervals are divided until nothing can have happened inside them.

Conservative advancement (B. Mirtich, PhD thesis, Berkeley 1996; for articulated bodies: X. Zhang, S. Redon, M. Lee,
Y. Kim, ACM Trans. Graph. 26 (2007) 15, doi:10.1145/1276377.1276396), from both ends of an interval: where distances at
its ends are c0 and c1 and no two bodies move against each other by more than L in between, nothing comes nearer than
(c0 + c1 - L) / 2. L comes from :class:`MotionBound`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from machining.cell import Scene, clearance
from machining.cell.scene import Pair
from machining.verification.courses import Courses, MovingAxes
from robots import forward_kinematics
from robots.arrays import Array, Bools, Integers
from robots.progress import Progress, report_progress

# A distance less than the safety distance by no more than this (m) is equal to it: rounding of the kinematics.
EQUAL = 1e-9
# Added to distances from axes, m: they are differences of squares.
ROUNDING = 1e-6
# Poses whose bound is worked out at once.
AT_ONCE = 1024
# Moves whose intervals are held at once.
CHUNK = 512
# Straight moves are divided into this many intervals at once: their joints may go to and fro.
FIRST_PIECES = 4
# A part of a move so small that joints still far apart at its ends have jumped.
LEAST_SHARE = 1e-6
# A proof must leave this distance (m), so that rounding does not make one.
PROOF = 1e-9


@dataclass(frozen=True, eq=False)
class MotionBound:
    """Bound on relative motion in a scene; made by :func:`motion_bound`.

    ``corners`` (s, 8, 3) m: boxes around the arm's moving solids, in the frames ``frame`` (s,) they move with.
    ``moves`` (s, dof): whether a joint moves a solid. ``lever`` (s, dof) m: constant distance where a joint turns a
    solid about a point of the arm (crank and bar of a parallelogram), NaN where it turns it about its own axis.
    ``table_reach`` m: farthest point from the turntable's axis of what it carries.
    """

    scene: Scene
    axes: MovingAxes
    corners: Array
    frame: Integers
    moves: Bools
    lever: Array
    table_reach: float

    def __call__(self, start: Array, way: Array) -> Array:
        """Most (m,) m that any two bodies move against each other.

        While axis j goes the way ``way[:, j]``, a point at a distance r_j from it goes at most ``way_j max r_j``. On
        the way r_j grows by no more than the joints behind j move the point, so the bounds follow one another from
        the flange inward. Linear axes add their ways, the turntable its angle times its reach.

        Parameters
        ----------
        start : (m, a) coordinates at one end
        way : (m, a) how far each axis moves from there, to and fro added up, 0 or more
        """
        rows = range(0, len(start), AT_ONCE)
        parts = [self.solids(start[i : i + AT_ONCE], way[i : i + AT_ONCE]).max(axis=1, initial=0.0) for i in rows]
        dof, k = self.axes.dof, self.axes.travels
        bound = np.concatenate(parts) if parts else np.zeros(0)
        bound += way[:, dof : dof + k].sum(axis=1)
        if self.axes.count > dof + k:
            bound += way[:, -1] * self.table_reach
        return np.asarray(bound)

    def solids(self, start: Array, way: Array) -> Array:
        """Most (m, s) m that any point of each moving solid of the arm goes, as seen from the base."""
        q, way = start[:, : self.axes.dof], way[:, : self.axes.dof]
        R, p = self.scene.arm.frames(q)
        x = np.einsum("nsij,scj->nsci", R[:, self.frame], self.corners) + p[:, self.frame][:, :, None]
        kinematics = forward_kinematics(self.scene.arm.robot, q)
        axis, origin = np.ascontiguousarray(kinematics.axis), kinematics.p[:, 1:]
        total = np.zeros((len(q), len(self.frame)))
        for j in range(self.axes.dof - 1, -1, -1):
            r = x - origin[:, j, None, None]
            along = np.einsum("nsci,ni->nsc", r, axis[:, j])
            away = np.einsum("nsci,nsci->nsc", r, r) - along**2
            reach = np.sqrt(np.maximum(away, 0.0).max(axis=2)) + ROUNDING
            reach = np.where(np.isnan(self.lever[:, j]), reach, self.lever[:, j])
            total += self.moves[:, j] * way[:, j, None] * (reach + total)
        return total


def motion_bound(scene: Scene, axes: MovingAxes) -> MotionBound:
    """Bound for a scene; the arm's bodies are taken as the boxes around their solids."""
    arm, robot = scene.arm, scene.arm.robot
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    box = scene.bounds
    corners = box.middle[:, None] + np.einsum("sij,sj,cj->sci", box.R, box.half, signs)
    frame = scene.solid_frames
    moved = (frame > 0) & (frame < arm.count)
    joints = np.arange(robot.dof)
    moves = joints < frame[moved, None]
    lever = np.full(moves.shape, np.nan)
    para = robot.parallelogram
    if para is not None:
        # The crank turns with the driven joint's body about a point of another; the bar goes along without turning.
        own, driven = para.crank_about + 1, para.driven + 1
        for row, number in enumerate(frame[moved]):
            if number > arm.flange:
                moves[row] = joints < driven
                swung = (joints >= own) & (joints < driven)
                crank = number == arm.flange + 1
                far = np.linalg.norm(corners[moved][row], axis=1).max() if crank else np.linalg.norm(para.pin)
                lever[row, swung] = float(far)
    table_reach = 0.0
    table = scene.cell.turntable
    carried = np.flatnonzero(frame == arm.count + 1)
    if table is not None and len(carried):
        r = corners[carried].reshape(-1, 3) - table.point
        table_reach = float(np.linalg.norm(np.cross(r, table.axis), axis=1).max())
    return MotionBound(scene, axes, corners[moved], frame[moved], moves, lever, table_reach)


@dataclass(eq=False)
class Swept:
    """What a sweep found, for n moves; those that were not asked for have no figures (NaN, -1).

    Attributes
    ----------
    distance : (n,) m, least distance seen, at points and where intervals were divided; at most ``within``, -1 mm for
        overlap
    proven : (n,) m, distance that is kept all along the move; below 0 where nothing was proven
    names : pairs of bodies that were checked
    pair : (n,) place in ``names`` of the nearest pair, -1: none within
    hit, hit_pair : (n,) share of the move at which bodies overlap first, NaN: nowhere; and the pair
    low, low_pair : (n,) share at which the first distance below the safety was seen, and the pair
    unproven, lost : (n,) first share at which a touch could not be excluded, or the straight line was lost
    samples : poses whose distances were worked out
    within : m, distances beyond are not worked out
    safety : m, the distance that bodies were to keep
    """

    names: tuple[Pair, ...]
    safety: float
    within: float
    samples: int
    distance: Array
    proven: Array
    hit: Array
    low: Array
    unproven: Array
    lost: Array
    pair: Integers
    hit_pair: Integers
    low_pair: Integers

    def see(self, move: Integers, share: Array, distance: Array, pair: Integers) -> None:
        """Enter distances seen at shares of moves; several of one move may come at once."""
        # The earliest is written last.
        for i in np.argsort(-share, kind="stable"):
            m, d = move[i], distance[i]
            if not d >= self.distance[m]:
                self.distance[m], self.pair[m] = d, pair[i]
            if d < 0.0 and not share[i] >= self.hit[m]:
                self.hit[m], self.hit_pair[m] = share[i], pair[i]
            elif 0.0 <= d < self.safety - EQUAL and not share[i] >= self.low[m]:
                self.low[m], self.low_pair[m] = share[i], pair[i]


def together(parts: Sequence[Swept]) -> Swept:
    """Sweeps of different moves of one program, with different bodies, as one.

    ``parts``: at least one; of each move one of them has figures.
    """
    if len(parts) == 1:
        return parts[0]
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    out = replace(parts[0], names=names, samples=sum(part.samples for part in parts))
    for field in ("distance", "proven", "hit", "low", "unproven", "lost"):
        # Each move has figures in one part at most.
        stack = np.stack([getattr(part, field) for part in parts])
        setattr(out, field, np.fmin.reduce(stack))
    for field in ("pair", "hit_pair", "low_pair"):
        places = [np.array([names.index(name) for name in part.names] + [-1]) for part in parts]
        own = [place[getattr(part, field)] for place, part in zip(places, parts, strict=True)]
        setattr(out, field, np.max(own, axis=0))
    return out


class _Intervals(NamedTuple):
    """Intervals of moves: shares s, coordinates v and distances c at both ends."""

    move: Integers
    s0: Array
    s1: Array
    v0: Array
    v1: Array
    c0: Array
    c1: Array

    def take(self, rows: Integers | Bools) -> _Intervals:
        return _Intervals._make(part[rows] for part in self)

    def joined(self, other: _Intervals) -> _Intervals:
        return _Intervals._make(np.concatenate(parts) for parts in zip(self, other, strict=True))


def sweep(
    courses: Courses,
    scene: Scene,
    *,
    moves: Bools | None = None,
    safety: float = 0.0,
    resolution: float = 1e-3,
    horizon: float = 0.1,
    progress: Progress | None = None,
) -> Swept:
    """Look for overlaps and distances below ``safety`` on whole moves, not only at their points.

    Moves with all axes even are decided for certain. On straight moves the way of each joint inside an interval is
    taken from its middle with twice the second difference: sure for smooth motion, an estimate next to singularities.
    Intervals whose motion is down to ``resolution`` are left: what could still touch there is ``unproven``; distances
    are then known to be at most half the resolution below those seen.

    Parameters
    ----------
    moves : (n,) which to look at; None: all. Move 0 is the first point alone
    safety, resolution, horizon : m, as in :class:`machining.verification.Demands`
    progress : called with (moves done, moves)
    """
    n = courses.program.n
    wanted = np.flatnonzero(np.ones(n, dtype=np.bool_) if moves is None else moves)
    within = safety + horizon
    found = Swept(scene.names, safety, within, 0, *np.full((6, n), np.nan), *np.full((3, n), -1, dtype=np.int64))
    bound = motion_bound(scene, courses.axes)
    for start in range(0, len(wanted), CHUNK):
        _sweep_some(courses, bound, wanted[start : start + CHUNK], resolution, found)
        report_progress(progress, min(start + CHUNK, len(wanted)), len(wanted))
    found.proven = np.minimum(found.proven, found.distance)
    return found


def _sweep_some(courses: Courses, bound: MotionBound, moves: Integers, resolution: float, found: Swept) -> None:
    needed = np.unique(np.concatenate([moves, np.maximum(moves - 1, 0)]))
    values = courses.points[needed]
    distance, pair = _distances(courses, bound.scene, values, found)
    end = np.searchsorted(needed, moves)
    found.see(moves, np.ones(len(moves)), distance[end], pair[end])
    found.proven[moves] = distance[end]
    moving = moves > 0
    moves, end = moves[moving], end[moving]
    begin = np.searchsorted(needed, moves - 1)
    found.see(moves, np.zeros(len(moves)), distance[begin], pair[begin])
    zero = np.zeros(len(moves))
    open_ = _Intervals(moves, zero, zero + 1.0, values[begin], values[end], distance[begin], distance[end])
    for number in range(1, FIRST_PIECES):
        straight = courses.straight[open_.move] & (open_.s1 == 1.0)
        if straight.any():
            cut = (number / FIRST_PIECES) * np.ones(int(straight.sum()))
            open_ = open_.take(~straight).joined(_divided(courses, bound, open_.take(straight), cut, found))
    while len(open_.move):
        open_ = _undecided(courses, bound, open_, resolution, found)
        middle = 0.5 * (open_.s0 + open_.s1)
        open_ = _divided(courses, bound, open_, middle, found)


def _undecided(courses: Courses, bound: MotionBound, at: _Intervals, resolution: float, found: Swept) -> _Intervals:
    """Intervals that must be divided further; what is decided goes into ``found``."""
    # What follows a touch in the same move makes it no worse.
    at = at.take(~(at.s0 >= found.hit[at.move]))
    L = bound(at.v0, _way(courses, at))
    kept = np.minimum(0.5 * (at.c0 + at.c1 - L), np.minimum(at.c0, at.c1))
    target = np.where(np.isnan(found.low[at.move]), max(found.safety, PROOF), PROOF)
    proven, fine = kept >= target, resolution >= L
    # Where a distance first falls below the safety, the place is found to the resolution, as that of a touch is.
    falls = (at.c0 >= found.safety) & (at.c1 < found.safety) & (at.s1 <= found.low[at.move])
    closed = (proven & ~falls) | fine
    np.minimum.at(found.proven, at.move[closed], kept[closed])
    doubt = fine & (kept < PROOF) & (at.c1 >= 0.0)
    np.fmin.at(found.unproven, at.move[doubt], at.s0[doubt])
    lost = ~closed & (at.s1 - at.s0 < LEAST_SHARE)
    np.fmin.at(found.lost, at.move[lost], at.s0[lost])
    found.proven[at.move[lost]] = -np.inf
    return at.take(~closed & ~lost)


def _way(courses: Courses, at: _Intervals) -> Array:
    """How far each axis goes in an interval (m, a)."""
    way = np.abs(at.v1 - at.v0)
    rows = np.flatnonzero(courses.straight[at.move])
    if len(rows):
        part = at.take(rows)
        middle, _ = courses.at(part.move, 0.5 * (part.s0 + part.s1))
        bend = np.abs(part.v0 - 2.0 * middle + part.v1)
        way[rows] = np.abs(middle - part.v0) + np.abs(part.v1 - middle) + 2.0 * bend
    return way


def _divided(courses: Courses, bound: MotionBound, at: _Intervals, cut: Array, found: Swept) -> _Intervals:
    """Intervals parted at shares ``cut``."""
    if not len(at.move):
        return at
    v, followed = courses.at(at.move, cut)
    c, pair = _distances(courses, bound.scene, v, found)
    found.see(at.move, cut, c, pair)
    np.fmin.at(found.lost, at.move[~followed], cut[~followed])
    first = _Intervals(at.move, at.s0, cut, at.v0, v, at.c0, c)
    return first.joined(_Intervals(at.move, cut, at.s1, v, at.v1, c, at.c1))


def _distances(courses: Courses, scene: Scene, values: Array, found: Swept) -> tuple[Array, Integers]:
    q, travel, table = courses.axes.parts(values)
    seen = clearance(scene, q, travel, table, within=found.within)
    found.samples += len(values)
    return seen.distance, seen.pair
