"""Where the two bodies of an offence come nearest, or overlap most, during the moves it lasts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cell.nearest import gaps, nearest
from machining.verification.offences import Offence
from machining.verification.verify import Verification
from robots.arrays import Array, Integers

# Poses looked at over the moves, and again about the worst of them.
POSES = 17


@dataclass(frozen=True, eq=False)
class Contact:
    """The worst pose of an offence of two bodies.

    Attributes
    ----------
    move, at, line : the move, the share of it, and its line in the source
    values : (a,) coordinates of all axes
    gap : m, distance of the bodies; below 0 where they overlap, then a shift of ``-gap`` parts them
    points : (2, 3) m in the world, on the first body and on the second; twice the same where they overlap
    """

    move: int
    at: float
    line: int
    values: Array
    gap: float
    points: Array


def contact_of(found: Verification, offence: Offence, poses: int = POSES) -> Contact | None:
    """The worst pose of an offence; None where it is not about two bodies.

    It is the worst of ``poses`` over its moves and of as many about that one; 1: the pose in which it first shows.
    """
    if offence.bodies is None:
        return None
    at = np.linspace(_place(offence.move, offence.at), float(offence.last), poses)
    if poses > 1:
        best = int(_gaps(found, offence.bodies, at).argmin())
        at = np.linspace(at[max(best - 1, 0)], at[min(best + 1, poses - 1)], poses)
        at = at[_gaps(found, offence.bodies, at).argmin()][None]
    move, share = _move_at(at)
    values = found.courses.at(move, share)[0]
    q, travel, table = found.axes.parts(values)
    seen = nearest(found.scene_at(int(move[0])), offence.bodies, q[0], travel[0], float(table[0]))
    base = found.program.cell.T_world_base(travel)[0]
    points = seen.points @ base[:3, :3].T + base[:3, 3]
    line = int(found.program.motions.line[move[0]])
    return Contact(int(move[0]), float(share[0]), line, values[0], seen.gap, points)


def _place(move: int, at: float) -> float:
    """A share of a move as a place along the program, in points."""
    return max(move - 1 + at, 0.0) if move else 0.0


def _move_at(place: Array) -> tuple[Integers, Array]:
    """Moves and shares of places along the program."""
    move = np.ceil(place - 1e-12).astype(np.int64)
    return move, np.where(move > 0, place - (move - 1), 1.0)


def _gaps(found: Verification, bodies: tuple[str, str], places: Array) -> Array:
    """Distances of two bodies at places along the program, m."""
    move, share = _move_at(places)
    q, travel, table = found.axes.parts(found.courses.at(move, share)[0])
    out = np.full(len(move), np.inf)
    for rows, scene in found.by_scene(move):
        # A body of another tool is not there.
        if all(name in scene.body_names for name in bodies):
            out[rows] = gaps(scene, bodies, q[rows], travel[rows], table[rows])
    return out
