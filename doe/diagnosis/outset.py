"""Where a diagnosis sets out: springs fitted to the readings, history, replicates that stand out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from doe.diagnosis.known import errors_of
from doe.diagnosis.scatter import FLOOR
from doe.diagnosis.setting import Setting, free_springs
from doe.estimation.estimate import estimate
from doe.estimation.problem import Problem, problem
from doe.tables.load_history import history_of
from doe.tables.measurements import Measurements
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import Maker, catalogue
from fem.effects.situation import History
from fem.free.parameters import parameter
from fem.model import ArmModel
from robots import ModelDescription
from robots.arrays import Array

# Compliances, rad/(N m), to expect of joints of which nothing is known: axes 1 to 3, and the wrist's.
ARM, WRIST = 1.0 / 1.2e6, 1.0 / 3e5
# A replicate this many standard deviations from its group's median is an outlier.
FAR = 6.0


def setting_of(
    description: ModelDescription,
    model: ArmModel,
    data: Measurements,
    *,
    accepted: Sequence[PlacedEffect] = (),
    own: Sequence[Maker] = (),
    free: Sequence[str] | None = None,
    history: History | None = None,
) -> Setting:
    """A model's springs fitted to readings, ready to be asked what is missing.

    ``history`` of the readings where these are part of a table; by default what they say themselves.

    Raises
    ------
    InputError
        No reading sees a joint's spring, or fewer readings than springs.
    """
    joints = tuple(free) if free is not None else free_springs(model, data)
    p = problem(model, data, [parameter(model, f"{name}.stiffness") for name in joints])
    found = estimate(p, FLOOR)
    own_compliance = np.array([_own(model, name) for name in joints])
    index = [model.robot.joint_names.index(name) for name in joints]
    usual = np.array([ARM if k < 3 else WRIST for k in index])
    typical = np.where(own_compliance > 0.0, np.maximum(own_compliance, found.u), np.maximum(usual, found.u))
    known = catalogue(model, description, own)
    s = Setting(
        description, model, problem(model, data, ()), _history(data, history), joints, found.u, typical,
        np.zeros((len(p), 0)), known, tuple(accepted),
    )  # fmt: skip
    return replace(s, errors=errors_of(s))


def _history(data: Measurements, history: History | None) -> History:
    """The readings' history; known as soon as some readings tell loading from unloading.

    A sheet of such readings is what a diagnosis asks for where the first ones did not: these count as loadings from
    zero beside it.
    """
    history = history or history_of(data)
    if history.is_known:
        return history
    down = history.unloading(np.linalg.norm(data.wrench[:, :3], axis=1))
    return replace(history, is_known=bool(down.any()))


def _own(model: ArmModel, name: str) -> float:
    joint = model.joints[model.robot.joint_names.index(name)]
    return float(joint.axial.compliance(np.zeros((1, model.robot.dof)))[0])


def replicate_weights(p: Problem) -> Array:
    """Weights (m,) of readings: next to nothing for one that its own replicates contradict."""
    weight = np.ones(len(p))
    groups = int(p.replicate.max()) + 1
    deviation, count = np.zeros(len(p)), np.bincount(p.replicate, minlength=groups)
    for g in np.flatnonzero(count >= 3):
        mine = p.replicate == g
        deviation[mine] = p.value[mine] - np.median(p.value[mine])
    size = np.abs(p.value) + 1e-6
    tested = count[p.replicate] >= 3
    if tested.sum() < 9:
        return weight
    relative = np.abs(deviation[tested]) / size[tested]
    scale = 1.4826 * float(np.median(relative[relative > 0.0])) if (relative > 0.0).any() else np.inf
    # The median of three lies on one of them: of the others the deviation is larger than one reading's own.
    weight[np.flatnonzero(tested)[relative > FAR * 1.5 * scale]] = 1e-4
    return weight
