"""What is asked of a surrogate, and what it says where it does not know."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from arm_cases import COUPLED, arm_compliance, few_runs, fitted, poses, sprung
from refusals import refuses

from fem import compliance, directional_stiffness
from fem.statics.small_displacements import LIMIT
from robots.arm_class import usual_load
from robots.inverse.singularities import NEAR_SINGULAR, singularity_distance
from robots.kinematics import stretched_length
from surrogate import compliance_matrix, fast, full_poses, query, scope_of, task_of, train
from surrogate.asking import SINGULARITY_ROWS
from surrogate.model import Quantity, Surrogate, predict, predict_compliance


@pytest.fixture(scope="module")
def plain():
    return fitted(150, 2, degree=6)


@pytest.fixture(scope="module")
def coupled():
    return fitted(150, 2, couplings=COUPLED, bars=True)


@pytest.fixture(scope="module")
def arm():
    """A serial arm learned exactly, with its kinematics and bars."""
    model = sprung("tx200")
    task = task_of(
        model, scope_of(model.robot, "0" * 64, ("q2_deg", "q3_deg", "q4_deg", "q5_deg")), np.random.default_rng(0)
    )
    with few_runs():
        return task, train(task, np.random.default_rng(0), basis="factored").best


def test_stiffness_in_N_per_mm_with_its_error_bar():
    s = fitted(basis="trigonometric", degree=2, target="direct", bars=True)
    Q = poses(20, 2, 7)
    answer = query(s, Q)
    # 1e-9: the fit is exact to round-off; a stiffness in N/m would be off by 1000.
    np.testing.assert_allclose(answer.stiffness_N_per_mm, 1.0 / (arm_compliance(Q) * 1000.0), rtol=1e-9)
    np.testing.assert_allclose(answer.value, 1.0 / arm_compliance(Q), rtol=1e-9)
    np.testing.assert_array_equal(answer.relative_error, s.bars.half_width(Q))
    assert answer.inside_domain.all()
    assert answer.reachable.all()
    assert answer.answered.all()
    assert answer.faults == {}


def test_the_bar_of_a_stiffness_is_that_of_its_compliance(coupled):
    """|k / k_true - 1| for k = 1 / c is |c_true / c - 1|: relative to the answer, not to the truth."""
    Q = poses(2000, 2, 3, "random", COUPLED)
    answer = query(coupled, Q)
    true = 1.0 / arm_compliance(Q)
    inside = np.abs(true / answer.value - 1.0) <= answer.relative_error
    # 500 runs set the factor (sd 1 %).
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


def test_without_bars_nothing_is_said_of_the_error(plain):
    answer = query(plain, poses(3, 2))
    assert np.isnan(answer.model_error).all()
    assert np.isnan(answer.relative_error).all()


OUT = np.radians([[0.0, 60.0], [46.0, 60.0], [-35.0, 110.0]])


def test_rows_outside_are_flagged_and_get_no_value(coupled):
    answer = query(coupled, OUT)
    assert answer.answered.tolist() == [True, False, False]
    assert np.isnan(answer.value[1:]).all()
    assert np.isinf(answer.relative_error).tolist() == [False, True, True]
    assert answer.faults == {
        1: "q2_deg = 46 deg (allowed -35 to 45 deg)",
        2: "forearm: +1 q2_deg -1 q3_deg = -145 deg (allowed -110 to 0 deg)",
    }
    np.testing.assert_array_equal(answer.value[0], query(coupled, OUT[:1]).value[0])


def test_extrapolated_answers_are_flagged_and_have_no_error_bar(coupled):
    answer = query(coupled, OUT, extrapolate=True)
    assert answer.inside_domain.tolist() == [True, False, True]
    assert answer.reachable.tolist() == [True, True, False]
    assert np.isinf(answer.relative_error).tolist() == [False, True, True]
    assert np.isinf(answer.model_error).tolist() == [False, True, True]
    assert np.all(np.isfinite(answer.stiffness_N_per_mm) & (answer.stiffness_N_per_mm > 0.0))
    assert set(answer.faults) == {1, 2}


def test_if_no_row_can_be_answered_all_are_counted_and_the_first_named_in_degrees(coupled):
    Q = np.radians([[46.0, 60.0], [-35.0, 110.0], *[[0.0, 30.0]] * 7])
    info = refuses("S001", "", query, coupled, Q)
    text = str(info)
    assert "9 of 9 rows (first 5 shown)" in text
    assert "row 1: q2_deg = 46 deg (allowed -35 to 45 deg)" in text
    assert "row 2: forearm: +1 q2_deg -1 q3_deg = -145 deg (allowed -110 to 0 deg)" in text
    assert "row 3: q3_deg = 30 deg (allowed 40 to 115 deg)" in text
    assert "row 6" not in text
    assert "--extrapolate" in text


def test_no_rows_are_no_fault(coupled):
    answer = query(coupled, np.empty((0, 2)))
    assert answer.value.shape == answer.relative_error.shape == answer.singularity.shape == (0,)


def test_a_pose_on_the_limit_is_inside(coupled):
    assert query(coupled, np.radians([[45.0, 115.0], [-35.0, 75.0]])).answered.all()


@pytest.mark.parametrize("extrapolate", [False, True])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_angle_that_is_no_number_is_always_refused(plain, bad, extrapolate):
    refuses(
        "S001",
        r"1 of 2 rows .* row 2: q3_deg = ",
        query,
        plain,
        np.array([[0.0, 1.0], [0.0, bad]]),
        extrapolate=extrapolate,
    )


@pytest.mark.parametrize("extrapolate", [False, True])
def test_a_compliance_of_zero_or_less_never_becomes_a_stiffness(extrapolate):
    s = fitted(degree=1, target="direct")
    c = np.zeros((s.expansion.n_terms, 1))
    for value, words in ((0.0, "not valid at 1 of 1 rows: row 1: 0 m/N"), (-1e-6, "row 1: -1e-06 m/N")):
        c[0] = value
        bad = replace(s, expansion=replace(s.expansion, coefficients=c))
        refuses("S001", words, query, bad, np.radians([[5.0, 70.0]]), extrapolate=extrapolate)


@pytest.mark.parametrize("angle", [1e3, 1e60, -1e60])
def test_overflow_far_outside_is_refused(plain, angle):
    refuses("S001", "not valid", query, plain, np.array([[angle, 1.0]]), extrapolate=True)


@pytest.mark.parametrize("shape", [(1, 3), (2,), (0,), (1, 1, 2)])
def test_wrong_shapes_are_refused(plain, shape):
    refuses("S001", r"shape .*q2_deg, q3_deg", query, plain, np.zeros(shape))


def test_another_direction_and_the_matrix_need_the_factored_basis(plain):
    Q = poses(2, 2)
    refuses(
        "S002", r"knows only the load along.*--basis factored", query, plain, Q, direction=np.array([1.0, 0.0, 0.0])
    )
    refuses("S002", r"compliance matrix.*--basis factored", compliance_matrix, plain, Q)
    assert not plain.has_matrix


def test_along_any_direction_it_is_the_models_stiffness(arm, rng):
    task, one = arm
    Q = task.over_domain(100, rng)
    for d in (np.array([1.0, 0.0, 0.0]), rng.normal(size=3)):
        exact = directional_stiffness(task.model, task.full(Q), d)
        np.testing.assert_allclose(query(one, Q, direction=d).value, exact, rtol=1e-9)  # an exact basis: round-off
    np.testing.assert_allclose(compliance_matrix(one, Q), compliance(task.model, task.full(Q)), rtol=1e-9, atol=1e-18)


def test_near_singular_poses_are_flagged(arm):
    task, one = arm
    Q = task.over_domain(500, np.random.default_rng(1))
    Q[:100, 3] = 0.0  # a straight wrist
    answer = query(one, Q)
    np.testing.assert_array_equal(
        answer.singularity, singularity_distance(task.model.robot, full_poses(task.model.robot, one, Q)).sigma_min
    )
    assert answer.near_singular[:100].all()
    assert answer.answered[:100].all()
    np.testing.assert_array_equal(answer.near_singular, answer.singularity < NEAR_SINGULAR)
    assert np.count_nonzero(~answer.near_singular) > 0


def test_in_bulk_nearness_to_singularities_is_told_on_request(arm, rng):
    task, one = arm
    Q = task.over_domain(SINGULARITY_ROWS + 1, rng)
    assert np.isnan(query(one, Q).singularity).all()
    assert not query(one, Q).near_singular.any()
    few = query(one, Q[1:]).singularity
    assert np.isfinite(few).all()
    np.testing.assert_array_equal(query(one, Q, singularity=True).singularity[1:], few)
    assert np.isnan(query(one, Q[:3], singularity=False).singularity).all()


def test_many_poses_get_what_each_gets_alone(arm, coupled, rng):
    """Value, bars and words, by whatever loops; some poses outside. 1e-12: rounding."""
    task, one = arm
    for s, Q in ((one, task.over_domain(40_000, rng)), (coupled, poses(40_000, 2, 3, "random", COUPLED))):
        Q[::7, 0] += 9.0
        many = query(s, Q)
        for i in (1, 2, 3, 5):
            alone = query(s, Q[i : i + 1])
            for name in ("value", "relative_error", "model_error", "parameter_error"):
                np.testing.assert_allclose(getattr(many, name)[i], getattr(alone, name)[0], rtol=1e-12)
            assert i not in many.faults
        assert list(many.faults) == np.flatnonzero(~many.answered).tolist() == [*range(0, len(Q), 7)]
        assert all(words.startswith(f"{s.inputs[0]} = ") for words in many.faults.values())


@pytest.mark.parametrize("compiled", [False, True])
def test_many_poses_take_little_memory(arm, rng, monkeypatch, compiled):
    """At most 1 kB a pose: 60 numbers of leverage alone would be half of it, as they were."""
    task, one = arm
    if not compiled:
        monkeypatch.setattr(fast, "kernels", lambda: None)
    Q = task.over_domain(100_000, rng)
    query(one, Q[:20_000])
    tracemalloc.start()
    try:
        query(one, Q)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak / len(Q) < 400


def test_stiffnesses_beyond_small_displacements_are_flagged_or_refused(arm, rng):
    """Rows of the compliance's factor so many times as large make the arm so much softer, squared."""
    task, one = arm
    Q = task.over_domain(50, rng)
    stiffness = query(one, Q).value
    assert not query(one, Q).beyond_small.any()
    robot = task.model.robot
    limit = usual_load(robot) / (LIMIT * stretched_length(robot))  # N/m: softer ones are beyond

    def softer(times: float) -> Surrogate:
        scaled = replace(one.expansion, coefficients=one.expansion.coefficients * np.sqrt(times))
        return replace(one, expansion=scaled)

    times = float(np.median(stiffness)) / limit
    answer = query(softer(times), Q)
    np.testing.assert_array_equal(answer.beyond_small, answer.value < limit)
    assert 10 < np.count_nonzero(answer.beyond_small) < 40
    refuses("M006", "beyond small displacements", query, softer(1e3 * times), Q)


