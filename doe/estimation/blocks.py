"""Readings in blocks of one set-up and component, and the covariance that a block's readings have in common.

In a block ``V = D + C C^T``: D diagonal, C two columns. Whatever is asked of V costs two columns a reading and a
2 x 2 matrix a block (Woodbury's identity), for all blocks at once; no block's own matrix is ever formed. Its
determinant cancels where both columns are far above D: at 100 standard deviations eight digits are left, at 1000 four.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from doe.estimation.problem import Problem
from robots.arrays import Array, Integers


@dataclass(frozen=True)
class Blocks:
    """The block of every reading: ``number`` (m,), counted from 0, and ``sums`` (b, m), which adds up over blocks."""

    number: Integers
    sums: csr_array

    @staticmethod
    def of(p: Problem) -> Blocks:
        """Blocks of a problem: readings of one component in one pose."""
        _, number = np.unique(6 * p.pose + p.component, return_inverse=True)
        starts = np.concatenate([[0], np.cumsum(np.bincount(number))])
        order = np.argsort(number, kind="stable")
        return Blocks(number, csr_array((np.ones(len(order)), order, starts), shape=(len(starts) - 1, len(order))))

    def __len__(self) -> int:
        return int(self.sums.shape[0])

    @property
    def most(self) -> int:
        """Readings in the largest block."""
        return int(np.bincount(self.number).max(initial=0))

    def add(self, x: Array) -> Array:
        """Sums (b, ...) of x (m, ...) over blocks."""
        return np.asarray(self.sums @ x.reshape(len(x), -1)).reshape(len(self), *x.shape[1:])

    def covariance(self, variance: Array, common: Array) -> Covariance:
        """V = diag(variance) + common common^T in every block; variance (m,), common (m, 2)."""
        return Covariance(self, variance, common if common.any() else None)

    def whiten(self, variance: Array, common: Array, columns: Array) -> tuple[Array, float]:
        """Turn columns (m, c) into ones of unit covariance, and ln|V|; V as in :meth:`covariance`."""
        V = self.covariance(variance, common)
        return V.whiten(columns), V.log_det


class Covariance:
    """V of all readings: its inverse and determinant, and a square root of the inverse, applied block by block."""

    def __init__(self, blocks: Blocks, variance: Array, common: Array | None) -> None:
        self.blocks = blocks
        self.variance = variance
        self.common = common
        self.log_det = float(np.log(variance).sum())
        if common is not None:
            self.E = common / variance[:, None]
            products = np.stack([common[:, 0] * self.E[:, 0], common[:, 0] * self.E[:, 1], common[:, 1] * self.E[:, 1]])
            self.a, self.b, self.c = blocks.add(products.T).T
            # I + C^T D^-1 C and its determinant.
            self.a, self.c = 1.0 + self.a, 1.0 + self.c
            self.det = self.a * self.c - self.b**2
            self.log_det += float(np.log(self.det).sum())

    @cached_property
    def middle(self) -> Array:
        """(I + C^T D^-1 C)^-1 (b, 2, 2)."""
        return np.asarray(_matrices(self.c, -self.b, self.a) / self.det[:, None, None])

    def solve(self, columns: Array) -> Array:
        """V^-1 times columns (m, c)."""
        out = columns / self.variance[:, None]
        if self.common is None:
            return out
        inner = self.middle @ self.blocks.add(self.E[:, :, None] * columns[:, None, :])
        return np.asarray(out - np.einsum("mk,mkc->mc", self.E, inner[self.blocks.number]))

    def whiten(self, columns: Array) -> Array:
        """V^(-1/2) times columns (m, c), up to a rotation: D^-1/2 first, then the symmetric root of I + U U^T.

        With K = U^T U and N = (I + K)^(1/2), ``(I + U U^T)^(-1/2) = I - U (I + K + N)^-1 U^T``; the root of a 2 x 2
        matrix A is ``(A + d I) / (tr A + 2 d)^(1/2)``, d^2 its determinant.
        """
        root = np.sqrt(self.variance)[:, None]
        out = columns / root
        if self.common is None:
            return out
        d = np.sqrt(self.det)
        t = np.sqrt(self.a + self.c + 2.0 * d)
        a, b, c = self.a + (self.a + d) / t, self.b + self.b / t, self.c + (self.c + d) / t
        inverse = _matrices(c, -b, a) / (a * c - b**2)[:, None, None]
        U = self.common / root
        inner = inverse @ self.blocks.add(U[:, :, None] * out[:, None, :])
        return np.asarray(out - np.einsum("mk,mkc->mc", U, inner[self.blocks.number]))


def _matrices(a: Array, b: Array, c: Array) -> Array:
    """Symmetric 2 x 2 matrices (n, 2, 2) of diagonals a, c and off-diagonals b (n,)."""
    return np.stack([np.stack([a, b], axis=1), np.stack([b, c], axis=1)], axis=1)
