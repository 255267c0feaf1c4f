"""Flat triangular shell element with six freedoms a node: OPT membrane and DKT bending.

Membrane: Felippa's optimal ANDES triangle with true drilling freedoms (C. A. Felippa and C. Militello,
Finite Elem. Anal. Des. 12, 1992, 189-201; C. A. Felippa, "A study of optimal membrane triangles with drilling
freedoms", CMAME 192, 2003, 2125-2168). Its stiffness is the basic part of a constant strain that passes the
patch test plus ``3/4 beta0`` times the higher-order part, the strains at the mid-sides due to the corner
rotations ``theta - theta0`` relative to the constant-strain triangle's. With ``alpha_b = 3/2`` and
``beta0 = (1 - 4 nu^2) / 2`` in-plane bending of a rectangle of two triangles is exact at any aspect ratio.

Bending: the discrete Kirchhoff triangle (J.-L. Batoz, K.-J. Bathe, L.-W. Ho, IJNME 15, 1980, 1771-1812):
fibre rotations quadratic in the element (scikit-fem's P2 basis), Kirchhoff's condition at the corners and,
along each side with a cubic deflection, at its middle.

Limits of validity: small displacements, linear elastic isotropic material, thin shells (no transverse shear:
its share is left out, some ``(t/span)^2``), facets without curvature, so membrane and bending couple only
through the angles between neighbours: a doubly curved, very thin shell (R/t of 250) needs a fine mesh. Near
``nu = 1/2`` beta0 would vanish; it is held at 0.01, as Felippa advises. At a fold a node has one rotation for two
walls, yet a wall in shear wants another drilling rotation than its neighbour's slope (they differ by half the shear
strain): torsion of a square tube is too stiff by up to 0.64 %, most where elements are as large as the wall is
thick (8 of 292 mm), less with either larger or smaller ones; docs/validation/shell_convergence_triangle.md.
"""

from __future__ import annotations

import numpy as np
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from fem.elements.facets import corner_motions, plane_stress, stiffness_from
from meshes.shell_mesh import refuse_bad_elements
from robots.arrays import Array, Bools

ALPHA_B = 1.5
BETA0_FLOOR = 0.01
# Felippa's beta 1 to 9 = 1, 2, 1, 0, 1, -1, -1, -1, -2, arranged for the natural strains of sides 01, 12, 20
# (rows) from the relative rotations of corners 0, 1, 2 (columns), at each corner.
_AT_CORNERS = np.array(
    [
        [[1.0, 2.0, 1.0], [0.0, 1.0, -1.0], [-1.0, -1.0, -2.0]],
        [[-2.0, -1.0, -1.0], [1.0, 1.0, 2.0], [-1.0, 0.0, 1.0]],
        [[1.0, -1.0, 0.0], [-1.0, -2.0, -1.0], [2.0, 1.0, 1.0]],
    ]
)
_AT_MIDSIDES = 0.5 * (_AT_CORNERS + np.roll(_AT_CORNERS, -1, axis=0))
# Curvatures are linear in the element and their product quadratic: the three-point rule is exact.
_CURVATURE_POINTS, _CURVATURE_WEIGHTS = get_quadrature(RefTri, 2)
# Sides behind the middle nodes 3, 4, 5 of scikit-fem's P2 triangle.
_P2_SIDES = ((0, 1), (1, 2), (0, 2))


def triangle_stiffness(
    corners: Array,
    youngs_modulus: float,
    poissons_ratio: float,
    thickness: Array,
    straight_sides: Bools | None = None,
) -> Array:
    """Stiffness of e triangles in global axes.

    Parameters
    ----------
    corners : (e, 3, 3) corner positions, m; either sense of rotation
    youngs_modulus : Pa
    poissons_ratio : above -1, below 0.5
    thickness : (e,) m
    straight_sides : (e, 3), default none
        Sides 01, 12, 20 that the corners' drilling rotations must not bend (``alpha_b = 0`` there), because the
        neighbour across has straight sides, as quads have; the patch test holds across such a seam then.

    Returns
    -------
    (e, 18, 18), freedoms (u, v, w, rx, ry, rz) of corners 0, 1, 2 (N/m, N, N m/rad); symmetric, six zero modes.

    Raises
    ------
    InputError
        Wrong shapes, numbers that are not finite, a triangle without area, thickness or material out of range.

    Notes
    -----
    Formulation, sources and limits of validity: see the module.
    """
    corners, thickness = np.asarray(corners, dtype=np.float64), np.asarray(thickness, dtype=np.float64)
    refuse_bad_elements("triangle", corners, 3, thickness, youngs_modulus, poissons_ratio)
    straight = np.zeros((len(corners), 3), dtype=bool) if straight_sides is None else straight_sides

    def rows(part: slice) -> Array:
        return _rows(corners[part], youngs_modulus, poissons_ratio, thickness[part], straight[part])

    return stiffness_from(rows, len(corners), 18)


