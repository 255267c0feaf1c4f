"""Arms with more than six joints: postures followed along frames, and moved through those that share a frame.

Such an arm reaches a frame in postures without number: its elbow can turn while the flange stands still. Postures that
are searched for anew at each frame lie anywhere on these curves, and no course leads through them. Here many are found
where a path begins and where it ends, and each is *followed* from frame to frame by the least joint motion.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Bools, Integers
from robots.frames import frames_between
from robots.inverse.axis_lines import axis_lines
from robots.inverse.branches import Reason
from robots.inverse.search import refine
from robots.inverse.turns import nearest_turn
from robots.kinematics import jacobian
from robots.robot import Robot

# Random starts at a frame: of many frames at once, and of few.
STARTS, MOST_STARTS = 48, 384
# A frame is at most this far (over the arm's length, plus rad) from the last one; longer ways are divided.
STRIDE = 0.04
# Frames farther apart than this are no path: what follows begins anew.
APART = 1.6
# Rad that a joint may move within a stride: more has jumped to another posture.
JUMP = 0.5
# Steps of least squares: from a stride away, and from anywhere.
FEW, MANY = 12, 40
# Rad from a limit within which postures are pushed off it, and by how much a stride at most.
ZONE, PUSH = 0.3, 0.04


def is_redundant(robot: Robot) -> bool:
    """Whether the arm reaches a frame in postures without number."""
    return robot.dof > 6


def self_motion(robot: Robot, q: Array) -> Array:
    """Direction (k, dof) in which joints at q (k, dof) rad move with the flange at rest; the fastest joint has 1.

    Of arms with eight joints or more, one of the directions. The sign has no meaning.
    """
    J = jacobian(robot, q, np.zeros(3))
    J[:, :3] /= axis_lines(robot).length
    along = np.linalg.svd(J)[2][:, -1]
    return np.asarray(along / np.abs(along).max(axis=1, keepdims=True))


def settled(robot: Robot, q: Array, T: Array) -> tuple[Array, Bools]:
    """Postures (k, dof) rad at frames (k, 4, 4), from those a stride away by the least motion, and which are there."""
    new, met = refine(robot, q, T, steps=FEW)
    return new, met & (np.abs(new - q).max(axis=1, initial=0.0) < JUMP)


def about(robot: Robot, q: Array, T: Array, offsets: Array) -> tuple[Array, NDArray[np.int8]]:
    """Postures (k, s, dof) rad at frames (k, 4, 4) next to q (k, dof): moved along the self-motion by offsets (s,) rad.

    With :class:`Reason` (k, s) of each; NaN where the frame is not reached.
    """
    k, s = len(q), len(offsets)
    start = q[:, None] + offsets[:, None] * self_motion(robot, q)[:, None]
    found, met = settled(robot, start.reshape(k * s, -1), np.repeat(T, s, axis=0))
    found[~met] = np.nan
    return found.reshape(k, s, -1), _reasons(robot, found).reshape(k, s)


def follow(robot: Robot, T: Array, generator: np.random.Generator, keep: int) -> tuple[Array, NDArray[np.int8]]:
    """Postures (n, m, keep, dof) rad at the frames (n, m, 4, 4) of m paths of n points, and :class:`Reason` of each.

    A column is a posture followed along its path, half of them from the path's end. Joints are not turned into their
    ranges by whole turns. A column that runs into a limit, or that the path leads away from, ends there; where fewer
    than half are left others are searched for.
    """
    n, half = len(T), keep - keep // 2
    if n == 1:
        parts = [_from_start(robot, T, generator, keep)]
    else:
        back = _from_start(robot, T[::-1], generator, keep // 2)
        parts = [_from_start(robot, T, generator, half), (back[0][::-1], back[1][::-1])]
    q, reason = (np.concatenate(both, axis=2) for both in zip(*parts, strict=True))
    return q, reason


def _from_start(robot: Robot, T: Array, generator: np.random.Generator, keep: int) -> tuple[Array, NDArray[np.int8]]:
    n, m = T.shape[:2]
    way = motion(robot, T)
    begins = way > APART
    knots = _knots(np.where(begins, 0.0, way).max(axis=1, initial=0.0), np.asarray(begins.any(axis=1)))
    q = np.full((n, m, keep, robot.dof), np.nan)
    reason = np.empty((n, m, keep), dtype=np.int8)
    now, reason[0] = starts(robot, T[0], generator, keep)
    q[0] = now
    for a, b in pairwise(knots.tolist()):
        fresh = begins[a]
        pieces = max(1, int(np.ceil(way[a:b].sum(axis=0)[~fresh].max(initial=0.0) / STRIDE))) if b == a + 1 else 1
        there = now
        for i in range(1, pieces + 1):
            frames = T[b] if i == pieces else frames_between(T[a], T[b], np.full(m, i / pieces))
            there = _moved(robot, there, frames)
        there[fresh] = np.nan
        reason[b] = _reasons(robot, there.reshape(-1, robot.dof)).reshape(m, keep)
        _fill(robot, q, reason, T, slice(a, b + 1), now, there)
        few = np.flatnonzero((reason[b] == Reason.FOUND).sum(axis=1) < (keep + 1) // 2)
        if len(few):
            others, why = starts(robot, T[b, few], generator, keep)
            lost = reason[b, few] != Reason.FOUND
            there[few] = np.where(lost[..., None], others, there[few])
            reason[b, few] = np.where(lost, why, reason[b, few])
        q[b] = now = there
    return q, reason


def motion(robot: Robot, T: Array) -> Array:
    """How far frames (n, ..., 4, 4) are from the last one, (n - 1, ...): way over the arm's length, plus the turn."""
    R = np.einsum("...ji,...jk->...ik", T[:-1, ..., :3, :3], T[1:, ..., :3, :3])
    # The chord, which small turns leave digits of.
    turn = 2.0 * np.arcsin(np.minimum(np.linalg.norm(R - np.eye(3), axis=(-2, -1)) / np.sqrt(8.0), 1.0))
    way = np.linalg.norm(np.diff(T[..., :3, 3], axis=0), axis=-1)
    return np.asarray(way / axis_lines(robot).length + turn)


