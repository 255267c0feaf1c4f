import time
from itertools import pairwise

import numpy as np
import pytest
from arm_cases import COUPLED, arm_compliance, fitted, planar_scope, poses, surrogate_from
from refusals import refuses

from robots.errors import InputError
from surrogate.asking import query
from surrogate.basis import make_basis
from surrogate.fit import fit
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
