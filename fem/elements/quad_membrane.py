"""Membrane of the flat quadrilateral facet: QM6 incompatible modes with stabilised drilling rotations.

The bilinear displacements get two incompatible modes a direction, ``1 - xi^2`` and ``1 - eta^2``, whose
gradients are taken with the Jacobian at the centre and scaled by ``det J0 / det J`` so that a constant
strain does no work on them (QM6: Taylor, Beresford and Wilson, Int. J. Numer. Meth. Eng. 10 (1976)
1211-1219, doi:10.1002/nme.1620100602). The rotation about the normal is tied to that of the displacement
field by ``gamma G int (theta_z - (v_x - u_y) / 2)^2 t dA`` (Hughes and Brezzi, Comput. Methods Appl. Mech.
Eng. 72 (1989) 105-121, doi:10.1016/0045-7825(89)90124-2).

The field's rotation includes that of the incompatible modes, so rectangles bend in their plane without
strain in the tie. With the bilinear part alone, a row of elements of aspect 2 bends 3 % too little, of aspect
5 15 %.
"""

from __future__ import annotations

import numpy as np
from skfem import Basis

from robots.arrays import Array, Integers

# In units of the shear modulus. With 0.01 the thick twisted beam stays 3 % too soft on every mesh; with 1 the
# hemisphere of 16 elements a side loses 2.5 %.
DRILLING_PENALTY = 0.1
DISPLACEMENTS = np.array([0, 1, 3, 4, 6, 7, 9, 10])
ROTATIONS = np.array([2, 5, 8, 11])
# Amplitudes of the incompatible modes, behind the freedoms of the nodes: two modes times (u, v).
MODES = np.arange(12, 16)


def plane_stress(youngs_modulus: float, poissons_ratio: float) -> Array:
    """Plane-stress elasticity (3, 3), Pa, for strains ``(e_x, e_y, gamma_xy)``."""
    E, nu = youngs_modulus, poissons_ratio
    return E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])


def membrane_rows(
    basis: Basis, corners: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array
) -> Array:
    """Weighted strains S of the membrane and the drilling tie in the facet's axes: the stiffness is ``S^T S``.

    Parameters
    ----------
    basis : Basis
        Bilinear, of the facets laid flat, with the 2x2 Gauss points.
    corners : array (e, 4, 2), m
        The same facets' corners.
    youngs_modulus, poissons_ratio : float
        Pa and 1.
    thickness : array (e,), m

    Returns
    -------
    array (e, 16, 12)
        Four strains at four points; freedoms ``(u, v, theta_z)`` of each node.
    """
    nodal = np.stack([shape[0].grad for shape in basis.basis])
    grad = np.concatenate([nodal, _incompatible_gradients(basis, corners)])
    value = np.stack([np.asarray(shape[0]) for shape in basis.basis])
    D = plane_stress(youngs_modulus, poissons_ratio)
    weight = np.sqrt(basis.dx * thickness[:, None])
    rows = np.concatenate(
        [
            _strain(weight * grad, np.asarray(np.linalg.cholesky(D).T, dtype=np.float64)),
            np.sqrt(DRILLING_PENALTY * D[2, 2]) * _drilling_excess(weight * grad, weight * value),
        ],
        axis=2,
    ).reshape(len(corners), 16, 16)
    # The modes take the amplitudes of least energy: least squares, by their normal equations.
    nodes, modes = rows[..., :12], rows[..., 12:]
    transposed = np.swapaxes(modes, 1, 2)
    return np.asarray(nodes - modes @ np.linalg.solve(transposed @ modes, transposed @ nodes))


def _incompatible_gradients(basis: Basis, corners: Array) -> Array:
    """Gradients (2, 2, e, g) of ``-(1 - xi^2) / 2`` and ``-(1 - eta^2) / 2`` with the centre's Jacobian."""
    a, b, c, d = np.moveaxis(corners, 1, 0)
    centre = 0.25 * np.stack([b + c - a - d, c + d - a - b], axis=2)  # d(x, y) / d(xi, eta)
    # The quadrature weights belong to the unit square, whose Jacobian is four times that of (-1, 1)^2.
    scale = 4.0 * np.linalg.det(centre)[:, None] * basis.W / basis.dx
    xi = 2.0 * basis.X - 1.0
    inverse = np.linalg.inv(centre)  # its rows are the gradients of xi and eta
    return np.asarray(np.einsum("eg,mg,emb->mbeg", scale, xi, inverse))


def _strain(grad: Array, root: Array) -> Array:
    """Root of the elasticity times the strain (e, g, 3, 16) of functions with gradients (6, 2, e, g).

    The functions are those of four nodes and two modes.
    """
    x, y = np.moveaxis(grad, (1, 0), (0, 3))
    u, v = _slots()
    B = np.zeros((*x.shape[:2], 3, 16))
    B[:, :, 0, u], B[:, :, 0, v] = root[0, 0] * x, root[0, 1] * y
    B[:, :, 1, v] = root[1, 1] * y
    B[:, :, 2, u], B[:, :, 2, v] = root[2, 2] * y, root[2, 2] * x
    return B


def _drilling_excess(grad: Array, value: Array) -> Array:
    """Drilling rotation less the rotation of the displacements, (e, g, 1, 16)."""
    x, y = np.moveaxis(grad, (1, 0), (0, 3))
    u, v = _slots()
    excess = np.zeros((*x.shape[:2], 1, 16))
    excess[:, :, 0, u] = 0.5 * y
    excess[:, :, 0, v] = -0.5 * x
    excess[:, :, 0, ROTATIONS] = np.moveaxis(value, 0, -1)
    return excess


def _slots() -> tuple[Integers, Integers]:
    """Where the six functions' amplitudes along x and y stand among the 16 freedoms."""
    slots = np.concatenate([DISPLACEMENTS, MODES])
    return slots[0::2], slots[1::2]
