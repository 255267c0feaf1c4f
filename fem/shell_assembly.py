"""Shell meshes as stiffness: element matrices by kind and the whole mesh's sparse matrix."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.shell_quad import quad_stiffness
from fem.shell_triangle import triangle_stiffness
from meshes.shell_mesh import ShellMesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def element_stiffness(mesh: ShellMesh) -> tuple[Array, Array]:
    """Stiffness of the triangles (m, 18, 18) and of the quads (q, 24, 24), body's axes; N/m, N, N m."""
    first_quad = len(mesh.triangles)
    material = (mesh.youngs_modulus, mesh.poissons_ratio)
    seam = beside_quads(mesh)
    return (
        triangle_stiffness(mesh.triangle_corners, *material, mesh.thickness[:first_quad], seam),
        quad_stiffness(mesh.quad_corners, *material, mesh.thickness[first_quad:]),
    )


def assemble_shell(mesh: ShellMesh) -> sp.csc_array:
    """Stiffness of the whole free mesh, (6k, 6k), six freedoms a node (u, rotation), body's axes."""
    pairs = zip(element_stiffness(mesh), (mesh.triangles, mesh.quads), strict=True)
    parts = [_scatter(K, elements) for K, elements in pairs]
    values, rows, columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    size = 6 * len(mesh.nodes)
    return sp.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()


def beside_quads(mesh: ShellMesh) -> NDArray[np.bool_]:
    """Which sides (m, 3) of the triangles are quads' sides too."""
    edges = np.sort(mesh.edges, axis=1)
    key = edges[:, 0] * np.int64(len(mesh.nodes)) + edges[:, 1]
    first_quad = 3 * len(mesh.triangles)
    return np.isin(key[:first_quad], key[first_quad:]).reshape(-1, 3)


def freedoms(nodes: Indices) -> Indices:
    """Numbers (..., 6) of the freedoms of nodes (...)."""
    return np.asarray(6 * np.asarray(nodes, dtype=np.int64)[..., None] + np.arange(6))


def _scatter(K: Array, elements: Indices) -> tuple[Array, NDArray[np.int32], NDArray[np.int32]]:
    """Values, rows and columns of element matrices (e, 6n, 6n) in the global one."""
    dofs = freedoms(elements).reshape(len(elements), 6 * elements.shape[1]).astype(np.int32)
    n = dofs.shape[1]
    return K.ravel(), np.repeat(dofs, n, axis=1).ravel(), np.tile(dofs, (1, n)).ravel()
