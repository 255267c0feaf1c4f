"""The covariance of calibrated numbers as arrays, and its numbers found again in a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import t as student

from fem import ArmModel, deflection
from fem.effects import LOAD_PATH, Maker, PlacedEffect, build_plain, described_effects
from fem.effects.secant import StatedLoad
from fem.elements.walls import wall_flexibilities
from fem.free.model import FreeModel, LoadedPoses
from fem.free.parameters import NamedNumbers, Parameter, described_variables, named_numbers
from robots import InputError, ModelDescription
from robots.arrays import Array, Indices
from robots.constants import NORMAL_95
from robots.schema.uncertainty import NumberStatus, NumberVariable, UndeterminedNumber

# Numbers of the test set-up: they are not in the arm's compliance.
SET_UP = ("load.", "point.")
# Numbers of the file and of its covariance are written with nine digits or more.
SAME = 1e-6
# Degrees of freedom that stand for a normal distribution in a file, which holds no infinity.
AS_NORMAL = 1e6
# Poses at which a model is compared with the one that the description gives.
COMPARED = 8
REMEDY = "calibrate again, or take [calibration.uncertainty] out of the model file"


@dataclass(frozen=True, eq=False)
class ParameterUncertainty:
    """Calibrated numbers with their covariance, without those of the test set-up (load, read point).

    ``names``, ``variable``, ``unit``, ``status`` (p): as in :class:`robots.schema.description.CalibrationUncertainty`;
    ``estimate`` (p,), ``covariance`` (p, p), ``degrees_of_freedom`` (p,): of the variables; ``directions`` (d, p):
    combinations that no reading determines; ``undetermined``: numbers without a variance; ``note``: what it rests on.
    ``description``: the model file; ``own``: laws of the user's own effects.
    """

    names: tuple[str, ...]
    variable: tuple[NumberVariable, ...]
    unit: tuple[str, ...]
    status: tuple[NumberStatus, ...]
    estimate: Array
    covariance: Array
    degrees_of_freedom: Array
    directions: Array
    undetermined: tuple[UndeterminedNumber, ...]
    note: str
    description: ModelDescription = field(repr=False)
    own: tuple[Maker, ...] = field(default=(), repr=False)
    _kept: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def sd(self) -> Array:
        """Standard deviations (p,) of the variables."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def widened(self) -> Array:
        """The covariance with every standard deviation times Student's t over the normal 95 % quantile.

        1.96 standard deviations of whatever is linear in the variables then are its 95 % interval: exactly where
        all have the same degrees of freedom, else nearly.
        """
        known = np.where(self.degrees_of_freedom >= AS_NORMAL, np.inf, self.degrees_of_freedom)
        wider = student.ppf(0.975, known) / NORMAL_95
        return np.asarray(self.covariance * np.outer(wider, wider))


def parameter_uncertainty(description: ModelDescription, own: Sequence[Maker] = ()) -> ParameterUncertainty | None:
    """What a model file says of how sure its numbers are; None where it says nothing of the arm's own numbers.

    Numbers of the test set-up (``load.``, ``point.``) are left out, their covariance with the others stays in those.
    """
    table = None if description.calibration is None else description.calibration.uncertainty
    if table is None:
        return None
    kept = [k for k, name in enumerate(table.parameters) if not name.startswith(SET_UP)]
    undetermined = tuple(u for u in table.undetermined if not u.name.startswith(SET_UP))
    if not kept and not undetermined:
        return None
    p = len(table.parameters)
    directions = np.array(table.undetermined_directions).reshape(-1, p)[:, kept]
    length = np.linalg.norm(directions, axis=1)
    V = np.array(table.covariance).reshape(p, p)[np.ix_(kept, kept)]
    return ParameterUncertainty(
        names=tuple(table.parameters[k] for k in kept),
        variable=tuple(table.variable[k] for k in kept),
        unit=tuple(table.unit[k] for k in kept),
        status=tuple(table.status[k] for k in kept),
        estimate=np.array(table.estimate)[kept],
        covariance=0.5 * (V + V.T),
        degrees_of_freedom=np.array(table.degrees_of_freedom)[kept],
        directions=directions[length > 0.0] / length[length > 0.0, None],
        undetermined=undetermined,
        note=table.note,
        description=description,
        own=tuple(own),
    )


@dataclass(frozen=True, eq=False)
class Bound:
    """Calibrated and open numbers of a model, ready to be varied.

    ``names`` (p + m): those with a variance, then those without; ``numbers``: of those that act on the compliance;
    ``columns`` (p + m,): where they stand in it, -1 for numbers of effects on readings. ``sizes`` (p + m,): by how
    much a variable may change where the readings say nothing. ``open_names``: of numbers and combinations left open.
    ``stated``: the load at which effects that are not linear are in the model, as secants.
    """

    plain: ArmModel
    numbers: NamedNumbers
    effects: tuple[PlacedEffect, ...]
    walls: Mapping[str, Any]
    names: tuple[str, ...]
    columns: Indices
    sizes: Array
    open_names: tuple[str, ...]
    stated: StatedLoad | None = None

    def free(self, at: LoadedPoses) -> FreeModel:
        """The model with these numbers free at loaded poses."""
        n = self.numbers
        return FreeModel(self.plain, n.parameters, at, n.laws, dict(self.walls), self.effects, None, self.stated)


