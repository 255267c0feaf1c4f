"""Promises of a plan: the lack of fit is in them, and repeats do not average it away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe import bundled_data, read_measurements
from doe.certainty.uncertainty import certainty
from doe.estimation.estimate import estimate
from doe.estimation.noise import Noise
from doe.estimation.problem import problem
from doe.planning.forecast import forecast
from doe.planning.lack_of_fit import ELSEWHERE, HIDDEN, SPREAD, USUAL, Shown, drawn_shares
from doe.planning.outset import Outset, first_outset, outset
from doe.planning.plan import MeasurementPlan, foresee
from doe.planning.pose_designs import pose_design
from doe.planning.protocol import Protocol
from fem import ArmModel, build_model
from fem.free.parameters import parameter
from robots import load_description
from robots.arrays import Array

GAUGE = (1e-5, 1e-5)
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return build_model(load_description("kr60-3"))


@pytest.fixture(scope="module")
def bare(model: ArmModel) -> Outset:
    springs = [parameter(model, f"{joint}.stiffness") for joint in model.robot.joint_names[:5]]
    return first_outset(model, springs, Noise(white=GAUGE))


def _plan(start: Outset, poses: int, repeats: int = 3) -> MeasurementPlan:
    protocol = Protocol(np.array([200.0, 400.0]), DIRECTIONS, (0, 1, 2), repeats)
    q = pose_design(start.free.model.robot, poses, rng=np.random.default_rng(4))
    return foresee(start, q, protocol)


def _half(start: Outset, made: MeasurementPlan) -> Array:
    return forecast(start, made, np.random.default_rng(0)).half95


def test_without_readings_the_usual_lack_of_fit_is_promised_for(bare: Outset) -> None:
    made = _plan(bare, 6)
    found = forecast(bare, made, np.random.default_rng(0))
    assert not found.seen
    assert found.lack[1] == pytest.approx(USUAL, rel=0.3)
    # The gauge of 0.01 mm by itself would know springs to a fraction of a percent.
    assert (found.half95 > 5.0 * np.array([1.96 * f.after for f in made.foresight])).all()


@pytest.mark.slow
def test_repeats_do_not_average_it_away_and_set_ups_do(bare: Outset) -> None:
    once, often, more = (_half(bare, _plan(bare, n, repeats)) for n, repeats in ((6, 1), (6, 50), (24, 1)))
    # Fifty times the readings would be seven times as sure, if they were independent.
    assert (often > 0.7 * once).all()
    assert (often <= once).all()
    assert (more < 0.7 * once).all()


def test_the_same_numbers_promise_the_same(bare: Outset) -> None:
    made = _plan(bare, 6)
    np.testing.assert_array_equal(_half(bare, made), _half(bare, made))


def test_real_readings_without_repeats_show_their_residual_as_lack_of_fit() -> None:
    """FANUC, 43 poses of one reading each: all of the residual counts once a set-up."""
    arm = build_model(load_description("fanuc-r2000ic"))
    data = read_measurements(bundled_data("fanuc-r2000ic"), arm.robot)
    springs = [parameter(arm, f"{joint}.stiffness") for joint in arm.robot.joint_names]
    e = estimate(problem(arm, data, springs), GAUGE)
    start = outset(e, certainty(e))
    assert start.shown is not None
    # All of the noise but a tenth of each number.
    whole = np.mean(e.noise.variance(e.problem, e.prediction)) / np.mean(e.prediction**2)
    assert start.shown.lack == pytest.approx(whole, rel=0.1)
    assert start.shown.own < 0.02 * start.shown.lack
    made = _plan(start, 10, repeats=20)
    found = forecast(start, made, np.random.default_rng(0))
    assert found.seen
    assert found.lack[1] > np.sqrt(start.shown.lack)
    less = replace(start, shown=replace(start.shown, lack=1e-4))
    assert (found.half95 > _half(less, made))[1:5].all()


# ------------------------------------------------------------
# What the readings so far show of a lack of fit, and what that says of campaigns to come


def _shares(lack: float, *, own: float = 1e-6, dof: float = 30.0) -> Array:
    return np.log(drawn_shares(Shown(lack**2, own, dof, 0.0, Noise((1e-5, 1e-5))), 4000, np.random.default_rng(0)))


def test_before_any_reading_it_is_the_usual_one() -> None:
    x = np.log(drawn_shares(None, 4000, np.random.default_rng(0)))
    assert np.median(x) == pytest.approx(np.log(USUAL), abs=0.08)
    assert x.std() == pytest.approx(SPREAD, rel=0.05)


def test_readings_and_what_is_usual_share_the_say() -> None:
    """With many degrees of freedom all is normal, and the posterior has a closed form."""
    x = _shares(0.2, own=1e-12, dof=1000.0)
    weight = SPREAD**2 / (SPREAD**2 + ELSEWHERE**2)
    assert x.mean() == pytest.approx(weight * (np.log(0.2) + HIDDEN) + (1.0 - weight) * np.log(USUAL), abs=0.06)
    assert x.std() == pytest.approx(np.sqrt(weight) * ELSEWHERE, rel=0.06)


def test_few_degrees_of_freedom_say_less() -> None:
    assert _shares(0.2, dof=2.0).std() > 1.05 * _shares(0.2, dof=200.0).std()
    assert np.quantile(_shares(0.2, dof=2.0), 0.9) > np.quantile(_shares(0.2, dof=200.0), 0.9)


def test_what_hides_in_the_readings_own_scatter_is_not_taken_for_none() -> None:
    hidden, clear = _shares(0.0, own=0.05**2), _shares(0.0, own=0.005**2)
    assert np.quantile(hidden, 0.9) > np.quantile(clear, 0.9) + 0.5
    assert np.exp(np.quantile(hidden, 0.9)) < USUAL * np.exp(1.2816 * SPREAD)


def test_more_shown_is_more_to_come() -> None:
    found = [np.quantile(_shares(lack), 0.9) for lack in (0.0, 0.02, 0.1, 0.4)]
    assert (np.diff(found) > 0.0).all()
