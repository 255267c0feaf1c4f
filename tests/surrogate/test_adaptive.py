"""Terms chosen one by one: what is sparse is found, what is not is at least no worse than a plain polynomial."""

import numpy as np
import pytest
from arm_cases import arm_compliance, planar_scope, poses, surrogate_from

from surrogate.basis import mixed_families
from surrogate.fit import ADAPTIVE_DEGREE, MAX_CHOSEN, RUNS_A_TERM, fit
from surrogate.model import predict


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
