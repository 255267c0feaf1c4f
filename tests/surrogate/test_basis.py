from itertools import product

import numpy as np
import pytest
from arm_cases import LOWER, UPPER
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from surrogate import expansion as expansion_module
from surrogate.basis import MAX_TERMS, make_basis, polynomial_basis, term_count, trigonometric_basis
from surrogate.families import mixed_family, polynomial_family, trigonometric_family


def poses(n, seed=0, lower=LOWER, upper=UPPER):
    return np.random.default_rng(seed).uniform(lower, upper, (n, len(lower)))


@pytest.mark.parametrize(
    ("name", "degree", "k", "expected"),
    [
        ("polynomial", 6, 4, 210),
        ("polynomial", 6, 1, 7),
        ("polynomial", 6, 6, 924),
        ("trigonometric", 2, 4, 625),
        ("trigonometric", 3, 2, 49),
        ("polynomial", 6, 7, 1716),
        ("trigonometric", 2, 5, 3125),
    ],
)
def test_number_of_terms(name, degree, k, expected):
    basis = make_basis(name, -np.ones(k), np.ones(k), degree)
    assert basis.n_terms == expected == term_count(name, degree, k)
    assert basis.design(np.zeros((3, k))).shape == (3, expected)


def orthogonal_projection_error(A, b):
    """The largest part of unit columns b that A cannot represent."""
    q, _ = np.linalg.qr(A)
    b = b / np.linalg.norm(b, axis=0)
    return np.abs(b - q @ (q.T @ b)).max()


def test_polynomial_spans_the_monomials():
    basis = polynomial_basis(LOWER, UPPER, 4)
    Q = poses(400)
    u = (2.0 * Q - UPPER - LOWER) / (UPPER - LOWER)
    powers = np.array([p for p in product(range(5), repeat=4) if sum(p) <= 4])
    monomials = np.prod(u[:, None, :] ** powers, axis=2)
    assert monomials.shape[1] == basis.n_terms
    # 1e-12: round-off of a well conditioned projection; a missing term leaves 1e-2 or more.
    assert orthogonal_projection_error(basis.design(Q), monomials) < 1e-12


def test_trigonometric_spans_the_raw_harmonics_of_uncentred_angles():
    lower, upper = LOWER[:3], UPPER[:3]
    basis = trigonometric_basis(lower, upper, 2)
    Q = poses(700, lower=lower, upper=upper)
    one = np.stack([np.ones_like(Q), np.cos(Q), np.sin(Q), np.cos(2 * Q), np.sin(2 * Q)], axis=2)
    raw = np.einsum("na,nb,nc->nabc", one[:, 0], one[:, 1], one[:, 2]).reshape(700, -1)
    assert raw.shape[1] == basis.n_terms
    # 1e-12: round-off; see above.
    assert orthogonal_projection_error(basis.design(Q), raw) < 1e-12


@pytest.mark.parametrize(("name", "degree"), [("polynomial", 6), ("trigonometric", 2)])
def test_functions_are_orthonormal_over_the_box(name, degree):
    lower, upper = LOWER[:2], UPPER[:2]
    basis = make_basis(name, lower, upper, degree)
    u, w = np.polynomial.legendre.leggauss(40)
    grid = np.stack(np.meshgrid(u, u, indexing="ij"), axis=-1).reshape(-1, 2)
    A = basis.design(0.5 * (lower + upper) + 0.5 * (upper - lower) * grid)
    gram = A.T @ (np.outer(w, w).ravel()[:, None] / 4.0 * A)
    # 1e-11: round-off (1e-16) times the condition number of the harmonics over an 80 deg range (1e4).
    np.testing.assert_allclose(gram, np.eye(basis.n_terms), atol=1e-11)


def test_orthonormal_harmonics_keep_a_narrow_range_well_conditioned():
    lower, upper = np.radians([10.0, -60.0]), np.radians([20.0, -50.0])
    Q = poses(4000, lower=lower, upper=upper)
    one = np.stack([np.ones_like(Q), np.cos(Q), np.sin(Q), np.cos(2 * Q), np.sin(2 * Q)], axis=2)
    raw = np.einsum("na,nb->nab", one[:, 0], one[:, 1]).reshape(len(Q), -1)
    own = trigonometric_basis(lower, upper, 2).design(Q)
    # 3: sampling noise of 4000 points on orthonormal functions; the raw harmonics are not usable at all.
    assert np.linalg.cond(own) < 3.0
    assert np.linalg.cond(raw) > 1e10


