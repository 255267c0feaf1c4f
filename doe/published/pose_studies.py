"""Level studies pose by pose, then each spring against joint angles: the published scheme of the XR701.

Regression of a joint's stiffness against joint angles is smooth, positive, and goes through the points. Three to five
distinct angles cannot fix the seven coefficients of a sixth degree. The rest is decided by the smallest roughness:
among all polynomials in ln k that pass through the points, the one whose coefficients have the least sum of squares,
each weighted by (1 + degree)^2, the mean of ln k being free. That keeps k positive, gives an even law for mirrored
points, and adds no bumps that no point asks for.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from doe.estimation.campaign import Campaign, Stage
from doe.estimation.study_plan import RegressionChoice
from doe.published.parametric import PoseFit, fit_pose
from doe.tables.loaded import select_poses, spring_parts
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.progress import Messages
from robots.schema.description import LogPolynomialLaw

# A spring whose whole influence on a reading is below this share of the gauge was not tested there.
UNTESTED_SHARE_OF_GAUGE = 0.01
# Springs that match as well anywhere within this factor are not identified at a pose.
IDENTIFIED_WITHIN = 3.0


@dataclass(frozen=True)
class SpringPoints:
    """Calibrated points of one spring.

    ``angles`` (m, i) rad in the law's inputs; ``stiffness`` (m,) N m/rad; ``origin`` (m,): "calibrated",
    "mirrored" or "held" (the value an earlier stage assumed there).
    """

    joint: str
    inputs: tuple[str, ...]
    angles: Array
    stiffness: Array
    origin: tuple[str, ...]


def total_degree_exponents(inputs: int, degree: int) -> Integers:
    """All exponents with a sum of at most ``degree``, lowest degree first, (t, inputs)."""
    rows = [e for e in itertools.product(range(degree + 1), repeat=inputs) if sum(e) <= degree]
    return np.array(sorted(rows, key=lambda e: (sum(e), e)), dtype=np.int64)


def fit_law(robot: Robot, points: SpringPoints, degree: int, source: str) -> LogPolynomialLaw:
    """Fit ln k by a polynomial of total degree ``degree`` in the scaled inputs.

    Points with equal angles and different stiffness get their least-squares (geometric) mean.
    Valid inside the robot's joint limits, to which the inputs are scaled.

    Raises
    ------
    InputError
        No points, or a stiffness that is not positive and finite.
    """
    if points.stiffness.size == 0:
        raise InputError(f"regression of {points.joint}: no calibrated point", code="C001")
    if not (np.isfinite(points.stiffness).all() and (points.stiffness > 0.0).all()):
        raise InputError(
            f"regression of {points.joint}: stiffness",
            code="C001",
            value=points.stiffness.tolist(),
            allowed="positive, finite",
        )
    limits = robot.limits[[robot.coordinate_index(name) for name in points.inputs]]
    centre, half = limits.mean(axis=1), np.ptp(limits, axis=1) / 2.0
    exponents = total_degree_exponents(len(points.inputs), degree)
    u = (points.angles - centre) / half
    V = np.prod(u[:, None, :] ** exponents[None], axis=2)
    weight = (1.0 + exponents.sum(axis=1)) ** 2.0
    weight[0] = 1e-3  # the constant term is all but free
    y = np.log(points.stiffness)
    scaled, *_ = np.linalg.lstsq(V / weight, y - y.mean(), rcond=1e-12)
    coefficients = scaled / weight
    coefficients[0] += y.mean()
    return LogPolynomialLaw(
        inputs=points.inputs,
        centre_deg=tuple(np.degrees(centre)),
        half_range_deg=tuple(np.degrees(half)),
        exponents=tuple(tuple(int(e) for e in row) for row in exponents),
        coefficients=tuple(float(c) for c in coefficients),
        source=source,
    )


@dataclass(frozen=True)
class PoseStudies:
    """A stage of level studies: ``fits`` by pose, ``points`` and ``laws`` of its springs by joint."""

    stage: Stage
    fits: tuple[PoseFit, ...]
    points: Mapping[str, SpringPoints]
    laws: Mapping[str, LogPolynomialLaw]

    @property
    def free(self) -> int:
        """How many springs were chosen, each at each pose."""
        return sum(len(fit.joints) for fit in self.fits)

    @property
    def at_bound(self) -> int:
        """Of them, those that stand at the end of their range."""
        return sum(remark.endswith("stands there") for fit in self.fits for remark in fit.remarks)

    @property
    def identified(self) -> int:
        """Of them, those that match the reading nowhere else: within a factor of three of one another."""
        ranges = np.vstack([fit.equivalent for fit in self.fits])
        return int(np.sum(ranges[:, 1] < IDENTIFIED_WITHIN * ranges[:, 0]))


def study_poses(
    model: ArmModel,
    data: Measurements,
    campaign: Campaign,
    stage: Stage,
    earlier: Sequence[str],
    spacing: str = "log",
    progress: Messages | None = None,
) -> PoseStudies:
    """Match each pose of a stage by levels of its springs, then put a law through them.

    ``model``: springs of earlier stages follow their laws, which pass through their points, and those that no stage
    has reached yet stand where the campaign says; ``earlier``: poses of the stages before; ``spacing``: of the
    levels, "log" or "linear".

    Raises
    ------
    InputError
        A pose that was not read, or another spacing.
    """
    joints = tuple(name.removesuffix(".law") for name in stage.parameters)
    choices = {law.joint: law for law in campaign.regressions}
    gauge, start = campaign.noise.gauge_mm * 1e-3, campaign.springs.start_Nm_per_rad
    columns = [model.robot.joint_names.index(joint) for joint in joints]
    fits = []
    for pose in stage.poses:
        one = select_poses(data, (pose,), f"stage {stage.name!r}")
        influence, rest = (part[one.used] for part in spring_parts(model, one))
        fixed = np.array([joint.axial.compliance(one.q[:1])[0] for joint in model.joints])
        fixed[columns] = 0.0
        base = rest + influence @ fixed - one.displacement[one.used]
        assert stage.levels is not None  # noqa: S101 - Campaign refuses such a stage
        A = influence[:, columns]
        fits.append(fit_pose(pose, A, base, joints, stage.levels, campaign.springs.ends, gauge, start, spacing))
        if progress is not None:
            progress(f"{stage.name}, pose {pose}: {fits[-1].runs} runs, {fits[-1].error_mm:+.3f} mm")
    points, laws = {}, {}
    source = " ".join(f"{campaign.title}: {stage.name}, poses {', '.join(stage.poses)} of {data.source}".split())
    for k, joint in enumerate(joints):
        held = _held(model, select_poses(data, earlier, f"stage {stage.name!r}"), columns[k], gauge, start)
        points[joint] = _points(model, data, choices[joint], fits, k, held, start)
        laws[joint] = fit_law(model.robot, points[joint], choices[joint].degree, source)
    return PoseStudies(stage, tuple(fits), points, laws)


def _held(model: ArmModel, earlier: Measurements, column: int, gauge_m: float, start: float) -> Array:
    """Poses (m, dof) of earlier stages' readings at which a spring's starting value took part in the match.

    Where a spring's torque vanishes its value was never tested, and no point is claimed there.
    """
    share = np.abs(spring_parts(model, earlier)[0][:, :, column]) / start
    tested = earlier.used & (share > UNTESTED_SHARE_OF_GAUGE * gauge_m)
    return np.unique(earlier.q[tested.any(axis=1)], axis=0)


def _points(
    model: ArmModel,
    data: Measurements,
    law: RegressionChoice,
    fits: Sequence[PoseFit],
    spring: int,
    held: Array,
    start: float,
) -> SpringPoints:
    columns = [model.robot.coordinate_index(name) for name in law.inputs]
    calibrated = np.array([data.q[data.pose.index(fit.pose), columns] for fit in fits])
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
        stiffness.append(np.full(len(extra), start))
        origin += ["held"] * len(extra)
    return SpringPoints(law.joint, law.inputs, np.vstack(angles), np.concatenate(stiffness), tuple(origin))
