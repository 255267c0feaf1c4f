"""Bending of the flat quadrilateral facet: MITC4 Reissner-Mindlin plate.

Curvatures come from bilinear rotations; the transverse shear strain is taken from the tangential shear at
the middle of each side and interpolated covariantly, which is what removes shear locking (Bathe and
Dvorkin, Int. J. Numer. Meth. Eng. 21 (1985) 367-383, doi:10.1002/nme.1620210213). That interpolation is the
lowest-order Nedelec element: the side's shear integral times the side's basis function.
"""

from __future__ import annotations

import numpy as np
from skfem import Basis

from fem.elements.quad_membrane import plane_stress
from robots.arrays import Array

SHEAR_FACTOR = 5.0 / 6.0
# Tangential integral of each Nedelec function along its side in the sense 0-1, 1-2, 2-3, 3-0 is +1 or -1;
# scikit-fem's last side runs 0-3, the direction used below. The nodes of a disconnected mesh ascend, so
# scikit-fem turns no side round.
SIDES = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
SIDE_SIGNS = np.array([-1.0, 1.0, -1.0, 1.0])


def bending_rows(
    basis: Basis,
    side_basis: Basis,
    corners: Array,
    youngs_modulus: float,
    poissons_ratio: float,
    thickness: Array,
) -> Array:
    """Weighted curvatures and shear strains S in the facet's axes: the stiffness is ``S^T S``.

    Parameters
    ----------
    basis, side_basis : Basis
        Bilinear and lowest-order Nedelec, of the facets laid flat, with the 2x2 Gauss points.
    corners : array (e, 4, 2), m
        The same facets' corners.
    youngs_modulus, poissons_ratio : float
        Pa and 1.
    thickness : array (e,), m

    Returns
    -------
    array (e, 20, 12)
        Three curvatures and two shears at four points; freedoms ``(w, theta_x, theta_y)`` of each node,
        rotations as vectors.
    """
    D = plane_stress(youngs_modulus, poissons_ratio)
    weight = np.sqrt(basis.dx * thickness[:, None])[:, :, None, None]
    bending = np.linalg.cholesky(D).T @ _curvature(basis)
    bending *= weight * (thickness / np.sqrt(12.0))[:, None, None, None]
    shear = np.sqrt(SHEAR_FACTOR * D[2, 2]) * weight * _assumed_shear(side_basis, corners)
    return np.concatenate([bending, shear], axis=2).reshape(len(corners), 20, 12)


def _curvature(basis: Basis) -> Array:
    """Curvature (e, g, 3, 12) of the normal's slopes ``(theta_y, -theta_x)``."""
    B = np.zeros((*basis.dx.shape, 3, 12))
    for node, shape in enumerate(basis.basis):
        x, y = shape[0].grad
        theta_x, theta_y = 3 * node + 1, 3 * node + 2
        B[:, :, 0, theta_y] = x
        B[:, :, 1, theta_x] = -y
        B[:, :, 2, theta_y] = y
        B[:, :, 2, theta_x] = -x
    return B


def _assumed_shear(side_basis: Basis, corners: Array) -> Array:
    """Transverse shear strain (e, g, 2, 12) of the sides' tangential shear."""
    integral = np.zeros((len(corners), 4, 12))
    for side, (a, b) in enumerate(SIDES):
        dx, dy = (corners[:, b] - corners[:, a]).T
        integral[:, side, 3 * a], integral[:, side, 3 * b] = -1.0, 1.0
        for node in (a, b):  # half the chord times the slope (theta_y, -theta_x)
            integral[:, side, 3 * node + 1] = -0.5 * dy
            integral[:, side, 3 * node + 2] = 0.5 * dx
    shapes = np.stack([s * np.asarray(shape[0]) for s, shape in zip(SIDE_SIGNS, side_basis.basis, strict=True)])
    e, g = side_basis.dx.shape
    return (np.moveaxis(shapes, (2, 3, 1), (0, 1, 2)).reshape(e, 2 * g, 4) @ integral).reshape(e, g, 2, 12)
