"""The functions a surrogate is a sum of: products of one-dimensional functions of the joint angles.

Both bases are written in a form that is orthonormal over the box of the domain. That changes nothing about
which functions they can represent, but the least squares problem is then about as well conditioned as the
choice of poses allows, and neither a narrow range nor a high degree spoils the digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import comb
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from sklearn.preprocessing import PolynomialFeatures

from robots.errors import InputError

Array = NDArray[np.float64]
BasisName = Literal["polynomial", "trigonometric"]

BASIS_NAMES: tuple[BasisName, ...] = ("polynomial", "trigonometric")
MAX_INPUTS = 6
MAX_DEGREE = 20
# Beyond this a fit takes gigabytes and hours: terms x runs numbers, terms^2 x runs operations.
MAX_TERMS = 6_000
# Numbers in one block of the design matrix while evaluating: 0.8 MB, so that it stays in the cache.
_BLOCK = 100_000
# One-dimensional functions closer to dependent than this leave fewer than four digits.
_WORST_RECOMBINATION = 1e12


@dataclass(frozen=True)
class Basis:
    """A set of ``t`` product functions of ``k`` joint angles, scaled by the domain.

    With ``x_i = q_i - centre_i`` and ``u_i = x_i / half_range_i``, term ``t`` is
    ``prod_i f_i[terms[t][i]]``, where

    - polynomial: ``f[j](u) = sqrt(2 j + 1) P_j(u)``, Legendre polynomials, the total degree at most
      ``degree``: the span of all monomials up to that degree;
    - trigonometric: ``f = g @ recombination[i]`` with ``g(x) = (1, cos x, sin x, ..., cos m x, sin m x)``,
      ``m = degree``, every combination of the inputs' functions: the tensor product's span.

    Parameters
    ----------
    name : 'polynomial' or 'trigonometric'
    degree : total degree, or the trigonometric order m in each input
    centre, half_range : (k,) rad
    terms : (t, k) which one-dimensional function of each input makes up each term
    recombination : (k, 2m+1, 2m+1) for the trigonometric basis, else empty; kept (and stored in files)
        rather than computed again, so that coefficients never meet functions rounded differently

    Raises
    ------
    InputError
        The parts do not fit together.
    """

    name: BasisName
    degree: int
    centre: tuple[float, ...]
    half_range: tuple[float, ...]
    terms: tuple[tuple[int, ...], ...]
    recombination: tuple[tuple[tuple[float, ...], ...], ...] = ()

    def __post_init__(self) -> None:
        k = len(self.centre)
        _check_size(self.name, self.degree, k)
        if len(self.half_range) != k or not np.all(np.isfinite([*self.centre, *self.half_range])):
            raise InputError("basis: centre and half_range", allowed=f"{k} finite numbers each")
        if min(self.half_range) <= 0.0:
            raise InputError("basis: half_range", value=list(self.half_range), allowed="greater than 0")
        if len(self.terms) != term_count(self.name, self.degree, k):
            raise InputError(
                "basis: number of terms",
                value=len(self.terms),
                allowed=f"{term_count(self.name, self.degree, k)} for {self.name} {self.degree}, {k} inputs",
            )
        if set(self.terms) != set(_terms(self.name, self.degree, k)):
            raise InputError(f"basis: terms are not those of the {self.name} basis, degree {self.degree}")
        if self.name == "trigonometric":
            m = 2 * self.degree + 1
            rows = [row for matrix in self.recombination for row in matrix]
            sizes_fit = len(self.recombination) == k and len(rows) == k * m and {len(r) for r in rows} == {m}
            if not sizes_fit or not np.all(np.isfinite(rows)):
                raise InputError("basis: recombination", allowed=f"finite numbers, {k} x {m} x {m}")
        elif self.recombination:
            raise InputError("basis: recombination", allowed="none for the polynomial basis")

    @property
    def n_inputs(self) -> int:
        """Number of joint angles k."""
        return len(self.centre)

    @property
    def n_terms(self) -> int:
        """Number of terms t."""
        return len(self.terms)

    def design(self, Q: Array) -> Array:
        """Every term at every pose; Q (n, k) rad -> (n, t).

        All of it is held in memory (8 n t bytes); to evaluate a sum of terms use `evaluate`.
        """
        x = (np.asarray(Q, dtype=np.float64) - np.array(self.centre)).T
        out: Array | None = None
        for i in range(self.n_inputs):
            # Whole rows are gathered, which costs a tenth of gathering columns.
            factor = self._one_dimensional(i, x[i])[self._term_columns[i]]
            out = factor if out is None else np.multiply(out, factor, out=out)
        assert out is not None  # noqa: S101 - there is at least one input
        return out.T

    def evaluate(self, Q: Array, coefficients: Array) -> Array:
        """Sum coefficients times terms, in blocks; Q (n, k) rad, coefficients (t,) -> (n,)."""
        out = np.empty(len(Q))
        step = max(1, _BLOCK // self.n_terms)
        for start in range(0, len(Q), step):
            out[start : start + step] = self.design(Q[start : start + step]) @ coefficients
        return out

    @cached_property
    def _term_columns(self) -> NDArray[np.intp]:
        return np.array(self.terms, dtype=np.intp).T

    @cached_property
    def _recombination(self) -> Array:
        return np.array(self.recombination)

    def _one_dimensional(self, i: int, x: Array) -> Array:
        """Functions of input i at x (n,) rad from the centre -> (functions, n)."""
        if self.name == "polynomial":
            return _legendre(x / self.half_range[i], self.degree)
        return np.asarray(self._recombination[i].T @ _harmonics(x, self.degree))


def polynomial_basis(lower: Array, upper: Array, degree: int = 6) -> Basis:
    """All polynomials up to a total degree in the angles scaled to [-1, 1]; 210 terms for k=4, degree 6.

    The term set is scikit-learn's ``PolynomialFeatures``; the monomials are replaced by products of
    Legendre polynomials with the same span.

    Parameters
    ----------
    lower, upper : (k,) rad, the box that is scaled to [-1, 1]
    degree : 1 to 20

    Raises
    ------
    InputError
        Empty or non-finite ranges, a degree or a number of inputs out of range, or too many terms.
    """
    return make_basis("polynomial", lower, upper, degree)


def trigonometric_basis(lower: Array, upper: Array, order: int = 2) -> Basis:
    """Tensor product of {1, cos q, sin q, ..., cos m q, sin m q}; (2m+1)^k terms, 625 for k=4, m=2.

    The compliance of a chain of revolute joints with constant springs lies in it exactly for m = 2.

    Parameters
    ----------
    lower, upper : (k,) rad, the box over which the functions are made orthonormal
    order : m, 1 to 20

    Raises
    ------
    InputError
        As for `polynomial_basis`; also if a range is so narrow that double precision cannot tell the
        functions apart.
    """
    return make_basis("trigonometric", lower, upper, order)


def make_basis(name: BasisName, lower: Array, upper: Array, degree: int) -> Basis:
    """Make the basis called ``name`` over the box lower..upper (k,) rad; see the two functions above."""
    lo, hi = as_box(lower, upper)
    _check_size(name, degree, len(lo))
    centre, half = 0.5 * (lo + hi), 0.5 * (hi - lo)
    return Basis(
        name,
        degree,
        tuple(centre.tolist()),
        tuple(half.tolist()),
        _terms(name, degree, len(lo)),
        tuple(_recombine(h, degree) for h in half) if name == "trigonometric" else (),
    )


def as_box(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Check the limits (k,) rad of a box: InputError unless finite, each lower one below its upper one."""
    lo, hi = np.atleast_1d(np.asarray(lower, np.float64)), np.atleast_1d(np.asarray(upper, np.float64))
    if lo.shape != hi.shape or lo.ndim != 1:
        raise InputError("domain: lower and upper", value=f"shapes {lo.shape} and {hi.shape}", allowed="(k,)")
    if not (np.all(np.isfinite(lo)) and np.all(np.isfinite(hi)) and np.all(lo < hi)):
        raise InputError(
            "domain",
            value=f"{np.degrees(lo).tolist()} to {np.degrees(hi).tolist()} deg",
            allowed="finite, each lower limit below its upper limit",
            remedy="give a range to each input, or make the input a fixed coordinate",
        )
    return lo, hi


