"""From a casing's skin to its mid-surface by moving the nodes; sharp edges stay sharp."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from meshes.surfaces.checks import SurfaceFault
from meshes.surfaces.remesh import normals, unit
from robots.arrays import Array, Bools, Integers

# Has no type hints.
_triangles: Any = trimesh.triangles

# Directions in which the faces around a node say less than this about the mid-surface are left alone.
LEAST_SHARE = 0.03
# No node moves further than this many half walls: a right-angled corner needs 1.73.
FARTHEST = 2.5


def offset_inward(name: str, nodes: Array, faces: Integers, depth: float) -> tuple[Array, int]:
    """Move nodes (n, 3) so that the planes of the faces around each move inward by ``depth`` m.

    Least squares over the faces, weighted by angle, so that sharp edges and corners keep the wall on all their
    sides. Nodes of elements that would fold move less; their number comes with the new nodes.

    Raises
    ------
    SurfaceFault
        Elements fold even so.
    """
    normal = unit(normals(nodes, faces))
    weight = _triangles.angles(nodes[faces])[:, :, None]
    matrix, side = np.zeros((len(nodes), 3, 3)), np.zeros((len(nodes), 3))
    np.add.at(matrix, faces, weight[..., None] * (normal[:, :, None] * normal[:, None, :])[:, None])
    np.add.at(side, faces, -depth * weight * normal[:, None])
    values, axes = np.linalg.eigh(matrix)
    inverse = np.where(values > LEAST_SHARE * values[:, -1:], 1.0 / np.maximum(values, 1e-300), 0.0)
    move = np.einsum("nij,nj,nkj,nk->ni", axes, inverse, axes, side)
    move *= np.minimum(1.0, FARTHEST * depth / np.maximum(np.linalg.norm(move, axis=1), 1e-300))[:, None]
    less = np.zeros(len(nodes), dtype=bool)
    for _ in range(5):
        folded = _folded(nodes, nodes + move, faces)
        if not folded.any():
            return nodes + move, int(less.sum())
        worst = np.unique(faces[folded])
        less[worst] = True
        move[worst] *= 0.5
    raise SurfaceFault(
        f"surface {name}: {int(folded.sum())} elements fold on the way to the mid-surface",
        value=f"inward by {depth:.4g} m",
        remedy="smooth sharp details, or choose a larger target size or a thinner wall",
    )


def _folded(before: Array, after: Array, faces: Integers) -> Bools:
    """Faces (m,) that turned by more than 60 deg or with an edge that all but vanished or turned round."""
    tilted = np.einsum("ij,ij->i", unit(normals(after, faces)), unit(normals(before, faces))) < 0.5
    old, new = (np.roll(nodes[faces], -1, axis=1) - nodes[faces] for nodes in (before, after))
    return np.asarray(tilted | ((old * new).sum(axis=2) < 0.1 * (old**2).sum(axis=2)).any(axis=1))
