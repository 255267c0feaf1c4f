"""Exact distance of two solids, by FCL (J. Pan, S. Chitta, D. Manocha, ICRA 2012, doi:10.1109/ICRA.2012.6225337)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import fcl
import numpy as np
import trimesh

from machining.cell.solids import Solid, inside
from robots.arrays import Array

# What stands for the distance of two solids that overlap, m. Depths are not computed: FCL gives none for surfaces.
OVERLAP = -1e-3
# A distance of hulls counts if its witnesses prove it to this, m; else the triangles are asked.
PROVEN = 1e-7
_POINTS = fcl.DistanceRequest(enable_nearest_points=True)
_PLAIN = fcl.DistanceRequest()


@dataclass(frozen=True, eq=False)
class ExactSolid:
    """A solid as FCL holds it: its hull, and the triangles of its surface."""

    solid: Solid
    moving: Any = field(init=False)
    fixed: Any = field(init=False)

    def __post_init__(self) -> None:
        geometry = _hull(self.solid)
        object.__setattr__(self, "moving", fcl.CollisionObject(geometry))
        object.__setattr__(self, "fixed", fcl.CollisionObject(geometry))

    @cached_property
    def triangles(self) -> tuple[Any, Any]:
        """The surface as a tree of triangles: a moving and a fixed object."""
        model = fcl.BVHModel()
        model.beginModel(len(self.solid.nodes), len(self.solid.faces))
        model.addSubModel(self.solid.nodes, self.solid.faces)
        model.endModel()
        return fcl.CollisionObject(model), fcl.CollisionObject(model)


def exact_distance(a: ExactSolid, b: ExactSolid, R: Array, t: Array, below: float) -> float:
    """Distance (m) of two solids, :data:`OVERLAP` where they share a point; anything not under ``below`` is ``below``.

    Cores of convex solids are asked for their distance as hulls (GJK). That search can stop early: with aligned
    faces FCL 0.7 has been seen to answer 1 m too much. The hulls' gap along the line of its two nearest points is a
    proof from below; where the two differ, the triangles decide.
    Closed surfaces are first bounded by their hulls; where these overlap, a surface inside the other counts as an
    overlap too.

    Parameters
    ----------
    R, t : (3, 3) and (3,) m, frame of b in that of a
    below : distance that matters, m
    """
    rounding = a.solid.radius + b.solid.radius
    place = fcl.Transform(R, t)
    b.moving.setTransform(place)
    found = fcl.DistanceResult()
    distance = float(fcl.distance(a.fixed, b.moving, _POINTS, found))
    apart = distance > 0.0
    proven = _proven(a.solid.nodes, b.solid.nodes, R, t, found) if apart else 0.0
    if a.solid.convex and b.solid.convex:
        if not apart:
            return OVERLAP
        if distance - proven > PROVEN:
            distance = _surface_distance(a, b, place)
    else:
        if proven - rounding >= below:
            return below
        distance = _surface_distance(a, b, place)
        if not apart and distance > 0.0 and _one_inside(a.solid, b.solid, R, t):
            return OVERLAP
    if distance <= 0.0 or distance < rounding:
        return OVERLAP
    return min(distance - rounding, below)


def _surface_distance(a: ExactSolid, b: ExactSolid, place: Any) -> float:
    b.triangles[0].setTransform(place)
    return float(fcl.distance(a.triangles[1], b.triangles[0], _PLAIN, fcl.DistanceResult()))


def _proven(nodes_a: Array, nodes_b: Array, R: Array, t: Array, found: Any) -> float:
    """Gap (m) of the hulls along the line of FCL's nearest points: a lower bound on their distance."""
    line = np.subtract(found.nearest_points[1], found.nearest_points[0])
    length = float(np.sqrt(line @ line))
    if not length > 0.0:
        return 0.0
    n = line / length
    return float((nodes_b @ (n @ R)).min() + t @ n - (nodes_a @ n).max())


def _one_inside(a: Solid, b: Solid, R: Array, t: Array) -> bool:
    """Whether a connected surface of one solid is inside the other."""
    return any(inside(R @ seed + t, a) for seed in b.seeds) or any(inside(R.T @ (seed - t), b) for seed in a.seeds)


def _hull(solid: Solid) -> Any:
    nodes, faces = solid.nodes, solid.faces
    if not solid.convex:
        around = trimesh.convex.convex_hull(nodes)
        nodes, faces = np.asarray(around.vertices, dtype=np.float64), np.asarray(around.faces, dtype=np.int64)
    counted = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1)
    return fcl.Convex(nodes, len(faces), counted.ravel())