def term_count(name: BasisName, degree: int, n_inputs: int) -> int:
    """Count the terms: C(k + degree, degree), or (2 degree + 1)^k."""
    if name == "polynomial":
        return comb(n_inputs + degree, degree)
    return int((2 * degree + 1) ** n_inputs)


def _check_size(name: str, degree: int, n_inputs: int) -> None:
    if name not in BASIS_NAMES:
        raise InputError("basis", value=name, allowed=", ".join(BASIS_NAMES))
    if not 1 <= n_inputs <= MAX_INPUTS:
        raise InputError("basis: number of inputs", value=n_inputs, allowed=f"1 to {MAX_INPUTS}")
    if not 1 <= degree <= MAX_DEGREE:
        raise InputError("basis: degree or order", value=degree, allowed=f"1 to {MAX_DEGREE}")
    terms = term_count("polynomial" if name == "polynomial" else "trigonometric", degree, n_inputs)
    if terms > MAX_TERMS:
        raise InputError(
            f"basis: terms of {name} {degree} with {n_inputs} inputs",
            value=terms,
            allowed=f"at most {MAX_TERMS}",
            remedy="lower the degree or fix one of the coordinates",
        )


def _terms(name: BasisName, degree: int, n_inputs: int) -> tuple[tuple[int, ...], ...]:
    if name == "polynomial":
        powers = PolynomialFeatures(degree).fit(np.zeros((1, n_inputs))).powers_
        return tuple(tuple(int(p) for p in row) for row in powers)
    return tuple(product(range(2 * degree + 1), repeat=n_inputs))


