"""How uncertain the arm's compliance is: assumed shares by part, or the covariance of a calibration.

The tool's compliance C_tt is linear in the compliances of the parts, so with variables v (J,) of the arm
``C_tt = rest + sum_j v_j D_j``: exact for shares of parts and for stiffnesses that a calibration found, the first
order for its laws over angles, its walls and its joint zeros.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import stdtrit

import fem
from doe.certainty.uncertainty import Certainty
from doe.estimation.estimate import Estimate
from fem.free.model import FreeModel, LoadedPoses
from fem.statics.inputs import as_points
from robots import InputError
from robots.arrays import Array
from robots.kinematics import as_poses

# Standard deviation of a part's compliance, share of it, where nothing better is known.
ASSUMED_SD = 0.15
# Beyond this share a normal distribution would make a tenth of a percent of the springs negative.
LARGEST_SD = 0.33
# The calibrated model must give this displacement again, or it is another model than the one in use.
SAME_MODEL = 1e-6
# Normal quantile of 95 % intervals.
NORMAL_95 = 1.959963984540054


class StiffnessUncertainty(Protocol):
    """``names`` (J,), ``value`` (J,), ``covariance`` (J, J) of the arm's variables; ``note``: what it rests on."""

    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102

    @property
    def value(self) -> Array: ...  # noqa: D102

    @property
    def covariance(self) -> Array: ...  # noqa: D102

    @property
    def note(self) -> str: ...  # noqa: D102

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Array:
        """D_j: derivative of C_tt by each variable, (n, J, 3, 3)."""
        ...


@dataclass(frozen=True, eq=False)
class PartShares:
    """Each part's compliance times a factor of mean 1: variables are the factors, independent, ``sd`` (J,)."""

    names: tuple[str, ...]
    sd: Array
    note: str

    @property
    def value(self) -> Array:
        """Ones (J,)."""
        return np.ones(len(self.names))

    @property
    def covariance(self) -> Array:
        """Diagonal (J, J)."""
        return np.diag(self.sd**2)

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Array:
        """See :class:`StiffnessUncertainty`; errors as :func:`fem.deflection_by_part`."""
        out = np.zeros((len(q), len(self.names), 3, 3))
        for k in range(3):
            shares = fem.deflection_by_part(model, q, np.eye(6)[k], point)
            lost = set(self.names) - set(shares)
            if lost:
                raise InputError("parts of the uncertainty", value=min(lost), allowed=", ".join(shares))
            for j, name in enumerate(self.names):
                out[:, j, :, k] = shares[name][:, :3]
        return out


def assumed_uncertainty(
    model: fem.ArmModel, relative_sd: float = ASSUMED_SD, by_part: Mapping[str, float] | None = None
) -> PartShares:
    """A stated standard deviation of every compliance in the model, share of it, independent from part to part.

    Parts are named as in :func:`fem.deflection_by_part`: joints (the spring about the axis; their bearings by
    themselves), links, base, tool, bar, crank. ``by_part`` overrides some.

    Raises
    ------
    InputError
        A share outside 0 to 0.33, a part that the model does not have, or a model in which nothing gives way.
    """
    # Any pose will do for their names; that of zeros may lay a parallelogram flat.
    middle = model.robot.limits.mean(axis=1)[None]
    parts = tuple(fem.deflection_by_part(model, middle, np.eye(6)[0]))
    own = dict(by_part or {})
    unknown = sorted(set(own) - set(parts))
    if unknown or not parts:
        allowed = ", ".join(parts) or "a model in which something gives way"
        raise InputError("part with an uncertain compliance", value=unknown[0] if unknown else "none", allowed=allowed)
    sd = np.array([own.get(name, relative_sd) for name in parts])
    if not ((sd >= 0.0) & (sd <= LARGEST_SD)).all():
        raise InputError("relative standard deviation of a compliance", value=sd.max(), allowed=f"0 to {LARGEST_SD}")
    said = "assumed" if relative_sd == ASSUMED_SD else "as stated"
    note = f"compliances: standard deviation {100 * relative_sd:g} % of each part, independent, {said}"
    if own:
        note += "; but " + ", ".join(f"{name} {100 * share:g} %" for name, share in own.items())
    return PartShares(parts, sd, note)


@dataclass(frozen=True, eq=False)
class CalibratedCompliances:
    """Variables of a calibration with their joint covariance; made by :func:`calibrated_uncertainty`."""

    free: FreeModel
    value: Array
    covariance: Array
    names: tuple[str, ...]
    note: str

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Array:
        """See :class:`StiffnessUncertainty`.

        Raises
        ------
        InputError
            ``model`` is not the calibrated one.
        """
        n = len(as_poses(model.robot, q))
        at = as_points(point, n)
        # A free model counts the point from the flange, as do the tasks.
        tip = model.robot.T_flange_tool[:3, 3] if at is None else at
        loads = np.repeat(np.eye(6)[:3], n, axis=0)
        poses = LoadedPoses(np.tile(q, (3, 1)), loads, np.tile(np.broadcast_to(tip, (n, 3)), (3, 1)))
        free = FreeModel(self.free.model, self.free.parameters, poses, self.free.laws, self.free.walls)
        value, J = free.evaluate(self.value)
        own = fem.deflection(model, poses.q, loads, poses.point)
        if not np.allclose(value, own, rtol=SAME_MODEL, atol=SAME_MODEL * np.abs(own[:, :3]).max()):
            raise InputError(
                "uncertainty of the stiffnesses: it belongs to another model than the one in use",
                remedy="use the model that this calibration gave",
            )
        return np.asarray(J[:, :3].reshape(3, n, 3, -1).transpose(1, 3, 2, 0))


def calibrated_uncertainty(estimate: Estimate, certainty: Certainty) -> CalibratedCompliances:
    """Joint uncertainty of what a calibration set free, for the model that it gave.

    Standard deviations are widened by Student's t over the normal quantile, so that the 95 % intervals keep the
    degrees of freedom of the calibration. Numbers of the test load (offset, tilt, read point) are left out: milling
    has another load. What the calibration held fixed counts as exact.

    Raises
    ------
    InputError
        Effects in the calibrated model; a number that the readings do not determine, or that stands at a bound: it
        has no standard deviation.
    """
    free = estimate.problem.free
    if free.effects:
        raise InputError(
            "uncertainty from a calibration with effects",
            value=", ".join(e.effect.code for e in free.effects),
            allowed="a model of springs, links and laws",
            remedy="state shares by part instead",
        )
    of_load = np.array([p.kind in ("load", "tilt", "point") for p in free.parameters], dtype=np.bool_)
    vague = [
        f"{e.parameter.name} ({e.status})"
        for e, out in zip(certainty.estimates, of_load, strict=True)
        if not out and not np.isfinite(e.sd)
    ]
    if vague:
        raise InputError(
            "uncertainty from a calibration: no standard deviation of " + ", ".join(vague),
            allowed="numbers that the readings determine",
            remedy="measure more poses, hold these numbers, or state shares by part",
        )
    dof = np.array([e.degrees_of_freedom for e in certainty.estimates])
    wider = np.ones(len(dof))
    few = np.isfinite(dof)
    wider[few] = stdtrit(np.maximum(dof[few], 1.0), 0.975) / NORMAL_95
    wider[of_load] = 0.0
    covariance = certainty.covariance * np.outer(wider, wider)
    names = tuple(p.name for p in free.parameters)
    note = f"compliances: covariance of a calibration ({len(names) - int(of_load.sum())} numbers), the rest exact"
    return CalibratedCompliances(free, np.where(of_load, 0.0, estimate.u), covariance, names, note)
