"""Calibrated variants side by side: fit, and prediction of poses left out one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from doe.published.constant import MIXED, ConstantFit, blind_directions, fit_constant
from doe.published.readings import Equations, equations, model_compliances, rms_mm
from doe.published.scheme import Scheme
from doe.published.staged import StagedResult, calibrate_staged
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import InputError
from robots.arrays import Array


@dataclass(frozen=True)
class Prediction:
    """Left-out errors: ``error_m`` (m,) simulated minus measured (NaN = could not be predicted).

    ``skipped``: poses without which the rest could not be calibrated, with the reason.
    """

    error_m: Array
    rms_mm: float
    skipped: dict[str, str]


def constant_fit(
    model: ArmModel, data: Measurements, joints: tuple[str, ...], bounds: tuple[float, float], gauge_m: float
) -> tuple[ConstantFit, Equations]:
    """Constant springs of ``joints`` fitted to all readings; the other joints keep the model's springs."""
    system = equations(model, data, gauge_m)
    fixed = model_compliances(model, system.q)
    return fit_constant(system, joints, model.robot.joint_names, fixed, bounds), system


def leave_one_pose_out(system: Equations, refit: Callable[[str], Array]) -> Prediction:
    """Predict each pose from all the others; ``refit(pose)`` gives compliances (m, dof) fitted without it."""
    error = np.full(len(system), np.nan)
    predicted = np.ones(len(system), dtype=np.bool_)
    skipped: dict[str, str] = {}
    for pose in dict.fromkeys(system.pose):
        mine = np.array(system.pose, dtype=object) == pose
        try:
            error[mine] = (system.predict(refit(pose)) - system.value)[mine]
        except InputError as reason:
            skipped[pose] = str(reason)
            predicted &= ~mine
    return Prediction(error, rms_mm(error[predicted], system.component[predicted]), skipped)


def constant_left_out(
    model: ArmModel, system: Equations, joints: tuple[str, ...], bounds: tuple[float, float]
) -> Prediction:
    """Leave-one-pose-out prediction of constant springs.

    A pose that alone determines a spring is not predicted: a value the rest made up would not be a test.
    """
    fixed = model_compliances(model, system.q)
    columns = [model.robot.joint_names.index(joint) for joint in joints]
    A = system.influence[:, columns] / system.sigma[:, None]

    def refit(pose: str) -> Array:
        rest = np.array(system.pose, dtype=object) != pose
        fit = fit_constant(system.take(rest), joints, model.robot.joint_names, fixed[rest], bounds)
        blind, mine = blind_directions(A[rest]), A[~rest]
        if np.any(np.abs(mine @ blind.T) > MIXED * np.abs(mine).max()):
            unknown = [s.joint for s in fit.springs if s.status == "not identified"]
            raise InputError(f"without pose {pose} the readings do not determine {', '.join(unknown)}")
        full = fixed.copy()
        full[:, columns] = fit.compliance[columns]
        return full

    return leave_one_pose_out(system, refit)


def staged_left_out(
    model: ArmModel, data: Measurements, scheme: Scheme, result: StagedResult, spacing: str = "log"
) -> Prediction:
    """Leave-one-pose-out prediction of the staged scheme."""

    def refit(pose: str) -> Array:
        fit = calibrate_staged(model, data, scheme, spacing=spacing, skip_poses=(pose,))
        return model_compliances(fit.model, result.system.q)

    return leave_one_pose_out(result.system, refit)
