"""The table ``[calibration.uncertainty]`` of a model file, from what a calibration found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.certainty.uncertainty import ParameterEstimate
from doe.estimation.calibration import Calibration
from doe.model_file.carried_on import NOTHING, CarriedOn, carried_on
from doe.model_file.stage_covariance import stage_covariance
from fem.free.parameters import Parameter, Scale, described_variables, named_numbers
from robots.arrays import Array
from robots.schema.uncertainty import (
    MOST_DEGREES_OF_FREEDOM,
    CalibrationUncertainty,
    NumberStatus,
    NumberVariable,
    UndeterminedNumber,
)

Status = Literal["determined", "one-sided", "at bound", "not identified"]

VARIABLES: dict[Scale, NumberVariable] = {"compliance": "1/value", "log": "ln value", "linear": "value"}
FIXED = "what the calibration held fixed counts as exact"
NO_COVARIANCE = (
    "no covariance of the springs is kept: studies pose by pose take the best of their levels, with no spare reading "
    "to judge their errors by (--scheme global gives one)"
)
NO_SPARE = "no covariance of the springs is kept: as many springs as readings leave nothing to judge their errors by"


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


def calibration_table(found: Calibration) -> CalibrationUncertainty | None:
    """Of a campaign's numbers, all stages; estimates are the calibrated model's own.

    Numbers of an earlier calibration that this one held stay in the covariance, and what their errors make of the
    new ones is added, as if their readings were others than these.
    """
    if not found.stages:
        return None
    last = {e.parameter.name: e for s in found.stages for e in s.certainty.estimates}
    # Until its origin is written anew the description has that of the calibration before.
    before = carried_on(found.description, found.model, tuple(last), found.effects)
    names, covariance, shares_readings = stage_covariance(found, before)
    named = named_numbers(found.model, names, found.effects)
    own = described_variables(found.description, named)
    units = [named.parameters[k] for k in named.columns]
    numbers = [
        _carried(before, k, units[k], own[k])
        if k < len(before.names)
        else _number(last[name], own[k], float(covariance[k, k]))
        for k, name in enumerate(names)
    ]
    note = "generalised least squares with estimated noise, priors included"
    if len(found.stages) > 1:
        note += "; later stages carry the errors of what earlier ones found"
    if shares_readings:
        note += ", taken as independent of their own though stages share readings"
    if any(s.study is not None for s in found.stages):
        note += "; stages by levels as least squares around the best levels"
    if before.names:
        note += f"; from an earlier calibration, readings taken as others than these: {', '.join(before.names)}"
    return uncertainty_table(numbers, covariance, _blind(found, names, before), note, before)


def _lost(before: CarriedOn, names: set[str]) -> list[str]:
    lost = [name for name in (*before.names, *before.lost) if name not in names]
    return [f"of an earlier calibration and now held: {', '.join(lost)}"] if lost else []


def _carried(before: CarriedOn, k: int, p: Parameter, own: float) -> FoundNumber:
    nan = math.nan
    return FoundNumber(
        before.names[k], p.unit, p.scale, own, (nan, nan), before.status[k], before.degrees_of_freedom[k],
        has_variance=True,
    )  # fmt: skip


def _number(e: ParameterEstimate, own: float, variance: float) -> FoundNumber:
    p = e.parameter
    has = e.status != "at bound" and not math.isnan(e.value) and variance > 0.0
    return FoundNumber(p.name, p.unit, p.scale, own, e.interval, e.status, e.degrees_of_freedom, has)


def _blind(found: Calibration, names: Sequence[str], before: CarriedOn) -> Array:
    """Directions that no reading of the last stage with these numbers determines, over all names."""
    last = {e.parameter.name: number for number, s in enumerate(found.stages) for e in s.certainty.estimates}
    rows = np.zeros((len(before.directions), len(names)))
    rows[:, : len(before.names)] = before.directions
    for number, s in enumerate(found.stages):
        mine = [e.parameter.name for e in s.certainty.estimates]
        now = np.array([last[name] == number for name in mine], dtype=np.bool_)
        more = np.zeros((len(s.certainty.null), len(names)))
        more[:, [names.index(name) for name in mine]] = np.where(now, s.certainty.null, 0.0)
        rows = np.vstack([rows, more])
    return rows


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