def _knots(way: Array, alone: Bools) -> Integers:
    """Points (k,) at most a stride apart, or neighbours; both ends of segments that stand ``alone`` (n - 1,)."""
    knots, gone = [0], 0.0
    for i, (step, single) in enumerate(zip(way.tolist(), alone.tolist(), strict=True)):
        if i > knots[-1] and (gone + step > STRIDE or single):
            knots.append(i)
            gone = 0.0
        gone += step
        if single:
            knots.append(i + 1)
            gone = 0.0
    return np.unique([*knots, len(way)])


def starts(robot: Robot, T: Array, generator: np.random.Generator, keep: int) -> tuple[Array, NDArray[np.int8]]:
    """Postures (k, keep, dof) rad at frames (k, 4, 4), as far from one another as can be, and :class:`Reason` of each.

    Found from random starts: the first is the one nearest to the middle of the joints' ranges. NaN where there are
    fewer.
    """
    k, dof = len(T), robot.dof
    many = int(np.clip(8 * MOST_STARTS // k, STARTS, MOST_STARTS))
    lower, upper = np.clip(robot.limits, -np.pi, np.pi).T
    middle = robot.limits.mean(axis=1)
    q = generator.uniform(lower, upper, (k * many, dof))
    q, met = refine(robot, q, np.repeat(T, many, axis=0), steps=MANY)
    q, inside = nearest_turn(robot, q, middle)
    q, good = q.reshape(k, many, dof), (met & inside).reshape(k, many)
    found = np.full((k, keep, dof), np.nan)
    # Of frames that no start reached or that no limit allows.
    why = np.where(met.reshape(k, many).any(axis=1), Reason.LIMITS, Reason.NOT_FOUND)
    reason = np.repeat(np.asarray(why, dtype=np.int8)[:, None], keep, axis=1)
    rows, away = np.arange(k), np.where(good, -np.abs(q - middle).max(axis=2), -np.inf)
    nearest = np.full((k, many), np.inf)
    for place in range(keep):
        best = away.argmax(axis=1)
        has = good[rows, best] & (away[rows, best] != 0.0)
        found[has, place], reason[has, place] = q[rows, best][has], Reason.FOUND
        nearest = np.minimum(nearest, np.abs(q - q[rows, best][:, None]).max(axis=2))
        away = np.where(good, nearest, -np.inf)
    return found, reason


def _moved(robot: Robot, q: Array, T: Array) -> Array:
    """Postures q (m, s, dof) followed to frames (m, 4, 4), away from limits; NaN where that fails."""
    out = np.full_like(q, np.nan)
    alive = np.isfinite(q).all(axis=2)
    if alive.any():
        new, met = settled(robot, _off_limits(robot, q[alive]), T[np.nonzero(alive)[0]])
        new[~met] = np.nan
        out[alive] = new
    return out


def _off_limits(robot: Robot, q: Array) -> Array:
    """Postures q (k, dof) moved along their self-motion away from limits that are near."""
    turned, _ = nearest_turn(robot, q, robot.limits.mean(axis=1))
    lower, upper = robot.limits.T
    pull = np.maximum(0.0, 1.0 - (turned - lower) / ZONE) - np.maximum(0.0, 1.0 - (upper - turned) / ZONE)
    near = np.flatnonzero(pull.any(axis=1))
    out = q.copy()
    if len(near):
        along = self_motion(robot, q[near])
        size = PUSH * np.clip((along * pull[near]).sum(axis=1), -1.0, 1.0)
        out[near] += size[:, None] * along
    return out


def _fill(
    robot: Robot, q: Array, reason: NDArray[np.int8], T: Array, rows: slice, before: Array, behind: Array
) -> None:
    """Postures at the points between two knots, in place: settled from the straight way between theirs."""
    inside = slice(rows.start + 1, rows.stop - 1)
    many = inside.stop - inside.start
    if not many:
        return
    share = np.arange(1, many + 1)[:, None, None, None] / (many + 1)
    start = before + share * (behind - before)
    alive = np.isfinite(start).all(axis=3)
    new, met = settled(robot, start[alive], T[inside][np.nonzero(alive)[:2]])
    new[~met] = np.nan
    out = np.full_like(start, np.nan)
    out[alive] = new
    q[inside], reason[inside] = out, _reasons(robot, out.reshape(-1, robot.dof)).reshape(alive.shape)


def _reasons(robot: Robot, q: Array) -> NDArray[np.int8]:
    """:class:`Reason` (k,) of postures q (k, dof) rad, NaN where none was found."""
    there = np.isfinite(q).all(axis=1)
    out = np.where(there, np.int8(Reason.FOUND), np.int8(Reason.NOT_FOUND))
    if there.any():
        _, inside = nearest_turn(robot, q[there], robot.limits.mean(axis=1))
        out[np.flatnonzero(there)[~inside]] = Reason.LIMITS
    return np.asarray(out, dtype=np.int8)
