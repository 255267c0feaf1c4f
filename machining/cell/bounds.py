"""Lower bounds on the distance of two solids, for many poses at once: bounding spheres and oriented boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import trimesh

from machining.cell.solids import Solid
from robots.arrays import Array

# Has no type hints.
_bounds: Any = trimesh.bounds
# Axes across two edges that are nearly parallel have no direction worth the name (sine of the angle).
PARALLEL = 1e-6
# The bound is taken this much lower (m) than computed, so that rounding never lifts it over the distance.
MARGIN = 1e-9


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
    """Bounds of several solids in one."""
    return Bounds(*(np.stack([getattr(b, f.name) for b in bounds]) for f in fields(Bounds)))


def sphere_gaps(centre_a: Array, radius_a: Array, centre_b: Array, radius_b: Array) -> Array:
    """Distance (...,) of bounding spheres, negative where they overlap; centres (..., 3)."""
    between = centre_a - centre_b
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", between, between)) - radius_a - radius_b - MARGIN)


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
