"""Where a propagated uncertainty says too little and says so; effects; models that it does not belong to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from refusals import refuses
from uncertain_models import SPRINGS, along, known, sprung, table_of, with_table

import fem
from doe.certainty.propagation import (
    SHARE,
    parameter_uncertainty,
    propagate,
)
from doe.certainty.uncertainty import ParameterEstimate
from doe.model_file.applied import apply_estimates
from fem import build_model
from fem.effects import build_arm, with_effects
from fem.effects.catalogue import effect_of
from fem.free.parameters import named_numbers
from robots import ModelDescription
from robots.schema.description import UndeterminedNumber


@pytest.fixture(scope="module")
def kuka() -> ModelDescription:
    return sprung()


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
