"""Readings under their loads: at which points, which of them are used, and what a model says of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from doe.tables.load_history import history_of
from doe.tables.measurements import Measurements
from fem import ArmModel, spring_influence
from fem.effects import History, PlacedEffect, observed
from fem.statics.loads import as_loaded
from robots import InputError
from robots.arrays import Array, Integers

# Whose point a reading was taken at: the model's tool point, or one of its own (px_mm, py_mm, pz_mm).
PointOf = Literal["tool", "table"]


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


def select_poses(data: Measurements, poses: Sequence[str], where: str) -> Measurements:
    """Select the readings of some poses (labels); ``where`` names who asks.

    Raises
    ------
    InputError
        A pose label that is not in the data.
    """
    known = list(dict.fromkeys(data.pose))
    for pose in poses:
        if pose not in known:
            raise InputError(f"{where}: pose", value=pose, allowed=f"one in {data.source}: {', '.join(known)}")
    return data.select(np.isin(np.array(data.pose, dtype=str), poses))


def spring_parts(model: ArmModel, data: Measurements) -> tuple[Array, Array]:
    """What a model makes of every reading, linear in the compliances about the joints' axes.

    Returns
    -------
    influence (n, 6, dof) : displacement (m or rad) per unit compliance of each joint, as fem.spring_influence
    rest (n, 6) : displacement from all else
    """
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    influence, rest = spring_influence(model, at.q, at.wrench, at.point)
    return np.swapaxes(influence, 1, 2), rest


def rms_mm(error: Array, component: Integers) -> float:
    """RMS of the translational errors in mm (NaN if none was read)."""
    linear = error[component < 3]
    return float(np.sqrt(np.mean(linear**2)) * 1e3) if linear.size else float("nan")


def simulate(
    model: ArmModel, data: Measurements, effects: Sequence[PlacedEffect] = (), history: History | None = None
) -> Array:
    """Simulated displacement (n, 6) of every reading; ``history``: by default what the table says of it."""
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    return observed(model, at, effects, history or history_of(data))
