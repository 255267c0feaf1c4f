"""Prediction of poses left out: the same as refitting by hand, and honest where it cannot be done."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from doe import (
    Equations,
    Measurements,
    Scheme,
    calibrate_staged,
    constant_fit,
    constant_left_out,
    equations,
    leave_one_pose_out,
    model_compliances,
    staged_left_out,
)
from fem import ArmModel
from robots import InputError

Arm = Callable[..., ArmModel]
Readings = Callable[..., Measurements]
JOINTS = ("j2", "j3", "j4", "j5")
BOUNDS = (1e5, 1e6)
GAUGE_M = 1e-5


@pytest.mark.parametrize("pose", ["5", "40", "75"])
def test_a_left_out_error_is_that_of_refitting_by_hand(arm: Arm, measured: Measurements, pose: str) -> None:
    model = arm()
    system = equations(model, measured, GAUGE_M)
    found = constant_left_out(model, system, JOINTS, BOUNDS)
    # By hand: without that row, all sixteen ways of holding springs at 1e9 N m/rad, the widest bound.
    columns = [model.robot.joint_names.index(j) for j in JOINTS]
    mine = np.array(system.pose) == pose
    A, b = system.influence[:, columns], system.value - system.rest
    best: tuple[float, np.ndarray] = (np.inf, np.zeros(4))
    for free in range(1, 16):
        use = [i for i in range(4) if (free >> i) & 1]
        c = np.full(4, 1e-9)
        rest = b[~mine] - A[~mine] @ np.where(np.isin(range(4), use), 0.0, c)
        c[use] = np.linalg.lstsq(A[~mine][:, use], rest, rcond=None)[0]
        square = float(np.sum((A[~mine] @ c - b[~mine]) ** 2))
        if (c >= 1e-9).all() and square < best[0]:
            best = square, c
    error = float((A[mine] @ best[1] - b[mine])[0])
    # The same optimum by another route: round-off on 2 mm, times the condition number of about 10.
    assert found.error_m[mine][0] == pytest.approx(error, abs=1e-13)


def test_a_staged_left_out_error_is_that_of_skipping_the_pose(arm: Arm, measured: Measurements, scheme: Scheme) -> None:
    model = arm()
    result = calibrate_staged(model, measured, scheme)
    found = staged_left_out(model, measured, scheme, result)
    without = calibrate_staged(model, measured, scheme, skip_poses=("40",))
    row = found.error_m[result.system.pose.index("40")]
    # The same computation: equal to the last bit but for the order of a sum.
    assert row == pytest.approx(without.residual_m[result.system.pose.index("40")], abs=1e-15)
    assert found.skipped == {}
    assert np.isfinite(found.rms_mm)


def test_the_parallelogram_predicts_left_out_poses_better(arm: Arm, measured: Measurements) -> None:
    rms = {}
    for load_path in ("parallelogram", "serial"):
        model = arm(load_path=load_path)
        rms[load_path] = constant_left_out(model, equations(model, measured, GAUGE_M), JOINTS, BOUNDS).rms_mm
    # Known figures of the bundled model (beam links), given to three digits: half a digit of the last.
    assert rms["parallelogram"] == pytest.approx(0.0742, abs=5e-4)
    assert rms["serial"] == pytest.approx(0.1349, abs=5e-4)


def test_what_the_model_can_do_is_predicted_to_round_off(arm: Arm, measured: Measurements, readings: Readings) -> None:
    model = arm()
    springs = {"j2": 5e5, "j3": 7e5, "j4": 2e5, "j5": 4e5}
    data = readings(model, springs, measured.q, measured.wrench, "z", measured.pose)
    found = constant_left_out(model, equations(model, data, GAUGE_M), JOINTS, BOUNDS)
    # Eight exact readings fix four springs; condition about 10, deflections of 5 mm.
    np.testing.assert_allclose(found.error_m, 0.0, atol=1e-13)


def test_a_pose_that_alone_tells_of_a_spring_is_not_predicted(
    arm: Arm, measured: Measurements, readings: Readings
) -> None:
    # Joint 4 has a lever at pose 39 alone: without it there is nothing to predict its share from.
    model = arm()
    keep = np.isin(measured.pose, ["4", "5", "40", "41", "76", "77", "39"])
    poses = tuple(np.array(measured.pose)[keep])
    springs = {"j2": 5e5, "j3": 7e5, "j4": 2e5, "j5": 4e5}
    data = readings(model, springs, measured.q[keep], measured.wrench[keep], "z", poses)
    found = constant_left_out(model, equations(model, data, GAUGE_M), JOINTS, BOUNDS)
    assert list(found.skipped) == ["39"]
    assert found.skipped["39"] == "without pose 39 the readings do not determine j4"
    assert np.isnan(found.error_m[poses.index("39")])
    assert np.isfinite(found.rms_mm)


def test_too_few_readings_skip_every_pose_with_a_reason(arm: Arm, measured: Measurements, readings: Readings) -> None:
    model = arm()
    keep = np.isin(measured.pose, ["3", "4", "5", "77"])
    data = measured.select(keep)
    found = constant_left_out(model, equations(model, data, GAUGE_M), JOINTS, BOUNDS)
    assert set(found.skipped) == {"3", "4", "5", "77"}
    assert "cannot determine" in found.skipped["4"] or "do not determine" in found.skipped["4"]
    assert np.isnan(found.rms_mm)


def test_all_readings_of_a_pose_are_left_out_together(arm: Arm, measured: Measurements, readings: Readings) -> None:
    model = arm()
    q, wrench = np.repeat(measured.q, 2, axis=0), np.repeat(measured.wrench, 2, axis=0)
    wrench[1::2] *= 0.5
    poses = tuple(np.repeat(measured.pose, 2))
    data = readings(model, {"j3": 7e5}, q, wrench, "xz", poses)
    system = equations(model, data, GAUGE_M)
    seen: dict[str, int] = {}

    def refit(pose: str) -> np.ndarray:
        seen[pose] = len(system.take(np.array(system.pose) != pose))
        return np.zeros(6)

    found = leave_one_pose_out(system, refit)
    # 18 readings of two components; one pose has four of the equations.
    assert seen == dict.fromkeys(measured.pose, 32)
    # Rigid joints: the error is the rest minus the reading, in any order. Exact.
    np.testing.assert_array_equal(found.error_m, system.rest - system.value)


def test_a_prediction_that_is_no_number_is_not_dropped(arm: Arm, measured: Measurements) -> None:
    system: Equations = equations(arm(), measured, GAUGE_M)

    def refit(pose: str) -> np.ndarray:
        if pose == "3":
            raise InputError("not this one")
        return np.full(6, np.nan if pose == "4" else 0.0)

    found = leave_one_pose_out(system, refit)
    assert found.skipped == {"3": "not this one"}
    # A skipped pose is said; a NaN is a fault, and must not look like a figure over the other poses.
    assert np.isnan(found.rms_mm)


def test_the_constant_fit_leaves_the_other_joints_to_the_model(arm: Arm, measured: Measurements) -> None:
    model = arm().with_springs({"j5": 4e5, "j3": 1e5})
    fit, system = constant_fit(model, measured, ("j2", "j3"), BOUNDS, GAUGE_M)
    c = model_compliances(model, system.q)
    assert c.shape == (9, 6)
    assert c[0, 4] == fit.compliance[4] == 1.0 / 4e5
    assert c[0, 2] == 1e-5
    assert fit.compliance[2] != 1e-5
    predicted = system.predict(fit.compliance)
    # Scaled by the gauge and back: round-off on 2 mm.
    np.testing.assert_allclose(predicted - system.value, fit.residual_m, atol=1e-15)
