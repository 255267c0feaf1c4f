"""Vectors at many poses: ``(3, n)``, wrenches ``(6, n)``, rotations ``(3, 3, n)``, poses along the last axis.

Each operation is then a few passes over contiguous memory, several times faster than one small product a
pose, and the result at a pose does not depend on its neighbours. A trailing 1 instead of n broadcasts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def poses_last(a: Array) -> Array:
    """Move the poses from the first to the last axis; copies only if they are not contiguous then."""
    return np.ascontiguousarray(np.moveaxis(a, 0, -1))


def dot(a: Array, b: Array) -> Array:
    """Scalar products of ``a`` and ``b`` (k, n) -> (n,)."""
    return np.asarray(np.einsum("k...,k...->...", a, b))


def cross(a: Array, b: Array) -> Array:
    """Cross products ``a x b`` of (3, n) arrays -> (3, n)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def to_base(R: Array, v: Array) -> Array:
    """``R v``: from local axes (the columns of R) to base axes."""
    return np.asarray(np.einsum("ij...,j...->i...", R, v))


def to_local(R: Array, v: Array) -> Array:
    """``R^T v``: from base axes to local axes (the columns of R)."""
    return np.asarray(np.einsum("ij...,i...->j...", R, v))


def rigid_rotation(R: Array, matrix: Array) -> Array:
    """``R matrix``, the same constant 3x3 rotation behind each of ``R`` (3, 3, n)."""
    return np.asarray(np.matmul(matrix.T, R))
