"""A sum of products of one-dimensional functions of the joint angles: what every surrogate is made of.

All bases (polynomials, trigonometric functions, mixtures) have this one form, so that evaluation, compiled kernels
and exports to other languages are written once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robots.arrays import Array, Integers, in_blocks
from robots.errors import InputError
from surrogate.scope import frozen

TURN = 2.0 * np.pi
# Numbers in one block of the design matrix while evaluating: 0.8 MB, so that it stays in the cache.
_BLOCK = 100_000
# Highest degree of a polynomial: all below it are computed too, so a wrong file could ask for any amount of memory.
_HIGHEST = 200


@dataclass(frozen=True, eq=False)
class Family:
    """One-dimensional functions of one joint angle: ``f(q) = matrix @ g(x)``.

    With ``x = q - centre``, wrapped into -pi to pi where ``periodic``, and ``u = x / half_range``,
    ``g = (1, cos x, sin x, ..., cos m x, sin m x, P_d1(u), ..., P_dp(u))`` with Legendre polynomials P_d.

    Parameters
    ----------
    centre, half_range : rad
    periodic : whole turns do not matter
    harmonics : m, 0 or more
    degrees : (p,) degrees of the Legendre polynomials, each 1 or more, ascending
    matrix : (f, 1 + 2 m + p)

    Raises
    ------
    InputError
        Numbers that are not finite or do not fit together.
    """

    centre: float
    half_range: float
    periodic: bool
    harmonics: int
    degrees: tuple[int, ...]
    matrix: Array

    def __post_init__(self) -> None:
        matrix = frozen(self.matrix)
        object.__setattr__(self, "matrix", matrix)
        raw = 1 + 2 * self.harmonics + len(self.degrees)
        if not np.isfinite([self.centre, self.half_range]).all() or not self.half_range > 0.0:
            raise InputError(
                "family: centre and half_range",
                code="F007",
                value=[self.centre, self.half_range],
                allowed="finite, range above 0",
            )
        highest = max(self.degrees, default=1)
        in_order = list(self.degrees) == sorted(set(self.degrees))
        if self.harmonics < 0 or min(self.degrees, default=1) < 1 or highest > _HIGHEST or not in_order:
            raise InputError(
                "family: harmonics and degrees",
                code="F007",
                value=[self.harmonics, *self.degrees],
                allowed=f"0 or more, and degrees from 1 to {_HIGHEST}, ascending",
            )
        if matrix.ndim != 2 or matrix.shape[1] != raw or not len(matrix) or not np.isfinite(matrix).all():
            raise InputError(
                "family: matrix", code="F007", value=f"shape {matrix.shape}", allowed=f"finite, (f, {raw}), f >= 1"
            )

    @property
    def size(self) -> int:
        """Number of functions f."""
        return len(self.matrix)

    def local(self, q: Array) -> Array:
        """Angle from the centre, x (n,) rad; whole turns are taken off where ``periodic``."""
        x = np.asarray(q, dtype=np.float64) - self.centre
        return x - TURN * np.round(x / TURN) if self.periodic else x

    def raw(self, q: Array) -> Array:
        """The functions g at q (n,) rad -> (1 + 2 m + p, n)."""
        x = self.local(q)
        out = np.ones((self.matrix.shape[1], len(x)))
        for j in range(1, self.harmonics + 1):
            out[2 * j - 1], out[2 * j] = np.cos(j * x), np.sin(j * x)
        if self.degrees:
            legendre = np.polynomial.legendre.legvander(x / self.half_range, self.degrees[-1]).T
            out[1 + 2 * self.harmonics :] = legendre[list(self.degrees)]
        return out

    def __call__(self, q: Array) -> Array:
        """All functions at q (n,) rad -> (f, n)."""
        return np.asarray(self.matrix @ self.raw(q))


class Products:
    """Products of functions of k joint angles: ``families`` (k,); ``terms`` (t, k), which function of each angle."""

    families: tuple[Family, ...]
    terms: Integers

    @property
    def n_inputs(self) -> int:
        """Number of joint angles k."""
        return len(self.families)

    @property
    def n_terms(self) -> int:
        """Number of terms t."""
        return len(self.terms)

    def design(self, Q: Array) -> Array:
        """Every term at every pose; Q (n, k) rad -> (n, t). All of it is held in memory (8 n t bytes)."""
        angles = np.asarray(Q, dtype=np.float64).T
        out: Array | None = None
        for family, column, angle in zip(self.families, self._columns, angles, strict=True):
            # Whole rows are gathered, which costs a tenth of gathering columns.
            factor = family(angle)[column]
            out = factor if out is None else np.multiply(out, factor, out=out)
        assert out is not None  # noqa: S101 - there is at least one input
        return out.T

    @cached_property
    def _columns(self) -> Integers:
        return np.ascontiguousarray(self.terms.T)


@dataclass(frozen=True, eq=False)
class Expansion(Products):
    """``y(q) = sum_t coefficients[t] prod_i f_i[terms[t, i]](q_i)`` over k joint angles.

    Parameters
    ----------
    families : (k,) the functions of each angle
    terms : (t, k) which function of each angle makes up each term; sorted by rows, no row twice
    coefficients : (t, m) for m numbers at once

    Raises
    ------
    InputError
        Shapes that do not fit, terms out of range or twice, coefficients that are not finite.
    """

    families: tuple[Family, ...]
    terms: Integers
    coefficients: Array

    def __post_init__(self) -> None:
        terms, coefficients = frozen(self.terms, np.int64), frozen(self.coefficients)
        object.__setattr__(self, "terms", terms)
        object.__setattr__(self, "coefficients", coefficients)
        check_terms(self.families, terms)
        if coefficients.ndim != 2 or len(coefficients) != len(terms) or not coefficients.shape[1]:
            raise InputError(
                "surrogate: coefficients",
                code="F007",
                value=f"shape {coefficients.shape}",
                allowed=f"({len(terms)}, m), one row for each term",
            )
        if not np.isfinite(coefficients).all():
            raise InputError("surrogate: coefficients", code="F007", value="NaN or infinity", allowed="finite numbers")

    @property
    def n_outputs(self) -> int:
        """Numbers m at each pose."""
        return int(self.coefficients.shape[1])

    def __call__(self, Q: Array) -> Array:
        """Q (n, k) rad -> y (n, m), block by block. Angles are not checked."""
        out = np.empty((len(Q), self.n_outputs))
        for rows in in_blocks(len(Q), max(1, _BLOCK // self.n_terms)):
            out[rows] = self.design(Q[rows]) @ self.coefficients
        return out


def check_terms(families: tuple[Family, ...], terms: Integers) -> None:
    """Refuse terms (t, k) that are not sorted, stand twice or name functions that are not there (InputError)."""
    k = len(families)
    if not k or terms.ndim != 2 or terms.shape[1] != k or not len(terms):
        raise InputError(
            "surrogate: terms", code="F007", value=f"shape {terms.shape}", allowed=f"(t, {k}), t and k at least 1"
        )
    sizes = np.array([f.size for f in families])
    if (terms < 0).any() or (terms >= sizes).any():
        raise InputError("surrogate: terms", code="F007", allowed="numbers of functions that the families have")
    order = np.lexsort(terms.T[::-1])
    repeated = (np.diff(terms[order], axis=0) == 0).all(axis=1)
    if repeated.any() or (order != np.arange(len(terms))).any():
        raise InputError("surrogate: terms", code="F007", allowed="sorted by rows, each once")