def _legendre(u: Array, degree: int) -> Array:
    """Legendre polynomials 0..degree at u (n,), orthonormal for the mean over [-1, 1] -> (degree+1, n)."""
    norm = np.sqrt(2.0 * np.arange(degree + 1) + 1.0)
    return np.asarray(norm[:, None] * np.polynomial.legendre.legvander(u, degree).T)


def _harmonics(x: Array, order: int) -> Array:
    """1, cos x, sin x, ..., cos m x, sin m x at x (n,) -> (2m+1, n)."""
    out = np.ones((2 * order + 1, len(x)))
    for j in range(1, order + 1):
        out[2 * j - 1], out[2 * j] = np.cos(j * x), np.sin(j * x)
    return out


def _recombine(half_range: float, order: int) -> tuple[tuple[float, ...], ...]:
    """Find the matrix that makes the harmonics orthonormal for the mean over -half_range..half_range."""
    # Gauss-Legendre is exact to round-off here: 40 nodes or more for each turn of the fastest product.
    u, w = np.polynomial.legendre.leggauss(40 + int(40 * order * half_range / np.pi))
    q, r = np.linalg.qr((_harmonics(half_range * u, order) * np.sqrt(0.5 * w)).T)
    del q
    condition = np.linalg.cond(r)
    if not condition < _WORST_RECOMBINATION:
        raise InputError(
            f"trigonometric basis of order {order} over a range of {2.0 * np.degrees(half_range):.6g} deg",
            value=f"functions that agree to 1 part in {condition:.1g}",
            allowed=f"up to {_WORST_RECOMBINATION:.0e}",
            remedy="lower the order, widen the range, or use the polynomial basis",
        )
    matrix = np.linalg.inv(r * np.sign(np.diag(r))[:, None])
    return tuple(tuple(row) for row in matrix.tolist())
