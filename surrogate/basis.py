"""The bases by name: which functions of the joint angles a surrogate is a sum of."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import comb
from typing import Literal, get_args

import numpy as np

from robots.arrays import Array, Integers
from robots.errors import InputError, require_one_of
from surrogate.expansion import Expansion, Family, Products, check_terms
from surrogate.families import mixed_family, polynomial_family, trigonometric_family
from surrogate.scope import as_box

BasisName = Literal["polynomial", "trigonometric", "adaptive", "factored"]

BASIS_NAMES: tuple[BasisName, ...] = get_args(BasisName)
MAX_INPUTS = 7
MAX_DEGREE = 20
# Beyond this a fit takes gigabytes and hours: terms x runs numbers, terms^2 x runs operations.
MAX_TERMS = 6_000
# Compliance of a chain of revolute joints: of second order in the sine and cosine of each angle; its rows of first.
GEOMETRY_ORDER = 2
FACTOR_ORDER = 1


@dataclass(frozen=True, eq=False)
class Basis(Products):
    """A set of ``t`` product functions of ``k`` joint angles.

    Parameters
    ----------
    name : one of `BASIS_NAMES`
    degree : total degree of the polynomials, or the trigonometric order in each input
    families : (k,) the functions of each angle
    terms : (t, k) which function of each angle makes up each term, sorted by rows
    """

    name: BasisName
    degree: int
    families: tuple[Family, ...]
    terms: Integers

    def __post_init__(self) -> None:
        require_one_of("basis", self.name, BASIS_NAMES, code="S003")
        check_terms(self.families, self.terms)

    def expansion(self, coefficients: Array) -> Expansion:
        """The sum with these coefficients (t,) or (t, m)."""
        return Expansion(self.families, self.terms, np.asarray(coefficients).reshape(self.n_terms, -1))

    def take(self, kept: Integers) -> Basis:
        """Only some of the terms."""
        return Basis(self.name, self.degree, self.families, self.terms[np.sort(kept)])


def polynomial_basis(lower: Array, upper: Array, degree: int = 6, periodic: tuple[bool, ...] | None = None) -> Basis:
    """All polynomials up to a total degree in the angles scaled to [-1, 1]; 210 terms for k=4, degree 6.

    The term set is scikit-learn's ``PolynomialFeatures``; the monomials are replaced by products of
    Legendre polynomials with the same span.

    Parameters
    ----------
    lower, upper : (k,) rad, the box that is scaled to [-1, 1]
    degree : 1 to 20
    periodic : inputs whose whole turns do not matter; their box is one turn at most

    Raises
    ------
    InputError
        Empty or non-finite ranges, a degree or a number of inputs out of range, or too many terms.
    """
    lo, hi, turns = _box(lower, upper, periodic)
    k = len(lo)
    check_size("polynomial", degree, k)
    from sklearn.preprocessing import PolynomialFeatures  # takes a second to import, and no query needs it

    powers = PolynomialFeatures(degree).fit(np.zeros((1, k))).powers_
    families = tuple(polynomial_family(a, b, degree, periodic=p) for a, b, p in zip(lo, hi, turns, strict=True))
    return Basis("polynomial", degree, families, sorted_terms(powers))


def trigonometric_basis(lower: Array, upper: Array, order: int = 2, periodic: tuple[bool, ...] | None = None) -> Basis:
    """Tensor product of {1, cos q, sin q, ..., cos m q, sin m q}; (2m+1)^k terms, 625 for k=4, m=2.

    The compliance of a chain of revolute joints with constant springs lies in it exactly for m = 2.

    Parameters
    ----------
    lower, upper : (k,) rad, the box over which the functions are made orthonormal
    order : m, 1 to 20
    periodic : as for `polynomial_basis`

    Raises
    ------
    InputError
        As for `polynomial_basis`; also if a range is so narrow that double precision cannot tell the
        functions apart.
    """
    lo, hi, turns = _box(lower, upper, periodic)
    check_size("trigonometric", order, len(lo))
    families = tuple(trigonometric_family(a, b, order, periodic=p) for a, b, p in zip(lo, hi, turns, strict=True))
    return Basis("trigonometric", order, families, np.array([*product(range(2 * order + 1), repeat=len(lo))]))


def make_basis(
    name: BasisName, lower: Array, upper: Array, degree: int, periodic: tuple[bool, ...] | None = None
) -> Basis:
    """Make the polynomial or trigonometric basis over the box lower..upper (k,) rad; see the two functions above."""
    if name == "polynomial":
        return polynomial_basis(lower, upper, degree, periodic)
    if name == "trigonometric":
        return trigonometric_basis(lower, upper, degree, periodic)
    raise InputError("basis", code="S003", value=name, allowed="polynomial, trigonometric")


def mixed_families(
    lower: Array, upper: Array, order: int, degree: int, periodic: tuple[bool, ...] | None = None
) -> tuple[Family, ...]:
    """Harmonics up to ``order``, then Legendre polynomials up to ``degree``, for each input (`mixed_family`)."""
    lo, hi, turns = _box(lower, upper, periodic)
    return tuple(mixed_family(a, b, order, degree, periodic=p) for a, b, p in zip(lo, hi, turns, strict=True))


def term_count(name: BasisName, degree: int, n_inputs: int) -> int:
    """Count the terms: C(k + degree, degree), or (2 degree + 1)^k."""
    if name == "polynomial":
        return comb(n_inputs + degree, degree)
    return int((2 * degree + 1) ** n_inputs)


def sorted_terms(terms: Integers) -> Integers:
    """Terms (t, k) sorted by rows, each once."""
    return np.unique(np.asarray(terms, dtype=np.int64), axis=0)


def check_size(name: BasisName, degree: int, n_inputs: int) -> None:
    """Refuse a basis that is none or too large to be fitted (InputError)."""
    require_one_of("basis", name, BASIS_NAMES, code="S003")
    if not 1 <= n_inputs <= MAX_INPUTS:
        raise InputError("basis: number of inputs", code="S003", value=n_inputs, allowed=f"1 to {MAX_INPUTS}")
    if not 1 <= degree <= MAX_DEGREE:
        raise InputError("basis: degree or order", code="S003", value=degree, allowed=f"1 to {MAX_DEGREE}")
    terms = term_count(name, degree, n_inputs)
    if terms > MAX_TERMS:
        raise InputError(
            f"basis: terms of {name} {degree} with {n_inputs} inputs",
            code="S003",
            value=terms,
            allowed=f"at most {MAX_TERMS}",
            remedy="lower the degree, fix one of the coordinates, or take the basis factored or adaptive",
        )


def _box(lower: Array, upper: Array, periodic: tuple[bool, ...] | None) -> tuple[Array, Array, tuple[bool, ...]]:
    lo, hi = as_box(lower, upper)
    turns = (False,) * len(lo) if periodic is None else periodic
    if len(turns) != len(lo):
        raise InputError("basis: periodic", code="S003", value=len(turns), allowed=f"one for each of {len(lo)} inputs")
    middle = 0.5 * (lo + hi)
    half = np.where(turns, np.minimum(0.5 * (hi - lo), np.pi), 0.5 * (hi - lo))
    return middle - half, middle + half, turns
