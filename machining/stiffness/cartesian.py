"""Cartesian compliance and stiffness of the tool: blocks, other points and axes, the inverse.

``C = J K_theta^-1 J^T`` (Gao 2024, eq. 3, doi:10.1109/ACCESS.2024.3435911) is what :func:`fem.compliance` gives for
rigid links with springs; for beam or shell links it is the same matrix with the links in it. All functions work on
a batch of poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.inputs import as_rotations, as_vectors
from machining.stiffness.loaded import loaded_compliance
from robots import InputError
from robots.arrays import Array, Bools

# The inverse loses as many digits as this has; beyond, its entries are noise. A pose is that close to a singular
# one only by construction.
WORST_CONDITION = 1e10


@dataclass(frozen=True)
class Blocks:
    """Blocks of a compliance (eq. 4): ``tt`` m/N, ``tr`` m/(N m), ``rt`` rad/N, ``rr`` rad/(N m), (n, 3, 3) each.

    ``rt`` is the transpose of ``tr`` unless moments act on the arm (:mod:`machining.stiffness.loaded`).
    """

    tt: Array
    tr: Array
    rt: Array
    rr: Array


def blocks(C: Array) -> Blocks:
    """Split compliances (n, 6, 6) into :class:`Blocks`.

    Raises
    ------
    InputError
        Another shape.
    """
    C = _as_six(C)
    return Blocks(C[:, :3, :3], C[:, :3, 3:], C[:, 3:, :3], C[:, 3:, 3:])


def translational(model: fem.ArmModel, q: Array, point: Array | None = None, wrench: ArrayLike | None = None) -> Array:
    """Translational compliance C_tt (n, 3, 3) m/N at the tool point, base axes: what the indices are made of.

    ``q`` (n, dof) rad; ``point`` (3,) or (n, 3) m, flange frame, instead of the model's tool point; ``wrench`` as in
    :func:`machining.stiffness.loaded.loaded_compliance` for the arm under load, None for the unloaded arm. Errors as
    there.
    """
    C = fem.compliance(model, q, point) if wrench is None else loaded_compliance(model, q, wrench, point)
    return blocks(C).tt


def moved(C: Array, lever: ArrayLike) -> Array:
    """Compliance at another point of the same rigid tool; ``lever`` (3,) or (n, 3) m leads there, in C's axes.

    ``C' = X C X^T`` with ``X = [[1, -[lever]x], [0, 1]]``.

    Raises
    ------
    InputError
        Shapes, or a lever that is not finite.
    """
    C = _as_six(C)
    r = as_vectors("lever", lever, len(C), "m", zero=True)
    X = np.zeros((len(C), 6, 6))
    X[:] = np.eye(6)
    X[:, 0, 4], X[:, 0, 5], X[:, 1, 5] = r[:, 2], -r[:, 1], r[:, 0]
    X[:, 1, 3], X[:, 2, 3], X[:, 2, 4] = -r[:, 2], r[:, 1], -r[:, 0]
    return np.asarray(X @ C @ np.swapaxes(X, 1, 2))


def in_axes(C: Array, R: ArrayLike) -> Array:
    """Express compliances in other axes: R (3, 3) or (n, 3, 3) has them as columns, given in C's axes.

    With ``R = R_flange @ R_flange_tool`` the result is in tool axes.

    Raises
    ------
    InputError
        Shapes, or R is no rotation.
    """
    C = _as_six(C)
    rotations = as_rotations("axes", R, len(C))
    turn = np.zeros((len(C), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotations
    return np.asarray(np.swapaxes(turn, 1, 2) @ C @ turn)


def cartesian_stiffness(
    model: fem.ArmModel, q: Array, wrench: ArrayLike | None = None, point: Array | None = None
) -> Array:
    """Cartesian stiffness K_X (n, 6, 6) at the tool point, base axes: N/m, N/rad, N m/m, N m/rad.

    Without a wrench ``J^-T K_theta J^-1`` (eq. 2); with one ``J^-T (K_theta - K_C) J^-1`` (eq. 1), the tangent at
    joint angles q under that load. Computed as the inverse of the compliance, so links that give way are in it.

    Raises
    ------
    InputError
        The compliance has no inverse: a singular pose, a rigid joint, or fewer than six compliant directions. The
        indices of :mod:`machining.stiffness.indices` need no inverse. Else as
        :func:`machining.stiffness.loaded.loaded_compliance`.
    """
    C = fem.compliance(model, q, point) if wrench is None else loaded_compliance(model, q, wrench, point)
    return inverse(C, "Cartesian stiffness")


def inverse(C: Array, what: str) -> Array:
    """Inverse of compliances (n, k, k).

    Raises
    ------
    InputError
        Some have none; the first pose and their number are said.
    """
    singular = is_singular(C)
    if singular.any():
        raise InputError(
            f"{what} at pose {int(np.argmax(singular))} ({int(singular.sum())} of {len(C)} poses)",
            code="M005",
            allowed="a compliance that has an inverse: no direction in which the tool is rigid",
            remedy="leave singular poses out, or use the compliance itself",
        )
    return np.asarray(np.linalg.inv(C))


def is_singular(C: Array) -> Bools:
    """Which compliances (n, k, k) have no usable inverse; units are scaled away by the diagonal."""
    size = np.sqrt(np.maximum(np.diagonal(C, axis1=1, axis2=2), 0.0))
    rigid = np.asarray((size <= 0.0).any(axis=1))
    safe = np.where(rigid[:, None], 1.0, size)
    scaled = np.where(rigid[:, None, None], 0.0, C / (safe[:, :, None] * safe[:, None, :]))
    values = np.linalg.svd(scaled, compute_uv=False)
    return np.asarray(values[:, -1] * WORST_CONDITION <= values[:, 0])


def _as_six(C: Array) -> Array:
    C = np.asarray(C, dtype=np.float64)
    if C.ndim != 3 or C.shape[1:] != (6, 6):
        raise InputError(
            "compliance",
            code="B001",
            value=f"shape {C.shape}",
            allowed="(n, 6, 6)",
            remedy="take it from fem.compliance",
        )
    return C
