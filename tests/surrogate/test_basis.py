from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from robots.errors import InputError
from surrogate import basis as basis_module
from surrogate.basis import MAX_TERMS, make_basis, polynomial_basis, term_count, trigonometric_basis
from surrogate.fit import space_filling_design
from surrogate.model import Couplings

LOWER = np.radians([-35.0, 40.0, -200.0, -100.0])
UPPER = np.radians([45.0, 115.0, 200.0, 100.0])


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
    monkeypatch.setattr(basis_module, "_BLOCK", 100 * basis.n_terms)
    # 1e-12 relative to the sum of absolute terms: round-off of sums in another order.
    np.testing.assert_allclose(basis.evaluate(Q, c), whole, atol=1e-12 * np.abs(basis.design(Q) @ c).max())


def test_one_block_at_a_time_is_held_in_memory(monkeypatch):
    basis = polynomial_basis(LOWER, UPPER, 6)
    rows = []
    design = type(basis).design
    monkeypatch.setattr(type(basis), "design", lambda self, Q: rows.append(len(Q)) or design(self, Q))
    basis.evaluate(poses(5000), np.ones(basis.n_terms))
    assert sum(rows) == 5000
    assert max(rows) * basis.n_terms <= basis_module._BLOCK


@pytest.mark.parametrize(
    ("name", "lower", "upper", "degree", "words"),
    [
        ("spline", [-1.0], [1.0], 3, "polynomial, trigonometric"),
        ("polynomial", [-1.0], [1.0], 0, "1 to 20"),
        ("polynomial", [1.0], [1.0], 3, "below its upper"),
        ("polynomial", [np.nan], [1.0], 3, "finite"),
        ("polynomial", [-1.0] * 7, [1.0] * 7, 2, "1 to 6"),
        ("polynomial", [-1.0, 0.0], [1.0], 2, r"\(k,\)"),
        ("trigonometric", [-1.0] * 6, [1.0] * 6, 2, f"15625; allowed: at most {MAX_TERMS}"),
        ("trigonometric", [-1e-4], [1e-4], 4, "widen the range"),
    ],
)
def test_bad_bases_are_refused(name, lower, upper, degree, words):
    with pytest.raises(InputError, match=words):
        make_basis(name, np.array(lower), np.array(upper), degree)


# Where the functions meet the joint space: designs that fill the same box.

# Limit q2 - q3 to -110..0 deg; the box allows -150..5.
COUPLED = Couplings(("forearm",), np.array([[1.0, -1.0]]), np.radians([-110.0]), np.array([0.0]))


def sobol(n, k, density):
    return space_filling_design(LOWER[:k], UPPER[:k], n, np.random.default_rng(0), density=density)


@pytest.mark.parametrize("density", ["arcsine", "uniform", "boundary"])
def test_designs_have_exactly_n_distinct_accepted_poses(density):
    def accept(Q):
        return Q[:, 1] > 1.0

    rng = np.random.default_rng
    limits = {"density": density, "couplings": COUPLED}
    for n in (1, 100, 777):
        Q = space_filling_design(LOWER[:2], UPPER[:2], n, rng(0), accept, **limits)
        assert Q.shape == (n, 2)
        assert np.all(np.clip(Q, LOWER[:2], UPPER[:2]) == Q)
        assert accept(Q).all()
        assert COUPLED.kept(Q).all()
    np.testing.assert_array_equal(Q, space_filling_design(LOWER[:2], UPPER[:2], 777, rng(0), accept, **limits))
    assert not np.array_equal(Q, space_filling_design(LOWER[:2], UPPER[:2], 777, rng(1), accept, **limits))
    if density != "boundary":
        assert len(np.unique(Q, axis=0)) == 777


def test_uniform_designs_fill_the_box_evenly():
    Q = sobol(1024, 3, "uniform")
    cells = np.floor((Q - LOWER[:3]) / (UPPER[:3] - LOWER[:3]) * 4).astype(int)
    counts = np.unique(cells, axis=0, return_counts=True)[1]
    # A scrambled Sobol set of 2^10 has 16 points in each of 4^3 cells (8..24 leaves room for its t value);
    # random points would have 3 to 30.
    assert len(counts) == 64
    assert counts.min() >= 8
    assert counts.max() <= 24


def test_boundary_poses_have_an_input_at_its_limit():
    Q = sobol(300, 3, "boundary")
    at_limit = np.isin(Q, [*LOWER[:3], *UPPER[:3]])
    assert at_limit.any(axis=1).all()
    assert set(at_limit.sum(axis=1)) == {1, 2, 3}


def test_an_empty_design_space_names_the_limits():
    never = replace(COUPLED, lower=np.radians([20.0]), upper=np.radians([40.0]))
    words = r"0 of 10 poses.*q2_deg -35 to 45 deg.*forearm refuses .*spans -150 to 5 deg, allowed 20 to 40 deg"
    with pytest.raises(InputError, match=words):
        space_filling_design(
            LOWER[:2], UPPER[:2], 10, np.random.default_rng(0), couplings=never, names=("q2_deg", "q3_deg")
        )
    with pytest.raises(InputError, match=r"accept\(\) refuses"):
        space_filling_design(LOWER[:2], UPPER[:2], 10, np.random.default_rng(0), lambda Q: np.zeros(len(Q), dtype=bool))
