"""Sensitivity study: two-level full factorial of joint springs, effects with signs, by pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.planning.designs import two_level_factorial
from doe.tables.loaded import spring_parts
from doe.tables.measurements import Measurements, largest_rows
from fem import ArmModel
from robots import InputError, require_one_of
from robots.arrays import Array


@dataclass(frozen=True)
class PoseEffects:
    """Main effects of the springs on the largest deflection read at one pose.

    ``component``: 0 to 2, the translation that was read largest; ``effect_mm`` (k,): how much less it is at the high
    level than at the low one, on average; ``share`` (k,): its part of the summed absolute effects; ``runs_mm``
    (2^k,): the runs in standard order.
    """

    pose: str
    component: int
    joints: tuple[str, ...]
    effect_mm: Array
    share: Array
    runs_mm: Array

    @property
    def ranking(self) -> tuple[str, ...]:
        """Joints from the largest effect to the smallest."""
        return tuple(self.joints[i] for i in np.argsort(-np.abs(self.effect_mm), kind="stable"))


def sensitivity_study(
    model: ArmModel, data: Measurements, joints: tuple[str, ...], low: float, high: float
) -> list[PoseEffects]:
    """Two-level factorial of k_j in {low, high} N m/rad at every pose of ``data``.

    Springs that are not varied are rigid. Deflection is a sum over springs, so all interactions are exactly zero and
    the main effects tell everything. At each pose the largest translation that was read counts.

    Raises
    ------
    InputError
        Bounds out of order, an unknown joint, or a pose where no translation was read.
    """
    if not 0.0 < low < high:
        raise InputError(
            "sensitivity bounds", code="M002", value=f"{low:g} to {high:g} N m/rad", allowed="0 < low < high"
        )
    for joint in joints:
        require_one_of("joint of the sensitivity study", joint, model.robot.joint_names, code="M002")
    design = two_level_factorial(len(joints))
    columns = [model.robot.joint_names.index(name) for name in joints]
    compliance = np.where(design > 0.0, 1.0 / high, 1.0 / low)
    influence, rest = spring_parts(model, data)
    out = []
    of_reading, size = data.largest
    for index in largest_rows(data.pose, size):
        pose, component = data.pose[index], int(of_reading[index])
        if np.isnan(size[index]):
            raise InputError(
                f"pose {pose} has no reading of a translation", code="C001", remedy="give dx_mm, dy_mm or dz_mm"
            )
        runs = (rest[index, component] + compliance @ influence[index, component, columns]) * 1e3
        # Half the runs have a factor high, half low: the contrast over half their number is the effect.
        towards = 1.0 if data.displacement[index, component] > 0.0 else -1.0
        effect = -towards * design.T @ runs / (len(runs) / 2)
        total = np.abs(effect).sum()
        share = np.abs(effect) / total if total > 0.0 else np.zeros_like(effect)
        out.append(PoseEffects(pose, component, joints, effect, share, runs))
    return out
