import time
from itertools import pairwise

import numpy as np
import pytest
from arm_cases import COUPLED, arm_compliance, fitted, planar_scope, poses, surrogate_from
from refusals import refuses

from robots.errors import InputError
from surrogate import least_squares
from surrogate.asking import query
from surrogate.basis import make_basis, mixed_families
from surrogate.fit import ADAPTIVE_DEGREE, MAX_CHOSEN, RUNS_A_TERM, fit
from surrogate.least_squares import condition_of, solve
from surrogate.model import predict, predict_compliance
from surrogate.scope import Couplings


def held_out(k, surrogate, n=500):
    Q = poses(n, k, 2)
    return np.abs(predict_compliance(surrogate, Q) / arm_compliance(Q) - 1.0)


@pytest.mark.parametrize(("k", "n"), [(3, 400), (4, 1000)])
def test_trigonometric_basis_recovers_an_arm_to_round_off(k, n):
    s = fitted(n, k, basis="trigonometric", degree=2, target="direct")
    assert s.expansion.n_terms == 5**k
    # 1e-10: round-off (1e-16) times the condition number (measured 51 and 344: 2e-14 and 4e-14), with room
    # for other LAPACKs.
    assert held_out(k, s).max() < 1e-10
    # The worst figure is a real comparison: another order cannot represent it.
    assert held_out(k, fitted(n, k, basis="trigonometric", degree=1, target="direct")).max() > 1e-3


def test_polynomial_recovers_a_degree_six_logarithm_to_round_off():
    scope = planar_scope(4)
    basis = make_basis("polynomial", scope.lower, scope.upper, 6)
    truth = np.random.default_rng(3).normal(size=basis.n_terms) * 0.02
    truth[0] = np.log(3e-6)
    Q, Q_test = poses(420, 4, 1, "arcsine"), poses(300, 4, 2)
    y, y_test = np.exp(basis.design(Q) @ truth), np.exp(basis.design(Q_test) @ truth)
    found = fit(Q, y, scope)
    # 1e-10: round-off of |ln c| = 13 times a condition number of about 20.
    np.testing.assert_allclose(found.coefficients[:, 0], truth, atol=1e-10)
    np.testing.assert_allclose(predict(surrogate_from(scope, found), Q_test), y_test, rtol=1e-10)
    low = surrogate_from(scope, fit(Q, y, scope, degree=5))
    assert np.sqrt(np.mean((predict(low, Q_test) / y_test - 1.0) ** 2)) > 1e-3


@pytest.mark.parametrize("target", ["direct", "logarithm"])
def test_held_out_error_falls_with_the_degree(target):
    rms = [np.sqrt(np.mean(held_out(3, fitted(400, 3, target=target, degree=d)) ** 2)) for d in (2, 4, 6, 8)]
    assert all(later < 0.7 * earlier for earlier, later in pairwise(rms))


def test_condition_number_is_that_of_the_matrix():
    Q = poses(150, 2, 1, "arcsine")
    found = fit(Q, arm_compliance(Q), planar_scope(2))
    # 1e-9: both come from singular values with round-off 1e-16 times the condition number.
    assert found.condition == pytest.approx(np.linalg.cond(found.basis.design(Q)), rel=1e-9)


@pytest.mark.parametrize("basis", ["polynomial", "adaptive"])
def test_relative_weights_minimise_the_relative_error(basis):
    Q = poses(150, 2, 1)
    y = arm_compliance(Q)
    found = fit(Q, y, planar_scope(2), basis, 2, target="direct")
    A = found.basis.design(Q) / y[:, None]
    residual = A @ found.coefficients[:, 0] - 1.0
    # 1e-9 of its terms' size: the normal equations of the weighted problem hold to round-off.
    assert np.abs(A.T @ residual).max() < 1e-9 * np.abs(A).sum()


def test_the_logarithm_minimises_the_error_of_the_logarithm():
    Q = poses(150, 2, 1)
    found = fit(Q, arm_compliance(Q), planar_scope(2), degree=2)
    A = found.basis.design(Q)
    residual = A @ found.coefficients[:, 0] - np.log(arm_compliance(Q))
    assert np.abs(A.T @ residual).max() < 1e-9 * np.abs(A).sum()


