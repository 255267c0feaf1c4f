"""How uncertain the arm's compliance is, by its calibration or by assumption, and so its stiffness along a path.

The tool's compliance C_tt is linear in the compliances of the parts, so with variables v (J,) of the arm
``C_tt = rest + sum_j v_j D_j``: exact for shares of parts and for stiffnesses that a calibration found, the first
order for its laws over angles, its walls and its joint zeros.

A calibrated model file says how sure its parameters are (``[calibration.uncertainty]``,
:mod:`doe.certainty.propagation`). What the calibration held fixed counts as exact there; what it left open has no
variance and is named, with what it may do. Only where a model file has no covariance are the compliances assumed to be
uncertain by 15 %.

An index is no linear function of the compliance, and the worst point of a path is none of its points, so their
intervals come from drawn arms (JCGM 101:2008). All courses of a path share the draws: what is uncertain about the arm
is common to them, and largely cancels in their ratio.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

import fem
from doe.certainty.propagation import ParameterUncertainty, compliance_gradients, drawn_variables, parameter_uncertainty
from fem.effects import Maker
from machining.cutting.spread import Estimated, interval
from machining.stiffness.cartesian import translational
from machining.stiffness.objective import Objective
from machining.task import Task
from robots import InputError, ModelDescription
from robots.arrays import Array, Bools, Integers
from robots.robot import middle_pose

Source = Literal["calibration", "assumed"]

# Standard deviation of a part's compliance, share of it, where nothing better is known.
ASSUMED_SD = 0.15
# Beyond this share a normal distribution would make a tenth of a percent of the springs negative.
LARGEST_SD = 0.33
# The calibrated model must give this displacement again, or it is another model than the one in use.
SAME_MODEL = 1e-6
# Poses at which that is looked at.
COMPARED = 8
# An end of a 95 % interval from so many draws is good to some 6 % of its half-width.
DRAWS = 1000
# Compliances worked on at once: some 40 MB.
AT_ONCE = 500_000
# Step along a change that a calibration left open, share of it: first order, as everywhere.
STEP = 1e-3
# Shares of the mean below which what a calibration left open does not matter.
SHARE = 0.01


@dataclass(frozen=True, eq=False)
class Influence:
    """How C_tt depends on the arm's variables at n poses.

    ``D`` (n, J, 3, 3): derivatives of C_tt by each variable. ``open_change`` (n, m, 3, 3): by how much each of the m
    parameters ``open_names`` that a calibration left open may change it: they have no variance. ``is_rough`` (n,):
    the first order does not hold.
    """

    D: Array
    open_names: tuple[str, ...]
    open_change: Array
    is_rough: Bools


@dataclass(frozen=True, eq=False)
class StiffnessUncertainty(ABC):
    """The arm's J variables: ``names``, ``value`` (J,), ``covariance`` (J, J).

    ``note``: what they rest on, and ``source`` in a word. ``open_names``: parameters and combinations that a
    calibration left open.
    """

    names: tuple[str, ...]
    value: Array
    covariance: Array
    note: str
    source: Source
    open_names: tuple[str, ...]

    @abstractmethod
    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Influence:
        """Dependence of C_tt on the variables at poses q (n, dof) rad; ``point`` as in :func:`fem.deflection`."""

    @abstractmethod
    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """Values (count, J) of the variables, drawn so that no compliance is negative."""


@dataclass(frozen=True, eq=False)
class PartShares(StiffnessUncertainty):
    """Each part's compliance times a factor of mean 1: variables are the factors, independent, ``sd`` (J,)."""

    sd: Array

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Influence:
        """See :class:`StiffnessUncertainty`; errors as :func:`fem.deflection_by_part`."""
        out = np.zeros((len(q), len(self.names), 3, 3))
        for k in range(3):
            shares = fem.deflection_by_part(model, q, np.eye(6)[k], point)
            lost = set(self.names) - set(shares)
            if lost:
                raise InputError("parts of the uncertainty", code="M013", value=min(lost), allowed=", ".join(shares))
            for j, name in enumerate(self.names):
                out[:, j, :, k] = shares[name][:, :3]
        return Influence(out, (), np.zeros((len(q), 0, 3, 3)), np.zeros(len(q), dtype=np.bool_))

    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """See :class:`StiffnessUncertainty`; the one draw in a thousand that is negative is rigid instead."""
        return np.asarray(np.maximum(1.0 + self.sd * generator.standard_normal((count, len(self.sd))), 0.0))


