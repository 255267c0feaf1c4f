"""Uncertainty of calibrated numbers propagated to the compliance: exact derivatives, sampling, coverage, flags."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses
from scipy.stats import binom
from uncertain_models import SPRINGS, along, known, sprung, table_of, with_laws, with_table

import fem
from doe import Measurements
from doe.calibration.run import run_campaign
from doe.calibration.written import calibration_table, with_origin
from doe.certainty.propagation import (
    SHARE,
    compliance_gradients,
    parameter_uncertainty,
    propagate,
    sampled,
)
from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.campaign import campaign_of
from doe.model_file.applied import apply_estimates
from fem import ArmModel, build_model
from fem.effects import build_arm, with_effects
from fem.effects.catalogue import effect_of
from fem.free.parameters import named_numbers
from fem.springs import LawSpring
from robots import ModelDescription, Robot, load_description
from robots.schema.description import LogFourierLaw, UndeterminedNumber

Arm = Callable[..., ArmModel]
Readings = Callable[..., Measurements]
Poses = Callable[[Robot, int, np.random.Generator], np.ndarray]


@pytest.fixture(scope="module")
def kuka() -> ModelDescription:
    return sprung()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


# --- exact: derivatives ------------------------------------------------------------------------------------


EVERY_KIND = (
    "j1.stiffness",
    "j4.rx",
    "base.ry",
    "tool.ty",
    "upper-arm.modulus",
    "forearm.wall",
    "j5.zero",
    "j2.law[1]",
    "j3.law[0]",
    "j3.law[2]",
)


@pytest.mark.slow
def test_derivatives_are_those_of_a_model_built_anew(kuka: ModelDescription, rng: np.random.Generator) -> None:
    # Places that give way at all: their rows are in the file before.
    start = apply_estimates(
        with_laws(kuka),
        [
            ParameterEstimate(p, v, (math.nan, math.nan), math.nan, "determined", math.inf)
            for p, v in zip(
                named_numbers(build_model(kuka), ("j4.rx", "base.ry", "tool.ty")).parameters,
                (2e6, 2e7, 4e6),
                strict=True,
            )
        ],
    )
    given = with_table(start, table_of(start, EVERY_KIND))
    model = build_model(given)
    q = 0.6 * rng.uniform(*model.robot.limits.T, (7, 6))
    wrench = np.concatenate([rng.normal(size=3), 0.3 * rng.normal(size=3)])
    found = propagate(model, known(given), q, wrench).gradient
    w = wrench / np.linalg.norm(wrench)
    numbers = named_numbers(model, EVERY_KIND)
    laws = {law.joint: law for law in numbers.laws}
    for k, (name, column) in enumerate(zip(EVERY_KIND, numbers.columns, strict=True)):
        h = 1e-4 * (numbers.u[column] if numbers.parameters[column].scale == "compliance" else 1.0)
        ends = []
        for step in (h, -h):
            u = numbers.u.copy()
            u[column] += step
            p = numbers.parameters[column]
            law = laws.get(p.place) if p.kind.of_law else None
            moved = range(law.first, law.first + law.basis.size) if law else [int(column)]
            estimates = [
                ParameterEstimate(
                    numbers.parameters[m],
                    numbers.parameters[m].outer(u[m]),
                    (math.nan, math.nan),
                    math.nan,
                    "determined",
                    math.inf,
                )
                for m in moved
            ]
            there = build_model(apply_estimates(start, estimates, [replace(law, first=0)] if law else []))
            ends.append(np.log(fem.deflection(there, q, w) @ w))
        # Differences leave 1e-8; a wall is interpolated to 1e-6 of the link's part.
        np.testing.assert_allclose(
            found[:, k], (ends[0] - ends[1]) / (2.0 * h), rtol=2e-5, atol=1e-11 / h, err_msg=name
        )


def test_one_spring_alone_has_the_compliance_s_own_relative_deviation(kuka: ModelDescription) -> None:
    # Rigid links and one spring: C = c t^2, so that the share is one whatever the pose.
    given = sprung(springs={"j2": 9e5})
    table = table_of(given, ["j2.stiffness"], relative=0.07)
    u = known(with_table(given, table, "rigid"))
    model = build_model(u.description, "rigid")
    q = np.radians([[0, -60, 90, 0, 20, 0], [30, -90, 100, 10, 40, 0]])
    np.testing.assert_allclose(propagate(model, u, q).relative_sd, 0.07, rtol=1e-12)


def test_the_whole_matrix_says_the_same_as_a_direction(kuka: ModelDescription, rng: np.random.Generator) -> None:
    given = with_table(kuka, table_of(kuka, ("j1.stiffness", "j2.stiffness", "j5.stiffness", "base.rx")[:3]))
    model, u = build_model(given), known(given)
    q = 0.6 * rng.uniform(*model.robot.limits.T, (5, 6))
    G = compliance_gradients(model, u, q).known
    d = rng.normal(size=(5, 6))
    C = fem.compliance(model, q)
    own = np.einsum("ni,npij,nj->np", d, G, d) / np.einsum("ni,nij,nj->n", d, C, d)[:, None]
    # Linear in the compliances: with the rest it is the compliance itself.
    np.testing.assert_allclose(propagate(model, u, q, d).gradient, own, rtol=1e-9, atol=1e-6 * np.abs(own).max())
    stiffer = model.with_springs({"j1": 3e6, "j2": 1.8e6, "j5": 3e5})
    np.testing.assert_allclose(
        C - np.einsum("npij,p->nij", G, 0.5 * u.estimate), fem.compliance(stiffer, q), atol=1e-12 * np.abs(C).max()
    )


def test_batches_do_not_matter(
    kuka: ModelDescription, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = with_table(kuka, table_of(kuka, ("j2.stiffness", "j3.stiffness")))
    model, u = build_model(given), known(given)
    q = 0.6 * rng.uniform(*model.robot.limits.T, (23, 6))
    d, tip = rng.normal(size=(23, 3)), rng.normal(size=(23, 3)) * 0.1
    whole = propagate(model, u, q, d, tip)
    monkeypatch.setattr("doe.certainty.propagation.BATCH", 7)
    parts = propagate(model, u, q, d, tip)
    np.testing.assert_allclose(parts.gradient, whole.gradient, rtol=1e-12)
    one = np.array([propagate(model, u, q[k : k + 1], d[k], tip[k]).relative_sd[0] for k in (0, 22)])
    np.testing.assert_allclose(whole.relative_sd[[0, 22]], one, rtol=1e-12)


# --- sampling, and where the first order ends --------------------------------------------------------------


@pytest.mark.slow
def test_models_built_with_drawn_springs_spread_as_stated(kuka: ModelDescription, rng: np.random.Generator) -> None:
    given = with_table(kuka, table_of(kuka, ("j1.stiffness", "j2.stiffness", "j3.stiffness", "j5.stiffness")))
    model, u = build_model(given), known(given)
    q = 0.6 * rng.uniform(*model.robot.limits.T, (6, 6))
    drawn = rng.multivariate_normal(u.estimate, u.covariance, size=1000, tol=1e-9, method="eigh")
    spread = np.array(
        [along(model.with_springs(dict(zip(("j1", "j2", "j3", "j5"), 1.0 / c, strict=True))), q) for c in drawn]
    )
    stated = propagate(model, u, q)
    # A standard deviation of 1000 draws is known to 1 / sqrt(2000) = 2.2 %; four of these.
    np.testing.assert_allclose(spread.std(axis=0) / stated.compliance, stated.relative_sd, rtol=0.09)
    mine = sampled(model, u, q, rng, 1000)
    np.testing.assert_allclose(mine.std(axis=0) / stated.compliance, stated.relative_sd, rtol=0.09)
    np.testing.assert_allclose(mine.mean(axis=0), stated.compliance, rtol=0.05 * 4.0 / math.sqrt(1000))


@pytest.mark.parametrize(("sd", "ratio"), [(0.05, 1.002), (0.3, 1.07), (0.6, 1.31)])
def test_the_first_order_of_a_law_ends_where_it_is_said_to(sd: float, ratio: float, rng: np.random.Generator) -> None:
    # One law alone carries everything: C is log-normal, of mean exp(s^2/2) and relative deviation (exp(s^2)-1)^(1/2).
    given = sprung(springs={})
    law = LogFourierLaw(kind="log-fourier", input="q2_deg", coefficients=(13.7, 0.2, -0.1), source="assumed")
    joints = tuple(j.model_copy(update={"stiffness": law if j.name == "j2" else None}) for j in given.joint)
    given = given.model_copy(update={"joint": joints})
    u = known(with_table(given, table_of(given, ["j2.law[0]"], relative=sd), "rigid"))
    model = build_model(u.description, "rigid")
    q = np.radians([[0, -60, 90, 0, 20, 0]])
    found = propagate(model, u, q)
    assert found.relative_sd[0] == pytest.approx(sd, rel=1e-9)
    exact = math.exp(sd**2 / 2.0) * math.sqrt(math.exp(sd**2) - 1.0) / sd
    assert exact == pytest.approx(ratio, abs=0.005)
    assert found.is_rough[0] == (sd > 0.3 + 1e-9)
    draws = sampled(model, u, q, rng, 20_000)[:, 0] / found.compliance[0]
    # Kurtosis of a log-normal number makes its sampled deviation vary: some 5 % at 0.6, below 1 % at 0.05.
    assert draws.std() / sd == pytest.approx(exact, rel=0.02 + 0.25 * sd**2)


def test_a_spring_that_may_be_rigid_is_cut_off_there(kuka: ModelDescription, rng: np.random.Generator) -> None:
    given = sprung(springs={"j2": 9e5})
    u = known(with_table(given, table_of(given, ["j2.stiffness"], relative=1.0), "rigid"))
    model = build_model(u.description, "rigid")
    q = np.radians([[0, -60, 90, 0, 20, 0]])
    draws = sampled(model, u, q, rng, 5000)[:, 0]
    assert draws.min() > 0.0
    assert propagate(model, u, q).is_rough[0]


def test_student_s_t_widens_as_its_quantile_does(kuka: ModelDescription) -> None:
    q = np.radians([[0, -60, 90, 0, 20, 0]])
    few, many = (with_table(kuka, table_of(kuka, ("j2.stiffness", "j3.stiffness"), dof=n)) for n in (5.0, 1e6))
    wide, plain = (propagate(build_model(given), known(given), q).relative_sd for given in (few, many))
    assert wide[0] / plain[0] == pytest.approx(2.570582 / 1.959964, rel=1e-6)


# --- calibrated --------------------------------------------------------------------------------------------


def test_a_campaign_s_covariance_reaches_the_file(
    kuka: ModelDescription, readings: Readings, rng: np.random.Generator, random_poses: Poses
) -> None:
    model = build_model(kuka)
    q = random_poses(model.robot, 12, rng)
    data = readings(model, {}, q, np.array([300.0, 200.0, -600.0, 0, 0, 0]), noise_m=2e-5 * rng.normal(size=(12, 6)))
    names = ("j2.stiffness", "j3.stiffness", "j5.stiffness", "forearm.modulus")
    found = run_campaign(kuka, lambda d: build_model(d), data, campaign_of("kr60-3", names))
    table = calibration_table(found)
    assert table is not None
    sure = found.stages[0].certainty
    assert table.parameters == names
    np.testing.assert_allclose(np.array(table.covariance), sure.covariance, rtol=1e-12)
    u = known(with_table(found.description, table))
    again = build_model(u.description)
    assert (propagate(again, u, q).relative_sd > 0.0).all()


@pytest.mark.slow
def test_intervals_of_the_compliance_hold_the_truth_as_often_as_they_say(
    arm: Arm, readings: Readings, random_poses: Poses
) -> None:
    rng = np.random.default_rng(11)
    truth = {"j2": 1.45e6, "j3": 8e5, "j4": 4e5, "j5": 2.5e5}
    springs = campaign_of("xr701", tuple(f"{joint}.stiffness" for joint in truth))
    model = arm().with_springs(truth)
    q, held_out = random_poses(model.robot, 8, rng), random_poses(model.robot, 25, rng)
    load = np.array([150.0, 250.0, -600.0, 0.0, 0.0, 0.0])
    times, inside, wide = 200, np.zeros((200, 25), dtype=bool), 0
    exact = along(model, held_out)
    for k in range(times):
        noise = 2e-5 * rng.normal(size=(8, 6))
        data = readings(arm(), truth, q, load, noise_m=noise)
        fit = run_campaign(load_description("xr701"), lambda _: arm(), data, springs)
        given, here = with_origin(fit, data), fit.model
        found = propagate(here, known(given), held_out)
        assert not found.is_lower_bound.any()
        wide += int(found.is_rough.sum())
        inside[k] = np.abs(exact / found.compliance - 1.0) <= 1.959964 * found.relative_sd
    assert wide == 0
    # One pose of each data set: independent trials, 99.9 % band of a binomial number of 95 %.
    one = int(inside[np.arange(times), rng.integers(0, 25, times)].sum())
    assert binom.ppf(0.0005, times, 0.95) <= one <= binom.ppf(0.9995, times, 0.95)
    # Poses of one data set go together: at worst as uncertain as one pose, four standard deviations.
    assert inside.mean() == pytest.approx(0.95, abs=4.0 * math.sqrt(0.95 * 0.05 / times))


def test_the_law_s_basis_is_the_file_s() -> None:
    model = build_model(with_laws(sprung()))
    numbers = named_numbers(model, ("j2.law[2]", "j1.stiffness", "j2.law[0]"))
    spring = model.joints[1].axial
    assert isinstance(spring, LawSpring)
    assert numbers.columns.tolist() == [2, 3, 0]
    np.testing.assert_allclose(numbers.u[:3], spring.coefficients)
    refuses("M001", r"j2\.law\[0\] to \[2\]", named_numbers, model, ("j2.law[3]",))


# ------------------------------------------------------------
# Where a propagated uncertainty says too little and says so; effects; models that it does not belong to

# --- what the readings left open ---------------------------------------------------------------------------


def left_open(given: ModelDescription, one: UndeterminedNumber) -> ModelDescription:
    table = table_of(given, ("j2.stiffness", "j3.stiffness"))
    return with_table(given, table.model_copy(update={"undetermined": (one,)}))


def test_an_open_number_is_flagged_where_it_carries_something(kuka: ModelDescription) -> None:
    given = left_open(
        kuka, UndeterminedNumber(name="j1.stiffness", status="not identified", unit="N m/rad", note="unseen")
    )
    model, u = build_model(given), known(given)
    q = np.radians([[0, -60, 90, 0, 20, 0]] * 2)
    # A vertical load does not turn a vertical axis; a sideways one does.
    found = propagate(model, u, q, np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]))
    assert found.is_lower_bound.tolist() == [False, True]
    assert found.matters == ("j1.stiffness",)
    # Its share is what it is in the model: an independent split of the deflection.
    parts = fem.deflection_by_part(model, q[1:], np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    share = parts["j1"][0, 1] / sum(part[0, 1] for part in parts.values())
    assert found.open_share[1, 0] == pytest.approx(share, rel=1e-9)
    assert found.relative_sd[1] < found.relative_sd[0]


@pytest.mark.parametrize(("low", "flagged"), [(1e5, True), (1e9, False), (None, True)])
def test_a_rigid_spring_is_flagged_by_how_soft_it_may_be(
    kuka: ModelDescription, low: float | None, flagged: bool
) -> None:
    given = left_open(
        sprung(springs={k: v for k, v in SPRINGS.items() if k != "j5"}),
        UndeterminedNumber(name="j5.stiffness", status="at bound", unit="N m/rad", low=low, note="rigid fits best"),
    )
    model, u = build_model(given), known(given)
    q = np.radians([[0, -60, 90, 0, 60, 0]])
    found = propagate(model, u, q)
    assert found.is_lower_bound[0] == flagged
    influence, _ = fem.spring_influence(model, q, np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    # Without a limit: as soft as the usual calibrated spring.
    soft = float(np.median(u.estimate)) if low is None else 1.0 / low
    assert found.open_share[0, 0] == pytest.approx(-influence[0, 4, 2] * soft / found.compliance[0], rel=1e-9)


def test_combinations_that_nothing_moves_are_flagged_where_they_show(kuka: ModelDescription) -> None:
    # Only the sum of the first axis' compliance and the base's about it is known, and only it matters at j1 = base.
    start = apply_estimates(
        kuka,
        [
            ParameterEstimate(
                named_numbers(build_model(kuka), ["base.rz"]).parameters[0],
                2e6,
                (math.nan, math.nan),
                math.nan,
                "determined",
                math.inf,
            )
        ],
    )
    for names, shows in ((("j1.stiffness", "base.rz"), False), (("j1.stiffness", "j2.stiffness"), True)):
        blind = np.array([[1.0, -1.0]]) / math.sqrt(2.0)
        given = with_table(start, table_of(start, names, blind=blind))
        model, u = build_model(given), known(given)
        # Base and first axis are the same line: turning one or the other is all the same.
        found = propagate(model, u, np.radians([[10.0, -60, 90, 0, 20, 0]]), np.array([0.0, 1.0, 0.0]))
        assert found.is_lower_bound[0] == shows
        assert found.open_names == (f"combination of {names[0]}, {names[1]}",)
        if not shows:
            assert found.open_share.max() < 1e-9 < SHARE


def test_the_test_load_is_no_property_of_the_arm(kuka: ModelDescription) -> None:
    names = ("j2.stiffness", "load.x", "point.z")
    given = with_table(kuka, table_of(kuka, names))
    u = known(given)
    assert u.names == ("j2.stiffness",)
    alone = with_table(kuka, table_of(kuka, ("load.x", "load.tilt_y")))
    assert parameter_uncertainty(alone) is None
    assert parameter_uncertainty(kuka) is None


# --- effects -----------------------------------------------------------------------------------------------


def test_effects_of_the_model_take_part_and_those_of_readings_do_not(kuka: ModelDescription) -> None:
    plain = build_model(kuka)
    tilt = effect_of("joint-tilt:j2", plain).placed({"stiffness_x": 1e6, "stiffness_y": 2e6})
    backlash = effect_of("backlash:j2", plain)
    gap = backlash.placed({p.name: p.value(p.size[0]) for p in backlash.parameters})
    start = with_effects(kuka, (tilt, gap), "assumed")
    names = ("j2.stiffness", "joint-tilt:j2.stiffness_x", f"backlash:j2.{backlash.parameters[0].name}")
    given = with_table(start, table_of(start, names))
    model, u = build_arm(given), known(given)
    q = np.radians([[15.0, -60, 90, 30, 20, 0], [0.0, -30, 60, 0, 40, 0]])
    d = np.array([0.3, 1.0, -1.0])
    found = propagate(model, u, q, d)
    np.testing.assert_allclose(found.compliance, along(model, q, d), rtol=1e-9)
    assert not found.gradient[:, 2].any()
    softer = with_effects(
        start, (effect_of("joint-tilt:j2", plain).placed({"stiffness_x": 5e5, "stiffness_y": 2e6}),), "assumed"
    )
    # Linear in the tilt's compliance: twice as soft is a step of its own size.
    grown = along(build_arm(softer), q, d) / found.compliance - 1.0
    np.testing.assert_allclose(found.gradient[:, 1] * 1e-6, grown, rtol=1e-6)


# --- refused -----------------------------------------------------------------------------------------------


def test_another_model_than_the_calibrated_one_is_refused(kuka: ModelDescription) -> None:
    given = with_table(kuka, table_of(kuka, ("j2.stiffness",)))
    u, q = known(given), np.radians([[0, -60, 90, 0, 20, 0]])
    refuses("M013", "rigid links, serial load path", propagate, build_model(given, "rigid"), u, q)
    refuses(
        "M013",
        r"uncertainty of j2\.stiffness.*changed after the calibration",
        propagate,
        build_model(given).with_springs({"j2": 9.1e5}),
        u,
        q,
    )
    lost = with_table(kuka, table_of(kuka, ("j2.stiffness",)).model_copy(update={"parameters": ("j9.stiffness",)}))
    refuses("M001", r"j9\.stiffness", propagate, build_model(lost), known(lost), q)
    law = with_table(kuka, table_of(kuka, ("j2.stiffness",)).model_copy(update={"parameters": ("j2.law[0]",)}))
    refuses("M001", "joints with a law: none in this model", propagate, build_model(law), known(law), q)


@pytest.mark.parametrize("direction", [[0.0, 0.0, 0.0], [1.0, np.nan, 0.0], [1.0, 0.0], [[0.0, 0.0, 1.0]] * 2])
def test_directions_that_are_none(kuka: ModelDescription, direction: list[float]) -> None:
    given = with_table(kuka, table_of(kuka, ("j2.stiffness",)))
    refuses(
        "B001",
        "load direction",
        propagate,
        build_model(given),
        known(given),
        np.zeros((1, 6)) + 0.3,
        np.array(direction),
    )


def test_a_rigid_arm_has_no_relative_deviation() -> None:
    table = table_of(sprung(), ("j2.stiffness",)).model_copy(update={"estimate": (0.0,)})
    rigid = with_table(sprung(springs={}), table, "rigid")
    refuses(
        "M005",
        "rigid in this direction",
        propagate,
        build_model(rigid, "rigid"),
        known(rigid),
        np.radians([[0, -60, 90, 0, 20, 0]]),
    )
