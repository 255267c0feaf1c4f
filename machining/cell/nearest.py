"""Where two bodies of a scene are nearest in one pose, or where and how far they reach into each other."""

from __future__ import annotations

from typing import NamedTuple

import fcl
import numpy as np

from machining.cell.cell import FLOOR
from machining.cell.scene import Pair, Scene
from machining.cell.separation import ExactSolid
from machining.cell.solids import Solid
from robots import InputError
from robots.arrays import Array, Bools

# Points a side of a triangle, looked at for the place of an overlap.
GRID = 6
_POINTS = fcl.DistanceRequest(enable_nearest_points=True)


class Nearest(NamedTuple):
    """Two bodies in one pose.

    ``gap`` m: their distance; where they overlap it is below 0, and a shift of ``-gap`` parts them (the least of the
    shifts along the normals of their hulls' faces). ``points`` (2, 3) m in the robot's base: the nearest point of each
    body, or twice the middle of the overlap.
    """

    gap: float
    points: Array


def nearest(scene: Scene, pair: Pair, q: Array, e: Array, table: float) -> Nearest:
    """Nearest points of two bodies of a scene, by name; one of them may be the floor.

    Parameters
    ----------
    q, e : (dof,) rad and (k,) m
    table : rad

    Raises
    ------
    InputError
        A name that no body has.
    """
    R, p = (x[0] for x in scene.frames(q[None], e[None], np.array([table])))
    if FLOOR in pair:
        found = min((_over_floor(scene, *one, R, p) for one in _solids(scene, _above(pair))), key=_gap)
        return found if pair[1] == FLOOR else Nearest(found.gap, found.points[::-1])
    pairs = ((a, b) for a in _solids(scene, pair[0]) for b in _solids(scene, pair[1]))
    return min((_of_solids(_Placed(*a, R, p), _Placed(*b, R, p)) for a, b in pairs), key=_gap)


def gaps(scene: Scene, pair: Pair, q: Array, e: Array, table: Array) -> Array:
    """Distances (n,) m of two bodies in n poses, below 0 where they overlap, as in :class:`Nearest`.

    Parameters as of :func:`nearest`, with one row a pose.
    """
    frames = zip(*scene.frames(q, e, table), strict=True)
    if FLOOR in pair:
        solids = _solids(scene, _above(pair))
        return np.array([min(_over_floor(scene, *one, R, p).gap for one in solids) for R, p in frames])
    first, second = (_solids(scene, name) for name in pair)
    return np.array(
        [min(_measured(_Placed(*a, R, p), _Placed(*b, R, p))[0] for a in first for b in second) for R, p in frames]
    )


class _Placed:
    """A solid in a pose."""

    def __init__(self, exact: ExactSolid, frame: int, R: Array, p: Array) -> None:
        self.exact, self.solid, self.R, self.p = exact, exact.solid, R[frame], p[frame]

    @property
    def nodes(self) -> Array:
        return np.asarray(self.solid.nodes @ self.R.T + self.p)


def _gap(found: Nearest) -> float:
    return found.gap


def _above(pair: Pair) -> str:
    return pair[0] if pair[1] == FLOOR else pair[1]


def _solids(scene: Scene, name: str) -> list[tuple[ExactSolid, int]]:
    """Solids of a body, each with the number of its frame."""
    out = [
        (solid, scene.members[i].frame)
        for solid, i in zip(scene.solids, scene.owner, strict=True)
        if scene.members[i].body.name == name
    ]
    if not out:
        raise InputError("body", code="K001", value=name, allowed=", ".join(m.body.name for m in scene.members))
    return out


def _over_floor(scene: Scene, exact: ExactSolid, frame: int, R: Array, p: Array) -> Nearest:
    """The lowest point of a solid, and the floor under it."""
    plane = scene.floor_plane(R[None], p[None])
    assert plane is not None  # noqa: S101 - a pair with the floor has one
    up, height = plane[0][0], float(plane[1][0])
    x = _Placed(exact, frame, R, p).nodes
    low = x[np.argmin(x @ up)] - exact.solid.radius * up
    gap = float(low @ up) - height
    return Nearest(gap, np.stack([low, low - gap * up]))


