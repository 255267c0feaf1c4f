"""Straight bars of ten-noded tetrahedra, six to a box."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from meshes.solid_mesh import SolidMesh, with_middles


def bar(length: float, side: float, along: int, across: int, poissons_ratio: float = 0.3) -> SolidMesh:
    """Square bar along x from the origin, seats at both ends; 200 GPa."""
    counts = (along, across, across)
    axes = [np.linspace(0.0, length, along + 1), *[np.linspace(-0.5 * side, 0.5 * side, across + 1)] * 2]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    number = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    cells = []
    for order in permutations(range(3)):
        steps = np.zeros((4, 3), dtype=int)
        for k, axis in enumerate(order):
            steps[k + 1] = steps[k] + np.eye(3, dtype=int)[axis]
        corners = [number[tuple(slice(s, s + n) for s, n in zip(step, counts, strict=True))].ravel() for step in steps]
        cell = np.stack(corners, axis=1)
        # Odd orders of the axes are left-handed.
        cells.append(cell if np.linalg.det(np.eye(3)[list(order)]) > 0.0 else cell[:, [1, 0, 2, 3]])
    nodes, tetrahedra = with_middles(grid.reshape(-1, 3), np.concatenate(cells))
    ends = {name: np.flatnonzero(nodes[:, 0] == x) for name, x in (("root", 0.0), ("tip", length))}
    return SolidMesh("bar", nodes, tetrahedra, 2e11, poissons_ratio, ends)
