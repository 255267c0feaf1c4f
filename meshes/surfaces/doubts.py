"""What a surface does not show of its link: openings that were closed, and hulls in place of the real shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from meshes.shell_mesh import connected, sides
from robots.arrays import Array, Bools, Integers

# Has no type hints.
_intersections: Any = trimesh.intersections

# Elements that are off the original by more than this share of the size span an opening; those wider than so much (m)
# are worth a word.
OFF, LEAST_OPENING = 1.0, 0.1
# A convex surface fills its hull to this share; tubes and boxes do too, whose girth is even along them to within this.
CONVEX, EVEN = 0.985, 0.08
STATIONS = 15


@dataclass(frozen=True)
class Opening:
    """A closed opening: its width (m), its middle (3,) m, and the triangles (m,) that close it."""

    width: float
    middle: Array
    faces: Bools


def openings(nodes: Array, faces: Integers, off: Array, size: float, held: Integers) -> list[Opening]:
    """Openings wider than 100 mm that a mid-surface spans, the widest first; those at its rings are not meant.

    ``off`` (n,) m: by node, how far from the original; empty where that is not known. ``held``: nodes of the rings.
    """
    if not off.size:
        return []
    spans = (off[faces] > OFF * size).all(axis=1)
    if not spans.any():
        return []
    piece = connected(len(nodes), sides(faces[spans]))
    at_rings = set(piece[np.intersect1d(held, faces[spans])].tolist())
    found = []
    own = np.where(spans, piece[faces[:, 0]], -1)
    for one in np.unique(own[spans]):
        patch = own == one
        inside = np.unique(faces[patch])
        # From its middle to its rim, and as far to the other side.
        width = 2.0 * float(off[inside].max())
        if one not in at_rings and width >= LEAST_OPENING:
            found.append(Opening(width, nodes[inside].mean(axis=0), patch))
    return sorted(found, key=lambda opening: -opening.width)


def is_hull(nodes: Array, faces: Integers) -> bool:
    """Whether a closed surface is convex without being a plain tube or box: the hull of a link."""
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    if mesh.volume < CONVEX * mesh.convex_hull.volume:
        return False
    middle = nodes - nodes.mean(axis=0)
    axes = np.linalg.svd(middle[:: max(1, len(middle) // 4000)], full_matrices=False)[2]
    along = middle @ axes[0]
    places = along.min() + np.linspace(0.1, 0.9, STATIONS) * np.ptp(along)
    girths = [_girth(mesh, nodes.mean(axis=0), axes[0], float(place)) for place in places]
    return float(np.std(girths) / np.mean(girths)) > EVEN


def _girth(mesh: trimesh.Trimesh, middle: Array, axis: Array, place: float) -> float:
    """Perimeter (m) of the section at a place along an axis."""
    cut = np.asarray(_intersections.mesh_plane(mesh, axis, middle + place * axis))
    return float(np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1).sum()) if len(cut) else 0.0