@pytest.mark.parametrize(("name", "degree"), [("polynomial", 6), ("trigonometric", 2)])
def test_evaluation_in_blocks_is_the_design_matrix_times_coefficients(name, degree, monkeypatch):
    basis = make_basis(name, LOWER, UPPER, degree)
    c = np.random.default_rng(1).normal(size=basis.n_terms)
    Q = poses(1003)
    whole = basis.design(Q) @ c
    monkeypatch.setattr(expansion_module, "_BLOCK", 100 * basis.n_terms)
    # 1e-12 relative to the sum of absolute terms: round-off of sums in another order.
    np.testing.assert_allclose(basis.expansion(c)(Q)[:, 0], whole, atol=1e-12 * np.abs(basis.design(Q) @ c).max())


def test_one_block_at_a_time_is_held_in_memory(monkeypatch):
    basis = polynomial_basis(LOWER, UPPER, 6)
    rows = []
    design = expansion_module.Expansion.design
    monkeypatch.setattr(expansion_module.Expansion, "design", lambda self, Q: rows.append(len(Q)) or design(self, Q))
    basis.expansion(np.ones(basis.n_terms))(poses(5000))
    assert sum(rows) == 5000
    assert max(rows) * basis.n_terms <= expansion_module._BLOCK


def test_a_random_polynomial_of_degree_six_is_reproduced(rng):
    basis = polynomial_basis(LOWER, UPPER, 6)
    powers = np.array([p for p in product(range(7), repeat=4) if sum(p) <= 6])
    weights = rng.normal(size=len(powers))

    def truth(Q):
        u = (2.0 * Q - UPPER - LOWER) / (UPPER - LOWER)
        return np.prod(u[:, None, :] ** powers, axis=2) @ weights

    Q, fresh = poses(800, 1), poses(500, 2)
    c = np.linalg.lstsq(basis.design(Q), truth(Q), rcond=None)[0]
    # 1e-10 of the largest value: round-off times a condition number below 1e3.
    np.testing.assert_allclose(basis.expansion(c)(fresh)[:, 0], truth(fresh), atol=1e-10 * np.abs(truth(Q)).max())


def test_taking_terms_keeps_their_functions():
    basis = polynomial_basis(LOWER, UPPER, 3)
    kept = np.array([7, 0, 20])
    np.testing.assert_array_equal(basis.take(kept).design(poses(9)), basis.design(poses(9))[:, np.sort(kept)])


@pytest.mark.parametrize("name", ["polynomial", "trigonometric"])
def test_whole_turns_do_not_matter_to_a_periodic_input(name):
    basis = make_basis(name, LOWER, UPPER, 2, (False, False, True, False))
    Q = poses(200)
    turned = Q + 2.0 * np.pi * np.array([0, 0, 1, 0])
    # 1e-12: round-off of an angle of 10 rad, times the steepest function.
    np.testing.assert_allclose(basis.design(turned), basis.design(Q), atol=1e-12)
    # One turn, not the 400 deg of the limits, is what the functions are orthonormal over.
    assert basis.families[2].half_range == np.pi


@pytest.mark.parametrize(
    ("name", "lower", "upper", "degree", "words"),
    [
        ("spline", [-1.0], [1.0], 3, "polynomial, trigonometric"),
        ("polynomial", [-1.0], [1.0], 0, "1 to 20"),
        ("polynomial", [1.0], [1.0], 3, "below its upper"),
        ("polynomial", [np.nan], [1.0], 3, "finite"),
        ("polynomial", [-1.0] * 8, [1.0] * 8, 2, "1 to 7"),
        ("polynomial", [-1.0, 0.0], [1.0], 2, r"\(k,\)"),
        ("trigonometric", [-1.0] * 6, [1.0] * 6, 2, f"15625; allowed: at most {MAX_TERMS}"),
        ("trigonometric", [-1e-4], [1e-4], 4, "widen the range"),
        ("polynomial", [-1.0], [1.0], 21, "1 to 20"),
        ("polynomial", [-1.0] * 7, [1.0] * 7, 9, "11440; allowed: at most 6000.*factored or adaptive"),
    ],
)
def test_bad_bases_are_refused(name, lower, upper, degree, words):
    refuses("S001 S003", words, make_basis, name, np.array(lower), np.array(upper), degree)


def test_one_word_on_turns_for_each_input():
    refuses("S003", "one for each of 4 inputs", polynomial_basis, LOWER, UPPER, 2, (True,))


# ------------------------------------------------------------
# families

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