def _measured(a: _Placed, b: _Placed) -> tuple[float, Array | None]:
    """Distance or overlap of two solids; and nearest points (2, 3) of their cores, in the base, if those are apart."""
    rounding = a.solid.radius + b.solid.radius
    hulls = a.solid.convex and b.solid.convex
    first, second = (a.exact.fixed, b.exact.moving) if hulls else (a.exact.triangles[1], b.exact.triangles[0])
    # As everywhere the first stays in its own frame and the second is put where it stands in that.
    second.setTransform(fcl.Transform(a.R.T @ b.R, a.R.T @ (b.p - a.p)))
    found = fcl.DistanceResult()
    distance = float(fcl.distance(first, second, _POINTS, found))
    if distance > 0.0:
        return distance - rounding, np.stack(found.nearest_points) @ a.R.T + a.p
    x, y = a.nodes, b.nodes
    return -min(_shift(x, a.solid, y), _shift(y, b.solid, x)) - rounding, None


def _of_solids(a: _Placed, b: _Placed) -> Nearest:
    """Nearest points of two solids."""
    gap, points = _measured(a, b)
    if points is None:
        place = _middle_of_overlap(a.nodes, a.solid, b.nodes, b.solid)
        return Nearest(gap, np.stack([place, place]))
    x, y = points
    along = (y - x) / max(float(np.linalg.norm(y - x)), 1e-12)
    return Nearest(gap, np.stack([x + a.solid.radius * along, y - b.solid.radius * along]))


def _face_normals(x: Array, solid: Solid) -> Array:
    """Outward unit normals (m, 3) of a solid's faces, its nodes at x; faces without an area are left out."""
    a, b, c = np.moveaxis(x[solid.faces], 1, 0)
    n = np.cross(b - a, c - a)
    size = np.linalg.norm(n, axis=1)
    return np.asarray(n[size > 0.0] / size[size > 0.0, None])


def _shift(x: Array, solid: Solid, y: Array) -> float:
    """Least shift along a face's normal of one core that takes all of the other's nodes y (k, 3) out of it, m."""
    n = _face_normals(x, solid)
    if not len(n):
        return np.inf
    return float(((x @ n.T).max(axis=0) - (y @ n.T).min(axis=0)).min())


def _middle_of_overlap(x: Array, a: Solid, y: Array, b: Solid) -> Array:
    """Middle (3,) of those points of two surfaces that are in the other's hull; or of the nearest two."""
    points, others = _all_over(x, a), _all_over(y, b)
    shared = [p[_within(p, z, solid)] for p, z, solid in ((points, y, b), (others, x, a))]
    if sum(map(len, shared)):
        return np.asarray(np.concatenate(shared).mean(axis=0))
    gaps = np.linalg.norm(points[:, None] - others[None], axis=2)
    i, j = np.unravel_index(gaps.argmin(), gaps.shape)
    return np.asarray(0.5 * (points[i] + others[j]))


def _all_over(x: Array, solid: Solid) -> Array:
    """Points (k, 3) all over the faces of a solid, its nodes at x."""
    share = np.array([[i, j, GRID - i - j] for i in range(GRID + 1) for j in range(GRID + 1 - i)]) / GRID
    faces = solid.faces[:: max(1, len(solid.faces) // 200)]
    return np.asarray((share @ x[faces]).reshape(-1, 3))


def _within(points: Array, y: Array, solid: Solid) -> Bools:
    """Whether points (k, 3) are behind all faces of a solid, its nodes at y."""
    n = _face_normals(y, solid)
    if not len(n):
        return np.asarray(np.linalg.norm(points - y.mean(axis=0), axis=1) <= solid.radius)
    reach = (y @ n.T).max(axis=0) + solid.radius
    return np.asarray((points @ n.T <= reach + 1e-9).all(axis=1))
