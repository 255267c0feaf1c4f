"""The table ``[calibration.uncertainty]`` of a model file: what a calibration found, and what was known before.

Numbers of an earlier calibration are kept where these are held and still the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from doe.certainty.uncertainty import Status
from fem import ArmModel
from fem.effects import PlacedEffect
from fem.free.parameters import Kind, Parameter, Scale, described_variables, named_numbers
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.schema.uncertainty import (
    MOST_DEGREES_OF_FREEDOM,
    CalibrationUncertainty,
    NumberStatus,
    NumberVariable,
    UndeterminedNumber,
)

VARIABLES: dict[Scale, NumberVariable] = {"compliance": "1/value", "log": "ln value", "linear": "value"}
FIXED = "what the calibration held fixed counts as exact"
# A file's numbers are written with nine digits or more.
SAME = 1e-6


@dataclass(frozen=True)
class CarriedOn:
    """Numbers of an earlier calibration that this one held, with their covariance (p, p) then.

    ``status``, ``degrees_of_freedom`` (p): theirs; ``undetermined``: those that had no variance. ``lost``: names of
    the earlier calibration that are not carried on though nothing new is known of them.
    """

    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    status: tuple[NumberStatus, ...] = ()
    degrees_of_freedom: tuple[float, ...] = ()
    directions: Array = field(default_factory=lambda: np.zeros((0, 0)))
    undetermined: tuple[UndeterminedNumber, ...] = ()
    lost: tuple[str, ...] = ()


NOTHING = CarriedOn()


def carried_on(
    before: ModelDescription, model: ArmModel, found: Sequence[str], effects: Sequence[PlacedEffect] = ()
) -> CarriedOn:
    """The numbers of ``before``'s calibration that the ``found`` ones do not replace and that ``model`` still has.

    ``model``: after the calibration, without ``effects``. Nothing is carried on to a model of other links or with
    another load path: there the numbers mean something else.
    """
    origin = before.calibration
    old = None if origin is None else origin.uncertainty
    if origin is None or old is None:
        return NOTHING
    new = [_key(model, name, effects) for name in found]
    alike = (origin.links, origin.load_path) == (model.link_kind, model.load_path)
    kept = [
        k
        for k, name in enumerate(old.parameters)
        if alike and _is_held(model, name, effects, new) and _is_same(before, model, effects, old, k)
    ]
    open_then = tuple(u for u in old.undetermined if alike and _is_held(model, u.name, effects, new))
    gone = [n for k, n in enumerate(old.parameters) if k not in kept and _is_held(model, n, effects, new)]
    directions = np.array(old.undetermined_directions).reshape(-1, len(old.parameters))[:, kept]
    return CarriedOn(
        names=tuple(old.parameters[k] for k in kept),
        covariance=np.array(old.covariance).reshape(len(old.parameters), -1)[np.ix_(kept, kept)],
        status=tuple(old.status[k] for k in kept),
        degrees_of_freedom=tuple(old.degrees_of_freedom[k] for k in kept),
        directions=directions[directions.any(axis=1)],
        undetermined=open_then,
        lost=tuple(gone),
    )


def _named(model: ArmModel, name: str, effects: Sequence[PlacedEffect]) -> Parameter | None:
    try:
        numbers = named_numbers(model, (name,), effects)
    except InputError:
        return None
    return numbers.parameters[int(numbers.columns[0])]


def _key(model: ArmModel, name: str, effects: Sequence[PlacedEffect]) -> tuple[Kind, str, tuple[int, ...]] | None:
    p = _named(model, name, effects)
    return None if p is None else (p.kind, p.place, p.index)


def _is_held(
    model: ArmModel,
    name: str,
    effects: Sequence[PlacedEffect],
    new: Sequence[tuple[Kind, str, tuple[int, ...]] | None],
) -> bool:
    """Whether the model has the number and nothing new is known of it, nor of a law in its place."""
    p = _named(model, name, effects)
    if p is None or (p.kind, p.place, p.index) in new:
        return False
    # The law of a row has index (row, k), that about the axis (k,): what it replaces is the whole law, or the spring.
    laws = {(one[1], one[2][:-1]) for one in new if one is not None and one[0].of_law}
    return ((p.place, p.index[:-1]) if p.kind.of_law else (p.spring_of, ())) not in laws


def _is_same(
    before: ModelDescription,
    model: ArmModel,
    effects: Sequence[PlacedEffect],
    old: CalibrationUncertainty,
    k: int,
) -> bool:
    """Whether the model's own number is the one that the covariance belongs to."""
    own = float(described_variables(before, named_numbers(model, (old.parameters[k],), effects))[0])
    return abs(own - old.estimate[k]) <= SAME * max(abs(own), abs(old.estimate[k]))


