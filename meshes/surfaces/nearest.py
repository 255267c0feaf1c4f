"""Nearest points on a triangle surface and on its sharp edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from scipy.spatial import KDTree

from robots.arrays import Array

# Has no type hints.
_triangles: Any = trimesh.triangles

# Of small triangles, the one nearest to a point is among so many whose middles are nearest.
CANDIDATES = 12


class NearestOn:
    """A surface to stay on: triangles (m, 3, 3) no larger than ``size`` m, and its sharp edges (s, 2, 3)."""

    def __init__(self, triangles: Array, edges: Array, size: float) -> None:
        self._triangles, self._segments, self._size = triangles, edges, size
        self._tree = KDTree(triangles.mean(axis=1))

    def nearest(self, points: Array) -> Array:
        """Nearest point on the surface (p, 3)."""
        count = min(CANDIDATES, len(self._triangles))
        near = self._tree.query(points, k=count)[1]
        on = _triangles.closest_point(self._triangles[near].reshape(-1, 3, 3), np.repeat(points, count, axis=0))
        return _nearest_of(points, np.asarray(on).reshape(-1, count, 3))

    def nearest_sharp(self, points: Array) -> Array:
        """Nearest point on the sharp edges, on the surface where none is near."""
        if not len(self._segments) or not len(points):
            return self.nearest(points) if len(points) else points
        start, way = self._segments[:, 0], self._segments[:, 1] - self._segments[:, 0]
        # Contours have edges of no length, where they pass through a grid point.
        squared = np.maximum((way**2).sum(axis=1), 1e-300)
        found = np.empty_like(points)
        for i in range(0, len(points), 256):  # keeps the table of points and segments small
            p = points[i : i + 256, None]
            share = np.clip(((p - start) * way).sum(axis=2) / squared, 0.0, 1.0)
            found[i : i + 256] = _nearest_of(p[:, 0], start + share[..., None] * way)
        far = np.linalg.norm(found - points, axis=1) > 0.5 * self._size
        found[far] = self.nearest(points[far])
        return found


def _nearest_of(points: Array, candidates: Array) -> Array:
    """The candidate (p, k, 3) nearest to each point (p, 3)."""
    best = np.argmin(((candidates - points[:, None]) ** 2).sum(axis=2), axis=1)
    return np.asarray(candidates[np.arange(len(points)), best])
