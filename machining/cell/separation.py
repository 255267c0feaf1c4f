"""Distance of two solids: lower bounds for many poses at once by spheres and oriented boxes, and exact by FCL.

FCL: J. Pan, S. Chitta, D. Manocha, ICRA 2012, doi:10.1109/ICRA.2012.6225337.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import fcl
import numpy as np
import trimesh

from machining.cell.solids import Solid, inside
from robots.arrays import Array

# Has no type hints.
_bounds: Any = trimesh.bounds
# Axes across two edges that are nearly parallel have no direction worth the name (sine of the angle).
PARALLEL = 1e-6
# The bound is taken this much lower (m) than computed, so that rounding never lifts it over the distance.
MARGIN = 1e-9
# What stands for the distance of two solids that overlap, m. Depths are not computed: FCL gives none for surfaces.
OVERLAP = -1e-3
# A distance of hulls counts if its witnesses prove it to this, m; else the triangles are asked.
PROVEN = 1e-7
_POINTS = fcl.DistanceRequest(enable_nearest_points=True)
_PLAIN = fcl.DistanceRequest()


@dataclass(frozen=True, eq=False)
class Bounds:
    """Spheres and boxes around solids (..., one each), in their bodies' frames.

    ``middle`` (..., 3) m of both; ``radius`` (...,) m of the sphere; ``R`` (..., 3, 3): the box's axes as columns;
    ``half`` (..., 3) m: its half sizes.
    """

    middle: Array
    radius: Array
    R: Array
    half: Array


def bounds_of(solid: Solid) -> Bounds:
    """Sphere and box around a solid; the box is the smallest found over the faces of the hull."""
    nodes = solid.nodes
    if len(nodes) < 4:
        x = nodes[-1] - nodes[0]
        length = float(np.linalg.norm(x))
        R = np.eye(3) if length == 0.0 else _axes_along(x / length)
        middle, half = 0.5 * (nodes[0] + nodes[-1]), np.array([0.5 * length, 0.0, 0.0])
    else:
        T, extents = _bounds.oriented_bounds(nodes)
        R = np.asarray(T[:3, :3].T, dtype=np.float64)
        middle, half = -R @ T[:3, 3], 0.5 * np.asarray(extents, dtype=np.float64)
    radius = float(np.linalg.norm(nodes - middle, axis=1).max())
    # The box is made to hold all nodes to the last digit.
    half = np.maximum(half, np.abs((nodes - middle) @ R).max(axis=0))
    return Bounds(middle, np.array(radius + solid.radius), R, half + solid.radius)


def stacked(bounds: Sequence[Bounds]) -> Bounds:
    """Bounds of several solids in one; there may be none."""
    if not bounds:
        return Bounds(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    return Bounds(*(np.stack([getattr(b, f.name) for b in bounds]) for f in fields(Bounds)))


def sphere_gaps(centre_a: Array, radius_a: Array, centre_b: Array, radius_b: Array) -> Array:
    """Distance (...,) of bounding spheres, negative where they overlap; centres (..., 3)."""
    between = centre_a - centre_b
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", between, between)) - radius_a - radius_b - MARGIN)


def segment_distance(a0: Array, a1: Array, b0: Array, b1: Array) -> Array:
    """Distance (m,) m of segments from a0 to a1 and from b0 to b1, all (m, 3) m; a segment may be a point.

    C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9: the nearest points of the two lines, clipped to one
    segment, then the nearest point to that on the other, and back.
    """
    u, v, r = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv = (np.einsum("mi,mi->m", x, y) for x, y in ((u, u), (v, v), (u, v)))
    ur, vr = np.einsum("mi,mi->m", u, r), np.einsum("mi,mi->m", v, r)

    def share(over: Array, under: Array) -> Array:
        # Of a point or of parallel lines any place does.
        return np.clip(np.divide(over, under, out=np.zeros_like(over), where=under > 0.0), 0.0, 1.0)

    s = share(uv * vr - ur * vv, uu * vv - uv * uv)
    t = share(uv * s + vr, vv)
    s = share(uv * t - ur, uu)
    apart = r + s[:, None] * u - t[:, None] * v
    return np.asarray(np.sqrt(np.einsum("mi,mi->m", apart, apart)))


def box_gaps(R: Array, t: Array, half_a: Array, half_b: Array) -> Array:
    """Lower bound (m,) m on the distance of boxes; negative says nothing.

    The gap on an axis between the boxes' shadows never exceeds their distance; the largest over the 15 axes of the
    separating axis theorem is taken (S. Gottschalk, M. Lin, D. Manocha, OBBTree, SIGGRAPH 1996,
    doi:10.1145/237170.237244).

    Parameters
    ----------
    R : (m, 3, 3) axes of box b in those of box a
    t : (m, 3) middle of box b in box a's frame, m
    half_a, half_b : (m, 3) half sizes, m
    """
    wide = np.abs(R)
    gap = (np.abs(t) - half_a - np.einsum("mij,mj->mi", wide, half_b)).max(axis=1)
    along_b = np.abs(np.einsum("mij,mi->mj", R, t)) - half_b - np.einsum("mij,mi->mj", wide, half_a)
    gap = np.maximum(gap, along_b.max(axis=1))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        # e_i x b has the components 0, -b_k, b_j; all three axes b of the other box at once.
        length = np.sqrt(R[:, j] ** 2 + R[:, k] ** 2)
        shadow = np.abs(t[:, k, None] * R[:, j] - t[:, j, None] * R[:, k])
        reach = half_a[:, j, None] * wide[:, k] + half_a[:, k, None] * wide[:, j]
        # |(e_i x b_c) . b_d| = |R[i, e]| with e the third axis beside c and d.
        other = wide[:, i]
        reach = reach + np.roll(half_b, -1, axis=1) * np.roll(other, -2, axis=1)
        reach += np.roll(half_b, -2, axis=1) * np.roll(other, -1, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.where(length > PARALLEL, (shadow - reach) / length, -np.inf)
        gap = np.maximum(gap, across.max(axis=1))
    return np.asarray(gap - MARGIN)


def _axes_along(x: Array) -> Array:
    y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


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
