import numpy as np
import pytest

from robots.errors import InputError
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
    assert found.penalty == 0.0


def test_qr_is_the_least_squares_solution(rng):
    A, b = rng.normal(size=(60, 7)), rng.normal(size=(60, 2))
    np.testing.assert_allclose(solve(A, b).coefficients, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-10)
    assert solve(A, b[:, 0]).coefficients.shape == (7, 1)


def test_ridge_is_the_minimum_of_its_penalised_sum(rng):
    A, b = matrix(60, 12, 1e3, rng), rng.normal(size=(60, 2))
    found = solve(A, b, "ridge")
    assert found.penalty > 0.0
    gradient = A.T @ (A @ found.coefficients - b) + found.penalty * found.coefficients
    np.testing.assert_allclose(gradient, 0.0, atol=1e-12)


def test_ridge_beats_qr_where_runs_hardly_determine_the_terms(rng):
    A, fresh = matrix(40, 30, 1e6, rng), matrix(40, 30, 1e6, rng)
    truth = rng.normal(size=30) * np.linalg.norm(A, axis=0)
    b = A @ truth + 1e-3 * rng.normal(size=40)
    error = {s: np.linalg.norm(solve(A, b, s).coefficients[:, 0] - truth) for s in ("qr", "ridge")}
    assert error["ridge"] < 0.1 * error["qr"]
    assert fresh.shape == A.shape


def test_ridge_hardly_penalises_what_the_runs_say_without_noise(rng):
    A, truth = 1e3 * rng.normal(size=(80, 20)), rng.normal(size=20)
    found = solve(A, A @ truth, "ridge")
    # The least penalty that is tried is 1e-14 of a column's square: nothing of the coefficients is lost.
    np.testing.assert_allclose(found.coefficients[:, 0], truth, rtol=1e-9)
    assert found.penalty < 1e-6 * np.sum(A[:, 0] ** 2)


@pytest.mark.parametrize("solver", ["qr", "ridge"])
def test_more_terms_than_runs_are_refused(solver, rng):
    with pytest.raises(InputError, match=r"has 9 terms, but there are 8 runs.*add runs, lower the degree"):
        solve(rng.normal(size=(8, 9)), np.ones(8), solver)


def test_undetermined_terms_are_refused_with_the_condition(rng):
    A = matrix(30, 5, 1e12, rng)
    with pytest.raises(InputError, match=r"do not determine all 5 terms \(condition 1e\+12\).*below 1e\+10"):
        solve(A, np.ones(30))
    A[:, 2] = 0.0
    with pytest.raises(InputError, match=r"condition (inf|\d)"):
        solve(A, np.ones(30))


def test_the_estimate_of_large_matrices_is_near_the_number_itself(rng, monkeypatch):
    R = np.linalg.qr(matrix(300, 200, 1e5, rng), mode="r")
    exact = condition_of(R)
    monkeypatch.setattr(least_squares, "_EXACT_CONDITION", 10)
    # The 1-norm and the 2-norm differ by a factor of the size at most (200), LAPACK's estimate by 3 or so more.
    assert exact / 10.0 < condition_of(R) < 600.0 * exact
    R[5, 5] = 0.0
    assert condition_of(R) == np.inf
