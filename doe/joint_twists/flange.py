"""What identified stiffnesses of joints make of the flange: against models of the gears alone, and flange deflections.

All of it over random poses, or at the poses of deflections that nothing was identified from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.joint_twists.identify import Identified
from doe.joint_twists.model_file import constant_compliances
from doe.joint_twists.substitute import (
    Errors,
    compliances_of,
    errors_of,
    loads_in,
    predict,
    reachable_poses,
    stiffness_with,
    usual_models,
)
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import InputError
from robots.arrays import Array
from robots.kinematics import forward_kinematics

# Random poses that models are compared at.
POSES = 2000
# A force or a lever (N/N, m) below this is rounding.
UNLOADED = 1e-6


@dataclass(frozen=True, eq=False)
class AtFlange:
    """What the stiffnesses make of the flange, over random poses.

    ``same`` and ``refitted``: errors of models of the gears alone, by flange axis, with ``effective`` compliances
    (dof,) of the second; ``file``: errors of the model file where it holds constants; ``spread`` (3,): median half
    width of the intervals of directional stiffness.
    """

    same: Errors
    refitted: Errors
    effective: Array
    file: Errors
    spread: Array


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Directional stiffness (n,) N/m at flange deflections that nothing was identified from.

    ``measured``; ``predicted`` with ``low`` and ``high``; ``labels`` and ``force`` (n,) N.
    """

    labels: tuple[str, ...]
    force: Array
    measured: Array
    predicted: Array
    low: Array
    high: Array

    @property
    def error(self) -> Array:
        """Relative error of the prediction (n,)."""
        return np.asarray(self.predicted / self.measured - 1.0)


def at_flange(model: ArmModel, found: Identified, seed: int) -> AtFlange | str:
    """The comparison; in its place why there is none, where forces at the flange load what nobody identified."""
    rng = np.random.default_rng(seed)
    q = reachable_poses(model, POSES, rng)
    six, reference = compliances_of(found), stiffness_with(model, found.compliances(q)[0], q, or_rigid=True)
    most = np.abs(loads_in(model, q, np.eye(3))).max(axis=(0, 1)).ravel()
    unknown = [
        f"{joint}.{row}"
        for ((joint, row), d), load in zip(found.directions.items(), most, strict=True)
        if d.status == "not identified" and load > UNLOADED
    ]
    if unknown:
        return f"no result at the flange: it depends on stiffnesses that are not identified: {', '.join(unknown)}"
    rigid = [f"flange {axis}" for axis, k in zip("XYZ", reference.max(axis=0), strict=True) if np.isinf(k)]
    if rigid:
        return f"no result at the flange: nothing identified deflects along {', '.join(rigid)}"
    same, refitted, effective = usual_models(model, six, poses=POSES, rng=rng)
    of_file = errors_of(stiffness_with(model, constant_compliances(found, q), q), reference)
    p = predict(model, found, q)
    spread = np.median((p.high - p.low) / (2.0 * p.value), axis=0)
    return AtFlange(same, refitted, effective, of_file, np.asarray(spread))


def held_out(model: ArmModel, found: Identified, data: Measurements) -> HeldOut:
    """Flange deflections against the stiffnesses, reading by reading: |F| / |d . F/|F||.

    Raises
    ------
    InputError
        No reading with a force and the displacement along it.
    """
    F = data.wrench[:, :3]
    size = np.linalg.norm(F, axis=1)
    along = np.einsum("ni,ni->n", data.displacement[:, :3], F) / np.maximum(size, 1e-300)
    use = (size > 0.0) & np.isfinite(along) & (along != 0.0) & ~data.wrench[:, 3:].any(axis=1)
    if not use.any():
        raise InputError(
            f"--holdout {data.source}: no reading with a force and the displacement along it",
            code="J004",
            allowed="fx_N fy_N fz_N and dx_mm dy_mm dz_mm where the force has a part",
            remedy="give deflections of the flange under forces",
        )
    rows = np.flatnonzero(use)
    R = forward_kinematics(model.robot, data.q[rows]).R_flange
    way = np.einsum("nji,nj->ni", R, F[rows]) / size[rows, None]
    parts = [predict(model, found, data.q[i : i + 1], way[k : k + 1]) for k, i in enumerate(rows)]
    value, low, high = (np.array([getattr(p, name)[0, 0] for p in parts]) for name in ("value", "low", "high"))
    labels = tuple(data.pose[i] for i in rows)
    return HeldOut(labels, size[rows], size[rows] / np.abs(along[rows]), value, low, high)
