import numpy as np
import pytest
from refusals import refuses

from surrogate import least_squares
from surrogate.least_squares import condition_of, solve


def matrix(n, t, condition, rng):
    u, v = np.linalg.qr(rng.normal(size=(n, t)))[0], np.linalg.qr(rng.normal(size=(t, t)))[0]
    return u * np.logspace(0.0, -np.log10(condition), t) @ v.T


@pytest.mark.parametrize("condition", [1.0, 1e4, 1e9])
def test_qr_keeps_the_digits_that_the_condition_allows(condition, rng):
    A, truth = matrix(80, 20, condition, rng), rng.normal(size=(20, 3))
    found = solve(A, A @ truth)
    # 1e-14 times the condition number: backward stable. Normal equations would square it: nothing left at 1e9.
    np.testing.assert_allclose(found.coefficients, truth, atol=1e-14 * condition)
    # 1e-6: the smallest singular value is known to 1e-16 of the largest.
    assert found.condition == pytest.approx(condition, rel=1e-6)


def test_qr_is_the_least_squares_solution(rng):
    A, b = rng.normal(size=(60, 7)), rng.normal(size=(60, 2))
    np.testing.assert_allclose(solve(A, b).coefficients, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-10)
    assert solve(A, b[:, 0]).coefficients.shape == (7, 1)


def test_more_terms_than_runs_are_refused(rng):
    refuses(
        "S004",
        r"has 9 terms, but there are 8 runs.*add runs, lower the degree",
        solve,
        rng.normal(size=(8, 9)),
        np.ones(8),
    )


def test_undetermined_terms_are_refused_with_the_condition(rng):
    A = matrix(30, 5, 1e12, rng)
    refuses("S004", r"do not determine all 5 terms \(condition 1e\+12\).*below 1e\+10", solve, A, np.ones(30))
    A[:, 2] = 0.0
    refuses("S004", r"condition (inf|\d)", solve, A, np.ones(30))


def test_the_estimate_of_large_matrices_is_near_the_number_itself(rng, monkeypatch):
    R = np.linalg.qr(matrix(300, 200, 1e5, rng), mode="r")
    exact = condition_of(R)
    monkeypatch.setattr(least_squares, "_EXACT_CONDITION", 10)
    # The 1-norm and the 2-norm differ by a factor of the size at most (200), LAPACK's estimate by 3 or so more.
    assert exact / 10.0 < condition_of(R) < 600.0 * exact
    R[5, 5] = 0.0
    assert condition_of(R) == np.inf
