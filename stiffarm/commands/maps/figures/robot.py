"""The robot in a plane picture: outline and pale filling of its bodies in parallel projection, as vectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from scipy.spatial import ConvexHull, QhullError

from robots import ModelDescription, Robot
from robots.arrays import Array, Bools
from stiffarm.pages.robot_drawing import DrawnBody, draw_robot
from stiffarm.pages.style import INK

# Points on the outline of a body that are tested for lying inside another one.
_SAMPLES: Final = 240
_PALE: Final = "#FFFFFF"


def robot_outlines(description: ModelDescription, robot: Robot, pose: Array, right: Array, up: Array) -> list[Array]:
    """Convex polygons (k, 2) mm, counter-clockwise, of the robot's bodies seen against right x up.

    The bodies that :func:`stiffarm.pages.robot_drawing.draw_robot` makes are convex, and so are their shadows.
    """
    return [
        polygon for body in draw_robot(description, robot, pose) if (polygon := _shadow(body, right, up)) is not None
    ]


def _shadow(body: DrawnBody, right: Array, up: Array) -> Array | None:
    flat = np.asarray(body.mesh.vertices) @ np.stack([right, up], axis=1)
    try:
        return np.asarray(flat[ConvexHull(flat).vertices])
    except QhullError:  # seen edge on
        return None


def draw_outlines(ax: Axes, polygons: Sequence[Array], **look: Any) -> None:
    """Draw bodies as one shape: pale where the picture behind is to be seen through it, dark around it."""
    if not polygons:
        return
    corners = [np.vstack([p, p[:1]]) for p in polygons]
    codes = [[Path.MOVETO, *[Path.LINETO] * (len(p) - 2), Path.CLOSEPOLY] for p in corners]
    # All wound the same way round: one path that is filled once where bodies overlap.
    path = Path(np.concatenate(corners), np.concatenate(codes))
    ax.add_patch(PathPatch(path, facecolor=_PALE, edgecolor="none", alpha=0.45, zorder=3))
    style = {"color": INK, "linewidth": 1.0, "zorder": 3.2, "solid_capstyle": "round", **look}
    for k, own in enumerate(corners):
        line = _densified(own)
        hidden = np.zeros(len(line), dtype=bool)
        for other in [*polygons[:k], *polygons[k + 1 :]]:
            hidden |= inside(line, other)
        ax.plot(*np.where(hidden[:, None], np.nan, line).T, **style)


def _densified(closed: Array) -> Array:
    """Points along a closed line, evenly spaced, its corners among them."""
    steps = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    where = np.union1d(at, np.linspace(0.0, at[-1], _SAMPLES))
    return np.stack([np.interp(where, at, closed[:, i]) for i in (0, 1)], axis=1)


def inside(points: Array, polygon: Array) -> Bools:
    """Which points (n, 2) lie inside a convex counter-clockwise polygon (k, 2), its border left out."""
    start, way = polygon, np.roll(polygon, -1, axis=0) - polygon
    off = points[:, None] - start
    # Distance from each edge's line, to the left of it: inside.
    left = (way[:, 0] * off[..., 1] - way[:, 1] * off[..., 0]) / np.maximum(np.linalg.norm(way, axis=1), 1e-12)
    return np.asarray((left > 1e-6 * np.ptp(polygon, axis=0).max()).all(axis=1))
