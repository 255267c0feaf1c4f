"""Vectors at many poses: ``(3, n)``, wrenches ``(6, n)``, rotations ``(3, 3, n)``, poses along the last axis.

Each operation is then a few passes over contiguous memory, several times faster than a small product for
each pose. Axes between the first and the last hold several vectors a pose, ``(3, k, n)``; they broadcast
against arrays without them, and a last axis of 1 broadcasts over the poses.
"""

from __future__ import annotations

import numpy as np

from robots.arrays import Array


def poses_last(a: Array) -> Array:
    """Move the poses from the first to the last axis; copies only if they are not contiguous then."""
    return np.ascontiguousarray(np.moveaxis(a, 0, -1))


def dot(a: Array, b: Array) -> Array:
    """Scalar products of ``a`` and ``b`` (i, ..., n) -> (..., n)."""
    return np.asarray(np.einsum("k...,k...->...", a, b))


def cross(a: Array, b: Array) -> Array:
    """Cross products ``a x b``."""
    out = np.empty((3, *np.broadcast_shapes(a.shape[1:], b.shape[1:])))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=out[k])
        out[k] -= a[j] * b[i]
    return out


def scaled(a: Array, factor: Array) -> Array:
    """Multiply ``a`` (i, n) by the numbers ``factor`` (..., n) -> (i, ..., n)."""
    return np.asarray(np.einsum("k...,...->k...", a, factor))


def constant_times(matrix: Array, a: Array) -> Array:
    """``matrix a`` with one constant matrix (k, i) for all of ``a`` (i, ..., n)."""
    return np.asarray(matrix @ a.reshape(len(a), -1)).reshape(-1, *a.shape[1:])


def to_base(R: Array, v: Array) -> Array:
    """``R v``: from local axes (the columns of R) to base axes."""
    return np.asarray(np.einsum("ij...,j...->i...", R, v))


def to_local(R: Array, v: Array) -> Array:
    """``R^T v``: from base axes to local axes (the columns of R)."""
    return np.asarray(np.einsum("ij...,i...->j...", R, v))


def times_constant(R: Array, matrix: Array) -> Array:
    """``R matrix``, the same constant 3x3 rotation behind each of ``R`` (3, 3, n)."""
    return np.asarray(np.matmul(matrix.T, R))