def test_arcsine_density_has_the_smaller_worst_error_at_the_boundary():
    test = np.vstack([poses(2000, 4, 8), poses(2000, 4, 9, "boundary")])
    worst = {}
    for density in ("uniform", "arcsine"):
        Q = poses(600, 4, 1, density)
        s = surrogate_from(planar_scope(4), fit(Q, arm_compliance(Q), planar_scope(4)))
        worst[density] = np.abs(predict(s, test) / arm_compliance(test) - 1.0).max()
    # Measured over seeds 0 to 5: a factor of 14 or more on this arm, 2 on the one in the docstring.
    assert worst["arcsine"] < 0.8 * worst["uniform"]


def test_repeats_leave_terms_undetermined():
    Q = np.tile(poses(12, 2, 1), (10, 1))
    refuses("S004", r"do not determine all 28 terms", fit, Q, arm_compliance(Q), planar_scope(2))


def test_more_terms_than_runs_names_both():
    refuses(
        "S004",
        r"625 terms, but there are 300 runs.*To fix it: add runs",
        fitted,
        300,
        4,
        basis="trigonometric",
        degree=2,
    )


@pytest.mark.parametrize("bad", [0.0, -1e-6, np.nan, np.inf])
def test_bad_values_are_refused_and_named(bad):
    Q = poses(60, 2, 1)
    y = arm_compliance(Q)
    y[[3, 5]] = bad
    refuses(
        "S004",
        r"2 of 60 values are no positive.*row 4: .*row 6: .*do not fill them",
        fit,
        Q,
        y,
        planar_scope(2),
        degree=3,
    )


def refused_fit(words, Q=None, y=None, couplings=None, **options):
    Q = poses(100, 2, 1) if Q is None else Q
    with pytest.raises(InputError, match=words):
        fit(Q, arm_compliance(Q) if y is None else y, planar_scope(2, couplings), **options)


def test_runs_that_cannot_carry_a_fit_are_refused():
    Q = poses(100, 2, 1)
    constant = Q.copy()
    constant[:, 1] = np.radians(90.0)
    for basis in ("polynomial", "adaptive"):
        refused_fit("q3_deg is 90 deg in all of them.*fixed coordinate", Q=constant, basis=basis)
    refused_fit("fitted runs: poses outside .* row 1: q2_deg", Q=Q + np.array([2.0, 0.0]))
    refused_fit("poses outside of the domain or a coupling.*forearm", couplings=COUPLED)
    refused_fit("fitted runs: 0 poses", Q=np.empty((0, 2)))
    refused_fit("fitted runs: 100 poses, values", y=np.ones(99))
    refused_fit("with an angle that is no finite", Q=np.where(np.arange(200).reshape(100, 2) == 7, np.nan, Q))
    refused_fit("target.*stiffness", target="stiffness")
    refused_fit("target.*factored", target="factored")
    refused_fit("basis.*spline", basis="spline")
    refused_fit("basis.*factored", basis="factored")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"load_direction": (0.0, 0.0, -2.0)}, "load_direction"),
        ({"load_direction": (0.0, 0.0, np.nan)}, "load_direction"),
        ({"inputs": ("q2_deg", "q2_deg")}, "each one once"),
        ({"inputs": ("q2_deg", "q1_deg")}, "each one once"),
        ({"inputs": ("q2_deg",), "periodic": ()}, "domain"),
        ({"fixed_deg": {"q1_deg": np.nan}}, "fixed_deg"),
        ({"upper": np.radians([-35.0, 40.0])}, "below its upper"),
        ({"couplings": Couplings.none(3)}, "couplings"),
        ({"periodic": (True,)}, "periodic"),
    ],
)
def test_a_scope_that_makes_no_sense_is_refused(changes, words):
    refuses("F007 S001", words, planar_scope, 2, **changes)


