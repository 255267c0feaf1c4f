"""Motions of an arm that leave the tool point where it is: a search along them for the pose with the best merit.

Peaks of a stiffness mostly stand at joint limits. So a trial that leaves the limits is not thrown away, it is brought
back onto them with the tool point held: the search slides along limits, and stops in their corners where it should.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from robots import Robot
from robots.arrays import Array, Bools
from robots.inverse.axis_lines import axis_lines
from robots.kinematics import forward_kinematics, tool_position
from robots.threads import compiled_loops, plain
from surrogate.maps.orientation import pattern

if TYPE_CHECKING:
    from surrogate.maps.kernels import Limbs

# None where numba is not there.
loops = partial(compiled_loops, "surrogate.maps.kernels")
# Poses worked on at once: bounds memory, not the result.
BATCH = 100_000
# Rad of all joints together below which the search ends.
FINEST = 1e-3
# Corrections of the tool point after a step, and what counts as there (share of the arm's length); on the way, where a
# pose is not yet a result, 0.2 um of 2 m will do.
CORRECTIONS, THERE, NEARLY_THERE = 8, 1e-11, 1e-7
# Rad of one correction at most.
LONGEST = 0.5
# Added to the diagonal of J J^T (its lengths over the arm's): next to singular poses steps stay bounded.
DAMPING = 1e-9


def improve(
    robot: Robot,
    merit: Callable[[Array], Array],
    q: Array,
    value: Array,
    point: Array,
    *,
    step: float = 0.2,
    rounds: int = 32,
    hold_last: bool = False,
    near: float = THERE,
) -> tuple[Array, Array]:
    """Climb from poses q (k, dof) rad with merits ``value`` (k,), each tool point held, to a peak nearby.

    Parameters
    ----------
    merit : poses (n, dof) -> (n,), large is good, -inf where a pose does not count
    point : (3,) m, the tool point in the flange frame
    step : rad, first step; halved where no direction helps, doubled (to at most ``step``) where one does
    rounds : at most
    hold_last : the last joint changes nothing and stays
    near : share of the arm's length that the tool point may be off after a step

    Returns
    -------
    q (k, dof) and merit (k,), none worse than given; all within limits, tool points held to ``near``
    """
    q, value = q.copy(), value.copy()
    size, last = np.full(len(q), step), np.zeros_like(q)
    target = tool_position(robot, forward_kinematics(robot, q), point) if len(q) else np.zeros((0, 3))
    for turn in range(rounds):
        rows = np.flatnonzero(size > FINEST)
        if not len(rows):
            break
        tries = pattern(turn, tilts_only=hold_last)
        for some in np.array_split(rows, -(-len(rows) * (len(tries) + 1) // BATCH)):
            free = self_motions(robot, q[some], point, hold_last)
            # (t, k, dof): directions of the pattern are mixes of the free motions; then the last way that helped.
            move = np.einsum("tf,kfj->tkj", tries[:, : free.shape[1]], free) * size[some, None]
            move = np.concatenate([move, last[None, some]])
            trial, kept = brought_back(
                robot, (q[some] + move).reshape(-1, robot.dof), target[some], point, hold_last, near=near
            )
            flat = np.full(len(trial), -np.inf)
            if kept.any():
                flat[kept] = merit(trial[kept])
            found, trial = flat.reshape(len(move), -1), trial.reshape(len(move), -1, robot.dof)
            best, column = found.argmax(axis=0), np.arange(len(some))
            better = found[best, column] > value[some]
            chosen = trial[best, column]
            # Ridges are climbed along, not from side to side: what two steps came to is tried again, and longer.
            last[some] = np.where(better[:, None], chosen - q[some] + 0.5 * last[some], 0.0)
            q[some[better]], value[some[better]] = chosen[better], found[best, column][better]
            size[some] = np.where(better, np.minimum(2.0 * size[some], step), 0.5 * size[some])
    return q, value


def self_motions(robot: Robot, q: Array, point: Array, hold_last: bool = False) -> Array:
    """Orthonormal directions (k, f, dof) of joint motion that leave the tool point at rest to first order."""
    compiled, free = loops(), robot.dof - hold_last
    if compiled is not None and free > 3:
        out = np.empty((len(q), free - 3, robot.dof))
        compiled.self_motions(_limbs(compiled, robot, point, hold_last), plain(q), out)
        return out
    _, J = _tip_and_jacobian(robot, q, point)
    _, _, Vt = np.linalg.svd(J[:, :, :free])
    return np.asarray(np.pad(Vt[:, 3:], ((0, 0), (0, 0), (0, robot.dof - free))))


def brought_back(
    robot: Robot,
    q: Array,
    target: Array,
    point: Array,
    hold_last: bool = False,
    *,
    corrections: int = CORRECTIONS,
    near: float = THERE,
) -> tuple[Array, Bools]:
    """Bring poses q (t k, dof) onto limits and couplings with the tool points at ``target`` (k, 3) m, t times over.

    By compiled loops where numba is there; numpy does the same otherwise.

    Returns
    -------
    q (t k, dof) rad, and whether that came about (t k,)
    """
    compiled = loops()
    if compiled is None:
        q, there = _brought_back(robot, q, target, point, hold_last, corrections, near)
    else:
        q, found = np.array(q, dtype=np.float64), np.zeros(len(q))
        arm = _limbs(compiled, robot, point, hold_last)
        compiled.brought_back(arm, q, plain(target), corrections, near, DAMPING, LONGEST, found)
        there = found > 0.0
    return q, there & robot.reachable(q)


def _limbs(compiled: ModuleType, robot: Robot, point: Array, hold_last: bool) -> Limbs:
    """The arm as the compiled loops take it."""
    chain, R = np.zeros((robot.dof + 1, compiled.COLUMNS)), np.eye(3)
    for i in range(robot.dof):
        pre = robot.T_pre[i]
        chain[i, : compiled.SHIFT], chain[i, compiled.SHIFT :] = (R @ pre[:3, :3]).ravel(), R @ pre[:3, 3]
        R = robot.R_post[i]
    chain[-1, compiled.SHIFT :] = R @ (robot.T_last_flange[:3, :3] @ point + robot.T_last_flange[:3, 3])
    low, high = robot.limits.T
    ends = np.array([(c.offset, c.lower, c.upper) for c in robot.couplings], dtype=np.float64)
    limbs: Limbs = compiled.Limbs(
        chain=chain,
        sign=plain(robot.sign),
        offset=plain(robot.offset),
        low=plain(low),
        high=plain(high),
        factors=plain(np.array([c.factors for c in robot.couplings]).reshape(-1, robot.dof)),
        ends=ends.reshape(-1, 3),
        free=robot.dof - hold_last,
        length=axis_lines(robot).length,
    )
    return limbs


def _brought_back(
    robot: Robot, q: Array, target: Array, point: Array, hold_last: bool, corrections: int, near: float
) -> tuple[Array, Bools]:
    """:func:`brought_back` by numpy, without the last look at the limits."""
    low, high = robot.limits.T
    goal, length = np.tile(target, (len(q) // max(len(target), 1), 1)), axis_lines(robot).length
    q, there = q.copy(), np.zeros(len(q), dtype=np.bool_)
    running = np.arange(len(q))
    for turn in range(corrections + 1):
        here = q[running]
        held = (here <= low) | (here >= high)
        here = np.clip(here, low, high)
        if hold_last:
            held[:, -1] = True
        normals = _onto_couplings(robot, here, held)
        tip, J = _tip_and_jacobian(robot, here, point)
        miss = (goal[running] - tip) / length
        q[running] = here
        met = np.linalg.norm(miss, axis=1) < near
        there[running[met]] = True
        running, held, miss, here, J = (v[~met] for v in (running, held, miss, here, J))
        if turn == corrections or not len(running):
            break
        J = np.where(held[:, None], 0.0, J / length)
        for a in normals:
            a = a[~met]
            J = J - (J @ a[:, :, None]) * a[:, None]
        gain = np.linalg.solve(J @ J.swapaxes(1, 2) + DAMPING * np.eye(3), miss[..., None])
        # A joint that stands on an end is held for one correction at a time: it may leave the end again.
        step = (J.swapaxes(1, 2) @ gain)[..., 0]
        largest = np.abs(step).max(axis=1, keepdims=True)
        q[running] = here + step * np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))
    return q, there


def _tip_and_jacobian(robot: Robot, q: Array, point: Array) -> tuple[Array, Array]:
    """Tool point (k, 3) m, base frame, and how it moves with the joints (k, 3, dof), from one pass."""
    frames = forward_kinematics(robot, q)
    tip = tool_position(robot, frames, point)
    lever = tip[:, None, :] - frames.p[:, 1:]
    return tip, np.swapaxes(np.cross(frames.axis * robot.sign[None, :, None], lever), 1, 2)


def _onto_couplings(robot: Robot, q: Array, held: Bools) -> list[Array]:
    """Move q (n, dof) in place onto couplings that it breaks; unit normals (n, dof) of these, else zero."""
    normals = []
    for c in robot.couplings:
        value = c.offset + q @ c.factors
        over = np.maximum(value - c.upper, 0.0) - np.maximum(c.lower - value, 0.0)
        active = (value >= c.upper - 1e-12) | (value <= c.lower + 1e-12)
        a = np.where(held, 0.0, c.factors) * active[:, None]
        size = np.linalg.norm(a, axis=1, keepdims=True)
        unit = np.divide(a, size, out=np.zeros_like(a), where=size > 0.0)
        q -= np.divide(over[:, None], size, out=np.zeros_like(size), where=size > 0.0) * unit
        normals.append(unit)
    return normals
