"""Whole turns: which equivalents of a joint angle (360 deg apart) lie within limits, and the nearest of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from robots.arrays import Array, Bools, Integers, in_blocks
from robots.robot import LIMIT_TOLERANCE_RAD, Robot

TURN = 2.0 * np.pi
# Poses whose turns are tried at once.
BLOCK = 8_192


@dataclass(frozen=True)
class EquivalentPoses:
    """k poses within limits: the ``target`` (k,) and ``column`` (k,) each belongs to, and its ``q`` (k, dof) rad."""

    target: Integers
    column: Integers
    q: Array


def nearest_turn(robot: Robot, q: Array, near: Array) -> tuple[Array, Bools]:
    """Turn every joint by whole turns to the equivalent nearest to ``near`` that keeps all limits.

    Parameters
    ----------
    robot : limits and couplings are those of :meth:`robots.robot.Robot.reachable`
    q : (..., dof) rad, NaN where there is nothing to turn
    near : (..., dof) rad, broadcast to q

    Returns
    -------
    q : (..., dof) rad. Where no combination of turns is within limits, joints that can are within theirs.
    inside : (...) whether all limits and couplings are kept
    """
    turned = q - TURN * np.round((q - near) / TURN)
    lower, upper = robot.limits[:, 0] - LIMIT_TOLERANCE_RAD, robot.limits[:, 1] + LIMIT_TOLERANCE_RAD
    # The range is an interval, so the equivalent nearest to `near` in it is the first one met from outside.
    inwards = np.ceil(np.maximum(lower - turned, 0.0) / TURN) - np.ceil(np.maximum(turned - upper, 0.0) / TURN)
    inwards[np.isnan(inwards)] = 0.0
    back = turned + TURN * inwards
    np.copyto(turned, back, where=(back >= lower) & (back <= upper))
    inside = robot.reachable(turned.reshape(-1, robot.dof)).reshape(turned.shape[:-1])
    if robot.couplings and not inside.all():
        _turn_into_couplings(robot, turned, inside, np.broadcast_to(near, q.shape))
    return turned, inside


def _turn_into_couplings(robot: Robot, q: Array, inside: Bools, near: Array) -> None:
    """Other turns of the coupled joints, in place, where a coupling is broken by the nearest ones."""
    coupled = [j for j in range(robot.dof) if any(c.factors[j] != 0.0 for c in robot.couplings)]
    open_rows = ~inside
    best = np.full(inside.shape, np.inf)
    start = q.copy()
    for turns in _combinations(robot, coupled):
        if not np.any(turns):
            continue
        other = start[open_rows] + TURN * turns
        cost = ((other - near[open_rows]) ** 2).sum(axis=-1)
        better = robot.reachable(other) & (cost < best[open_rows])
        rows = tuple(index[better] for index in np.nonzero(open_rows))
        q[rows], best[rows], inside[rows] = other[better], cost[better], True


def every_turn(robot: Robot, q: Array) -> EquivalentPoses:
    """Every equivalent of k poses within limits and couplings; q (k, dof) rad. ``column`` is 0.

    Joints with ranges of less than a turn have one equivalent or none; +-360 deg has two, or three at its ends.
    """
    targets, poses = [np.zeros(0, dtype=np.int64)], [np.zeros((0, robot.dof))]
    # In blocks: what is tried is far more than what is kept.
    for rows in in_blocks(len(q), BLOCK):
        target, turned = _every_turn(robot, q[rows])
        targets.append(target + rows.start)
        poses.append(turned)
    target = np.concatenate(targets)
    return EquivalentPoses(target, np.zeros(len(target), dtype=np.int64), np.concatenate(poses))


def _every_turn(robot: Robot, q: Array) -> tuple[Integers, Array]:
    """Rows (s,) of q and their equivalents (s, dof) rad, a row's own side by side."""
    lower = robot.limits[:, 0] - LIMIT_TOLERANCE_RAD
    lowest = q + TURN * np.ceil((lower - q) / TURN)
    targets, poses = [], []
    for turns in _combinations(robot, range(robot.dof), both_ways=False):
        other = lowest + TURN * turns
        rows = np.flatnonzero(robot.reachable(other))
        targets.append(rows)
        poses.append(other[rows])
    target = np.concatenate(targets)
    order = np.argsort(target, kind="stable")
    return target[order], np.concatenate(poses)[order]


def _combinations(robot: Robot, joints: range | list[int], *, both_ways: bool = True) -> Iterator[Array]:
    """Whole turns (dof,) that can lie within the joints' ranges, from any equivalent or from the lowest on."""
    most = np.floor((np.diff(robot.limits, axis=1)[:, 0] + 2.0 * LIMIT_TOLERANCE_RAD) / TURN).astype(int)
    ranges = [range(-most[j] if both_ways else 0, most[j] + 1) if j in joints else range(1) for j in range(robot.dof)]
    for turns in product(*ranges):
        yield np.array(turns, dtype=np.float64)