def part_shares(names: tuple[str, ...], sd: Array, note: str) -> PartShares:
    """Standard deviations ``sd`` (J,) of the compliances of parts, shares of them, as stated by whoever asks."""
    return PartShares(names, np.ones(len(names)), np.diag(sd**2), note, "assumed", (), sd)


def assumed_uncertainty(
    model: fem.ArmModel, relative_sd: float = ASSUMED_SD, by_part: Mapping[str, float] | None = None, why: str = ""
) -> PartShares:
    """A stated standard deviation of every compliance in the model, share of it, independent from part to part.

    Parts are named as in :func:`fem.deflection_by_part`: joints (the spring about the axis; their bearings by
    themselves), links, base, tool, bar, crank. ``by_part`` overrides some. ``why``: goes into the note.

    Raises
    ------
    InputError
        A share outside 0 to 0.33, a part that the model does not have, or a model in which nothing deflects.
    """
    # Any pose will do for their names; that of zeros may lay a parallelogram flat.
    parts = tuple(fem.deflection_by_part(model, middle_pose(model.robot)[None], np.eye(6)[0]))
    own = dict(by_part or {})
    unknown = sorted(set(own) - set(parts))
    if unknown or not parts:
        allowed = ", ".join(parts) or "a model in which something deflects"
        raise InputError(
            "part with an uncertain compliance", code="M013", value=unknown[0] if unknown else "none", allowed=allowed
        )
    sd = np.array([own.get(name, relative_sd) for name in parts])
    if not ((sd >= 0.0) & (sd <= LARGEST_SD)).all():
        raise InputError(
            "relative standard deviation of a compliance", code="M013", value=sd.max(), allowed=f"0 to {LARGEST_SD}"
        )
    said = "assumed" if relative_sd == ASSUMED_SD else "as stated"
    note = f"compliances: standard deviation {100 * relative_sd:g} % of each part, independent, {said}"
    if own:
        note += "; but " + ", ".join(f"{name} {100 * share:g} %" for name, share in own.items())
    return part_shares(parts, sd, note + (f" ({why})" if why else ""))


@dataclass(frozen=True, eq=False)
class CalibratedCompliances(StiffnessUncertainty):
    """What a calibrated model file says of its own parameters, named as in ``calibrate --free``.

    Made by :func:`calibrated_uncertainty`. ``model``: the calibrated one. The covariance is widened by Student's t over
    the normal quantile, so that 95 % intervals keep the degrees of freedom of the calibration.
    """

    known: ParameterUncertainty
    model: fem.ArmModel

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Influence:
        """See :class:`StiffnessUncertainty`. ``model`` may stand on something softer than the calibrated one did.

        Raises
        ------
        InputError
            ``model`` is not the calibrated one.
        """
        on_its_base = replace(model, base=self.model.base)
        for load in np.eye(6)[:3]:
            own, there = (fem.deflection(m, q[:COMPARED], load, None) for m in (self.model, on_its_base))
            if not np.allclose(own, there, rtol=SAME_MODEL, atol=SAME_MODEL * np.abs(own[:, :3]).max(initial=0.0)):
                raise InputError(
                    "uncertainty of the stiffnesses: it belongs to another model than the one in use",
                    code="M013",
                    remedy="use the model of the calibrated file",
                )
        # A free model counts the point from the flange, as do the tasks.
        found = compliance_gradients(self.model, self.known, q, point, size=3)
        return Influence(found.known, found.open_names, found.open_change, found.is_rough)

    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """See :class:`StiffnessUncertainty`; errors as :func:`calibrated_uncertainty`."""
        return drawn_variables(self.known, self.model, middle_pose(self.model.robot)[None], generator, count)


def calibrated_uncertainty(
    model: fem.ArmModel, description: ModelDescription, own: Sequence[Maker] = ()
) -> CalibratedCompliances | None:
    """The covariance that a model file holds, for the model built of it; None where it holds none.

    ``own``: laws of the user's own effects.

    Raises
    ------
    InputError
        A model with other links or another load path than the calibrated one, or parameters that were changed since.
    """
    known = parameter_uncertainty(description, own)
    if known is None or not known.names:
        return None
    opened = compliance_gradients(model, known, middle_pose(model.robot)[None], size=3).open_names
    note = f"compliances: covariance of the model's calibration ({len(known.names)} parameters), the rest exact"
    if opened:
        note += f"; left open by the calibration, so not in the intervals: {', '.join(opened)}"
    return CalibratedCompliances(known.names, known.estimate, known.widened, note, "calibration", opened, known, model)


