"""Quadrilateral flat-facet shell with six freedoms a node: QM6 membrane, MITC4 bending, stabilised drilling.

The four corners are projected on their mean plane (through their centroid, parallel to both diagonals), where
membrane and bending do not couple. The corners lie ``+h, -h, +h, -h`` above that plane. A rigid link joins each
corner to its projection, ``u_plane = u - h theta x n``, and its transpose brings the forces back with the
moment ``-h n x f`` that equilibrium asks for. (Warp correction after MacNeal, Comput. Struct. 8 (1978)
175-183; his couples of forces normal to the plane, in the place of moments, were tried: with them a twisted
beam of 24 elements, t = 0.0032, reaches 0.93 of its deflection, with moments 1.00.)

*Membrane*, QM6: the bilinear displacements get two incompatible modes a direction, ``1 - xi^2`` and ``1 - eta^2``,
whose gradients are taken with the Jacobian at the centre and scaled by ``det J0 / det J`` so that a constant strain
does no work on them (QM6: Taylor, Beresford and Wilson, Int. J. Numer. Meth. Eng. 10 (1976) 1211-1219,
doi:10.1002/nme.1620100602). The rotation about the normal is tied to that of the displacement field by ``gamma G
int (theta_z - (v_x - u_y) / 2)^2 t dA`` (Hughes and Brezzi, Comput. Methods Appl. Mech. Eng. 72 (1989) 105-121,
doi:10.1016/0045-7825(89)90124-2).

The field's rotation includes that of the incompatible modes, so rectangles bend in their plane without
strain in the tie. With the bilinear part alone, a row of elements of aspect 2 bends 3 % too little, of aspect
5 15 %.

*Bending*, MITC4 Reissner-Mindlin plate: curvatures come from bilinear rotations; the transverse shear strain is
taken from the tangential shear at the middle of each side and interpolated covariantly, which is what removes shear
locking (Bathe and Dvorkin, Int. J. Numer. Meth. Eng. 21 (1985) 367-383, doi:10.1002/nme.1620210213). That
interpolation is the lowest-order Nedelec element: the side's shear integral times the side's basis function.

Limits of validity, as measured in ``tests/benchmarks/test_shell_quad_benchmarks.py`` or for its problems:

- Small displacements and strains, isotropic linear material, thickness constant within an element.
- Shells of R/t = 100 to 250 under smooth fields: elements of 5 to 6 deg of arc leave 1 to 2 %, of 3 deg
  0.5 %. The dent below a point load wants elements of sqrt(R t) / 2 for 1 %; its depth then grows with the
  logarithm of the refinement without end, as Reissner-Mindlin theory has it.
- No shear locking from t/L = 1e-5 (clamped plate, 16 elements a span, 0.1 %). Thick walls: up to about
  t/L = 1/5, where the theory itself ends.
- Warping: rigid bodies are exact at any warp. A twisted strip is within 1.1 % at 15 deg of twist between
  opposite sides of an element, 3 % at 30 deg.
- Shape: strictly convex. Aspect ratio 16 leaves 1 % in a plate four elements wide. Rectangles are
  exact in pure bending in their plane; trapezoids lock there as all four-node elements do (sides leaning by
  half the height in a single row: 0.51 of the deflection), so walls bent in their plane want several rows.
"""

from __future__ import annotations

import numpy as np
from skfem import Basis, ElementQuad1, ElementQuadN1, MeshQuad1

from fem.elements.facets import corner_motions, plane_stress, stiffness_from
from meshes.shell_mesh import refuse_bad_elements
from robots.arrays import Array, Integers

# 2x2 Gauss points: full integration of all parts; the modes QM6 and MITC4 leave out are in their strains.
QUADRATURE_ORDER = 3
# In units of the shear modulus. With 0.01 the thick twisted beam stays 3 % too soft on every mesh; with 1 the
# hemisphere of 16 elements a side loses 2.5 %.
DRILLING_PENALTY = 0.1
DISPLACEMENTS = np.array([0, 1, 3, 4, 6, 7, 9, 10])
ROTATIONS = np.array([2, 5, 8, 11])
# Amplitudes of the incompatible modes, behind the freedoms of the nodes: two modes times (u, v).
MODES = np.arange(12, 16)
SHEAR_FACTOR = 5.0 / 6.0
# Tangential integral of each Nedelec function along its side in the sense 0-1, 1-2, 2-3, 3-0 is +1 or -1;
# scikit-fem's last side runs 0-3, the direction used below. The nodes of a disconnected mesh ascend, so
# scikit-fem turns no side round.
SIDES = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
SIDE_SIGNS = np.array([-1.0, 1.0, -1.0, 1.0])


