"""The 6 x 6 compliance as a sum of squares: exact where the arm is, positive semidefinite everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arm_cases import few_runs, sprung
from refusals import refuses

from fem import build_model, compliance, compliance_factor, directional_stiffness
from fem.springs import FourierBasis, LawSpring, PolynomialBasis, TableBasis
from robots import load_description
from surrogate import scope_of, task_of, train
from surrogate.factored import MET, fit_factored
from surrogate.model import Factor, compliance_matrix, predict, predict_compliance

INPUTS = {"xr701": ("q2_deg", "q3real_deg", "q4_deg", "q5_deg")}
OTHERS = ("q2_deg", "q3_deg", "q4_deg", "q5_deg")
# A serial arm of four inputs: round-off of some hundred sums, measured 2e-15 to 1e-14.
EXACT = 1e-12
SEXTIC = LawSpring(
    PolynomialBasis(
        (1, 2), np.array([0.0, 0.2]), np.array([1.5, 1.8]), np.array([[0, 0], [1, 0], [0, 2], [2, 1], [3, 3]])
    ),
    np.array([13.5, 0.3, -0.4, 0.2, 0.1]),
)
WAVES = LawSpring(FourierBasis(1, 2), np.array([13.7, 0.3, -0.2, 0.1, 0.05]))


def learned(model, seed=0, inputs=None, **options):
    names = inputs or INPUTS.get(model.robot.name, OTHERS)
    rng = np.random.default_rng(seed)
    task = task_of(model, scope_of(model.robot, "0" * 64, names), rng)
    with few_runs(rows=options.pop("rows", 800)):
        return task, train(task, rng, basis="factored", **options).best


@pytest.fixture(scope="module")
def serial():
    return learned(sprung("kr60-3", "beam"))


@pytest.fixture(scope="module")
def bar():
    return learned(sprung("xr701", "beam"))


@pytest.fixture(scope="module")
def lawful():
    return learned(sprung("kr60-3", j2=WAVES, j3=SEXTIC))


def poses(task, n=300, seed=9):
    return task.over_domain(n, np.random.default_rng(seed))


def off(one, task, Q):
    """Largest error of an entry over sqrt(C_ii C_jj)."""
    C, truth = compliance_matrix(one, Q), compliance(task.model, task.full(Q))
    d = np.sqrt(np.einsum("nii->ni", truth))
    return np.abs((C - truth) / (d[:, :, None] * d[:, None, :])).max()


def test_a_serial_arm_with_constant_springs_is_exact(serial):
    task, one = serial
    assert off(one, task, poses(task)) < EXACT
    assert one.errors.max_relative < EXACT
    assert one.errors.matrix_max < EXACT
    # 3^4 products of 1, cos, sin; the matrix itself would take 5^4.
    assert one.expansion.n_terms <= 81
    # Rows of springs without a law are turned until as few as possible are left.
    assert one.factor.weights == ()
    assert len(one.factor.group) <= 6 * 12


@pytest.mark.parametrize("name", ["xr701", "tx200"])
@pytest.mark.parametrize("links", ["rigid", "beam"])
def test_other_serial_arms(name, links):
    task, one = learned(sprung(name, links, "serial"))
    assert off(one, task, poses(task)) < EXACT


def test_laws_of_angles_are_exact_too(lawful):
    task, one = lawful
    # Polynomial and Fourier laws lie in what laws are sought in; 1e-9: least squares over 210 nearly dependent terms.
    assert off(one, task, poses(task)) < 1e-9
    assert len(one.factor.weights) == 2
    assert sorted(set(one.factor.group)) == [-1, 0, 1]


def test_the_parallelogram_is_met(bar):
    task, one = bar
    # MET (1e-7) is the RMS over a part's rows, times 2 in their squares; the worst entry of 300 poses is some more.
    assert off(one, task, poses(task)) < 20.0 * MET
    assert one.errors.rms_interior < 2.0 * MET
    assert one.expansion.n_terms > 81


def test_a_table_is_learned_as_far_as_smooth_functions_go_and_says_how_far():
    table = LawSpring(TableBasis(1, np.radians([-135.0, -60.0, 0.0, 35.0])), np.log([8e5, 1.2e6, 9e5, 1e6]))
    task, one = learned(sprung("kr60-3", j2=table))
    # Kinks: not exact, yet a tenth of the law's own variation; and the stated figure is the one seen.
    fresh = poses(task, 2000)
    error = np.abs(predict_compliance(one, fresh) / task.run(fresh) - 1.0)
    assert 1e-6 < error.max() < 0.02
    assert np.sqrt(np.mean(error**2)) == pytest.approx(one.errors.rms_interior, rel=0.15)


@pytest.mark.parametrize("which", ["serial", "bar", "lawful"])
@pytest.mark.parametrize("where", ["inside", "beyond", "far"])
def test_positive_semidefinite_at_any_pose(which, where, request, rng):
    task, one = request.getfixturevalue(which)
    Q = poses(task, 1000)
    middle, half = 0.5 * (one.lower + one.upper), 0.5 * (one.upper - one.lower)
    # Far, but not so far that polynomials of the sixth degree of a law overflow in exp(): that is refused.
    share = {"inside": 1.0, "beyond": 1.5, "far": 100.0 if which != "lawful" else 3.0}[where]
    if where != "inside":
        Q = middle + share * half * rng.uniform(-1.0, 1.0, Q.shape)
    C = compliance_matrix(one, Q)
    np.testing.assert_array_equal(C, C.swapaxes(1, 2))
    d = np.sqrt(np.einsum("nii->ni", C))
    assert (d > 0.0).all()
    # 1e-12: round-off of the entries, scaled to one. Inside, six compliant joints and more hold all directions.
    least = np.linalg.eigvalsh(C / (d[:, :, None] * d[:, None, :])).min()
    assert least > -1e-12


def test_a_poor_fit_is_positive_semidefinite_too(rng):
    """By construction, not because the fit is good."""
    task, one = learned(sprung("kr60-3", j3=SEXTIC))
    spoilt = replace(
        one,
        expansion=replace(
            one.expansion, coefficients=one.expansion.coefficients * rng.normal(size=(1, one.expansion.n_outputs))
        ),
    )
    C = compliance_matrix(spoilt, poses(task))
    d = np.sqrt(np.einsum("nii->ni", C))
    assert np.linalg.eigvalsh(C / (d[:, :, None] * d[:, None, :])).min() > -1e-12
    assert off(spoilt, task, poses(task)) > 0.1
    assert (predict_compliance(spoilt, poses(task)) > 0.0).all()


@pytest.mark.parametrize("which", ["serial", "lawful"])
def test_any_direction(which, request, rng):
    task, one = request.getfixturevalue(which)
    Q = poses(task, 50)
    C = compliance_matrix(one, Q)
    for d in (*np.eye(3), rng.normal(size=3)):
        unit = d / np.linalg.norm(d)
        found = predict(one, Q, d)
        np.testing.assert_allclose(found, np.einsum("i,nij,j->n", unit, C[:, :3, :3], unit), rtol=1e-12)
        np.testing.assert_allclose(found, 1.0 / directional_stiffness(task.model, task.full(Q), d), rtol=1e-9)
    np.testing.assert_array_equal(predict(one, Q), predict(one, Q, np.array(one.load_direction)))


@pytest.mark.parametrize("bad", [np.zeros(3), np.array([np.nan, 0, 1]), np.array([np.inf, 0, 1]), np.ones(2)])
def test_directions_that_are_none(serial, bad):
    task, one = serial
    refuses("B001", "three finite numbers, not all zero", predict, one, poses(task, 2), bad)


def test_five_inputs():
    names = ("q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg")
    task, one = learned(sprung("tx200"), inputs=names)
    assert one.inputs == names
    assert off(one, task, poses(task)) < EXACT


@pytest.mark.slow
def test_all_six_inputs_of_a_tool_off_the_axis():
    model = sprung("tx200")
    # The force sensor's compliance is not the same about all axes, so that the last joint matters.
    model = replace(model, tool=np.diag([1e-8, 2e-8, 3e-8, 1e-6, 4e-6, 2e-6]))
    task, one = learned(model, inputs=model.robot.coordinates)
    assert off(one, task, poses(task)) < EXACT


def test_so_far_outside_that_it_overflows_is_refused(lawful):
    _, one = lawful
    refuses("S001", "not valid at 1 of 1 rows", compliance_matrix, one, np.array([[1e3, -1e3, 0.0, 0.0]]))
    refuses("S001", "not valid at 1 of 1 rows", predict, one, np.array([[1e3, -1e3, 0.0, 0.0]]))


def test_many_poses_are_worked_on_in_blocks(serial, monkeypatch):
    task, one = serial
    Q = poses(task, 500)
    whole = compliance_matrix(one, Q)
    monkeypatch.setattr("surrogate.model._BLOCK", 7 * one.expansion.n_outputs)
    # Round-off of each pose's largest entry: small ones are differences of large ones, and BLAS rounds by block size.
    np.testing.assert_allclose(compliance_matrix(one, Q), whole, rtol=1e-13, atol=1e-14 * np.abs(whole).max())
    assert compliance_matrix(one, Q[:0]).shape == (0, 6, 6)


def test_factors_that_make_no_sense_are_refused(lawful):
    _, one = lawful
    law = one.factor.weights[0]
    for group, weights in (([0], ()), ([-2], ()), ([], ()), ([[0]], (law,)), ([1], (law,))):
        refuses("F007", "groups", Factor, np.array(group, dtype=np.int64), weights)
    two = replace(law, coefficients=np.hstack([law.coefficients] * 2))
    refuses("F007", "weights", Factor, np.array([0]), (two,))
    refuses("F007", "factor", replace, one, factor=None)
    refuses("F007", "numbers a pose", replace, one, factor=Factor(one.factor.group[:-1], one.factor.weights))


def test_too_many_inputs_are_refused():
    model = sprung("kr60-3")
    scope = scope_of(model.robot, "0" * 64, OTHERS)
    wide = replace(
        scope,
        inputs=tuple(f"a{i}" for i in range(8)),
        lower=-np.ones(8),
        upper=np.ones(8),
        periodic=(),
        couplings=type(scope.couplings).none(8),
        fixed_deg={},
    )
    refuses(
        "S003",
        r"factored basis: terms: got 6561; allowed: at most 6000",
        fit_factored,
        lambda Q: pytest.fail("run"),
        lambda n: pytest.fail("drawn"),
        wide,
    )


def test_a_rigid_model_is_refused():
    model = build_model(load_description("kr60-3"), links="rigid").with_rigid_joints()
    refuses("M005", "nothing in it deflects", compliance_factor, model, np.zeros((2, 6)))
