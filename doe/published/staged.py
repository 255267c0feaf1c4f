"""The published staged scheme: parametric studies joint by joint, then springs against joint angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.published.parametric import PoseFit, fit_pose
from doe.published.readings import Equations, check_poses, equations, model_compliances, rms_mm
from doe.published.scheme import Law, Scheme, Stage
from doe.published.spring_regression import SpringPoints, fit_law
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.springs import ConstantSpring, SpringLaw, spring_from
from robots import InputError
from robots.arrays import Array
from robots.progress import Messages
from robots.schema.description import LogPolynomialLaw

# A spring whose whole influence on a reading is below this share of the gauge was not tested there.
UNTESTED_SHARE_OF_GAUGE = 0.01


@dataclass(frozen=True)
class StagedResult:
    """Springs of the staged scheme.

    ``fits``: by stage name; ``points`` and ``laws``: by joint; ``model``: the calibrated model;
    ``residual_m`` (m,): simulated minus measured over all equations ``system``.
    """

    scheme: Scheme
    fits: dict[str, tuple[PoseFit, ...]]
    points: dict[str, SpringPoints]
    laws: dict[str, LogPolynomialLaw]
    model: ArmModel
    system: Equations
    residual_m: Array

    @property
    def rms_mm(self) -> float:
        """RMS of the translational residuals."""
        return rms_mm(self.residual_m, self.system.component)

    @property
    def parameters(self) -> int:
        """How many spring values were chosen."""
        return sum(len(fit.joints) for stage in self.fits.values() for fit in stage)


def calibrate_staged(
    model: ArmModel,
    data: Measurements,
    scheme: Scheme,
    *,
    spacing: str = "log",
    skip_poses: tuple[str, ...] = (),
    progress: Messages | None = None,
) -> StagedResult:
    """Run the scheme's stages on the readings (already selected by load).

    Springs of earlier stages enter later ones through their laws, which pass through their points; a
    pose left out (``skip_poses``) is therefore simply one point less.

    Raises
    ------
    InputError
        The scheme names a pose or joint that the data or robot has not, or a stage lost all its poses.
    """
    scheme.check_against(model.robot)
    for stage in scheme.stage:
        check_poses(data, stage.poses, f"scheme {scheme.title!r}, {stage.name}")
    check_poses(data, skip_poses, "poses to leave out")
    system = equations(model, data, scheme.gauge_mm * 1e-3)
    springs: dict[str, SpringLaw] = {
        joint: ConstantSpring(scheme.initial_Nm_per_rad) for stage in scheme.stage for joint in stage.joints
    }
    fits: dict[str, tuple[PoseFit, ...]] = {}
    points: dict[str, SpringPoints] = {}
    laws: dict[str, LogPolynomialLaw] = {}
    tested = _held_points(model, system, scheme, skip_poses)
    for stage in scheme.stage:
        poses = tuple(pose for pose in stage.poses if pose not in skip_poses)
        if not poses:
            raise InputError(f"{stage.name} of {scheme.title!r} has no pose left")
        fits[stage.name] = _run_stage(model, system, scheme, stage, poses, springs, spacing, progress)
        for k, joint in enumerate(stage.joints):
            law = next(law for law in scheme.law if law.joint == joint)
            points[joint] = _points(model, system, law, fits[stage.name], k, tested[joint], scheme)
            source = f"{scheme.title}: {stage.name}, poses {', '.join(poses)} of {data.source}"
            laws[joint] = fit_law(model.robot, points[joint], scheme.regression_degree, _plain(source))
            springs[joint] = spring_from(model.robot, laws[joint])
    calibrated = model.with_springs(springs)
    residual = system.predict(model_compliances(calibrated, system.q)) - system.value
    return StagedResult(scheme, fits, points, laws, calibrated, system, residual)


def _plain(source: str) -> str:
    return " ".join(source.split())


def _run_stage(
    model: ArmModel,
    system: Equations,
    scheme: Scheme,
    stage: Stage,
    poses: tuple[str, ...],
    springs: dict[str, SpringLaw],
    spacing: str,
    progress: Messages | None,
) -> tuple[PoseFit, ...]:
    columns = [model.robot.joint_names.index(joint) for joint in stage.joints]
    current = model.with_springs(springs)
    out = []
    for pose in poses:
        one = system.of_poses((pose,))
        fixed = model_compliances(current, one.q[:1])[0]
        out.append(
            fit_pose(
                one,
                fixed,
                columns,
                stage.joints,
                stage.levels,
                (scheme.low_Nm_per_rad, scheme.high_Nm_per_rad),
                scheme.gauge_mm * 1e-3,
                scheme.initial_Nm_per_rad,
                spacing,
            )
        )
        if progress is not None:
            progress(f"{stage.name}, pose {pose}: {out[-1].runs} runs, {out[-1].error_mm:+.3f} mm")
    return tuple(out)


def _held_points(model: ArmModel, system: Equations, scheme: Scheme, skip: tuple[str, ...]) -> dict[str, Array]:
    """Poses (m, dof) of earlier stages at which a spring's initial value took part in the match.

    Where a spring's torque vanishes its value was never tested, and no point is claimed there.
    """
    held: dict[str, Array] = {}
    before: list[str] = []
    for stage in scheme.stage:
        for joint in stage.joints:
            one = system.of_poses(tuple(pose for pose in before if pose not in skip))
            column = model.robot.joint_names.index(joint)
            share = np.abs(one.influence[:, column]) / scheme.initial_Nm_per_rad
            took_part = share > UNTESTED_SHARE_OF_GAUGE * scheme.gauge_mm * 1e-3
            held[joint] = np.unique(one.q[took_part], axis=0)
        before.extend(stage.poses)
    return held


def _points(
    model: ArmModel,
    system: Equations,
    law: Law,
    fits: tuple[PoseFit, ...],
    spring: int,
    held: Array,
    scheme: Scheme,
) -> SpringPoints:
    columns = [model.robot.coordinate_index(name) for name in law.inputs]
    calibrated = np.array([system.of_poses((fit.pose,)).q[0, columns] for fit in fits])
    angles, stiffness = [calibrated], [np.array([fit.stiffness[spring] for fit in fits])]
    origin = ["calibrated"] * len(fits)
    if law.symmetric_in is not None:
        mirrored = calibrated.copy()
        mirrored[:, law.inputs.index(law.symmetric_in)] *= -1.0
        angles.append(mirrored)
        stiffness.append(stiffness[0])
        origin += ["mirrored"] * len(fits)
    if held.size:
        extra = np.unique(held[:, columns], axis=0)
        angles.append(extra)
        stiffness.append(np.full(len(extra), scheme.initial_Nm_per_rad))
        origin += ["held"] * len(extra)
    return SpringPoints(law.joint, law.inputs, np.vstack(angles), np.concatenate(stiffness), tuple(origin))