@pytest.mark.parametrize("basis", ["polynomial", "trigonometric"])
def test_many_queries_are_no_loop(basis):
    s = fitted(1000, 4, basis=basis, degree={"polynomial": 6, "trigonometric": 2}[basis], bars=True)
    scope = planar_scope(4)
    Q = np.random.default_rng(5).uniform(scope.lower, scope.upper, (20_000, 4))
    query(s, Q)  # compiles, once for each machine
    start = time.process_time()
    together = query(s, Q).stiffness_N_per_mm
    batch, start = time.process_time() - start, time.process_time()
    alone = [float(query(s, Q[k : k + 1]).stiffness_N_per_mm[0]) for k in range(20)]
    loop = time.process_time() - start
    np.testing.assert_allclose(together[:20], alone, rtol=1e-12)
    # Measured: a thousandth and less of what a loop takes for a pose.
    assert batch / len(Q) < 0.1 * loop / len(alone)


# ------------------------------------------------------------
# Terms chosen one by one: what is sparse is found, what is not is at least no worse than a plain polynomial


def rms(scope, found, f, k):
    Q = poses(1000, k, 2)
    return float(np.sqrt(np.mean((predict(surrogate_from(scope, found), Q) / f(Q) - 1.0) ** 2)))


@pytest.mark.parametrize("target", ["direct", "logarithm"])
def test_a_sum_of_few_products_is_found(target, rng):
    scope = planar_scope(3)
    families = mixed_families(scope.lower, scope.upper, 2, ADAPTIVE_DEGREE)
    terms = np.array([[0, 0, 0], [0, 4, 1], [1, 2, 0], [3, 0, 6], [5, 5, 5]])
    weights = np.array([5.0, 0.5, -0.4, 0.3, 0.2])

    def f(Q):
        values = [family(angle) for family, angle in zip(families, Q.T, strict=True)]
        sums = weights @ np.prod([v[column] for v, column in zip(values, terms.T, strict=True)], axis=0)
        return np.exp(0.1 * sums) if target == "logarithm" else 40.0 + sums

    Q = poses(900, 3, 1, "arcsine")
    found = fit(Q, f(Q), scope, "adaptive", target=target)
    assert {tuple(t) for t in terms} <= {tuple(t) for t in found.basis.terms}
    # 1e-9: round-off times the condition number (below 1e4) of terms that are no more than a third of the runs.
    assert rms(scope, found, f, 3) < 1e-9


def test_a_joint_that_depends_on_its_angle_is_learned_better_than_by_the_sixth_degree():
    scope = planar_scope(4)

    def f(Q):
        return arm_compliance(Q) * np.exp(0.3 * np.cos(2.0 * Q[:, 1]))

    Q = poses(1500, 4, 1, "arcsine")
    own = rms(scope, fit(Q, f(Q), scope, "adaptive", target="direct"), f, 4)
    plain = rms(scope, fit(Q, f(Q), scope, "polynomial", 6), f, 4)
    # Measured: more than ten times better.
    assert own < 0.5 * plain


def test_one_input_has_fewer_candidates_than_are_taken_at_a_time():
    scope = planar_scope(1)
    Q = poses(200, 1, 1)
    found = fit(Q, arm_compliance(Q), scope, "adaptive", target="direct")
    # Of second order in the angle's sine and cosine, so exact; 1e-10: round-off times the condition number.
    assert rms(scope, found, arm_compliance, 1) < 1e-10


def test_no_more_terms_than_the_runs_carry():
    scope = planar_scope(4)
    Q = poses(120, 4, 1, "arcsine")
    found = fit(Q, arm_compliance(Q), scope, "adaptive")
    assert found.basis.n_terms <= 120 // RUNS_A_TERM <= MAX_CHOSEN
    assert found.basis.name == "adaptive"


def test_the_same_runs_give_the_same_terms():
    scope = planar_scope(3)
    Q = poses(300, 3, 1)
    a, b = (fit(Q, arm_compliance(Q), scope, "adaptive") for _ in range(2))
    np.testing.assert_array_equal(a.basis.terms, b.basis.terms)
    np.testing.assert_array_equal(a.coefficients, b.coefficients)


# ------------------------------------------------------------
# least squares


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
