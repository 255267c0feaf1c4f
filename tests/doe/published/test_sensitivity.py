"""Sensitivity study: effects in closed form, signs, no interactions, ranking on the measured poses."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from doe import Campaign, Measurements, PoseEffects, sensitivity_study, two_level_factorial
from doe.tables.loaded import select_poses, spring_parts
from fem import ArmModel

Arm = Callable[..., ArmModel]
Readings = Callable[..., Measurements]
LOW, HIGH = 1e5, 1e6


def study(model: ArmModel, data: Measurements, scheme: Campaign) -> tuple[Measurements, dict[str, PoseEffects]]:
    used = select_poses(data, scheme.beside.sensitivity.poses, "test")
    return used, {e.pose: e for e in sensitivity_study(model, used, scheme.beside.sensitivity.joints, LOW, HIGH)}


@pytest.mark.parametrize("load_path", ["serial", "parallelogram"])
def test_effects_equal_the_closed_form(arm: Arm, measured: Measurements, scheme: Campaign, load_path: str) -> None:
    used, effects = study(arm(load_path=load_path), measured, scheme)
    influence = spring_parts(arm(load_path=load_path), used)[0]
    columns = [arm().robot.joint_names.index(j) for j in scheme.beside.sensitivity.joints]
    assert used.pose == tuple(effects) == ("5", "41", "77")
    for i, effect in enumerate(effects.values()):
        exact = influence[i, 2, columns] * (1.0 / HIGH - 1.0 / LOW) * 1e3
        # Runs are tens of mm and 16 of them are averaged: round-off.
        np.testing.assert_allclose(effect.effect_mm, exact, rtol=1e-12, atol=1e-12)


def test_runs_are_the_models_deflections(
    arm: Arm, measured: Measurements, scheme: Campaign, readings: Readings
) -> None:
    # The whole chain again by the static solve: springs low or high, the others as good as rigid.
    model = arm()
    _, effects = study(model, measured, scheme)
    pose = measured.select(np.array([p == "41" for p in measured.pose]))
    for run, levels in enumerate(two_level_factorial(4)):
        springs = {j: HIGH if s > 0 else LOW for j, s in zip(scheme.beside.sensitivity.joints, levels, strict=True)}
        dz = readings(model, springs, pose.q, pose.wrench).displacement[0, 2]
        # Two ways of summing the same parts: round-off on tens of mm.
        assert effects["41"].runs_mm[run] == pytest.approx(dz * 1e3, rel=1e-12)


def test_a_stiffer_spring_lifts_the_tool(arm: Arm, measured: Measurements, scheme: Campaign) -> None:
    # Load and deflection point down, so going from soft to stiff raises dz: every effect is positive.
    for effect in study(arm(load_path="serial"), measured, scheme)[1].values():
        assert (effect.effect_mm[[0, 1, 3]] > 0.0).all()
        assert effect.share.sum() == pytest.approx(1.0, abs=1e-12)  # round-off of four numbers


def test_there_are_no_interactions(arm: Arm, measured: Measurements, scheme: Campaign) -> None:
    design = two_level_factorial(4)
    for effect in study(arm(load_path="serial"), measured, scheme)[1].values():
        for size in (2, 3, 4):
            for group in itertools.combinations(range(4), size):
                contrast = design[:, group].prod(axis=1) @ effect.runs_mm / 8.0
                # Deflection is a sum over springs; what is left is round-off on runs of tens of mm.
                assert abs(contrast) < 1e-12


@pytest.mark.parametrize("pose", ["41", "77"])
def test_the_serial_path_ranks_as_the_papers_figure_4(
    arm: Arm, measured: Measurements, scheme: Campaign, pose: str
) -> None:
    effect = study(arm(load_path="serial"), measured, scheme)[1][pose]
    assert effect.ranking == ("j2", "j3", "j5", "j4")
    # A straight wrist under a vertical load leaves joint 4 no lever: "almost no effect" in the paper.
    assert effect.share[2] < 1e-6


def test_with_the_parallelogram_joint_2_all_but_vanishes_at_pose_41(
    arm: Arm, measured: Measurements, scheme: Campaign
) -> None:
    serial = study(arm(load_path="serial"), measured, scheme)[1]["41"]
    bar = study(arm(), measured, scheme)[1]["41"]
    # The lever shrinks from the whole reach (1.57 m) to L2 sin 5 deg = 0.096 m, and enters squared:
    # (0.096 / 1.57)^2 = 0.4 %.
    assert bar.effect_mm[0] < 0.01 * serial.effect_mm[0]
    # Joint 3 carries the same moment either way; only round-off differs.
    assert bar.effect_mm[1] == pytest.approx(serial.effect_mm[1], rel=1e-12)
    # Where the upper arm leans, joint 2 counts with the parallelogram as well.
    assert study(arm(), measured, scheme)[1]["77"].ranking[:2] == ("j3", "j2")


def test_of_several_loads_the_largest_counts(arm: Arm, readings: Readings) -> None:
    model = arm()
    q = np.radians([[0.0, 5.0, 77.5, 0.0, 0.0, 0.0]] * 2)
    wrench = np.array([[0, 0, -100.0, 0, 0, 0], [0, 0, -650.0, 0, 0, 0]])
    data = readings(model, {"j3": 8e5}, q, wrench, pose=("41", "41"))
    both = sensitivity_study(model, data, ("j3",), LOW, HIGH)
    alone = sensitivity_study(model, data.select(np.array([False, True])), ("j3",), LOW, HIGH)
    assert len(both) == 1
    assert np.array_equal(both[0].effect_mm, alone[0].effect_mm)


def test_bad_input_is_named(arm: Arm, measured: Measurements, scheme: Campaign, readings: Readings) -> None:
    model = arm()
    refuses(
        "M002", r"sensitivity bounds: got '1e\+06 to 100000", sensitivity_study, model, measured, ("j2",), HIGH, LOW
    )
    refuses("M002", "'j9'", sensitivity_study, model, measured, ("j9",), LOW, HIGH)
    refuses("T009", "pose: got '99'", select_poses, measured, ("99",), "test")
    turned = replace(measured.select(np.arange(measured.n) < 1), displacement=np.full((1, 6), np.nan))
    refuses("C001", "has no reading of a translation", sensitivity_study, model, turned, ("j2",), LOW, HIGH)


def test_the_component_that_was_read_largest_counts(arm: Arm, measured: Measurements, readings: Readings) -> None:
    model = arm()
    sideways = readings(model, {"j2": 1e6}, measured.q[:1], measured.wrench[:1], "xz", pose=("3",))
    largest = int(np.nanargmax(np.abs(sideways.displacement[0, :3])))
    (found,) = sensitivity_study(model, sideways, ("j2",), LOW, HIGH)
    assert found.component == largest
    # A stiffer joint deflects less, whichever way the component points.
    assert (found.effect_mm > 0.0).all()