@dataclass(frozen=True)
class FoundNumber:
    """A number with what a calibration says of it; ``interval`` in SI ``unit``; ``has_variance``: see the covariance.

    ``estimate``: the variable at the number that the model file holds. ``note``: why it has no variance, where that is
    not the usual reason.
    """

    name: str
    unit: str
    scale: Scale
    estimate: float
    interval: tuple[float, float]
    status: Status
    degrees_of_freedom: float
    has_variance: bool
    note: str | None = None


def uncertainty_table(
    found: Sequence[FoundNumber], covariance: Array, blind: Array, note: str, before: CarriedOn = NOTHING
) -> CalibrationUncertainty | None:
    """The table, or None where there is no number or no noise to judge them by.

    ``covariance`` (p, p) of the variables of the p numbers ``found``; ``blind`` (d, p): directions of these variables
    that no reading determines. ``before``: what was known of other numbers; the note names those that are not among
    ``found``.
    """
    kept = [k for k, f in enumerate(found) if f.has_variance]
    V = 0.5 * (covariance + covariance.T)[np.ix_(kept, kept)]
    mine = [found[k] for k in kept]
    if not found or not np.isfinite(V).all() or any(not f.degrees_of_freedom > 0.0 for f in mine):
        return None
    return CalibrationUncertainty(
        parameters=tuple(f.name for f in mine),
        unit=tuple(f.unit for f in mine),
        variable=tuple(VARIABLES[f.scale] for f in mine),
        estimate=tuple(f.estimate for f in mine),
        covariance=tuple(tuple(row) for row in V.tolist()),
        degrees_of_freedom=tuple(min(max(f.degrees_of_freedom, 1.0), MOST_DEGREES_OF_FREEDOM) for f in mine),
        status=tuple(_status(f.status) for f in mine),
        undetermined_directions=tuple(tuple(row) for row in _directions(blind[:, kept]).tolist()),
        undetermined=(*(_undetermined(f) for f in found if not f.has_variance), *before.undetermined),
        note="; ".join((note, FIXED, *_lost(before, {f.name for f in found}))),
    )


def _lost(before: CarriedOn, names: set[str]) -> list[str]:
    lost = [name for name in (*before.names, *before.lost) if name not in names]
    return [f"of an earlier calibration and now held: {', '.join(lost)}"] if lost else []


def _directions(blind: Array) -> Array:
    """Those of length one that are left when numbers without a variance are taken out."""
    length = np.linalg.norm(blind, axis=1)
    kept = length > 0.0
    return np.asarray(blind[kept] / length[kept, None])


def _status(status: Status) -> NumberStatus:
    return "not identified" if status == "at bound" else status


def _undetermined(f: FoundNumber) -> UndeterminedNumber:
    low, high = (None if not math.isfinite(v) else v for v in f.interval)
    if low == 0.0 and f.scale != "linear":
        low = None
    if f.note is not None:
        note = f.note
    elif f.status == "at bound":
        said = [] if low is None else [f"at least {low:.3g} {f.unit}"]
        said += [] if high is None else [f"at most {high:.3g} {f.unit}"]
        note = "stands at an end of its range; " + (" and ".join(said) + ", 95 %" if said else "no limit is known")
    else:
        note = "no reading moves with it; the model keeps what it had"
    status: Literal["at bound", "not identified"] = "at bound" if f.status == "at bound" else "not identified"
    return UndeterminedNumber(name=f.name, status=status, unit=f.unit, low=low, high=high, note=note)
