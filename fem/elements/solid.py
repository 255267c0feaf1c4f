"""Quadratic tetrahedra: stiffness, stress and volume of the ten-noded element on scikit-fem's ``ElementTetP2``.

Isoparametric, so that edges may be curved; four points, which are exact where they are straight. Displacements only,
three freedoms a node.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.sparse as sp

from meshes.solid_mesh import SolidMesh
from robots import InputError
from robots.arrays import Array

# Elements at a time: their matrices take some 30 MB.
BLOCK = 2000
# Nodes of an element.
NODES = 10


@cache
def _reference(order: int) -> tuple[Array, Array, Array]:
    """Weights (p,), shapes (p, 10) and their gradients (p, 10, 3) at the points of a rule on the reference element."""
    # scikit-fem takes a second to load, and only solids need it here.
    import skfem

    points, weights = skfem.quadrature.get_quadrature(skfem.refdom.RefTet, order)
    element = skfem.ElementTetP2()
    values = [element.lbasis(points, i) for i in range(NODES)]
    return weights, np.stack([v for v, _ in values], axis=1), np.stack([g.T for _, g in values], axis=1)


def _gradients(mesh: SolidMesh, cells: slice, order: int) -> tuple[Array, Array]:
    """Gradients of the shapes (e, p, 10, 3), 1/m, and weights times the Jacobian (e, p), m^3.

    Raises
    ------
    InputError
        Elements that are turned inside out.
    """
    weights, _, slopes = _reference(order)
    corners = mesh.nodes[mesh.tetrahedra[cells]]
    jacobian = np.einsum("eni,pnj->epij", corners, slopes, optimize=True)
    volume = np.linalg.det(jacobian)
    if not (volume > 0.0).all():
        bad = int(np.flatnonzero(~(volume > 0.0).all(axis=1))[0])
        raise InputError(
            f"solid mesh {mesh.name}: {int((~(volume > 0.0).all(axis=1)).sum())} tetrahedra turned inside out or flat",
            code="L007",
            value=f"the first near {np.round(corners[bad].mean(axis=0), 4).tolist()} m",
            remedy="choose a smaller element size",
        )
    return np.asarray(slopes @ np.linalg.inv(jacobian)), np.asarray(weights * volume)


def solid_stiffness(mesh: SolidMesh, cells: slice = slice(None)) -> Array:
    """Stiffness (e, 30, 30) of the elements, three freedoms a node in turn, body's axes, N/m."""
    lame, shear = lame_constants(mesh.youngs_modulus, mesh.poissons_ratio)
    slopes, volume = _gradients(mesh, cells, 2)
    e, p = volume.shape
    flat = slopes.reshape(e, p, 3 * NODES)
    # G[a i, b j]: integral of the slope of shape a along i times that of shape b along j.
    G = np.swapaxes(flat * volume[:, :, None], 1, 2) @ flat
    by_node = G.reshape(e, NODES, 3, NODES, 3)
    K = lame * by_node + shear * by_node.swapaxes(2, 4)
    same = shear * np.einsum("eakbk->eab", by_node)
    for i in range(3):
        K[:, :, i, :, i] += same
    return np.asarray(K.reshape(e, 3 * NODES, 3 * NODES))


def assemble_solid(mesh: SolidMesh) -> sp.csc_array:
    """Stiffness of the whole free mesh (3k, 3k), three freedoms a node, body's axes."""
    k, cells = len(mesh.nodes), mesh.tetrahedra
    keys, place = np.unique(
        (k * np.repeat(cells, NODES, axis=1) + np.tile(cells, (1, NODES))).ravel(), return_inverse=True
    )
    sums = np.zeros((len(keys), 9))
    for first in range(0, len(cells), BLOCK):
        part = slice(first, first + BLOCK)
        K = solid_stiffness(mesh, part).reshape(-1, NODES, 3, NODES, 3).swapaxes(2, 3).reshape(-1, 9)
        at = place[NODES**2 * first : NODES**2 * first + len(K)]
        own, where = np.unique(at, return_inverse=True)
        gather = sp.csr_array((np.ones(len(at)), (where, np.arange(len(at)))), shape=(len(own), len(at)))
        sums[own] += np.asarray(gather @ K)
    starts = np.searchsorted(keys, k * np.arange(k + 1))
    blocks = sums.reshape(-1, 3, 3), (keys % k).astype(np.int32), starts.astype(np.int32)
    # Rows for columns: the matrix is symmetric, and this costs nothing.
    return sp.csc_array(sp.bsr_array(blocks, shape=(3 * k, 3 * k)).tocsr().T)


def solid_volume(mesh: SolidMesh) -> tuple[Array, Array]:
    """Volumes (e,) m^3 and centres (e, 3) m of the elements."""
    _, shapes, _ = _reference(2)
    _, volume = _gradients(mesh, slice(None), 2)
    points = np.einsum("pn,eni->epi", shapes, mesh.nodes[mesh.tetrahedra], optimize=True)
    total = volume.sum(axis=1)
    return np.asarray(total), np.asarray(np.einsum("ep,epi->ei", volume, points) / total[:, None])


def solid_energy(mesh: SolidMesh, displacement: Array) -> Array:
    """Strain energy (e,) J of the elements, from displacements (k, 3) m."""
    energy = []
    for first in range(0, len(mesh.tetrahedra), BLOCK):
        part = slice(first, first + BLOCK)
        u = displacement[mesh.tetrahedra[part]].reshape(-1, 3 * NODES)
        energy.append(0.5 * np.einsum("ei,eij,ej->e", u, solid_stiffness(mesh, part), u, optimize=True))
    return np.concatenate(energy)


def solid_stress(mesh: SolidMesh, displacement: Array) -> Array:
    """Stress (e, 3, 3) Pa in the middle of each element, from displacements (k, 3) m in the mesh's axes."""
    lame, shear = lame_constants(mesh.youngs_modulus, mesh.poissons_ratio)
    slopes, _ = _gradients(mesh, slice(None), 1)
    gradient = np.einsum("eni,enj->eij", displacement[mesh.tetrahedra], slopes[:, 0], optimize=True)
    strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
    volumetric = np.trace(strain, axis1=1, axis2=2)
    return np.asarray(2.0 * shear * strain + lame * volumetric[:, None, None] * np.eye(3))


def von_mises_solid(stress: Array) -> Array:
    """Von Mises stress (...) of stress tensors (..., 3, 3)."""
    deviator = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) / 3.0
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1))))


def lame_constants(youngs_modulus: float, poissons_ratio: float) -> tuple[float, float]:
    """Lame's first constant and the shear modulus, Pa."""
    shear = youngs_modulus / (2.0 * (1.0 + poissons_ratio))
    return 2.0 * shear * poissons_ratio / (1.0 - 2.0 * poissons_ratio), shear
