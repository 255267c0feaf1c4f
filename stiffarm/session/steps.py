"""The workflow's steps as functions: what each command runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from doe import (
    ConstantFit,
    Equations,
    Measurements,
    PoseEffects,
    Prediction,
    Scheme,
    StagedResult,
    bundled_data,
    calibrate_staged,
    constant_fit,
    constant_left_out,
    equations,
    factorial_poses,
    select_loads,
    sensitivity_study,
    staged_left_out,
    with_constant_springs,
    with_spring_laws,
)
from fem import ArmModel, LinkKind, directional_stiffness
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.files.reading import read_sha256
from stiffarm.session.inputs import ModelInput
from stiffarm.session.useless_readings import refuse_useless
from surrogate import Surrogate, full_poses
from surrogate.model import predict_compliance

# A gauge of 0.01 mm is what the field uses where a data set says nothing.
DEFAULT_GAUGE_mm = 0.01
DEFAULT_BOUNDS_Nm_per_rad = (1e5, 1e6)
VERTICAL = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class RigidJoints:
    """The first model: flexible links, rigid joints. (m,) per equation; mm. ``links``: kind of links."""

    links: LinkKind
    pose: tuple[str, ...]
    measured_mm: Array
    simulated_mm: Array

    @property
    def factor(self) -> Array:
        """Measured over simulated deflection."""
        return self.measured_mm / self.simulated_mm


@dataclass(frozen=True)
class Variant:
    """One calibrated variant, ready to compare: its model, fit, and left-out prediction."""

    name: str
    scheme: str
    description: ModelDescription
    model: ArmModel
    system: Equations
    residual_m: Array
    rms_mm: float
    parameters: int
    left_out: Prediction
    remarks: tuple[str, ...]
    constant: ConstantFit | None = None
    staged: StagedResult | None = None

    @property
    def predicted_mm(self) -> Array:
        """Simulated readings (m,) in mm (mrad for rotations)."""
        return (self.system.value + self.residual_m) * 1e3


def readings_with_rigid_joints(given: ModelInput, data: Measurements) -> Equations:
    """The readings as equations of the arm with rigid joints: ``rest`` is what links, bar and crank alone give."""
    return equations(given.model.with_rigid_joints(), data, DEFAULT_GAUGE_mm * 1e-3)


def rigid_joints(given: ModelInput, data: Measurements, poses: tuple[str, ...] | None = None) -> RigidJoints:
    """Simulate the vertical readings with rigid joints, to see how much the links alone give."""
    system = readings_with_rigid_joints(given, data)
    system = system.take(system.component == 2)
    if not len(system):
        raise InputError(
            f"{data.source}: no vertical deflection was read",
            allowed="readings in the column dz_mm",
            remedy="`stiffarm calibrate --scheme global` takes readings in any direction",
        )
    if poses is not None:
        system = system.of_poses(poses)
    return RigidJoints(given.model.link_kind, system.pose, system.value * 1e3, system.rest * 1e3)


def sensitivity(
    given: ModelInput,
    data: Measurements,
    joints: tuple[str, ...],
    poses: tuple[str, ...],
    low: float,
    high: float,
) -> list[PoseEffects]:
    """Two-level factorial of the springs at the poses."""
    system = equations(given.model, data, DEFAULT_GAUGE_mm * 1e-3).of_poses(poses)
    return sensitivity_study(system, joints, given.robot.joint_names, low, high)


def calibrate_by_stages(
    given: ModelInput,
    data: Measurements,
    scheme: Scheme,
    loads: tuple[float, ...],
    spacing: str = "log",
    progress: Callable[[str], None] | None = None,
) -> Variant:
    """The published staged scheme, with its left-out prediction."""
    used = select_loads(data, loads)
    refuse_useless(given, data, used)
    result = calibrate_staged(given.model, used, scheme, spacing=spacing, progress=progress)
    remarks = tuple(
        f"{stage}, pose {fit.pose}: {remark}"
        for stage, fits in result.fits.items()
        for fit in fits
        for remark in fit.remarks
    )
    return Variant(
        name=f"staged, {given.model.load_path}",
        scheme="staged",
        description=with_spring_laws(given.description, given.model, result.laws, used, loads, result.rms_mm, remarks),
        model=result.model,
        system=result.system,
        residual_m=result.residual_m,
        rms_mm=result.rms_mm,
        parameters=result.parameters,
        left_out=staged_left_out(given.model, used, scheme, result, spacing),
        remarks=remarks,
        staged=result,
    )


def calibrate_constant(
    given: ModelInput,
    data: Measurements,
    joints: tuple[str, ...],
    loads: tuple[float, ...],
    bounds: tuple[float, float] = DEFAULT_BOUNDS_Nm_per_rad,
    gauge_mm: float = DEFAULT_GAUGE_mm,
) -> Variant:
    """Constant springs on all readings at once, with their left-out prediction."""
    used = select_loads(data, loads)
    refuse_useless(given, data, used)
    fit, system = constant_fit(given.model, used, joints, bounds, gauge_mm * 1e-3)
    description = with_constant_springs(given.description, given.model, fit, used, loads)
    return Variant(
        name=f"constant, {given.model.load_path}",
        scheme="global",
        description=description,
        # The same springs as in the description, without building its links again.
        model=given.model.with_springs({s.joint: s.stiffness for s in fit.springs if np.isfinite(s.stiffness)}),
        system=system,
        residual_m=fit.residual_m,
        rms_mm=fit.rms_mm,
        parameters=sum(s.status != "not identified" for s in fit.springs),
        left_out=constant_left_out(given.model, system, joints, bounds),
        remarks=fit.remarks,
        constant=fit,
    )


def bundled_sha256(robot: str) -> str | None:
    """Hash of the measurement table bundled with a robot, or None."""
    try:
        return read_sha256(bundled_data(robot), "measurement file")
    except InputError:
        return None


def springs_seen(given: ModelInput, data: Measurements) -> tuple[str, ...]:
    """Joints whose spring at least one reading moves with."""
    system = equations(given.model, data, DEFAULT_GAUGE_mm * 1e-3)
    size = np.abs(system.influence / system.sigma[:, None]).max(axis=0)
    return tuple(n for n, s in zip(given.robot.joint_names, size, strict=True) if s > 1e-9 * size.max())


def recommended(variants: list[Variant]) -> Variant:
    """The variant that predicts left-out poses best (not the one that fits best)."""
    return min(variants, key=lambda v: v.left_out.rms_mm if np.isfinite(v.left_out.rms_mm) else np.inf)


@dataclass(frozen=True)
class FactorialRuns:
    """The factorial of joint angles on a calibrated model: poses (n, k) deg, stiffness (n,) N/mm."""

    inputs: tuple[str, ...]
    poses_deg: Array
    stiffness_N_per_mm: Array  # noqa: N815 - the unit as the shop writes it


def factorial_runs(model: ArmModel, scheme: Scheme) -> FactorialRuns:
    """Structural stiffness (vertical load) over the scheme's adjusted full factorial."""
    q = factorial_poses(model.robot, scheme.factorial)
    columns = [model.robot.coordinate_index(name) for name in scheme.factorial.inputs]
    return FactorialRuns(scheme.factorial.inputs, np.degrees(q[:, columns]), directional_stiffness(model, q) * 1e-3)


def default_inputs(model: ArmModel) -> tuple[str, ...]:
    """Joint coordinates that move the stiffness: all but the first, and but the last of six."""
    names = model.robot.coordinates
    return names[1:5] if model.robot.dof == 6 else names[1:]


def nine_pose_check(learned: Surrogate, model: ArmModel, data: Measurements) -> tuple[list[str], Array, Array]:
    """Surrogate and model stiffness (n,) N/mm at the distinct measured poses, with their labels."""
    rows = [rows[0] for rows in data.pose_groups().values()]
    q = data.q[rows]
    columns = [model.robot.coordinate_index(name) for name in learned.inputs]
    return (
        [data.pose[i] for i in rows],
        1e-3 / predict_compliance(learned, q[:, columns]),
        directional_stiffness(model, full_poses(model.robot, learned, q[:, columns])) * 1e-3,
    )
