"""Evidence of many candidates on one base at once, for given noise.

A candidate's columns X add to a base's evidence (:mod:`doe.diagnosis.evidence`) by their Schur complement,
``G = X^T V^-1 X - X^T V^-1 A S^-1 A^T V^-1 X``. Candidates are taken by the number of their amplitudes, and their
columns once for each group of readings that are alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr

from doe.diagnosis.evidence import Whitened
from doe.diagnosis.signatures import Signature
from doe.estimation.blocks import Alike, Covariance
from robots.arrays import Array, Bools, Indices

# Columns worked on at once: few enough that they stay in cache.
AT_ONCE = 128
# Directions of a candidate's columns weaker than this share of its strongest one are followed by the base.
FOLLOWED = 1e-9


@dataclass(frozen=True)
class Fitted:
    """A candidate at one noise: log evidence, posterior means and covariance of its amplitudes, excess of chi-square.

    ``excess``: fall of the weighted sum of squares by the candidate's columns, the base free to follow;
    ``base`` (b,): posterior means of the base's numbers, from their prior means.
    """

    log_evidence: float
    mean: Array
    covariance: Array
    excess: float
    base: Array


@dataclass(frozen=True)
class _Chunk:
    """Candidates numbered ``mine`` (n,) with as many amplitudes each, their columns side by side, and priors (n, a).

    ``rows`` (g, n a) of the columns: of the groups of readings that are ``alike``, or of the readings.
    """

    mine: Indices
    rows: Array
    alike: Alike | None
    mean: Array
    precision: Array
    positive: Bools

    @staticmethod
    def of(candidates: Sequence[Signature], mine: Indices) -> _Chunk:
        some = [candidates[i] for i in mine]
        mean, sd, positive = (np.stack([getattr(c, name) for c in some]) for name in ("mean", "sd", "positive"))
        return _Chunk(mine, np.hstack([c.rows for c in some]), some[0].alike, mean, sd**-2.0, positive)

    def whitened(self, V: Covariance) -> _Columns:
        """The columns at one noise."""
        means = None if self.alike is None else V.of_means(self.alike)
        if self.alike is None or means is None:
            rows = self.rows if self.alike is None else self.rows[self.alike.groups.number]
            return _Columns(None, V, V.whiten(rows))
        return _Columns(self.alike, means, means.whiten(self.rows))


@dataclass(frozen=True)
class _Columns:
    """Whitened columns (g, k) of means of readings that are alike, or of the readings; V is their covariance."""

    alike: Alike | None
    V: Covariance
    WX: Array

    def of_base(self, w: Whitened) -> tuple[Array, Array]:
        """A base's whitened columns (g, b) and residual (g,) for the same rows."""
        return (w.W, w.r) if self.alike is None else w.of_means(self.alike, self.V)


