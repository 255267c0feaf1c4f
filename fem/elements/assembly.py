"""Meshes of links as stiffness: element matrices by kind and the whole mesh's sparse matrix."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fem.elements.quad import quad_stiffness
from fem.elements.solid import assemble_solid
from fem.elements.triangle import triangle_stiffness
from meshes.shell_mesh import ShellMesh
from meshes.solid_mesh import SolidMesh
from robots.arrays import Array, Bools, Integers


def assemble_link(mesh: ShellMesh | SolidMesh) -> tuple[sp.csc_array, Integers]:
    """Stiffness of the whole free mesh, and which of its 6k freedoms those of the matrix are."""
    every = freedoms(np.arange(len(mesh.nodes)))
    if isinstance(mesh, ShellMesh):
        return assemble_shell(mesh), every.ravel()
    return assemble_solid(mesh), every[:, :3].ravel()


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
    k = len(mesh.nodes)
    pairs = [_pairs(elements) for elements in (mesh.triangles, mesh.quads)]
    keys, place = np.unique(np.concatenate([k * row + column for row, column in pairs]), return_inverse=True)
    sums = np.zeros((len(keys), 36))
    ends = np.split(place, [len(pairs[0][0])])
    for K, at in zip(element_stiffness(mesh), ends, strict=True):
        if len(K):
            gather = sp.csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(keys), len(at)))
            sums += np.asarray(gather @ _blocks(K))
    starts = np.searchsorted(keys, k * np.arange(k + 1))
    blocks = sums.reshape(-1, 6, 6), (keys % k).astype(np.int32), starts.astype(np.int32)
    # Rows for columns: the matrix is symmetric, and this costs nothing.
    return sp.csc_array(sp.bsr_array(blocks, shape=(6 * k, 6 * k)).tocsr().T)


def beside_quads(mesh: ShellMesh) -> Bools:
    """Which sides (m, 3) of the triangles are quads' sides too."""
    edges = np.sort(mesh.edges, axis=1)
    key = edges[:, 0] * np.int64(len(mesh.nodes)) + edges[:, 1]
    first_quad = 3 * len(mesh.triangles)
    return np.isin(key[:first_quad], key[first_quad:]).reshape(-1, 3)


def freedoms(nodes: Integers) -> Integers:
    """Numbers (..., 6) of the freedoms of nodes (...)."""
    return np.asarray(6 * np.asarray(nodes, dtype=np.int64)[..., None] + np.arange(6))


def _pairs(elements: Integers) -> tuple[Integers, Integers]:
    """Nodes (e n n,) of the rows and of the columns of the blocks of elements (e, n)."""
    n = elements.shape[1]
    return np.repeat(elements, n, axis=1).ravel(), np.tile(elements, (1, n)).ravel()


def _blocks(K: Array) -> Array:
    """Blocks (e n n, 36) of element matrices (e, 6n, 6n), one a pair of nodes."""
    n = K.shape[1] // 6
    return np.asarray(np.swapaxes(K.reshape(len(K), n, 6, n, 6), 2, 3).reshape(-1, 36))
