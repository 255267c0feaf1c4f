"""Motions of an arm that leave the tool point where it is: a search along them for the pose with the best merit.

Peaks of a stiffness mostly stand at joint limits. So a trial that leaves the limits is not thrown away, it is brought
back onto them with the tool point held: the search slides along limits, and stops in their corners where it should.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robots import Robot
from robots.arrays import Array, Bools
from robots.inverse.axis_lines import axis_lines
from robots.kinematics import forward_kinematics, tool_position
from surrogate.maps.orientation import pattern

# Poses worked on at once: bounds memory, not the result.
BATCH = 20_000
# Rad of all joints together below which the search ends.
FINEST = 1e-3
# Corrections of the tool point after a step, and what counts as there (share of the arm's length).
CORRECTIONS, THERE = 8, 1e-11
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
) -> tuple[Array, Array]:
    """Climb from poses q (k, dof) rad with merits ``value`` (k,), each tool point held, to a peak nearby.

    Parameters
    ----------
    merit : poses (n, dof) -> (n,), large is good, -inf where a pose does not count
    point : (3,) m, the tool point in the flange frame
    step : rad, first step; halved where no direction helps, doubled (to at most ``step``) where one does
    rounds : at most
    hold_last : the last joint changes nothing and stays

    Returns
    -------
    q (k, dof) and merit (k,), none worse than given; all within limits, tool points held to 1e-11 of the arm's length
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
            trial, kept = brought_back(robot, (q[some] + move).reshape(-1, robot.dof), target[some], point, hold_last)
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
    _, J = _tip_and_jacobian(robot, q, point)
    if hold_last:
        J = J[:, :, :-1]
    _, _, Vt = np.linalg.svd(J)
    free = Vt[:, 3:]
    return np.asarray(np.pad(free, ((0, 0), (0, 0), (0, 1))) if hold_last else free)


def brought_back(
    robot: Robot, q: Array, target: Array, point: Array, hold_last: bool = False, *, corrections: int = CORRECTIONS
) -> tuple[Array, Bools]:
    """Bring poses q (t k, dof) onto limits and couplings with the tool points at ``target`` (k, 3) m, t times over.

    Returns
    -------
    q (t k, dof) rad, and whether that came about (t k,)
    """
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
        met = np.linalg.norm(miss, axis=1) < THERE
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
    return q, there & robot.reachable(q)


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