def bind(uncertainty: ParameterUncertainty, model: ArmModel, q: Array) -> Bound:
    """Find the numbers in the model; the result is kept for the next call with the same model object.

    Raises
    ------
    InputError
        A model with other links or another load path than the calibrated one, with other numbers, or that lacks some.
    """
    last = uncertainty._kept.get("bound")
    if last is not None and last[0] is model:
        return last[1]  # type: ignore[no-any-return]
    _same_kind(uncertainty.description, model)
    bound = _bound(uncertainty, model)
    _same_displacements(bound, model, q[:COMPARED])
    uncertainty._kept["bound"] = (model, bound)
    return bound


def _bound(uncertainty: ParameterUncertainty, model: ArmModel) -> Bound:
    description = uncertainty.description
    plain, effects = model, tuple[PlacedEffect, ...]()
    if description.effect:
        plain = build_plain(description, model.link_kind, model.load_path)
        placed = described_effects(description, plain, uncertainty.own)
        effects = tuple(e for e in placed if e.effect.code != LOAD_PATH)
    names = (*uncertainty.names, *(u.name for u in uncertainty.undetermined))
    every = named_numbers(plain, names, effects)
    _same_numbers(uncertainty, described_variables(description, every)[: len(uncertainty.names)])
    secant = () if model.secants is None else tuple(e.effect.code for e in model.secants.carried)
    acting = tuple(e for e in effects if e.effect.stage == "model" or e.effect.code in secant)
    codes = {e.effect.code for e in acting}
    asked = [every.parameters[k] for k in every.columns]
    acts = np.array([not p.kind.of_effect or p.place in codes for p in asked], dtype=np.bool_)
    numbers = named_numbers(plain, [name for name, yes in zip(names, acts, strict=True) if yes], acting)
    columns = np.full(len(names), -1, dtype=np.intp)
    columns[acts] = numbers.columns
    walls = wall_flexibilities(description, plain, numbers.parameters)
    together = tuple(_together(uncertainty.names, row) for row in uncertainty.directions)
    left_open = (*(u.name for u in uncertainty.undetermined), *together)
    sizes, stated = _sizes(uncertainty, asked, every), None if model.secants is None else model.secants.load
    return Bound(plain, numbers, acting, walls, names, columns, sizes, left_open, stated)


def _together(names: tuple[str, ...], direction: Array) -> str:
    large = np.abs(direction) > SAME * np.abs(direction).max()
    return "combination of " + ", ".join(name for name, yes in zip(names, large, strict=True) if yes)


def _sizes(uncertainty: ParameterUncertainty, asked: list[Parameter], every: NamedNumbers) -> Array:
    """By how much each variable (p + m,) may plausibly change."""
    u = np.abs(every.u[every.columns])
    p = len(uncertainty.names)
    limits = [(None, None)] * p + [(one.low, one.high) for one in uncertainty.undetermined]
    out = np.empty(len(asked))
    for k, (one, (low, high)) in enumerate(zip(asked, limits, strict=True)):
        if one.is_logarithm:
            out[k] = 1.0
        elif one.scale == "compliance":
            softest = 0.0 if low is None or low <= 0.0 else 1.0 / low
            out[k] = max(u[k], softest) if u[k] > 0.0 or softest else _usual(uncertainty, one)
        else:
            half = 0.0 if low is None or high is None else 0.5 * (high - low)
            out[k] = max(u[k], half) or one.upper
    return out


def _usual(uncertainty: ParameterUncertainty, one: Parameter) -> float:
    """What a part that is rigid in the model may give way by: the median of the calibrated ones of its unit."""
    known = [
        float(c)
        for c, variable, unit in zip(uncertainty.estimate, uncertainty.variable, uncertainty.unit, strict=True)
        if variable == "1/value" and unit == one.unit and c > 0.0
    ]
    return float(np.median(known)) if known else 1.0 / one.lower


def _same_kind(description: ModelDescription, model: ArmModel) -> None:
    c = description.calibration
    # Without links of its own an arm is the same whatever they would be made of.
    has_links = bool(description.link) or description.parallelogram is not None
    if c is not None and ((has_links and c.links != model.link_kind) or c.load_path != model.load_path):
        raise InputError(
            "uncertainty of the calibrated numbers: the model in use",
            code="M013",
            value=f"{model.link_kind} links, {model.load_path} load path",
            allowed=f"that of the calibration: {c.links} links, {c.load_path} load path",
            remedy="use these, or calibrate with the others",
        )


def _same_numbers(uncertainty: ParameterUncertainty, own: Array) -> None:
    size = np.maximum(np.abs(uncertainty.estimate), np.abs(own))
    wrong = np.flatnonzero(np.abs(own - uncertainty.estimate) > SAME * np.maximum(size, uncertainty.sd * SAME))
    if wrong.size:
        k = int(wrong[0])
        raise InputError(
            f"uncertainty of {uncertainty.names[k]} ({uncertainty.variable[k]} in SI): the model has",
            code="M013",
            value=float(f"{own[k]:.9g}"),
            allowed=f"the calibrated {uncertainty.estimate[k]:.9g}",
            remedy=f"the number was changed after the calibration: {REMEDY}",
        )


def _same_displacements(bound: Bound, model: ArmModel, q: Array) -> None:
    """Refuse a model that is not the description's: its numbers would be varied around other values."""
    tip = np.broadcast_to(model.robot.T_flange_tool[:3, 3], (len(q), 3))
    for load in np.eye(6)[:3]:
        at = LoadedPoses(q, np.tile(load, (len(q), 1)), tip)
        there, here = bound.free(at).displacement(bound.numbers.u), deflection(model, q, load)
        if not np.allclose(there, here, rtol=SAME, atol=SAME * float(np.abs(here[:, :3]).max(initial=0.0))):
            raise InputError(
                "uncertainty of the calibrated numbers: the model in use is not the one of the model file",
                code="M013",
                remedy="build the model from the file as it is (effects included)",
            )