def quad_stiffness(corners: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array) -> Array:
    """Stiffness of quadrilateral shell elements in global axes.

    Parameters
    ----------
    corners : array (e, 4, 3), m
        In order around each element; either sense and any first corner give the same stiffness.
    youngs_modulus, poissons_ratio : float
        Pa, > 0; and 1, in (-1, 0.5).
    thickness : array (e,), m
        Greater than zero.

    Returns
    -------
    array (e, 24, 24)
        Symmetric; freedoms ``(u, v, w, rx, ry, rz)`` of each node; N/m, N, N m.

    Raises
    ------
    InputError
        An element is degenerate or not convex, or a thickness or material constant is out of range.

    Notes
    -----
    Formulation, sources and limits of validity: see the module.
    """
    corners, thickness = np.asarray(corners, dtype=float), np.asarray(thickness, dtype=float)
    refuse_bad_elements("quad", corners, 4, thickness, youngs_modulus, poissons_ratio)
    R = quad_frames(corners)
    local = (corners - corners.mean(axis=1, keepdims=True)) @ R
    flat, height = local[..., :2], local[..., 2]

    def rows(part: slice) -> Array:
        return _rows(flat[part], height[part], R[part], youngs_modulus, poissons_ratio, thickness[part])

    return stiffness_from(rows, len(corners), 24)


def quad_frames(corners: Array) -> Array:
    """Rotations (e, 3, 3) of the mean planes: columns are the facet's x, y and normal in global axes.

    The x axis halves the angle between the sides' directions 0-1 and 3-2; zero area gives NaN.
    """
    first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    with np.errstate(invalid="ignore"):
        normal = _unit(np.cross(first, second))
        x = _unit(first - second)
    return np.stack([x, np.cross(normal, x), normal], axis=2)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _rows(
    flat: Array, height: Array, R: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array
) -> Array:
    """Weighted strains S (e, 36, 24) of global freedoms: ``S^T S`` is the stiffness.

    ``flat`` (e, 4, 2) and ``height`` (e, 4): the corners in the facet's axes R (e, 3, 3).
    """
    e = len(flat)
    # Disconnected: scikit-fem has no surfaces in space, so each facet lies flat in its own plane.
    mesh = MeshQuad1(np.ascontiguousarray(flat.reshape(-1, 2).T), np.arange(4 * e).reshape(e, 4).T.copy())
    basis = Basis(mesh, ElementQuad1(), intorder=QUADRATURE_ORDER, disable_doflocs=True)
    sides = Basis(mesh, ElementQuadN1(), intorder=QUADRATURE_ORDER, disable_doflocs=True)
    material = (youngs_modulus, poissons_ratio, thickness)
    membrane = membrane_rows(basis, flat, *material).reshape(e, 16, 4, 3)
    bending = bending_rows(basis, sides, flat, *material).reshape(e, 80, 3)
    in_plane, out_of_plane = corner_motions(np.swapaxes(R, 1, 2))
    rows = np.empty((e, 36, 4, 6))
    by_corner = np.swapaxes(rows[:, :16], 1, 2)
    np.matmul(np.swapaxes(membrane, 1, 2), _linked_to_plane(in_plane[:, None], height), out=by_corner)
    np.matmul(bending, out_of_plane, out=rows[:, 16:].reshape(e, 80, 6))
    return rows.reshape(e, 36, 24)


def _linked_to_plane(motion: Array, height: Array) -> Array:
    """Motion (e, 4, 3, 6) in the plane of the corners' projections from that of the corners (e, 1, 3, 6).

    A rigid link adds to the projection's ``u`` and ``v`` what its corner's tilt moves it: ``-h theta x n``.
    """
    x, y = motion[:, :, 0, :3], motion[:, :, 1, :3]
    linked = np.repeat(motion, 4, axis=1)
    linked[:, :, 0, 3:] -= height[:, :, None] * y
    linked[:, :, 1, 3:] += height[:, :, None] * x
    return linked


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
