"""How uncertain the arm's compliance is: the covariance of its calibration, or assumed shares by part.

The tool's compliance C_tt is linear in the compliances of the parts, so with variables v (J,) of the arm
``C_tt = rest + sum_j v_j D_j``: exact for shares of parts and for stiffnesses that a calibration found, the first
order for its laws over angles, its walls and its joint zeros.

A calibrated model file says how sure its parameters are (``[calibration.uncertainty]``,
:mod:`doe.certainty.propagation`). What the calibration held fixed counts as exact there; what it left open has no
variance and is named, with what it may do. Only where a model file has no covariance are the compliances assumed to be
uncertain by 15 %.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np

import fem
from doe.certainty.propagation import ParameterUncertainty, compliance_gradients, drawn_variables, parameter_uncertainty
from fem.effects import Maker
from robots import InputError, ModelDescription
from robots.arrays import Array, Bools

Source = Literal["calibration", "assumed"]

# Standard deviation of a part's compliance, share of it, where nothing better is known.
ASSUMED_SD = 0.15
# Beyond this share a normal distribution would make a tenth of a percent of the springs negative.
LARGEST_SD = 0.33
# The calibrated model must give this displacement again, or it is another model than the one in use.
SAME_MODEL = 1e-6
# Poses at which that is looked at.
COMPARED = 8


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


class StiffnessUncertainty(Protocol):
    """The arm's J variables: ``names``, ``value`` (J,), ``covariance`` (J, J); ``note``: what they rest on."""

    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102

    @property
    def value(self) -> Array: ...  # noqa: D102

    @property
    def covariance(self) -> Array: ...  # noqa: D102

    @property
    def note(self) -> str: ...  # noqa: D102

    @property
    def source(self) -> Source: ...  # noqa: D102

    @property
    def open_names(self) -> tuple[str, ...]:
        """Parameters and combinations that a calibration left open."""
        ...

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Influence:
        """Dependence of C_tt on the variables at poses q (n, dof) rad; ``point`` as in :func:`fem.deflection`."""
        ...

    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """Values (count, J) of the variables, drawn so that no compliance is negative."""
        ...


@dataclass(frozen=True, eq=False)
class PartShares:
    """Each part's compliance times a factor of mean 1: variables are the factors, independent, ``sd`` (J,)."""

    names: tuple[str, ...]
    sd: Array
    note: str
    source: Source = "assumed"
    open_names: tuple[str, ...] = ()

    @property
    def value(self) -> Array:
        """Ones (J,)."""
        return np.ones(len(self.names))

    @property
    def covariance(self) -> Array:
        """Diagonal (J, J)."""
        return np.diag(self.sd**2)

    def influence(self, model: fem.ArmModel, q: Array, point: Array | None) -> Influence:
        """See :class:`StiffnessUncertainty`; errors as :func:`fem.deflection_by_part`."""
        out = np.zeros((len(q), len(self.names), 3, 3))
        for k in range(3):
            shares = fem.deflection_by_part(model, q, np.eye(6)[k], point)
            lost = set(self.names) - set(shares)
            if lost:
                raise InputError("parts of the uncertainty", value=min(lost), allowed=", ".join(shares))
            for j, name in enumerate(self.names):
                out[:, j, :, k] = shares[name][:, :3]
        return Influence(out, (), np.zeros((len(q), 0, 3, 3)), np.zeros(len(q), dtype=np.bool_))

    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """See :class:`StiffnessUncertainty`; the one draw in a thousand that is negative is rigid instead."""
        return np.asarray(np.maximum(1.0 + self.sd * generator.standard_normal((count, len(self.sd))), 0.0))


def assumed_uncertainty(
    model: fem.ArmModel, relative_sd: float = ASSUMED_SD, by_part: Mapping[str, float] | None = None, why: str = ""
) -> PartShares:
    """A stated standard deviation of every compliance in the model, share of it, independent from part to part.

    Parts are named as in :func:`fem.deflection_by_part`: joints (the spring about the axis; their bearings by
    themselves), links, base, tool, bar, crank. ``by_part`` overrides some. ``why``: goes into the note.

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
    return PartShares(parts, sd, note + (f" ({why})" if why else ""))


@dataclass(frozen=True, eq=False)
class CalibratedCompliances:
    """What a calibrated model file says of its own parameters; made by :func:`calibrated_uncertainty`.

    ``model``: the calibrated one. Standard deviations are widened by Student's t over the normal quantile, so that 95 %
    intervals keep the degrees of freedom of the calibration.
    """

    known: ParameterUncertainty
    model: fem.ArmModel
    open_names: tuple[str, ...]
    source: Source = field(default="calibration", init=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, as in ``calibrate --free``."""
        return self.known.names

    @property
    def value(self) -> Array:
        """The variables (J,) at the model's own parameters."""
        return self.known.estimate

    @property
    def covariance(self) -> Array:
        """Of the variables, widened (J, J)."""
        return self.known.widened

    @property
    def note(self) -> str:
        """What it rests on, and what the calibration left open."""
        note = f"compliances: covariance of the model's calibration ({len(self.names)} parameters), the rest exact"
        if self.open_names:
            note += f"; left open by the calibration, so not in the intervals: {', '.join(self.open_names)}"
        return note

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
                    remedy="use the model of the calibrated file",
                )
        # A free model counts the point from the flange, as do the tasks.
        found = compliance_gradients(self.model, self.known, q, point, size=3)
        return Influence(found.known, found.open_names, found.open_change, found.is_rough)

    def draws(self, count: int, generator: np.random.Generator) -> Array:
        """See :class:`StiffnessUncertainty`; errors as :func:`calibrated_uncertainty`."""
        return drawn_variables(self.known, self.model, _middle(self.model), generator, count)


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
    found = compliance_gradients(model, known, _middle(model), size=3)
    return CalibratedCompliances(known, model, found.open_names)


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
        return _assumed(model, f"the calibration's covariance does not hold for this model: {error}")
    if found is not None:
        return found
    if description.calibration is None:
        return _assumed(model, "this model is not calibrated")
    table = description.calibration.uncertainty
    opened = "" if table is None else f": it left open {', '.join(u.name for u in table.undetermined)}"
    return _assumed(model, f"the model's calibration has no covariance{opened}")


def _assumed(model: fem.ArmModel, why: str) -> PartShares:
    if not fem.compliance(model, _middle(model)).any():
        return PartShares((), np.zeros(0), "nothing in this model gives way")
    return assumed_uncertainty(model, why=why)


def _middle(model: fem.ArmModel) -> Array:
    """A pose (1, dof) rad that every arm can take."""
    return np.asarray(model.robot.limits.mean(axis=1)[None])