def test_an_unknown_robot_has_no_flag(plain):
    answer = query(plain, poses(3, 2))
    assert np.isnan(answer.singularity).all()
    assert not answer.beyond_small.any()
    assert not answer.near_singular.any()


def test_another_quantity_is_given_as_it_is(plain):
    other = replace(plain, quantity=Quantity("isotropy", "1", "isotropy"))
    Q = poses(5, 2)
    np.testing.assert_array_equal(query(other, Q).value, predict(plain, Q))
    refuses("S002", r"compliance from a surrogate of: got 'isotropy'", predict_compliance, other, Q)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"target": "stiffness"}, "target"),
        ({"target": "factored"}, "factor"),
        ({"inputs": ("q2_deg",), "lower": np.zeros(1), "upper": np.ones(1), "periodic": ()}, "couplings"),
    ],
)
def test_surrogates_that_do_not_fit_together_are_refused(plain, changes, words):
    refuses("F007", words, replace, plain, **changes)


def test_surrogates_of_other_inputs_or_figures_are_refused(plain):
    refuses("F007", "one of 2 inputs", replace, plain, expansion=fitted(300, 3, degree=2).expansion)
    refuses(
        "F007",
        "numbers a pose",
        replace,
        plain,
        expansion=replace(plain.expansion, coefficients=np.hstack([plain.expansion.coefficients] * 2)),
    )
    for bad in (-0.1, np.nan, np.inf):
        refuses("F007", "error figures", replace, plain, errors=replace(plain.errors, rms_relative=bad))
