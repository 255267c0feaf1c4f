"""Motors: dual quaternions (..., 8), the real part first, that turn about lines and shift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ONE = np.eye(8)[0]


def _product() -> Array:
    """Of quaternions, w first: (a b)_k = a_i b_j P_ijk."""
    P = np.zeros((4, 4, 4))
    for i in range(4):
        P[0, i, i] = P[i, 0, i] = 1
    P[1:, 1:, 0] -= np.eye(3)
    for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
        P[i, j, k], P[j, i, k] = 1, -1
    return P


_P = _product().reshape(4, 16)


def _times(a: Array, b: Array) -> Array:
    return np.asarray((b[..., None, :] @ (a @ _P).reshape(*a.shape[:-1], 4, 4))[..., 0, :])


def then(a: Array, b: Array) -> Array:
    """Motion ``b`` in the frame that ``a`` gives."""
    a, b = np.broadcast_arrays(a, b)
    real = _times(a[..., :4], b[..., :4])
    return np.concatenate([real, _times(a[..., :4], b[..., 4:]) + _times(a[..., 4:], b[..., :4])], axis=-1)


def turn(about: Array, through: Array, angle: Array | float) -> Array:
    """About a line of unit direction (3,) through a point (3,), by angles (...) in rad."""
    half = np.asarray(angle, dtype=float)[..., None] / 2
    c, s = np.cos(half), np.sin(half)
    return np.concatenate([c, s * about, 0 * c, s * np.cross(through, about)], axis=-1)


def shift(by: Array) -> Array:
    """By (..., 3) in m."""
    out = np.zeros((*by.shape[:-1], 8))
    out[..., 0], out[..., 5:] = 1, by / 2
    return out


def cross(a: Array, b: Array) -> Array:
    """Of (..., 3), faster than numpy's for small arrays."""
    x, y, z = (a[..., k] for k in range(3))
    u, v, w = (b[..., k] for k in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def direct(m: Array, v: Array) -> Array:
    """Directions (..., 3) turned by motors (..., 8)."""
    m, v = np.broadcast_arrays(m, np.concatenate([v, np.zeros((*v.shape[:-1], 5))], axis=-1))
    v, u = v[..., :3], m[..., 1:4]
    t = 2 * cross(u, v)
    return np.asarray(v + m[..., :1] * t + cross(u, t))


def origin(m: Array) -> Array:
    """Where motors (..., 8) bring the origin to: 2 d r*."""
    w, u, dw, du = m[..., :1], m[..., 1:4], m[..., 4:5], m[..., 5:]
    return np.asarray(2 * (w * du - dw * u + cross(u, du)))


def at(m: Array, point: Array) -> Array:
    """Points (..., 3) moved by motors (..., 8)."""
    return direct(m, point) + origin(m)
