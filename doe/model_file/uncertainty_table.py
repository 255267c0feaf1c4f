"""The table ``[calibration.uncertainty]`` of a model file, from what a calibration found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.model_file.carried_on import NOTHING, CarriedOn
from fem.free.parameters import Scale
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
