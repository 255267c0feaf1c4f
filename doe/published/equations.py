"""Readings as linear equations in the joint compliances: ``value = rest + influence . c + noise``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.tables.loaded import loaded_points
from doe.tables.measurements import Measurements
from fem import ArmModel, spring_influence
from fem.statics.loads import as_loaded
from robots import InputError
from robots.arrays import Array, Bools, Integers

COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Equations:
    """m read components, one equation each.

    ``influence`` (m, dof): displacement (m or rad) per unit compliance of each joint's axial spring;
    ``rest`` (m,): displacement from all else; ``value`` (m,): what was read;
    ``row`` (m,): reading it belongs to; ``component`` (m,): 0..5 as in COMPONENTS;
    ``q`` (m, dof): pose; ``pose``: its label.
    """

    influence: Array
    rest: Array
    value: Array
    row: Integers
    component: Integers
    q: Array
    pose: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.value)

    def take(self, mask: Bools) -> Equations:
        """Keep the equations where ``mask`` (m,) is true."""
        return Equations(
            self.influence[mask],
            self.rest[mask],
            self.value[mask],
            self.row[mask],
            self.component[mask],
            self.q[mask],
            tuple(np.array(self.pose, dtype=object)[mask]),
        )

    def of_poses(self, poses: tuple[str, ...]) -> Equations:
        """Keep the equations of some poses.

        Raises
        ------
        InputError
            There is no equation of one of them.
        """
        for pose in poses:
            if pose not in self.pose:
                known = ", ".join(dict.fromkeys(self.pose))
                raise InputError("pose", value=pose, allowed=f"one that was read: {known}")
        return self.take(np.isin(np.array(self.pose, dtype=str), poses))


def model_compliances(model: ArmModel, q: Array) -> Array:
    """Axial compliances (m, dof) in rad/(N m) of a model at poses q (m, dof)."""
    return np.stack([joint.axial.compliance(q) for joint in model.joints], axis=1)


def equations(model: ArmModel, data: Measurements) -> Equations:
    """Set up the equations of all read components."""
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    influence, rest = spring_influence(model, at.q, at.wrench, at.point)
    row, component = np.nonzero(data.used)
    return Equations(
        influence=influence[row, :, component],
        rest=rest[row, component],
        value=data.displacement[row, component],
        row=row,
        component=component,
        q=data.q[row],
        pose=tuple(data.pose[i] for i in row),
    )
