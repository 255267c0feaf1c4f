import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from surrogate.families import mixed_family, polynomial_family, trigonometric_family

TURN = 2.0 * np.pi
# Ranges as joints have them: short, long, more than a turn, lopsided.
RANGES = [(-0.2, 0.1), (-0.6, 0.8), (0.7, 2.0), (-np.pi, np.pi), (-3.49, 3.49), (-6.2, 1.0)]
FAMILIES = {
    "polynomial": lambda a, b, **more: polynomial_family(a, b, 6, **more),
    "trigonometric": lambda a, b, **more: trigonometric_family(a, b, 2, **more),
    "mixed": lambda a, b, **more: mixed_family(a, b, 2, 6, **more),
    "factored": lambda a, b, **more: mixed_family(a, b, 1, 12, **more),
    "law": lambda a, b, **more: mixed_family(a, b, 4, 40, **more),
}


def quadrature(a, b, n=200):
    u, w = np.polynomial.legendre.leggauss(n)
    return 0.5 * (a + b) + 0.5 * (b - a) * u, 0.5 * w


def gram(family, a, b):
    q, w = quadrature(a, b)
    values = family(q)
    return (values * w) @ values.T


@pytest.mark.parametrize("limits", RANGES)
@pytest.mark.parametrize("name", FAMILIES)
def test_orthonormal_over_the_range(name, limits):
    family = FAMILIES[name](*limits)
    # Round-off (1e-16) times the largest factors: harmonics over 17 deg 1e8, elsewhere 1e4; mixed ones 1e7 at most.
    # By ascending degree, without regard to what they add, the last functions over 80 deg were off by 20.
    tolerance = {"polynomial": 1e-13, "trigonometric": 1e-7 if limits == RANGES[0] else 1e-10}.get(name, 1e-8)
    np.testing.assert_allclose(gram(family, *limits), np.eye(family.size), atol=tolerance)


@pytest.mark.parametrize("name", FAMILIES)
def test_the_first_function_is_one(name):
    np.testing.assert_allclose(FAMILIES[name](-0.6, 0.8)(np.linspace(-0.6, 0.8, 7))[0], 1.0, rtol=1e-12)


def left_over(family, wanted, a, b):
    """The largest part of unit functions (m, n at the nodes) that a family cannot represent."""
    q, w = quadrature(a, b)
    basis = np.linalg.qr((family(q) * np.sqrt(w)).T)[0]
    b_ = (wanted(q) * np.sqrt(w)).T
    b_ = b_ / np.linalg.norm(b_, axis=0)
    return np.abs(b_ - basis @ (basis.T @ b_)).max()


def harmonics(order):
    def values(q):
        return np.array([np.ones_like(q), *(f(m * q) for m in range(1, order + 1) for f in (np.cos, np.sin))])

    return values


def legendre(degree, a, b):
    return lambda q: np.polynomial.legendre.legvander((2.0 * q - a - b) / (b - a), degree).T


def monomials(degree):
    return lambda q: np.array([(q / 3.5) ** d for d in range(degree + 1)])


@pytest.mark.parametrize("limits", RANGES[1:])
def test_what_each_kind_spans(limits):
    # 1e-12 and 1e-9: round-off, and round-off times what is kept of nearly dependent functions; a missing function
    # leaves 1e-3 and more.
    assert left_over(FAMILIES["polynomial"](*limits), monomials(6), *limits) < 1e-12
    assert left_over(FAMILIES["polynomial"](*limits), monomials(7), *limits) > 1e-6
    assert left_over(FAMILIES["trigonometric"](*limits), harmonics(2), *limits) < 1e-9
    mixed = FAMILIES["mixed"](*limits)
    assert left_over(mixed, harmonics(2), *limits) < 1e-9
    # Polynomials that the functions before them represent to 1e-7 of themselves may be left out, no others: taken by
    # ascending degree, those that are like the harmonics would leave no digits for the rest.
    assert left_over(mixed, monomials(6), *limits) < 1e-6
    assert left_over(FAMILIES["factored"](*limits), legendre(12, *limits), *limits) < 1e-6


def test_the_first_functions_of_a_mixed_family_are_the_harmonics():
    """What the factored basis takes as the arm's geometry."""
    limits = (-1.2, 0.9)
    mixed, pure = mixed_family(*limits, 1, 12), trigonometric_family(*limits, 1)
    q = np.linspace(*limits, 20)
    np.testing.assert_allclose(np.abs(mixed(q)[:3]), np.abs(pure(q)), rtol=1e-9)


def test_functions_that_add_nothing_are_left_out():
    whole = mixed_family(-0.2, 0.2, 3, 12)
    # Harmonics up to the third over 23 deg are polynomials up to the sixth degree but for parts in 1e7.
    assert whole.size < 1 + 6 + 12
    assert mixed_family(-np.pi, np.pi, 2, 6).size == 1 + 4 + 6


@given(st.floats(-20.0, 20.0), st.integers(-4, 4))
def test_periodic_families_do_not_know_turns_apart(q, turns):
    family = FAMILIES["trigonometric"](-np.pi, np.pi, periodic=True)
    # 1e-12: an angle of 50 rad is known to 7e-15.
    np.testing.assert_allclose(family(np.array([q + TURN * turns])), family(np.array([q])), atol=1e-12)


def test_others_do():
    family = polynomial_family(-3.5, 3.5, 2)
    assert abs(family(np.array([-3.0]))[1, 0] - family(np.array([-3.0 + TURN]))[1, 0]) > 1.0


def test_a_range_too_narrow_for_harmonics_is_refused():
    refuses("S003", r"order 4 over a range of 0\.0\d+ deg.*widen the range", trigonometric_family, -1e-4, 1e-4, 4)
