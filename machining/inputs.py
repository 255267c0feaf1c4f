"""Checks of the vectors and matrices that callers hand to the indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError
from robots.arrays import Array

# A rotation that was read from a file has some eight digits.
ROTATION_TOLERANCE = 1e-6


def as_vectors(what: str, vector: ArrayLike, n: int, unit: str, *, zero: bool = False) -> Array:
    """Vectors (n, 3) from (3,) or (n, 3).

    Raises
    ------
    InputError
        Another shape, a value that is not finite, or length zero where ``zero`` does not allow it.
    """
    v = np.asarray(vector, dtype=np.float64)
    allowed = f"finite{'' if zero else ', not all zero'}, shape (3,) or ({n}, 3): {unit}"
    if v.shape not in ((3,), (n, 3)):
        raise InputError(what, code="B001", value=f"shape {v.shape}", allowed=allowed, remedy="one row a pose")
    rows = np.atleast_2d(v)
    bad = ~np.isfinite(rows).all(axis=1)
    if not zero:
        bad |= ~(rows != 0.0).any(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            what if v.ndim == 1 else f"{what}, row {row}",
            code="B001",
            value=rows[row].tolist(),
            allowed=allowed,
            remedy="give a direction" if np.isfinite(rows[row]).all() else "complete or remove it",
        )
    return np.broadcast_to(v, (n, 3))


def as_units(what: str, vector: ArrayLike, n: int) -> Array:
    """Unit vectors (n, 3) along (3,) or (n, 3); errors as :func:`as_vectors`."""
    v = as_vectors(what, vector, n, "a direction in base axes")
    # Scaled first: squares of very long or very short vectors leave the range of floats.
    v = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def as_compliances(C_tt: ArrayLike) -> Array:
    """Compliance blocks (n, 3, 3) as floats.

    Raises
    ------
    InputError
        Another shape, or a value that is not finite.
    """
    C = np.asarray(C_tt, dtype=np.float64)
    allowed = "finite, shape (n, 3, 3), m/N"
    if C.ndim != 3 or C.shape[1:] != (3, 3):
        remedy = "take it from machining.translational or machining.blocks"
        raise InputError("compliance block", code="B001", value=f"shape {C.shape}", allowed=allowed, remedy=remedy)
    bad = ~np.isfinite(C).all(axis=(1, 2))
    if bad.any():
        raise InputError(
            f"compliance block at pose {int(np.argmax(bad))}", code="B001", value=C[bad][0].tolist(), allowed=allowed
        )
    return C


def as_rotations(what: str, R: ArrayLike, n: int) -> Array:
    """Rotations (n, 3, 3) from (3, 3) or (n, 3, 3).

    Raises
    ------
    InputError
        Another shape, or no rotation.
    """
    rotations = np.asarray(R, dtype=np.float64)
    if rotations.shape not in ((3, 3), (n, 3, 3)):
        raise InputError(what, code="B001", value=f"shape {rotations.shape}", allowed=f"(3, 3) or ({n}, 3, 3)")
    off = np.abs(np.swapaxes(rotations, -1, -2) @ rotations - np.eye(3)).max(initial=0.0)
    if not off < ROTATION_TOLERANCE or not (np.linalg.det(rotations) > 0.0).all():
        raise InputError(
            what, code="B001", allowed="rotations: orthonormal columns, right-handed", remedy="normalise the axes"
        )
    return np.broadcast_to(rotations, (n, 3, 3))


def as_frame(what: str, T: ArrayLike) -> Array:
    """A rigid transform (4, 4); raises InputError for anything else."""
    frame = np.asarray(T, dtype=np.float64)
    if frame.shape != (4, 4) or not np.isfinite(frame).all() or not np.array_equal(frame[3], [0.0, 0.0, 0.0, 1.0]):
        allowed = "finite (4, 4): rotation, position in m, and 0 0 0 1 below"
        raise InputError(what, code="B001", value=f"shape {frame.shape}", allowed=allowed)
    as_rotations(what, frame[:3, :3], 1)
    return frame