@dataclass(frozen=True)
class _Products:
    """A chunk's products at one noise beside a base: with one another, with the base, and with the residual.

    ``own`` (n, a, a); ``half`` (b, n a): L^-1 W^T WX; ``right`` (n a,): WX^T r.
    """

    chunk: _Chunk
    own: Array
    half: Array
    right: Array

    @staticmethod
    def of(chunk: _Chunk, x: _Columns, w: Whitened) -> _Products:
        """The products of a chunk's whitened columns with a base."""
        n, a = chunk.mean.shape
        W, r = x.of_base(w)
        by_candidate = np.moveaxis(x.WX.reshape(-1, n, a), 1, 0)
        own = np.asarray(np.swapaxes(by_candidate, 1, 2) @ by_candidate)
        return _Products(chunk, own, w.root @ (W.T @ x.WX), x.WX.T @ r)

    def beside(self, x: _Columns, w: Whitened) -> _Products:
        """The products with a base that has further columns than this one's."""
        (W, r), known = x.of_base(w), w.new.start
        more = W[:, w.new].T @ x.WX - w.L[known:, :known] @ self.half
        half = np.vstack([self.half, w.root[known:, known:] @ more])
        return replace(self, half=half, right=x.WX.T @ r)

    def times(self, size: float) -> _Products:
        """The products of columns that are larger."""
        return replace(self, own=size**2 * self.own, half=size * self.half, right=size * self.right)

    def fitted(self, w: Whitened) -> _Fits:
        """Fits on the base that the products are with."""
        n, a = self.chunk.mean.shape
        half = np.moveaxis(self.half.reshape(-1, n, a), 1, 0)
        G = self.own - np.swapaxes(half, 1, 2) @ half
        g = (self.right - self.half.T @ w.z).reshape(n, a)
        mean, precision = self.chunk.mean, self.chunk.precision
        S = G + precision[:, :, None] * np.eye(a)
        covariance = np.asarray(np.linalg.inv(S))
        h = g + precision * mean
        v = np.einsum("nkl,nl->nk", covariance, h)
        gain = 0.5 * np.einsum("nk,nk->n", h, v) - 0.5 * np.sum(precision * mean**2, axis=1)
        gain += 0.5 * (np.log(precision).sum(axis=1) - np.linalg.slogdet(S)[1])
        sd = np.sqrt(np.einsum("nkk->nk", covariance))
        above = log_ndtr(v / sd) - log_ndtr(mean * np.sqrt(precision))
        gain += np.sum(np.where(self.chunk.positive, above, 0.0), axis=1)
        # How the base's numbers that have floors make room.
        K = (w.root[:, w.bounded].T @ self.half).reshape(-1, n, a)
        u = w.u[w.bounded] - np.einsum("fnk,nk->nf", K, v)
        gain += w.above(u, np.einsum("fnk,nkl,fnl->nf", K, covariance, K))
        return _Fits(self.chunk, w.unbounded + gain, v, covariance, G, g, half)


@dataclass(frozen=True)
class _Fits:
    """Fits of a chunk's candidates: log evidence (n,), means (n, a) and covariances (n, a, a) of amplitudes.

    ``G`` (n, a, a), ``g`` (n, a): Schur complements and their right hand sides; ``half`` (n, b, a).
    """

    chunk: _Chunk
    log_evidence: Array
    mean: Array
    covariance: Array
    G: Array
    g: Array
    half: Array

    @cached_property
    def excess(self) -> Array:
        """Fall (n,) of the weighted sum of squares."""
        values, vectors = np.linalg.eigh(self.G)
        size = np.abs(values)
        told = size > FOLLOWED * size.max(axis=1, keepdims=True, initial=0.0)
        along = np.einsum("nkl,nk->nl", vectors, self.g)
        return np.asarray(np.sum(np.divide(along**2, values, out=np.zeros_like(values), where=told), axis=1))


