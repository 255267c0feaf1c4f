"""What flat triangles and quads share: plane stress, how corners move in the facet's axes, stiffness from strains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robots.arrays import Array, in_blocks

# Elements worked on at a time: their arrays stay in the processor's cache.
BATCH = 2048


def plane_stress(youngs_modulus: float, poissons_ratio: float) -> Array:
    """Plane-stress matrix (3, 3) in Pa for the strains (xx, yy, gamma xy)."""
    nu = poissons_ratio
    shape = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    return np.asarray(youngs_modulus / (1.0 - nu**2) * shape)


def corner_motions(axes: Array) -> tuple[Array, Array]:
    """What a corner's six global freedoms move: (u, v, rz) and (w, rx, ry), (e, 3, 6) each, in axes (e, 3, 3), rows."""
    in_plane, out_of_plane = np.zeros((2, len(axes), 3, 6))
    in_plane[:, :2, :3], in_plane[:, 2, 3:] = axes[:, :2], axes[:, 2]
    out_of_plane[:, 0, :3], out_of_plane[:, 1:, 3:] = axes[:, 2], axes[:, :2]
    return in_plane, out_of_plane


def stiffness_from(rows: Callable[[slice], Array], count: int, size: int) -> Array:
    """Stiffness ``S^T S`` (count, size, size) from the weighted strains S (e, s, size) of some elements at a time."""
    K = np.empty((count, size, size))
    for part in in_blocks(count, BATCH):
        S = rows(part)
        np.matmul(np.swapaxes(S, 1, 2), S, out=K[part])
    return K
