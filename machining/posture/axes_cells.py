"""The axes map by cell: which posture stands behind each, why it is barred, and what error the force leaves there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import fem
from machining.cell import Scene, clearance
from machining.posture.axes_map import AxesMap, Zone
from machining.stiffness.cartesian import translational
from machining.task import Task
from robots import Robot
from robots.arrays import Array, Integers

# Causes that are told apart; what is rarer stands together.
MOST_CAUSES = 14
# Distance within which the pair that is too near is looked for, m.
WITHIN = 0.2


@dataclass(frozen=True, eq=False)
class AxesCells:
    """A map with postures, n points and m angles.

    ``cause`` (n, m): place in ``causes`` of why a cell is barred, 0 where it is not. ``error`` (n, m) m: the surface
    error that a given force leaves at each cell, NaN without a posture; None without a force.
    """

    map: AxesMap
    cause: Integers
    causes: tuple[str, ...]
    error: Array | None


def causes_of(
    made: AxesMap, robot: Robot, scenes: Sequence[Scene], place: Integers, e: Array, table: float
) -> tuple[Integers, tuple[str, ...]]:
    """Why cells are barred: the joint beyond its limit, the two bodies too near, or the zone's name.

    Parameters
    ----------
    made : a map with postures
    scenes, place : bodies with each tool, none where collisions are not looked at; (n,) whose are there at each point
    e : (n, k) m, travels of the linear axes at the points
    table : rad
    """
    assert made.q is not None  # noqa: S101 - the map was made with postures
    said = np.full(made.zone.shape, "", dtype=object)
    for zone in (Zone.UNREACHABLE, Zone.SINGULAR, Zone.LIMITS, Zone.COLLISION):
        said[made.zone == zone] = zone.words
    known = np.isfinite(made.q).all(axis=-1)
    beyond = np.nonzero((made.zone == Zone.LIMITS) & known)
    said[beyond] = [f"limit of {name}" for name in _worst_limit(robot, made.q[beyond])]
    hit = np.nonzero((made.zone == Zone.COLLISION) & known)
    for number, scene in enumerate(scenes):
        rows = np.flatnonzero(place[hit[0]] == number)
        if not len(rows):
            continue
        here = hit[0][rows], hit[1][rows]
        seen = clearance(scene, made.q[here], e[here[0]], np.array([table]), within=WITHIN)
        pairs = [seen.nearest(i) for i in range(len(rows))]
        said[here] = [Zone.COLLISION.words if pair is None else f"{pair[0]} and {pair[1]} too near" for pair in pairs]
    # Numbers by how many cells there are of each.
    names, count = np.unique(said[said != ""].astype(str), return_counts=True)
    ordered = names[np.argsort(-count, kind="stable")].tolist()
    shown = ordered[:MOST_CAUSES]
    number_of = {name: k + 1 for k, name in enumerate(shown)}
    rest = len(shown) + 1
    code = np.array([0 if not name else number_of.get(name, rest) for name in said.ravel()], dtype=np.int64)
    return code.reshape(said.shape), ("", *shown, *(["barred for another reason"] if len(ordered) > len(shown) else []))


def _worst_limit(robot: Robot, q: Array) -> list[str]:
    """The joint or coupling (k,) that is farthest beyond its limit, or nearest to it, at poses q (k, dof) rad."""
    beyond = [np.maximum(robot.limits[:, 0] - q, q - robot.limits[:, 1])]
    names = [name.removesuffix("_deg") for name in robot.coordinates]
    for c in robot.couplings:
        value = c.offset + q @ c.factors
        beyond.append(np.maximum(c.lower - value, value - c.upper)[:, None])
        names.append(c.name)
    return [names[i] for i in np.concatenate(beyond, axis=1).argmax(axis=1)]


def errors_of(made: AxesMap, task: Task, arm: fem.ArmModel, force: Array, at: Array, known: Array) -> Array:
    """Surface error (n, m) m of every cell under a force (n, 3) N in base axes, NaN where there is no posture.

    Parameters
    ----------
    made : a map with postures
    at, known : postures (n, dof) rad along a course and the error (n,) m there. What else is in that error, bending of
        the tool and the depth of cut at rest, is the same for all angles, and more than 0 is material left in both
    """
    assert made.q is not None  # noqa: S101 - the map was made with postures

    def along(q: Array, point: Integers) -> Array:
        C = translational(arm, q, task.tip_at(point))
        return np.asarray(np.einsum("ka,kab,kb->k", task.normals[point], C, force[point]))

    rows = np.arange(len(at))
    there = along(at, rows)
    sign = 1.0 if float(there @ known) >= 0.0 else -1.0
    out = np.full(made.zone.shape, np.nan)
    cells = np.nonzero(np.isfinite(made.q).all(axis=-1))
    out[cells] = sign * along(made.q[cells], cells[0]) + (known - sign * there)[cells[0]]
    return out