class Stack:
    """Candidates by code with their columns side by side, for one noise and base after the other.

    ``flat``: all that have amplitudes, code after code; ``place``: where in it a code's are; ``rarity`` (n,): what the
    log evidence of each is charged with.
    """

    def __init__(self, candidates: Mapping[str, Sequence[Signature]]) -> None:
        self.by_code = candidates
        self.flat: list[Signature] = []
        self.place: dict[str, slice] = {}
        for code, some in candidates.items():
            flat = [c for c in some if c.shift is None]
            if flat:
                self.place[code] = slice(len(self.flat), len(self.flat) + len(flat))
                self.flat += flat
        self.rarity = np.array([c.rarity for c in self.flat])
        self.chunks = list(self._chunks())

    def _chunks(self) -> Iterator[_Chunk]:
        kinds: dict[tuple[int, int], list[int]] = {}
        for i, c in enumerate(self.flat):
            kinds.setdefault((id(c.alike), c.rows.shape[1]), []).append(i)
        for (_, width), mine in kinds.items():
            size = max(AT_ONCE // max(width, 1), 1)
            for first in range(0, len(mine), size):
                yield _Chunk.of(self.flat, np.array(mine[first : first + size]))


class Fits:
    """Fits of all of a stack's candidates that have amplitudes on one base."""

    def __init__(self, w: Whitened, stack: Stack, products: Iterable[_Products]) -> None:
        self._w, self._parts = w, [p.fitted(w) for p in products]
        self._where = np.zeros((len(stack.flat), 2), dtype=np.intp)
        self.log_evidence = np.zeros(len(stack.flat))
        for k, part in enumerate(self._parts):
            mine = part.chunk.mine
            self.log_evidence[mine] = part.log_evidence - stack.rarity[mine]
            self._where[mine] = np.stack([np.full(len(mine), k), np.arange(len(mine))], axis=1)

    @cached_property
    def excess(self) -> Array:
        """Fall (n,) of the weighted sum of squares by each candidate."""
        out = np.zeros(len(self.log_evidence))
        for part in self._parts:
            out[part.chunk.mine] = part.excess
        return out

    def shows(self, i: int) -> Array:
        """Rise (a,) of chi-square by each of a candidate's columns alone, the base free to follow."""
        k, place = self._where[i]
        return np.asarray(np.diag(self._parts[k].G[place]))

    def mean(self, i: int) -> Array:
        """Posterior means (a,) of a candidate's amplitudes."""
        k, place = self._where[i]
        return np.asarray(self._parts[k].mean[place])

    def __getitem__(self, i: int) -> Fitted:
        k, place = self._where[i]
        part, w = self._parts[k], self._w
        base = w.u - w.root.T @ (part.half[place] @ part.mean[place])
        return Fitted(
            float(part.log_evidence[place]),
            part.mean[place].copy(),
            part.covariance[place].copy(),
            float(part.excess[place]),
            np.asarray(base),
        )


class Kept:
    """A stack whitened at one noise, and its products with a base, for bases that have further columns."""

    def __init__(self, w: Whitened, stack: Stack) -> None:
        self.w, self.stack = w, stack
        self._columns = [chunk.whitened(w.V) for chunk in stack.chunks]
        self._products = [_Products.of(chunk, x, w) for chunk, x in zip(stack.chunks, self._columns, strict=True)]

    def fit(self, w: Whitened) -> Fits:
        """Fits on another base at the same noise; one that the base itself is within takes a fraction of the work."""
        if w.within is self.w:
            further = (p.beside(x, w) for p, x in zip(self._products, self._columns, strict=True))
        else:
            further = (_Products.of(chunk, x, w) for chunk, x in zip(self.stack.chunks, self._columns, strict=True))
        return Fits(w, self.stack, further)


def fit_all(w: Whitened, candidates: Stack | Sequence[Signature]) -> Fits:
    """Every candidate's fit on a base; those without amplitudes are not for here."""
    stack = candidates if isinstance(candidates, Stack) else Stack({"": candidates})
    return Fits(w, stack, (_Products.of(chunk, chunk.whitened(w.V), w) for chunk in stack.chunks))


def against(w: Whitened, stack: Stack, changes: Array) -> Iterator[tuple[Indices, Array, Array]]:
    """Numbers (n,) of candidates, their Schur complements (n, a, a) and right hand sides (n, a, d), some at a time.

    ``changes`` (m, d): of the readings, each in place of the residual.
    """
    V = w.V
    half_of_changes = w.root @ (w.W.T @ V.whiten(changes))
    for chunk in stack.chunks:
        x, (n, a) = chunk.whitened(V), chunk.mean.shape
        p = _Products.of(chunk, x, w)
        half = np.moveaxis(p.half.reshape(-1, n, a), 1, 0)
        own = changes if x.alike is None else x.alike.mean(changes, V.variance)
        g = x.WX.T @ x.V.whiten(own) - p.half.T @ half_of_changes
        yield chunk.mine, p.own - np.swapaxes(half, 1, 2) @ half, np.asarray(g.reshape(n, a, -1))


def scaled_evidence(w: Whitened, rows: Array, alike: Alike | None, sizes: Sequence[float]) -> list[float]:
    """Log evidence of a base beside columns of standard normal numbers that are larger by each of some sizes.

    ``rows`` (g, k): of the columns, once for each group of readings that are ``alike``.
    """
    one = np.ones((1, rows.shape[1]))
    chunk = _Chunk(np.array([0]), rows, alike, 0.0 * one, one, np.zeros(one.shape, dtype=bool))
    products = _Products.of(chunk, chunk.whitened(w.V), w)
    return [float(products.times(size).fitted(w).log_evidence[0]) for size in sizes]
