"""Membrane of the flat quadrilateral facet: QM6 incompatible modes with stabilised drilling rotations.

The bilinear displacements get two incompatible modes a direction, ``1 - xi^2`` and ``1 - eta^2``, whose
gradients are taken with the Jacobian at the centre and scaled by ``det J0 / det J`` so that a constant
strain does no work on them (QM6: Taylor, Beresford and Wilson, Int. J. Numer. Meth. Eng. 10 (1976)
1211-1219, doi:10.1002/nme.1620100602). The rotation about the normal is tied to that of the displacement
field by ``gamma G int (theta_z - (v_x - u_y) / 2)^2 t dA`` (Hughes and Brezzi, Comput. Methods Appl. Mech.
Eng. 72 (1989) 105-121, doi:10.1016/0045-7825(89)90124-2). The rotation is that of the compatible part, as
in the source; it vanishes for a rigid rotation and for a constant strain with its own mean rotation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skfem import Basis

Array = NDArray[np.float64]

# In units of the shear modulus. The results hardly depend on it between 0.01 and 1; a small one leaves the
# in-plane bending of the incompatible modes alone, which bilinear drilling rotations would stiffen.
DRILLING_PENALTY = 0.1


def plane_stress(youngs_modulus: float, poissons_ratio: float) -> Array:
    """Plane-stress elasticity (3, 3), Pa, for strains ``(e_x, e_y, gamma_xy)``."""
    E, nu = youngs_modulus, poissons_ratio
    return E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])


def membrane_stiffness(
    basis: Basis, corners: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array
) -> Array:
    """Stiffness of the membrane and the drilling rotations in the facet's axes.

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
    array (e, 12, 12)
        Freedoms ``(u, v, theta_z)`` of each node; N/m, N, N m.
    """
    grad = np.stack([shape[0].grad for shape in basis.basis])  # (4, 2, e, g)
    weight = basis.dx * thickness[:, None]
    D = plane_stress(youngs_modulus, poissons_ratio)

    B = np.concatenate([_strain(grad), _strain(_incompatible_gradients(basis, corners))], axis=-1)  # 8 + 4 freedoms
    K = np.einsum("eg,egki,kl,eglj->eij", weight, B, D, B, optimize=True)
    coupling = K[:, :8, 8:]
    condensed = K[:, :8, :8] - coupling @ np.linalg.solve(K[:, 8:, 8:], np.swapaxes(coupling, 1, 2))

    penalty = DRILLING_PENALTY * D[2, 2]
    excess = _drilling_excess(basis, grad)
    out = np.asarray(np.einsum("eg,egi,egj->eij", penalty * weight, excess, excess, optimize=True))
    displacements = np.array([0, 1, 3, 4, 6, 7, 9, 10])
    out[:, displacements[:, None], displacements] += condensed
    return out


def _strain(grad: Array) -> Array:
    """Strain (e, g, 3, 2n) of n functions with gradients (n, 2, e, g); freedoms u1, v1, u2, v2, ..."""
    n, _, e, g = grad.shape
    x, y = np.moveaxis(grad, (1, 0), (0, 3))
    B = np.zeros((e, g, 3, 2 * n))
    B[:, :, 0, 0::2] = B[:, :, 2, 1::2] = x
    B[:, :, 1, 1::2] = B[:, :, 2, 0::2] = y
    return B


def _incompatible_gradients(basis: Basis, corners: Array) -> Array:
    """Gradients (2, 2, e, g) of ``-(1 - xi^2) / 2`` and ``-(1 - eta^2) / 2`` with the centre's Jacobian."""
    a, b, c, d = np.moveaxis(corners, 1, 0)
    centre = 0.25 * np.stack([b + c - a - d, c + d - a - b], axis=2)  # d(x, y) / d(xi, eta)
    # quadrature weights belong to the unit square, whose Jacobian is four times that of (-1, 1)^2
    scale = 4.0 * np.linalg.det(centre)[:, None] * basis.W / basis.dx
    xi = 2.0 * basis.X - 1.0
    modes = np.stack([np.stack([xi[0], 0.0 * xi[0]]), np.stack([0.0 * xi[1], xi[1]])])  # (mode, axis, g)
    return np.asarray(np.einsum("eg,eab,mag->mbeg", scale, np.linalg.inv(centre), modes))


def _drilling_excess(basis: Basis, grad: Array) -> Array:
    """Drilling rotation less the rotation of the displacements, (e, g, 12)."""
    value = np.stack([shape[0].value for shape in basis.basis])
    excess = np.empty((*basis.dx.shape, 12))
    excess[..., 0::3] = 0.5 * np.moveaxis(grad[:, 1], 0, -1)
    excess[..., 1::3] = -0.5 * np.moveaxis(grad[:, 0], 0, -1)
    excess[..., 2::3] = np.moveaxis(np.broadcast_to(value, (4, *basis.dx.shape)), 0, -1)
    return excess
