"""How far an effect stands out: chi-square that no choice of springs takes away, with the true covariance."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from .screws import Array, Whole


def blocks(labels: Whole, columns: Array) -> Array:
    """Low-rank root (n, axes, groups): each group's own column (n, axes) where its label is, zero elsewhere."""
    names, where = np.unique(labels, return_inverse=True)
    out = np.zeros((*columns.shape, len(names)))
    out[np.arange(len(labels)), :, where] = columns
    return out


def whitened(covariance: Array, root: Array, columns: Array) -> Array:
    """Columns (n, axes, k) as (n axes, k), whitened by ``covariance + root root'`` of blocks (n, axes, axes)."""
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))

    def flat(a: Array) -> Array:
        return np.asarray(np.einsum("nij,njk->nik", inverse, a).reshape(a.shape[0] * a.shape[1], a.shape[2]))

    white, low = flat(columns), flat(root)
    if low.shape[1] == 0:
        return white
    values, vectors = np.linalg.eigh(low.T @ low)
    values = np.maximum(values, 1e-300)
    shrink = -np.expm1(-0.5 * np.log1p(values)) / values
    reach = low @ vectors
    return np.asarray(white - reach @ (shrink[:, None] * (reach.T @ white)))


def unexplained(covariance: Array, root: Array, springs: Array, seen: Array) -> float:
    """Chi-square of ``seen`` (n, axes) after fitting compliances, never negative, of columns (n, axes, joints)."""
    white = whitened(covariance, root, np.concatenate([springs, seen[:, :, None]], axis=2))
    A, b = white[:, :-1], white[:, -1]
    size = np.linalg.norm(A, axis=0)
    A = A[:, size > 1e-9 * max(float(size.max()), 1e-300)]
    A = A / np.linalg.norm(A, axis=0)
    _, R = np.linalg.qr(np.column_stack([A, b]))
    left = nnls(R[:, :-1], R[:, -1])[1]
    return float(left**2)
