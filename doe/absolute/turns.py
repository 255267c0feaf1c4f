"""Rotation vectors at many poses: their rotations, and the derivatives of these."""

from __future__ import annotations

import numpy as np

from fem.statics.vectors import cross, dot
from robots.arrays import Array

# Below this angle series replace quotients of small numbers; what they leave out is rounding.
SMALL = 1e-4


def _coefficients(square: Array) -> tuple[Array, Array, Array]:
    """``sin t / t``, ``(1 - cos t) / t^2`` and ``(t - sin t) / t^3`` for squares t^2."""
    t = np.sqrt(np.maximum(square, SMALL**2))
    exact = np.sin(t) / t, (1.0 - np.cos(t)) / t**2, (t - np.sin(t)) / t**3
    series = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    small = square < SMALL**2
    a, b, c = (np.where(small, s, e) for s, e in zip(series, exact, strict=True))
    return a, b, c


def turned(w: Array, v: Array) -> Array:
    """``exp(w) v`` for rotation vectors w and vectors v (3, ..., n), by Rodrigues' formula."""
    a, b, _ = _coefficients(dot(w, w))
    wv = cross(w, v)
    return np.asarray(v + a * wv + b * cross(w, wv))


def rotation(w: Array) -> Array:
    """``exp(w)`` (3, 3) of one rotation vector (3,)."""
    return turned(w[:, None], np.eye(3))


def left_rate(w: Array, d: Array) -> Array:
    """``J(w) d``: the turn, about axes outside, by which exp(w) changes as w moves by d; (3, ..., n) each."""
    _, b, c = _coefficients(dot(w, w))
    wd = cross(w, d)
    return np.asarray(d + b * wd + c * cross(w, wd))


def nearest_rotation(A: Array) -> Array:
    """The rotation (3, 3) next to a matrix (3, 3) in the sum of squares (Kabsch)."""
    U, _, Vt = np.linalg.svd(A)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