def stiffness_uncertainty(
    model: fem.ArmModel, description: ModelDescription, own: Sequence[Maker] = ()
) -> StiffnessUncertainty:
    """The covariance of the model's calibration; 15 % of each compliance where there is none, and why.

    A model with other links or another load path than the calibrated one has none either. A model in which nothing
    gives way has nothing that could be uncertain.
    """
    try:
        found = calibrated_uncertainty(model, description, own)
    except InputError as error:
        return _assumed(model, f"the calibration's covariance does not hold for this model: {error.prose}")
    if found is not None:
        return found
    if description.calibration is None:
        return _assumed(model, "this model is not calibrated")
    table = description.calibration.uncertainty
    opened = "" if table is None else f": it left open {', '.join(u.name for u in table.undetermined)}"
    return _assumed(model, f"the model's calibration has no covariance{opened}")


def _assumed(model: fem.ArmModel, why: str) -> PartShares:
    if not fem.compliance(model, middle_pose(model.robot)[None]).any():
        return part_shares((), np.zeros(0), "nothing in this model deflects")
    return assumed_uncertainty(model, why=why)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A quantity along a course: ``value`` (n,), that of drawn arms ``draws`` (c, n).

    ``open_share``: by which share of the mean each parameter that the calibration left open may change it.
    """

    value: Array
    draws: Array
    open_share: Mapping[str, float]

    @property
    def matters(self) -> dict[str, float]:
        """What of :attr:`open_share` is more than 1 %: no interval holds it."""
        return {name: share for name, share in self.open_share.items() if share > SHARE}

    def estimated(self, statistic: Callable[[Array], Array]) -> Estimated:
        """A statistic of the values along the path, (..., n) to (...), with its interval."""
        return Estimated(float(statistic(self.value)), *interval(np.asarray(statistic(self.draws))))

    def ratio(self, other: Drawn, statistic: Callable[[Array], Array]) -> Estimated:
        """A statistic here over that of another course, from common draws."""
        drawn = np.asarray(statistic(self.draws)) / np.asarray(statistic(other.draws))
        return Estimated(float(statistic(self.value) / statistic(other.value)), *interval(drawn))


def drawn_stiffness(
    model: fem.ArmModel,
    task: Task,
    q: Array,
    stiffness: StiffnessUncertainty,
    of: Callable[[Array, Integers], Array],
    generator: np.random.Generator,
    draws: int = DRAWS,
) -> Drawn:
    """A quantity of C_tt along postures q (n, dof) rad, for arms drawn from ``stiffness``.

    ``of``: compliances (k, 3, 3) m/N at the path points (k,) to values (k,). The same generator state gives the same
    arms, so draw for each course of a path from a copy of it.
    """
    C = translational(model, q, task.tip)
    found = stiffness.influence(model, q, task.tip)
    n, points = len(q), np.arange(len(q))
    value = of(C, points)
    rest = C - np.einsum("j,njab->nab", stiffness.value, found.D)
    v = stiffness.draws(draws, generator)
    out = np.empty((draws, n))
    step = max(1, AT_ONCE // draws)
    for first in range(0, n, step):
        rows = slice(first, first + step)
        D = found.D[rows].transpose(1, 0, 2, 3).reshape(v.shape[1], -1)
        drawn = rest[rows] + (v @ D).reshape(draws, -1, 3, 3)
        out[:, rows] = of(drawn.reshape(-1, 3, 3), np.tile(points[rows], draws)).reshape(draws, -1)
    # To first order a law may be drawn beyond rigid.
    out = np.where(out < 0.0, np.inf, out)
    share = {}
    for k, name in enumerate(found.open_names):
        moved = of(C + STEP * found.open_change[:, k], points)
        share[name] = abs(float(moved.mean() / value.mean()) - 1.0) / STEP
    return Drawn(value, out, share)


def drawn_objective(
    model: fem.ArmModel,
    task: Task,
    courses: Mapping[str, Array],
    objective: Objective,
    stiffness: StiffnessUncertainty,
    seed: int = 0,
) -> dict[str, Drawn]:
    """What courses of postures (n, dof) rad along one path are judged by, for the same drawn arms."""
    force = objective.forces(task.path.n)

    def of(C: Array, point: Integers) -> Array:
        return objective.of_compliance(C, task.normals[point], None if force is None else force[point])

    return {
        name: drawn_stiffness(model, task, q, stiffness, of, np.random.default_rng(seed)) for name, q in courses.items()
    }
