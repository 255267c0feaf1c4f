"""From where a place in a cell is seen: the direction to the eye, and what stands in the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.arrays import Array, Bools, Integers

# Lines of sight that a view is judged by, a body.
RAYS = 24
# Directions tried, deg: aside of the arm first, of views that show as much the first is taken; then height over them.
TURNS = (-57.0, 57.0, -90.0, 90.0, -25.0, 25.0, -120.0, 120.0, -155.0, 155.0)
HEIGHTS = (27.0, 45.0, 12.0, 65.0)
# A view must show so much more than an earlier one to be taken instead.
BETTER = 0.1
# A body that hides more than this share of the lines of sight stands in the way.
IN_THE_WAY = 0.34


def dense(vertices: Array, triangles: Integers) -> Array:
    """Points (k, 3) all over triangles: corners, and a grid within each."""
    share = np.array([[i, j, 8 - i - j] for i in range(9) for j in range(9 - i)]) / 8.0
    return np.asarray((share @ vertices[triangles]).reshape(-1, 3))


def near_points(place: Array, points: Array, reach: float) -> Array:
    """At most :data:`RAYS` points of a body within ``reach`` m of a place, evenly chosen; the nearest if none is."""
    away = np.linalg.norm(points - place, axis=1)
    near = points[away < reach] if (away < reach).any() else points[np.argsort(away)[:RAYS]]
    return np.asarray(near[np.linspace(0, len(near) - 1, min(len(near), RAYS)).astype(int)])


def towards(base: Array, place: Array, seen: Sequence[Array], everything: Array) -> Array:
    """From a place to the eye, from above: the view that shows most of the body that it shows least of.

    Parameters
    ----------
    base : (3,) m, foot of the arm
    seen : points (k, 3) m of each body that must be seen
    everything : (t, 3, 3) m, corners of all triangles in the scene
    """
    ahead = place[:2] - base[:2]
    along = float(np.arctan2(ahead[1], ahead[0])) if np.linalg.norm(ahead) > 1e-6 else 0.0
    best, chosen = -1.0, np.array([0.0, -1.0, 0.5])
    for height in np.radians(HEIGHTS):
        for turn in np.radians(TURNS):
            level = np.array([np.cos(along + turn), np.sin(along + turn), 0.0])
            way = np.cos(height) * level + np.array([0.0, 0.0, np.sin(height)])
            shown = min((float(unhidden(points, way, everything).mean()) for points in seen), default=1.0)
            if shown > best + BETTER:
                best, chosen = shown, way
        # From higher up only what could not be seen from here.
        if best > 1.0 - BETTER:
            break
    return chosen


def in_the_way(points: Array, way: Array, bodies: Sequence[Array]) -> list[int]:
    """Numbers of the bodies (t, 3, 3) m that hide points (k, 3) from an eye far off along ``way``."""
    return [i for i, body in enumerate(bodies) if 1.0 - float(unhidden(points, way, body).mean()) > IN_THE_WAY]


def unhidden(points: Array, way: Array, triangles: Array) -> Bools:
    """Whether nothing stands between points (k, 3) and an eye far off along ``way`` (T. Moeller, B. Trumbore 1997)."""
    way = way / np.linalg.norm(way)
    # A step off the surface that a point is on.
    start = points + 1e-3 * way
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(way, v)
    volume = np.einsum("ti,ti->t", u, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = start[:, None] - a
        first = np.einsum("kti,ti->kt", r, p) / volume
        q = np.cross(r, u)
        second = q @ way / volume
        distance = np.einsum("kti,ti->kt", q, v) / volume
    hit = (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0) & (distance > 0.0)
    return np.asarray(~hit.any(axis=1))
