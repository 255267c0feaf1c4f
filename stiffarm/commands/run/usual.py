"""What a run does for an arm without a published scheme: a calibration file made from its readings."""

from __future__ import annotations

from typing import Final

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign, campaign_of
from doe.estimation.study_plan import Comparison, Factorial, GlobalPlan, SensitivityPlan, SpringRange
from fem.arm import Arm
from stiffarm.session import steps
from surrogate import inputs_that_matter

# Poses of the sensitivity study: a picture of more is not read.
_POSES: Final = 3
_LEVELS: Final = 3


def usual_campaign(given: Arm, table: Measurements) -> Campaign:
    """All springs that the readings see, free at once, and studies over the poses and angles that were read.

    Sensitivities are shown at the poses that deflect least, middling and most; springs are varied over the range of
    arms of this size; main effects are those of three levels between the smallest and the largest angle read, or
    between the limits of joints that did not move.
    """
    joints = steps.springs_seen(given, table)
    low, high = steps.usual_springs(given, joints)
    # Which angles matter does not depend on how stiff the joints are, only on whether they give way.
    inputs = inputs_that_matter(given.model.with_springs(dict.fromkeys(joints, high)))
    compared = Comparison.model_validate(
        {
            "sensitivity": SensitivityPlan(joints=joints, poses=spread_poses(table)),
            "global": GlobalPlan(joints=joints),
            "factorial": usual_factorial(given, table, inputs),
        }
    )
    plain = campaign_of(given.robot.name, tuple(f"{joint}.stiffness" for joint in joints))
    springs = SpringRange(low_Nm_per_rad=low, high_Nm_per_rad=high, start_Nm_per_rad=high)
    return plain.model_copy(update={"springs": springs, "compare": compared, "title": "all springs at once"})


def spread_poses(table: Measurements, count: int = _POSES) -> tuple[str, ...]:
    """Labels of up to ``count`` poses, from the one that deflects least under its loads to the one that does most."""
    size = np.where(table.used, np.abs(table.displacement), 0.0)
    largest = {pose: float(size[rows].max()) for pose, rows in table.pose_groups().items()}
    order = sorted(largest, key=lambda pose: largest[pose])
    picked = np.unique(np.round(np.linspace(0, len(order) - 1, min(count, len(order)))).astype(int))
    return tuple(order[k] for k in picked)


def usual_factorial(given: Arm, table: Measurements, inputs: tuple[str, ...]) -> Factorial:
    """Three levels of each input over the angles read."""
    return Factorial(inputs=inputs, levels_deg=tuple(_levels(given, table, name) for name in inputs))


def _levels(given: Arm, table: Measurements, name: str) -> tuple[float, ...]:
    column = given.robot.coordinate_index(name)
    q = np.degrees(table.q[:, column])
    low, high = (q.min(), q.max()) if np.ptp(q) > 0.0 else np.degrees(given.robot.limits[column])
    return tuple(float(f"{v:.4g}") for v in np.linspace(low, high, _LEVELS))
