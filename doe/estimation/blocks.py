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

from robots.arrays import Array, Indices, Integers


@dataclass(frozen=True)
class Blocks:
    """The block of every reading: ``number`` (m,), counted from 0, and ``sums`` (b, m), which adds up over blocks."""

    number: Integers
    sums: csr_array

    @staticmethod
    def of(key: Integers) -> Blocks:
        """Blocks of readings with the same ``key`` (m,)."""
        _, number = np.unique(key, return_inverse=True)
        starts = np.concatenate([[0], np.cumsum(np.bincount(number))])
        order = np.argsort(number, kind="stable")
        return Blocks(number, csr_array((np.ones(len(order)), order, starts), shape=(len(starts) - 1, len(order))))

    def __len__(self) -> int:
        return int(self.sums.shape[0])

    @property
    def most(self) -> int:
        """Readings in the largest block."""
        return int(np.bincount(self.number).max(initial=0))

    @cached_property
    def first(self) -> Indices:
        """The first reading (b,) of each block."""
        return np.asarray(self.sums.indices[self.sums.indptr[:-1]], dtype=np.intp)

    def weighted(self, x: Array) -> csr_array:
        """Sums over blocks with weights x (m, k) (k b, m): the first column's of all blocks, then the next one's."""
        order, starts, k = self.sums.indices, self.sums.indptr, x.shape[1]
        ends = np.concatenate([[0], (np.arange(k)[:, None] * len(order) + starts[1:]).reshape(-1)])
        return csr_array((x[order].T.reshape(-1), np.tile(order, k), ends), shape=(k * len(self), len(x)))

    def add(self, x: Array) -> Array:
        """Sums (b, ...) of x (m, ...) over blocks."""
        return np.asarray(self.sums @ x.reshape(len(x), -1)).reshape(len(self), *x.shape[1:])

    def covariance(self, variance: Array, common: Array) -> Covariance:
        """V = diag(variance) + common common^T in every block; variance (m,), common (m, 2)."""
        kept = common[:, common.any(axis=0)]
        return Covariance(self, variance, kept if kept.size else None)


@dataclass(frozen=True)
class Alike:
    """Groups of readings of one block for which a law predicts the same: only the mean of a group tells of it.

    ``groups``: of the readings (m,); ``blocks``: of the groups (g,).
    """

    groups: Blocks
    blocks: Blocks

    @staticmethod
    def of(key: Integers, blocks: Blocks) -> Alike:
        """Groups of readings of one block with the same ``key`` (m,)."""
        groups = Blocks.of(blocks.number * (int(key.max(initial=0)) + 1) + key)
        return Alike(groups, Blocks.of(blocks.number[groups.first]))

    def once(self, x: Array) -> Array | None:
        """Rows x (m, ...) once for each group (g, ...); None where they differ within one."""
        out = x[self.groups.first]
        return out if np.array_equal(out[self.groups.number], x) else None

    def mean(self, x: Array, variance: Array) -> Array:
        """Means (g, k) of x (m, k), weighted by 1 / variance (m,)."""
        precision = 1.0 / variance
        return self.groups.add(x * precision[:, None]) / self.groups.add(precision)[:, None]