def _rows(
    corners: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array, straight_sides: Bools
) -> Array:
    """Weighted strains S (e, 21, 18) of global freedoms: the stiffness is ``S^T S``."""
    axes, xy = facet_axes(corners)
    area = 0.5 * _cross(xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0])
    mean, higher = membrane_strains(xy, area, np.where(straight_sides, 0.0, ALPHA_B))
    membrane = np.concatenate([mean[:, None], higher], axis=1)
    share = np.sqrt([1.0, *[0.75 * beta0(poissons_ratio)] * 3])
    membrane *= np.sqrt(area * thickness)[:, None, None, None, None] * share[:, None, None, None]
    bending = bending_curvatures(xy)
    bending *= np.sqrt(area * thickness**3 / 12.0)[:, None, None, None, None]
    bending *= np.sqrt(2.0 * _CURVATURE_WEIGHTS)[:, None, None, None]
    root = np.asarray(np.linalg.cholesky(plane_stress(youngs_modulus, poissons_ratio)).T, dtype=np.float64)
    return _to_global(_times(root, membrane), _times(root, bending), axes)


def _times(root: Array, strains: Array) -> Array:
    """Upper triangular plane-stress root times strains (e, p, 3, ...), where xy stands by itself."""
    out = np.empty_like(strains)
    out[:, :, 0] = root[0, 0] * strains[:, :, 0] + root[0, 1] * strains[:, :, 1]
    out[:, :, 1] = root[1, 1] * strains[:, :, 1]
    out[:, :, 2] = root[2, 2] * strains[:, :, 2]
    return out


def beta0(poissons_ratio: float) -> float:
    """Factor of the higher-order membrane stiffness that makes in-plane bending exact."""
    return max(0.5 * (1.0 - 4.0 * poissons_ratio**2), BETA0_FLOOR)


def facet_axes(corners: Array) -> tuple[Array, Array]:
    """Local axes as rows (e, 3, 3), x along side 01, z normal, and corners in them (e, 3, 2), corner 0 at 0."""
    span = corners - corners[:, :1]
    x = span[:, 1] / np.linalg.norm(span[:, 1], axis=1)[:, None]
    z = np.cross(span[:, 1], span[:, 2])
    z = z / np.linalg.norm(z, axis=1)[:, None]
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    return axes, span @ np.swapaxes(axes[:, :2], 1, 2)


