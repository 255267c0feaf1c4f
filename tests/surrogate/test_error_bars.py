"""Error bars: 95 % of fresh poses inside, wide where the errors are, and the calibration's uncertainty on top."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arm_cases import arm_compliance, few_runs, fitted, planar_scope, poses, sprung
from refusals import refuses
from scipy.stats import spearmanr

from robots import load_description
from robots.constants import NORMAL_95
from surrogate import scope_of, task_of, train
from surrogate.asking import query
from surrogate.basis import make_basis
from surrogate.error_bars import MATTERS, ErrorBars, ParameterBars, learn_bars
from surrogate.model import predict, predict_compliance

K = 3


def errors(surrogate, Q):
    return np.abs(predict_compliance(surrogate, Q) / arm_compliance(Q) - 1.0)


@pytest.fixture(scope="module", params=["polynomial", "trigonometric"])
def barred(request):
    options = {"polynomial": {"degree": 4}, "trigonometric": {"degree": 1, "target": "direct"}}[request.param]
    return fitted(300, K, basis=request.param, bars=True, **options)


def test_fresh_errors_fall_inside_as_often_as_stated(barred):
    Q = poses(10_000, K, 11, "random")
    covered = np.mean(errors(barred, Q) <= barred.bars.half_width(Q))
    # 500 runs set the factor: the share it covers is 95 % with a standard deviation of sqrt(.95 * .05 / 500) = 1 %;
    # three of them. The figures of a whole training, with 4096 runs, are held to 93-97 % below.
    assert covered == pytest.approx(0.95, abs=0.03)


def test_bars_are_wide_where_the_errors_are_large(barred):
    Q = poses(5000, K, 12, "random")
    error, width = errors(barred, Q), barred.bars.half_width(Q)
    # Rank correlation of independent figures: below 0.03 in 95 % of all cases.
    assert spearmanr(error, width).statistic > 0.2
    order = np.argsort(width)
    thirds = [np.sqrt(np.mean(error[part] ** 2)) for part in np.array_split(order, 3)]
    assert thirds[0] < thirds[1] < thirds[2]
    # One width for all poses would cover fewer than 95 % where it matters.
    assert np.mean(error[order[-500:]] <= np.quantile(error, 0.95)) < 0.93
    assert np.mean(error[order[-500:]] <= width[order[-500:]]) > 0.90


def test_a_noisier_region_gets_wider_bars():
    scope = planar_scope(2)
    Q = poses(2000, 2, 1, "random")
    u = 2.0 * (Q[:, 0] - scope.lower[0]) / (scope.upper[0] - scope.lower[0]) - 1.0
    size = 1e-3 * np.exp(2.0 * u)
    error = size * np.random.default_rng(0).normal(size=len(Q))
    basis = make_basis("polynomial", scope.lower, scope.upper, 3)
    bars = learn_bars(basis, scope, poses(200, 2, 2), Q, error)
    # A log-linear size lies in the quadratic, over a range of e^4 here. The standard deviation of ln|normal| is 1.1:
    # 1000 draws leave 0.1 of a fit of 7 numbers on average, more in the corners.
    ratio = np.log(bars.half_width(Q) / (NORMAL_95 * size))
    assert np.abs(ratio).max() < 0.6
    assert np.sqrt(np.mean(ratio**2)) < 0.2
    assert bars.n_runs == 2000


def test_errors_of_zero_and_of_round_off_are_no_trouble():
    scope = planar_scope(2)
    Q = poses(400, 2, 1, "random")
    basis = make_basis("polynomial", scope.lower, scope.upper, 3)
    for error in (np.zeros(400), np.full(400, 1e-300)):
        width = learn_bars(basis, scope, poses(200, 2, 2), Q, error).half_width(Q)
        assert (width <= 1e-15).all()
        assert (width >= 0.0).all()


def test_too_few_runs_for_a_quantile_are_refused():
    scope = planar_scope(2)
    basis = make_basis("polynomial", scope.lower, scope.upper, 3)
    refuses(
        "S004",
        r"runs kept out: got 199; allowed: 200 or more",
        learn_bars,
        basis,
        scope,
        poses(100, 2),
        poses(199, 2),
        np.ones(199),
    )


def test_far_outside_the_size_is_capped(barred):
    assert np.isfinite(barred.bars.half_width(np.full((1, K), 1e4))).all()


@pytest.mark.parametrize("changes", [{"exponent": np.nan}, {"quantile": -1.0}, {"quantile": np.inf}, {"scale": "two"}])
def test_bars_that_make_no_sense_are_refused(barred, changes):
    bars = barred.bars
    if changes == {"scale": "two"}:
        changes = {"scale": replace(bars.scale, coefficients=np.hstack([bars.scale.coefficients] * 2))}
    refuses("F007", "error bars", replace, bars, **changes)


def test_bars_over_other_inputs_are_refused(barred):
    other = fitted(150, 2, bars=True, degree=3)
    refuses("F007", "one of 3 inputs", replace, barred, bars=other.bars)


# --- both parts in an answer --------------------------------------------------------------------------------------


def test_an_answers_bar_is_both_parts_together(barred):
    one = barred.bars.scale.coefficients
    expansion = replace(barred.bars.scale, coefficients=1e-8 * np.hstack([one, 0.0 * one]))
    both = replace(barred, parameters=ParameterBars(expansion, ("a", "b")))
    Q = poses(50, K, 3)
    alone, answer = query(barred, Q), query(both, Q)
    np.testing.assert_array_equal(alone.relative_error, alone.model_error)
    assert np.isnan(alone.parameter_error).all()
    np.testing.assert_array_equal(answer.model_error, alone.model_error)
    wanted = NORMAL_95 * np.abs(expansion(Q)[:, 0]) / predict(both, Q)
    np.testing.assert_allclose(answer.parameter_error, wanted, rtol=1e-12)
    np.testing.assert_allclose(answer.relative_error**2, answer.model_error**2 + answer.parameter_error**2, rtol=1e-12)


def test_gradients_of_several_parameters_add_in_squares():
    scope = planar_scope(2)
    basis = make_basis("polynomial", scope.lower, scope.upper, 1)
    expansion = basis.expansion(np.array([[3.0, 4.0], [0.0, 0.0], [0.0, 0.0]]))
    bars = ParameterBars(expansion, ("a", "b"))
    np.testing.assert_allclose(bars.relative_sd(poses(5, 2), np.full(5, 10.0)), 0.5, rtol=1e-12)


def test_what_the_readings_left_open_is_named_where_it_matters(barred):
    basis = make_basis("polynomial", barred.lower, barred.upper, 1)
    none = basis.expansion(np.zeros((4, 1)))
    # Rows are 1, then the third, second and first angle: j5 matters in half of the range of the first.
    share = basis.expansion(np.array([[0.001, MATTERS], [0.0, 0.0], [0.0, 0.0], [0.0, 0.01]]))
    one = replace(barred, parameters=ParameterBars(none, ("j2",), undetermined=("j4", "j5"), open_share=share))
    Q = poses(40, K, 3)
    answer = query(one, Q)
    middle = 0.5 * (barred.lower[0] + barred.upper[0])
    assert answer.open == {int(i): ("j5",) for i in np.flatnonzero(Q[:, 0] > middle)}
    assert 0 < len(answer.open) < 40
    # Rows without a value say nothing.
    outside = np.vstack([Q[Q[:, 0] > middle][:1], barred.upper + 0.1])
    assert set(query(one, outside).open) == {0}


@pytest.mark.parametrize(
    "changes", [{"misfit": -1.0}, {"misfit": np.nan}, {"undetermined": ("j4",)}, {"open_share": "own"}]
)
def test_parameter_bars_that_make_no_sense_are_refused(changes):
    scope = planar_scope(2)
    expansion = make_basis("polynomial", scope.lower, scope.upper, 1).expansion(np.ones((3, 1)))
    changes = {name: expansion if value == "own" else value for name, value in changes.items()}
    refuses("F007", "uncertainty of parameters", ParameterBars, expansion, ("j2",), **changes)


def calibrated(name, links, dof=1e6):
    """A robot with constant springs known to 5 %, all correlated, as a description with the table and its model."""
    import sys
    from pathlib import Path

    sys.path.append(str(Path(__file__).parents[1] / "doe"))
    import uncertain_models as um

    names = {"kr60-3": [f"j{i}.stiffness" for i in range(2, 6)], "xr701": [f"j{i}.stiffness" for i in range(2, 6)]}[
        name
    ]
    given = um.sprung(name)
    return um.with_table(given, um.table_of(given, names, dof=dof), links)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "links", "dof"), [("kr60-3", "rigid", 1e6), ("xr701", "beam", 6.0)])
def test_the_calibrations_part_is_what_propagation_says(name, links, dof):
    from doe.certainty.propagation import parameter_uncertainty, propagate
    from fem import build_model
    from stiffarm.commands.fit.learning import learning_task

    description = calibrated(name, links, dof)
    model = build_model(description, links=links)
    names = model.robot.coordinates[1:5]
    task = learning_task(description, model, names, np.random.default_rng(0))
    with few_runs(calibration=1500):
        one = train(task, np.random.default_rng(0), basis="factored").best
    assert one.parameters is not None
    assert len(one.parameters.names) == 4
    Q = task.over_domain(400, np.random.default_rng(7))
    answer = query(one, Q)
    told = propagate(model, parameter_uncertainty(description), task.full(Q)).relative_sd
    # By springs the compliance changes as it is itself: of second order in sines and cosines, so exact. They
    # are divided by what the surrogate takes for the compliance, which a parallelogram's is to 1e-7.
    np.testing.assert_allclose(answer.parameter_error, NORMAL_95 * told, rtol=1e-6)
    assert one.parameters.misfit < 1e-9


# --- slow: whole trainings ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["polynomial", "trigonometric", "factored", "adaptive"])
@pytest.mark.parametrize("name", ["xr701", "kr60-3", "tx200"])
def test_coverage_over_ten_thousand_fresh_poses(name, basis):
    model = sprung(name, "beam")
    names = model.robot.coordinates[1:5]
    task = task_of(model, scope_of(model.robot, "0" * 64, names), np.random.default_rng(1))
    one = train(task, np.random.default_rng(1), basis=basis).best
    Q = task.over_domain(10_000, np.random.default_rng(77))
    error = np.abs(predict(one, Q) / task.run(Q) - 1.0)
    covered = np.mean(error <= one.bars.half_width(Q))
    # 93-97 %, as promised; by chance it is off by 0.4 %: 4096 runs set the factor, 10 000 judge it.
    assert 0.93 <= covered <= 0.97
    assert one.errors.coverage95 == pytest.approx(covered, abs=0.015)


def test_descriptions_without_a_table_have_no_calibration_part():
    from stiffarm.commands.fit.learning import learning_task

    description = load_description("kr60-3")
    task = learning_task(description, sprung("kr60-3"), ("q2_deg", "q3_deg"), np.random.default_rng(0))
    assert task.gradients is None
    with few_runs():
        assert train(task, np.random.default_rng(0), basis="polynomial", degree=2).best.parameters is None


def test_error_bars_are_kept_as_arrays_of_one_number_for_each_pose(barred):
    assert isinstance(barred.bars, ErrorBars)
    assert barred.bars.half_width(poses(7, K)).shape == (7,)