class Covariance:
    """V of all readings: its inverse and determinant, and a square root of the inverse, applied block by block.

    ``common`` (m, k): one or two columns, none of them zero. ``E`` (m, k): D^-1 times these.
    """

    def __init__(self, blocks: Blocks, variance: Array, common: Array | None) -> None:
        self.blocks = blocks
        self.variance = variance
        self.common = common
        self.log_det = float(np.log(variance).sum())
        self._of_means: dict[int, tuple[Alike, Covariance | None]] = {}
        if common is not None:
            self.E = common / variance[:, None]
            self.inner = blocks.add(common[:, :, None] * self.E[:, None, :]) + np.eye(common.shape[1])
            self.log_det += float(np.log(_determinant(self.inner)).sum())

    def log_dets(self, group: Integers) -> Array:
        """Log determinant (g,) of each group's part of V; ``group`` (m,): numbers, a block being of one group."""
        out = np.bincount(group, np.log(self.variance))
        if self.common is not None:
            of_blocks = np.log(_determinant(self.inner))
            out = out + np.bincount(group[self.blocks.first], of_blocks, minlength=len(out))
        return np.asarray(out)

    @cached_property
    def middle(self) -> Array:
        """(I + C^T D^-1 C)^-1 (b, k, k)."""
        return _inverse(self.inner)

    @property
    def inverse_diagonal(self) -> Array:
        """Diagonal (m,) of V^-1."""
        plain = 1.0 / self.variance
        if self.common is None:
            return np.asarray(plain)
        return np.asarray(plain - np.einsum("mk,mkl,ml->m", self.E, self.middle[self.blocks.number], self.E))

    def of_means(self, alike: Alike) -> Covariance | None:
        """Covariance of the means of readings that are alike; None where what they have in common differs.

        With P the groups' indicator (m, g) it is ``(P^T V^-1 P)^-1``: columns P X have the same products with all
        others as their rows X (g, k) have with the others' means (:meth:`Alike.mean`).
        """
        if id(alike) not in self._of_means:
            common = None if self.common is None else alike.once(self.common)
            apart = self.common is not None and common is None
            precision = alike.groups.add(1.0 / self.variance)
            # Kept with the groups themselves, whose number others would bear once they are gone.
            self._of_means[id(alike)] = alike, None if apart else Covariance(alike.blocks, 1.0 / precision, common)
        return self._of_means[id(alike)][1]

    def solve(self, columns: Array) -> Array:
        """V^-1 times columns (m, c)."""
        out = columns / self.variance[:, None]
        return out if self.common is None else self._solving.taken_from(out, columns)

    def whiten(self, columns: Array) -> Array:
        """V^(-1/2) times columns (m, c), up to a rotation: D^-1/2 first, then the symmetric root of I + U U^T.

        With K = U^T U and N = (I + K)^(1/2), ``(I + U U^T)^(-1/2) = I - U (I + K + N)^-1 U^T``.
        """
        out = columns / np.sqrt(self.variance)[:, None]
        return out if self.common is None else self._whitening.taken_from(out, out)

    @cached_property
    def _solving(self) -> _InBlocks:
        return _InBlocks(self.blocks, self.E, self.middle)

    @cached_property
    def _whitening(self) -> _InBlocks:
        assert self.common is not None  # noqa: S101 - asked before
        U = self.common / np.sqrt(self.variance)[:, None]
        return _InBlocks(self.blocks, U, _inverse(self.inner + _root(self.inner)))


class _InBlocks:
    """``U middle U^T`` block by block; U (m, k), ``middle`` (b, k, k)."""

    def __init__(self, blocks: Blocks, U: Array, middle: Array) -> None:
        self.sums = blocks.weighted(U)
        self.back, self.middle = self.sums.T, middle

    def taken_from(self, out: Array, x: Array) -> Array:
        """``out`` less this times x (m, c), in place."""
        b, k, _ = self.middle.shape
        inner = np.swapaxes((self.sums @ x).reshape(k, b, -1), 0, 1)
        out -= self.back @ np.swapaxes(self.middle @ inner, 0, 1).reshape(k * b, -1)
        return out


def _determinant(A: Array) -> Array:
    """Determinants (b,) of symmetric matrices (b, k, k), k one or two."""
    return np.asarray(A[:, 0, 0] if A.shape[1] == 1 else A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] ** 2)


def _inverse(A: Array) -> Array:
    """Inverses of symmetric matrices (b, k, k), k one or two."""
    if A.shape[1] == 1:
        return np.asarray(1.0 / A)
    turned = A[:, ::-1, ::-1] * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return np.asarray(turned / _determinant(A)[:, None, None])


def _root(A: Array) -> Array:
    """Square roots of symmetric matrices (b, k, k); of two rows: (A + d I) / (tr A + 2 d)^(1/2), d^2 = |A|."""
    if A.shape[1] == 1:
        return np.sqrt(A)
    d = np.sqrt(_determinant(A))
    return np.asarray((A + d[:, None, None] * np.eye(2)) / np.sqrt(A[:, 0, 0] + A[:, 1, 1] + 2.0 * d)[:, None, None])