def membrane_strains(xy: Array, area: Array, alpha: Array) -> tuple[Array, Array]:
    """Strains (xx, yy, gamma xy) from the freedoms (u, v, rz) of the corners of flat triangles (e, 3, 2).

    ``alpha`` (e, 3): Felippa's alpha_b of sides 01, 12, 20.

    Returns
    -------
    mean : (e, 3, 3, 3), of the whole element, by strain, corner and freedom
    higher : (e, 3, 3, 3, 3), deviation at the middles of sides 01, 12, 20, by point, strain, corner and freedom
    """
    e = len(xy)
    before, after = np.roll(xy, 1, axis=1), np.roll(xy, -1, axis=1)
    # By corner i with the others j, k: (x_kj, y_jk), twice the area times the gradient of N_i.
    b, c = after[..., 1] - before[..., 1], before[..., 0] - after[..., 0]
    # What the sides, bent by the rotations of their ends, take in per unit rotation: squares of the normals.
    dx, dy = (after - xy)[..., 0], (after - xy)[..., 1]
    swept = np.stack([dy**2, dx**2, -2.0 * dx * dy], axis=1) * (alpha / 6.0)[:, None]
    mean = np.zeros((e, 3, 3, 3))
    mean[:, 0, :, 0] = mean[:, 2, :, 1] = b
    mean[:, 1, :, 1] = mean[:, 2, :, 0] = c
    mean[..., 2] = np.roll(swept, 1, axis=2) - swept
    mean /= 2.0 * area[:, None, None, None]

    relative = np.zeros((e, 3, 3, 3))
    relative[..., 0] = (c / (4.0 * area[:, None]))[:, None]
    relative[..., 1] = (-b / (4.0 * area[:, None]))[:, None]
    relative[:, range(3), range(3), 2] = 1.0
    # From the natural strains of sides (i, j), k opposite, to Cartesian ones; the lengths cancel.
    b_next, c_next = np.roll(b, -1, axis=1), np.roll(c, -1, axis=1)
    natural = np.stack([-b * b_next, -c * c_next, -(b * c_next + c * b_next)], axis=1)
    natural /= 6.0 * area[:, None, None]
    at_midsides = natural.reshape(-1, 3) @ np.moveaxis(_AT_MIDSIDES, 1, 0).reshape(3, 9)
    turn = np.moveaxis(at_midsides.reshape(e, 3, 3, 3), 2, 1)
    return mean, np.asarray((turn.reshape(e, 9, 3) @ relative.reshape(e, 3, 9)).reshape(e, 3, 3, 3, 3))


def bending_curvatures(xy: Array) -> Array:
    """Curvatures (e, 3, 3, 3, 3) by quadrature point, component, corner and freedom (w, rx, ry).

    Components (xx, yy, twice xy): strains at unit height over the mid-surface, of flat triangles (e, 3, 2).
    """
    reference = np.stack([ElementTriP2().lbasis(_CURVATURE_POINTS, i)[1] for i in range(6)])
    jacobian = np.stack([xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]], axis=1)
    gradient = np.linalg.inv(jacobian) @ np.moveaxis(reference, -1, 0)[:, None].swapaxes(2, 3)
    along = np.moveaxis(gradient, 0, 1).reshape(len(xy), 1, 6, 6) @ _fibre_rotations(xy)
    x, y = np.moveaxis(along.reshape(len(xy), 2, 3, 2, 9), 1, 0)
    curvature = np.stack([x[:, :, 0], y[:, :, 1], x[:, :, 1] + y[:, :, 0]], axis=2)
    return np.asarray(curvature.reshape(len(xy), 3, 3, 3, 3))


def _fibre_rotations(xy: Array) -> Array:
    """Rotations (e, 2, 6, 9) of the normal towards x and y at the P2 nodes from (w, rx, ry) of the corners."""
    beta = np.zeros((len(xy), 2, 6, 3, 3))
    for i in range(3):
        beta[:, 0, i, i, 2] = 1.0
        beta[:, 1, i, i, 1] = -1.0
    for node, (i, j) in enumerate(_P2_SIDES, start=3):
        side = xy[:, j] - xy[:, i]
        length = np.linalg.norm(side, axis=1)[:, None]
        s = side / length
        # Across the side linear; along it minus the slope of the cubic deflection, in the middle.
        middle = 0.5 * np.eye(2) - 0.75 * s[:, :, None] * s[:, None]
        slope = 1.5 * s / length
        for corner, sign in ((i, 1.0), (j, -1.0)):
            beta[:, :, node, corner, 0] = sign * slope
            beta[:, :, node, corner, 1] = -middle[:, :, 1]
            beta[:, :, node, corner, 2] = middle[:, :, 0]
    return beta.reshape(len(xy), 2, 6, 9)


def _to_global(membrane: Array, bending: Array, axes: Array) -> Array:
    """Strain rows (e, 21, 18) from global freedoms: four membrane and three bending points, three strains each."""
    e = len(axes)
    in_plane, out_of_plane = corner_motions(axes)
    rows = np.empty((e, 63, 6))
    np.matmul(membrane.reshape(e, 36, 3), in_plane, out=rows[:, :36])
    np.matmul(bending.reshape(e, 27, 3), out_of_plane, out=rows[:, 36:])
    return rows.reshape(e, 21, 18)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
