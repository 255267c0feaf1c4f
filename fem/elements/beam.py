"""3-D Timoshenko beam elements: flexibility by quadrature along the element, so taper is exact statics.

The element's flexibility is the unit-load integral ``f = int b(x)^T D(x)^-1 b(x) dx`` with the exact
section forces ``b`` of a tip wrench and ``D = diag(EA, GA_y, GA_z, GJ, EI_y, EI_z)``; its 12x12 stiffness
is ``G f^-1 G^T`` with the equilibrium matrix ``G`` (Przemieniecki, Theory of Matrix Structural Analysis,
1968, ch. 5; force-based form: Spacone, Filippou, Taucer 1996). A prismatic element is exact at its nodes.
Valid for small displacements of straight beams with the shear centre on the axis; warping is free.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from meshes import BeamMesh, element_axes, section_properties
from robots.arrays import Array

# 1/EI of a linear taper is no polynomial; order 9 (five points) leaves 1e-9 at four elements a segment.
QUADRATURE_ORDER = 9


def element_flexibility(mesh: BeamMesh) -> Array:
    """Tip flexibility (m, 6, 6) of each element clamped at its first node, local axes."""
    length, _ = element_axes(mesh)
    s, weight = _quadrature()
    dimensions = mesh.dimensions[:, None, 0] * (1.0 - s)[None, :, None] + mesh.dimensions[:, None, 1] * s[None, :, None]
    p = section_properties(mesh.kind, dimensions, mesh.poissons_ratio)
    E, G = mesh.youngs_modulus, mesh.youngs_modulus / (2.0 * (1.0 + mesh.poissons_ratio))
    rigidity = np.stack([E * p.area, G * p.shear_y, G * p.shear_z, G * p.torsion, E * p.iyy, E * p.izz], axis=-1)
    b = _section_forces(length, s)
    return np.asarray(np.einsum("m,g,mgki,mgk,mgkj->mij", length, weight, b, 1.0 / rigidity, b, optimize=True))


def _quadrature() -> tuple[Array, Array]:
    """Gauss-Legendre points and weights on [0, 1] of one element."""
    points, weights = np.polynomial.legendre.leggauss((QUADRATURE_ORDER + 1) // 2)
    return (points + 1.0) / 2.0, weights / 2.0


def _section_forces(length: Array, s: Array) -> Array:
    """Section forces (m, g, 6, 6) at station s (0 root, 1 tip) from a unit wrench at the tip."""
    lever = length[:, None] * (1.0 - s)[None, :]
    b = np.broadcast_to(np.eye(6), (*lever.shape, 6, 6)).copy()
    b[..., 4, 2] = -lever
    b[..., 5, 1] = lever
    return b


def element_stiffness(mesh: BeamMesh) -> Array:
    """Element stiffness (m, 12, 12) in the body's axes; freedoms: node 1 (u, rotation), node 2."""
    length, R = element_axes(mesh)
    m = len(length)
    equilibrium = np.zeros((m, 12, 6))
    equilibrium[:, :6] = -np.eye(6)
    equilibrium[:, 4, 2] = length
    equilibrium[:, 5, 1] = -length
    equilibrium[:, 6:] = np.eye(6)
    K = equilibrium @ np.linalg.solve(element_flexibility(mesh), np.swapaxes(equilibrium, 1, 2))
    turn = np.zeros((m, 12, 12))
    for k in range(4):
        turn[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = R
    K = turn @ K @ np.swapaxes(turn, 1, 2)
    return np.asarray(0.5 * (K + np.swapaxes(K, 1, 2)))


def assemble(mesh: BeamMesh) -> sp.csc_array:
    """Stiffness of the whole free mesh, (6k, 6k), six freedoms a node (u, rotation)."""
    dofs = (6 * mesh.elements[:, :, None] + np.arange(6)).reshape(len(mesh.elements), 12)
    rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
    size = 6 * len(mesh.nodes)
    K = sp.coo_array((element_stiffness(mesh).ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
    return K.tocsc()
