"""What a run does for an arm without a published scheme: a calibration file made from its readings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from doe import Measurements
from doe.estimation.campaign import Campaign, campaign_of
from doe.estimation.study_plan import Comparison, Factorial, GlobalPlan, SensitivityPlan, SpringRange
from doe.tables.measurements import largest_rows
from fem import ArmModel
from fem.arm import Arm
from stiffarm.session import steps
from surrogate import inputs_that_matter

# Poses of the sensitivity study: a picture of more is not read.
_POSES: Final = 3
_LEVELS: Final = 3


def usual_campaign(given: Arm, table: Measurements) -> Campaign:
    """All springs that the readings see, free at once, and studies over the poses that were read.

    Sensitivities are shown at the poses that deflect least, middling and most; springs are varied over the range of
    arms of this size.
    """
    joints = steps.springs_seen(given, table)
    low, high = steps.usual_springs(given, joints)
    studied = SensitivityPlan(joints=joints, poses=spread_poses(table))
    compared = Comparison.model_validate({"sensitivity": studied, "global": GlobalPlan(joints=joints)})
    plain = campaign_of(given.robot.name, tuple(f"{joint}.stiffness" for joint in joints))
    springs = SpringRange(low_Nm_per_rad=low, high_Nm_per_rad=high, start_Nm_per_rad=high)
    return plain.model_copy(update={"springs": springs, "compare": compared, "title": "all springs at once"})


def spread_poses(table: Measurements, count: int = _POSES) -> tuple[str, ...]:
    """Labels of up to ``count`` poses, from the one that deflects least under its loads to the one that does most."""
    size = table.largest[1]
    rows = largest_rows(table.pose, size)
    rows = rows[~np.isnan(size[rows])]
    rows = rows[np.argsort(size[rows], kind="stable")]
    picked = np.unique(np.round(np.linspace(0, len(rows) - 1, min(count, len(rows)))).astype(int))
    return tuple(table.pose[k] for k in rows[picked])


def usual_factorial(given: Arm, table: Measurements, models: Sequence[ArmModel]) -> Factorial:
    """Three levels of each angle that matters to one of the models, over those read, or the limits where none moved."""
    matter = {name for model in models for name in inputs_that_matter(model)}
    inputs = tuple(name for name in given.robot.coordinates if name in matter)
    return Factorial(inputs=inputs, levels_deg=tuple(_levels(given, table, name) for name in inputs))


def _levels(given: Arm, table: Measurements, name: str) -> tuple[float, ...]:
    column = given.robot.coordinate_index(name)
    q = np.degrees(table.q[:, column])
    low, high = (q.min(), q.max()) if np.ptp(q) > 0.0 else np.degrees(given.robot.limits[column])
    return tuple(float(f"{v:.4g}") for v in np.linspace(low, high, _LEVELS))
