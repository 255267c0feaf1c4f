"""The workflow's steps as functions: what each command runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from doe import Measurements, bundled_data, factorial_poses, read_measurements
from doe.estimation.study_plan import Factorial
from doe.tables.loaded import select_poses, spring_parts
from fem import ArmModel, LinkKind, directional_stiffness
from fem.arm import Arm
from robots import InputError, Robot
from robots.arm_class import arm_class
from robots.arrays import Array

# A gauge of 0.01 mm is what the field uses where a data set says nothing.
DEFAULT_GAUGE_mm = 0.01


@dataclass(frozen=True)
class RigidJoints:
    """The first model: flexible links, rigid joints. (m,) per reading; mm. ``links``: kind of links."""

    links: LinkKind
    pose: tuple[str, ...]
    measured_mm: Array
    simulated_mm: Array

    @property
    def factor(self) -> Array:
        """Measured over simulated deflection."""
        return self.measured_mm / self.simulated_mm


def usual_springs(given: Arm, joints: Sequence[str] = ()) -> tuple[float, float]:
    """Where stiffnesses (N m/rad) of these joints, or of all, are expected in arms of this size, to one digit."""
    of, names = arm_class(given.description, given.robot), given.robot.joint_names
    columns = [names.index(joint) for joint in joints or names]
    return float(f"{of.low[columns].min():.1g}"), float(f"{of.high[columns].max():.1g}")


def links_alone(given: Arm, data: Measurements) -> Array:
    """Displacements (n, 6), m and rad, that links, bar and crank alone give, the joints rigid."""
    return spring_parts(given.model.with_rigid_joints(), data)[1]


def rigid_joints(given: Arm, data: Measurements, poses: tuple[str, ...] | None = None) -> RigidJoints:
    """Simulate the readings with rigid joints, to see how much the links alone give: the largest translation of each.

    Raises
    ------
    InputError
        No translation was read.
    """
    data = data.select(~np.isnan(data.deflection))
    if not data.n:
        raise InputError(
            f"{data.source}: no translation was read", code="T006", allowed="readings in dx_mm, dy_mm or dz_mm"
        )
    if poses is not None:
        data = select_poses(data, poses, "rigid joints")
    largest = np.arange(data.n), data.largest[0]
    both = data.displacement[largest] * 1e3, links_alone(given, data)[largest] * 1e3
    return RigidJoints(given.model.link_kind, data.pose, *both)


def is_bundled(robot: Robot, table: Measurements) -> bool:
    """Whether these are the readings bundled with a robot, by what they say."""
    try:
        return table.says_the_same(read_measurements(bundled_data(robot.name), robot))
    except InputError:
        return False


def springs_seen(given: Arm, data: Measurements) -> tuple[str, ...]:
    """Joints whose spring at least one reading moves with."""
    size = np.abs(spring_parts(given.model, data)[0][data.used]).max(axis=0)
    return tuple(n for n, s in zip(given.robot.joint_names, size, strict=True) if s > 1e-9 * size.max())


@dataclass(frozen=True)
class FactorialRuns:
    """The factorial of joint angles on a calibrated model: poses (n, k) deg, stiffness (n,) N/mm."""

    plan: Factorial
    poses_deg: Array
    stiffness_N_per_mm: Array  # noqa: N815 - the unit as the shop writes it

    @property
    def inputs(self) -> tuple[str, ...]:
        """The joint coordinates varied (k,)."""
        return self.plan.inputs


def factorial_runs(model: ArmModel, plan: Factorial, *, whole: bool = True) -> FactorialRuns:
    """Structural stiffness (vertical load) over an adjusted full factorial; not ``whole``: of what can be reached."""
    q = factorial_poses(model.robot, plan, whole=whole)
    columns = [model.robot.coordinate_index(name) for name in plan.inputs]
    return FactorialRuns(plan, np.degrees(q[:, columns]), directional_stiffness(model, q) * 1e-3)
