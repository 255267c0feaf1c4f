"""Quadrilateral flat-facet shell with six freedoms a node: QM6 membrane, MITC4 bending, stabilised drilling.

The four corners are projected on their mean plane (through their centroid, parallel to both diagonals), where
membrane and bending do not couple: see ``fem.elements.quad_membrane`` and ``fem.elements.quad_bending`` for the
formulations and their sources. The corners lie ``+h, -h, +h, -h`` above that plane. A rigid link joins each
corner to its projection, ``u_plane = u - h theta x n``, and its transpose brings the forces back with the
moment ``-h n x f`` that equilibrium asks for. (Warp correction after MacNeal, Comput. Struct. 8 (1978)
175-183; his couples of forces normal to the plane, in the place of moments, were tried: with them a twisted
beam of 24 elements, t = 0.0032, reaches 0.93 of its deflection, with moments 1.00.)

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

from fem.elements.quad_bending import bending_rows
from fem.elements.quad_membrane import membrane_rows
from robots.arrays import Array
from robots.errors import InputError

# 2x2 Gauss points: full integration of all parts; the modes QM6 and MITC4 leave out are in their strains.
QUADRATURE_ORDER = 3
# Elements worked on at a time: their arrays stay in the processor's cache.
BATCH = 2048
# A corner's area relative to the diagonals' product below which the corner counts as collapsed or re-entrant.
SMALLEST_CORNER = 1e-6


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
    _check_inputs(corners, youngs_modulus, poissons_ratio, thickness)
    R = quad_frames(corners)
    local = (corners - corners.mean(axis=1, keepdims=True)) @ R
    flat, height = local[..., :2], local[..., 2]
    _check_shapes(flat)
    K = np.empty((len(corners), 24, 24))
    for first in range(0, len(corners), BATCH):
        part = slice(first, first + BATCH)
        rows = _rows(flat[part], height[part], R[part], youngs_modulus, poissons_ratio, thickness[part])
        np.matmul(np.swapaxes(rows, 1, 2), rows, out=K[part])
    return K


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
    # What a corner's six global freedoms move: (u, v, theta_z) and (w, theta_x, theta_y) in the facet's axes.
    in_plane, out_of_plane = np.zeros((e, 1, 3, 6)), np.zeros((e, 3, 6))
    in_plane[:, 0, :2, :3], in_plane[:, 0, 2, 3:] = np.swapaxes(R[:, :, :2], 1, 2), R[:, :, 2]
    out_of_plane[:, 0, :3], out_of_plane[:, 1:, 3:] = R[:, :, 2], np.swapaxes(R[:, :, :2], 1, 2)
    rows = np.empty((e, 36, 4, 6))
    by_corner = np.swapaxes(rows[:, :16], 1, 2)
    np.matmul(np.swapaxes(membrane, 1, 2), _linked_to_plane(in_plane, height), out=by_corner)
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


def _check_inputs(corners: Array, youngs_modulus: float, poissons_ratio: float, thickness: Array) -> None:
    if corners.ndim != 3 or corners.shape[1:] != (4, 3):
        raise InputError("corners of quadrilateral shells", value=corners.shape, allowed="shape (e, 4, 3)")
    if not np.isfinite(corners).all():
        raise InputError("corners of quadrilateral shells", value="NaN or infinity", allowed="finite, m")
    if thickness.shape != corners.shape[:1]:
        raise InputError(
            "thickness of quadrilateral shells", value=thickness.shape, allowed=f"shape {corners.shape[:1]}"
        )
    bad = np.flatnonzero(~((thickness > 0.0) & np.isfinite(thickness)))
    if len(bad):
        raise InputError(
            f"thickness of quadrilateral shell element {bad[0]} ({len(bad)} bad in all)",
            value=thickness[bad[0]],
            allowed="finite and > 0 m",
            remedy="give each wall its thickness",
        )
    if not (np.isfinite(youngs_modulus) and youngs_modulus > 0.0):
        raise InputError("Young's modulus", value=youngs_modulus, allowed="finite and > 0 Pa")
    if not -1.0 < poissons_ratio < 0.5:
        raise InputError("Poisson's ratio", value=poissons_ratio, allowed="between -1 and 0.5")


def _check_shapes(flat: Array) -> None:
    """Refuse facets that are not strictly convex: their map from the square would fold or flatten."""
    ahead, behind = np.roll(flat, -1, axis=1) - flat, np.roll(flat, 1, axis=1) - flat
    area = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    first, second = flat[:, 2] - flat[:, 0], flat[:, 3] - flat[:, 1]
    scale = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    bad = np.flatnonzero(~(area.min(axis=1) > SMALLEST_CORNER * scale))  # NaN of a zero area is bad too
    if len(bad):
        raise InputError(
            f"quadrilateral shell element {bad[0]} ({len(bad)} bad in all)",
            value="a corner of 180 deg or more, or coincident or crossing corners",
            allowed="four corners in order around a convex quadrilateral",
            remedy="reorder the corners, or split the element into triangles",
        )
