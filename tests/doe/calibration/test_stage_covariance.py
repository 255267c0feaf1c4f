"""Numbers found in stages: the joint covariance against what many made-up campaigns scatter by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from doe import Measurements
from doe.calibration.run import Calibration, run_campaign
from doe.calibration.written import calibration_table, stage_covariance
from doe.estimation.campaign import Campaign, campaign_of, parse_campaign
from doe.model_file.uncertainty_table import carried_on
from fem import build_model
from robots import ModelDescription, Robot, load_description
from robots.schema.description import Calibration as Origin
from robots.schema.description import CalibrationUncertainty, UndeterminedNumber

Readings = Callable[..., Measurements]
Poses = Callable[[Robot, int, np.random.Generator], np.ndarray]

HEAD = 'schema = "stiffarm-calibration/1"\nrobot = "kr60-3"\ntitle = "test"\n[noise]\nrobust = false\n'
STAGES = (
    HEAD
    + """
[[parameter]]
name = "j2.stiffness"
[[parameter]]
name = "j3.stiffness"
[[parameter]]
name = "j5.stiffness"
[[stage]]
name = "first"
parameters = ["j2.stiffness"]
poses = ["P1", "P2", "P3", "P4", "P5"]
[[stage]]
name = "second"
parameters = ["j3.stiffness", "j5.stiffness"]
poses = ["P6", "P7", "P8", "P9", "P10"]
"""
)


@pytest.fixture(scope="module")
def kuka() -> ModelDescription:
    return load_description("kr60-3")


def campaigns(
    given: ModelDescription, text: str, readings: Readings, random_poses: Poses, times: int, noise_m: float = 2e-5
) -> list[Calibration]:
    """The same arm read again and again; stage one knows the arm but for the number it seeks."""
    rng = np.random.default_rng(3)
    model = build_model(given)
    q = random_poses(model.robot, 10, rng)
    load = np.array([300.0, 200.0, -600.0, 0.0, 0.0, 0.0])
    campaign: Campaign = parse_campaign(text, "test")

    def once() -> Calibration:
        data = readings(model, {}, q, load, noise_m=noise_m * rng.normal(size=(10, 6)))
        return run_campaign(given, lambda d: build_model(d), data, campaign)

    return [once() for _ in range(times)]


def variables(c: Calibration) -> list[float]:
    return [
        e.parameter.inner(e.value)
        for name in stage_covariance(c)[0]
        for s in c.stages
        for e in s.certainty.estimates
        if e.parameter.name == name
    ]


def test_one_stage_is_its_own_covariance(kuka: ModelDescription, readings: Readings, random_poses: Poses) -> None:
    once = STAGES[: STAGES.index("[[stage]]")]
    (found,) = campaigns(kuka, once, readings, random_poses, 1)
    names, V, shared = stage_covariance(found)
    assert names == ("j2.stiffness", "j3.stiffness", "j5.stiffness")
    np.testing.assert_array_equal(V, found.stages[0].certainty.covariance)
    assert not shared


def test_the_last_stage_s_own_error_stands_beside_what_it_inherits(
    kuka: ModelDescription, readings: Readings, random_poses: Poses
) -> None:
    (found,) = campaigns(kuka, STAGES, readings, random_poses, 1)
    names, V, shared = stage_covariance(found)
    first, second = (s.certainty.covariance for s in found.stages)
    assert not shared
    assert V[0, 0] == pytest.approx(first[0, 0], rel=1e-12)
    inherited = V[1:, 1:] - second
    # Rank one: all of it comes from one number, along with the covariance with it.
    np.testing.assert_allclose(inherited, np.outer(V[1:, 0], V[1:, 0]) / V[0, 0], rtol=1e-6)
    assert (np.diag(inherited) > 0.0).all()
    assert names[0] == "j2.stiffness"
    sharing = STAGES.replace('["P6", ', '["P1", "P6", ')
    assert stage_covariance(campaigns(kuka, sharing, readings, random_poses, 1)[0])[2]


@pytest.mark.slow
def test_campaigns_scatter_as_the_joint_covariance_says(
    kuka: ModelDescription, readings: Readings, random_poses: Poses
) -> None:
    times = 100
    found = campaigns(kuka, STAGES, readings, random_poses, times)
    scatter = np.cov(np.array([variables(c) for c in found]).T)
    stated = np.mean([stage_covariance(c)[1] for c in found], axis=0)
    sd = np.sqrt(np.diag(scatter))
    # A variance of 100 draws is known to (2 / 99)^(1/2) = 14 %: four of these; a correlation to 1 / sqrt(100).
    np.testing.assert_allclose(np.diag(stated) / sd**2, 1.0, atol=0.57)
    size = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(stated / np.outer(size, size), scatter / np.outer(sd, sd), atol=4.0 / np.sqrt(times))
    # And without what is inherited the second stage would be far too sure of at least one number.
    alone = np.mean([np.diag(c.stages[1].certainty.covariance) for c in found], axis=0)
    assert (alone / sd[1:] ** 2).min() < 0.6


def test_an_earlier_calibration_is_a_stage_before_the_first(
    kuka: ModelDescription, readings: Readings, random_poses: Poses
) -> None:
    (both,) = campaigns(kuka, STAGES, readings, random_poses, 1)
    stated = calibration_table(both)
    assert stated is not None
    # The same two stages as two calibrations, each with the readings of its own.
    rng = np.random.default_rng(3)
    q = random_poses(build_model(kuka).robot, 10, rng)
    load = np.array([300.0, 200.0, -600.0, 0.0, 0.0, 0.0])
    data = readings(build_model(kuka), {}, q, load, noise_m=2e-5 * rng.normal(size=(10, 6)))
    first = run_campaign(kuka, lambda d: build_model(d), data.select(np.arange(10) < 5), campaign_of("kr60-3", ONE))
    given = with_origin(first.description, calibration_table(first))
    again = run_campaign(given, lambda d: build_model(d), data.select(np.arange(10) >= 5), campaign_of("kr60-3", TWO))
    found = calibration_table(again)
    assert found is not None
    assert found.parameters == stated.parameters == (*ONE, *TWO)
    V, W = np.array(found.covariance), np.array(stated.covariance)
    # The campaigns differ in how they treat outliers, of which there are none.
    np.testing.assert_allclose(V, W, rtol=1e-3, atol=1e-3 * float(np.sqrt(W[0, 0] * W[1, 1])))
    assert "from an earlier calibration, readings taken as others than these: j2.stiffness" in found.note


def test_what_is_found_anew_or_gone_is_not_carried_on(
    kuka: ModelDescription, readings: Readings, random_poses: Poses
) -> None:
    (both,) = campaigns(kuka, STAGES, readings, random_poses, 1)
    table = calibration_table(both)
    assert table is not None
    open_number = UndeterminedNumber(name="j6.stiffness", status="at bound", unit="N m/rad", low=1e5, note="made up")
    given = with_origin(both.description, table.model_copy(update={"undetermined": (open_number,)}))
    model = build_model(given)
    kept = carried_on(given, model, ("j3.rz",))
    # The same spring by its other name.
    assert kept.names == ("j2.stiffness", "j5.stiffness")
    np.testing.assert_array_equal(kept.covariance, np.array(table.covariance)[np.ix_([0, 2], [0, 2])])
    assert kept.undetermined == (open_number,)
    assert carried_on(given, model, ("j6.stiffness",)).undetermined == ()
    # A number that was changed in between, and links of another kind.
    assert carried_on(given, model.with_springs({"j2": 1e6}), ("j3.rz",)).lost == ("j2.stiffness",)
    assert carried_on(given, build_model(given, "rigid"), ()).names == ()
    assert carried_on(kuka, model, ("j3.rz",)).names == ()


ONE, TWO = ("j2.stiffness",), ("j3.stiffness", "j5.stiffness")


def with_origin(given: ModelDescription, table: CalibrationUncertainty | None) -> ModelDescription:
    origin = Origin(
        scheme="global",
        load_path=given.load_path,
        links="beam",
        data="made up",
        data_sha256="0" * 64,
        rms_mm=0.01,
        loads_N=(),
        uncertainty=table,
    )
    return given.model_copy(update={"calibration": origin})
