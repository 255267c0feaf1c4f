"""Readings as linear equations in the joint compliances: ``value = rest + influence . c + noise``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.tables.measurements import Measurements
from fem import ArmModel, spring_influence
from fem.statics.loads import as_loaded
from robots import InputError
from robots.arrays import Array, Bools, Integers

# Whose point a reading was taken at: the model's tool point, or one of its own (px_mm, py_mm, pz_mm).
PointOf = Literal["tool", "table"]

COMPONENTS = ("dx", "dy", "dz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Equations:
    """m read components, one equation each.

    ``influence`` (m, dof): displacement (m or rad) per unit compliance of each joint's axial spring;
    ``rest`` (m,): displacement from all else; ``value`` (m,): what was read; ``sigma`` (m,): its standard
    deviation; ``row`` (m,): reading it belongs to; ``component`` (m,): 0..5 as in COMPONENTS;
    ``q`` (m, dof): pose; ``pose``: its label.
    """

    influence: Array
    rest: Array
    value: Array
    sigma: Array
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
            self.sigma[mask],
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

    def predict(self, compliances: Array) -> Array:
        """Predicted readings (m,) for compliances (dof,) or (m, dof) in rad/(N m)."""
        return np.asarray(self.rest + np.sum(self.influence * compliances, axis=1))


def model_compliances(model: ArmModel, q: Array) -> Array:
    """Axial compliances (m, dof) in rad/(N m) of a model at poses q (m, dof)."""
    return np.stack([joint.axial.compliance(q) for joint in model.joints], axis=1)


def loaded_points(model: ArmModel, data: Measurements) -> Array:
    """Loaded and measured points (n, 3) m in the flange frame: the reading's own, else the model's tool point.

    Own points are off by what the model says of them (``ArmModel.load_point``).
    """
    tool = np.broadcast_to(model.robot.T_flange_tool[:3, 3], (data.n, 3))
    return np.where(np.isnan(data.point), tool, data.point + model.load_point)


def points_of(data: Measurements) -> tuple[PointOf, ...]:
    """Whose points these readings have: the model's tool point, the table's own ones, or both."""
    own = ~np.isnan(data.point).any(axis=1)
    every: tuple[PointOf, ...] = ("tool", "table")
    return tuple(whose for whose, some in zip(every, (not own.all(), bool(own.any())), strict=True) if some)


def equations(model: ArmModel, data: Measurements, gauge_m: float) -> Equations:
    """Set up the equations of all read components.

    ``gauge_m`` is the standard deviation (m; for rotations the same number in rad) of readings that
    carry no ``sigma_mm`` of their own.
    """
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    influence, rest = spring_influence(model, at.q, at.wrench, at.point)
    row, component = np.nonzero(data.used)
    sigma = np.where(np.isnan(data.sigma), gauge_m, data.sigma)
    return Equations(
        influence=influence[row, :, component],
        rest=rest[row, component],
        value=data.displacement[row, component],
        sigma=sigma[row],
        row=row,
        component=component,
        q=data.q[row],
        pose=tuple(data.pose[i] for i in row),
    )


def select_loads(data: Measurements, loads_N: tuple[float, ...]) -> Measurements:
    """Select readings by load magnitude (within 1 %, for a real weight is never its nominal one); () = all.

    Raises
    ------
    InputError
        No reading at one of the loads.
    """
    if not loads_N:
        return data
    keep = np.zeros(data.n, dtype=np.bool_)
    for load in loads_N:
        hit = np.abs(data.loads_N - load) <= 0.01 * abs(load)
        if not hit.any():
            present = ", ".join(f"{v:g}" for v in np.unique(np.round(data.loads_N, 6)))
            raise InputError(f"{data.source}: load to calibrate on (N)", value=load, allowed=present)
        keep |= hit
    return data.select(keep)


def check_poses(data: Measurements, poses: tuple[str, ...], where: str) -> None:
    """Raise InputError if a pose label is not in the data."""
    known = list(dict.fromkeys(data.pose))
    for pose in poses:
        if pose not in known:
            raise InputError(f"{where}: pose", value=pose, allowed=f"one in {data.source}: {', '.join(known)}")


def rms_mm(error: Array, component: Integers) -> float:
    """RMS of the translational errors in mm (NaN if none was read)."""
    linear = error[component < 3]
    return float(np.sqrt(np.mean(linear**2)) * 1e3) if linear.size else float("nan")
