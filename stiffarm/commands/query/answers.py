"""What a surrogate answered at poses: a table with intervals and flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fem.statics.small_displacements import FLAG
from fem.statics.stated import at_load_entry, stiffness_ends
from robots import Remark
from robots.arrays import Array, Bools
from robots.quantities import Quantity, angle, rounded, stiffness
from stiffarm.result import Result, Table
from surrogate import QueryResult, Surrogate, compliance_matrix
from surrogate.model import COMPLIANCE

if TYPE_CHECKING:
    import pandas as pd

# Rows and columns of the compliance matrix.
_AXES = ("x", "y", "z", "rx", "ry", "rz")


def value_of(surrogate: Surrogate) -> Quantity:
    """The quantity that a surrogate answers; in full in files, since a bar may be far below the sixth digit."""
    name = surrogate.quantity.name
    if name == COMPLIANCE:
        found = stiffness("stiffness")
    else:
        found = stiffness(name) if surrogate.quantity.unit == "N/m" else Quantity(name)
    return replace(found, digits=6, stored=17)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Answers(Result):
    """What a surrogate answered, with 95 % intervals, and flags in words."""

    quantity: Quantity

    @property
    def values(self) -> Array:
        """The values (n,), in the unit that their column's name says; NaN where not answered."""
        return np.asarray(self.quantity.factor * self.tables[0].values[self.quantity])

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """One row a pose: its angles, the value, the ends of its 95 % interval, flags; numbers in full."""
        if table is not None:
            return super().to_frame(table)
        import pandas as pd

        of, q = self.tables[0], self.quantity
        low, high = (q.factor * end for end in of.intervals[q])
        ends = {q.column_of("low95"): low, q.column_of("high95"): np.where(np.isfinite(high), high, np.nan)}
        numbers = {one.column: one.factor * values for one, values in of.values.items()}
        return pd.DataFrame({"pose": of.labels["pose"], **numbers, **ends, "flags": of.labels["flags"]})


def answered(
    surrogate: Surrogate,
    poses_deg: Array,
    labels: Sequence[str],
    result: QueryResult,
    *,
    direction: Array | None = None,
    matrix: bool = False,
    remarks: Sequence[str] = (),
) -> Answers:
    """Answers at poses (n, k); ``matrix``: with the compliance matrix (SI)."""
    quantity, q = value_of(surrogate), np.radians(poses_deg)
    low, high = stiffness_ends(result.value, result.relative_error)
    unknown = ~np.isfinite(result.relative_error)
    low, high = np.where(unknown, np.nan, low), np.where(unknown, np.nan, high)
    words = flag_words(result).tolist()
    lower_bound = np.zeros(len(words), dtype=np.bool_)
    lower_bound[[*result.open]] = True
    n, missing = len(words), int(np.count_nonzero(~result.answered))
    flags: dict[str, Sequence[Any]] = {
        "inside_domain": result.inside_domain.tolist(),
        "reachable": result.reachable.tolist(),
        "error_is_lower_bound": lower_bound.tolist(),
        "near_singular": _known(result.singularity, result.near_singular.tolist()),
        FLAG: result.beyond_small.tolist(),
    }
    errors = {
        Quantity("relative_error95"): result.relative_error,
        Quantity("relative_error95_surrogate"): result.model_error,
        Quantity("relative_error95_calibration"): result.parameter_error,
    }
    if matrix:
        errors |= _entries(surrogate, q, result.answered)
    values = dict(zip(map(angle, surrogate.inputs), q.T, strict=True)) | {quantity: result.value}
    unanswered = f"{missing} of {n} poses lie outside the fitted range and have no value: see flags"
    along = None
    if surrogate.quantity.name == COMPLIANCE:
        along = list(surrogate.load_direction) if direction is None else direction.tolist()
    known = surrogate.parameters is not None
    return Answers(
        name="query",
        title=f"{quantity.name.replace('_', ' ').capitalize()} of {surrogate.robot} by its surrogate",
        question="how stiff is it at these poses?",
        answer=_answer(quantity, result.value, low, high),
        how_sure=f"95 % intervals hold the surrogate's own error{' and the uncertainty of the calibration' * known}.",
        what_next="" if known else "Calibrate the model before you rely on these numbers: `stiffarm calibrate`.",
        facts={
            "robot": surrogate.robot,
            "quantity": surrogate.quantity.name,
            "quantity_in_words": surrogate.quantity.label,
            "load_direction": along,
            "fixed_deg": dict(surrogate.fixed_deg),
            "errors": surrogate_errors(surrogate),
            **at_load_entry(surrogate.at_load),
        },
        tables=(
            Table(
                "answers",
                f"{quantity.heading} of {surrogate.robot}",
                {"pose": labels, "flags": words},
                values,
                {quantity: (low, high)},
                errors,
                flags,
            ),
        ),
        # The first note says how the links were modelled; the others, what a stiffness has in it and what not.
        remarks=(*remarks, *surrogate.notes[1:], *([Remark(unanswered, code="W014")] if missing else [])),
        found=result,
        quantity=quantity,
    )


def _answer(quantity: Quantity, value: Array, low: Array, high: Array) -> str:
    what, some = quantity.name.replace("_", " ").capitalize(), value[np.isfinite(value)]
    if len(value) == 1 and len(some):
        ends = f" ({quantity.between(low[0], high[0])}, 95 %)" if np.isfinite(low[0]) else ""
        return f"{what} {quantity.text(value[0], unit=True)}{ends}."
    ends = f": {quantity.between(some.min(), some.max())}" if len(some) else ""
    return f"{what} at {len(some)} of {len(value)} poses{ends}."


def _known(at: Array, values: list[Any]) -> list[Any]:
    """The values, None where ``at`` (n,) is not finite."""
    fine = np.isfinite(at)
    return values if fine.all() else [v if yes else None for v, yes in zip(values, fine.tolist(), strict=True)]


def flag_words(result: QueryResult) -> NDArray[np.object_]:
    """Flags (n,) of all rows in words; most have none."""
    n = len(result.value)
    out = np.full(n, "", dtype=object)
    some = (result.near_singular & result.answered) | result.beyond_small | result.rough
    some |= result.answered & np.isnan(result.relative_error)
    some[[*result.faults, *result.open]] = True
    for i in np.flatnonzero(some).tolist():
        out[i] = flags(result, i)
    return out


def flags(result: QueryResult, i: int) -> str:
    """What a reader of one row must know, in words; empty if nothing."""
    out = []
    if i in result.faults:
        kind = "extrapolated" if result.answered[i] else "not answered"
        out.append(f"{kind}: {result.faults[i]}")
    if result.near_singular[i] and result.answered[i]:
        out.append(f"near a singularity (smallest singular value {result.singularity[i]:.2g})")
    if result.beyond_small[i]:
        out.append("beyond small displacements: too soft for linear statics")
    if i in result.open:
        out.append(f"error bar is a lower bound: calibration did not identify {', '.join(result.open[i])}")
    if result.rough[i]:
        out.append("error bar is rough: the uncertainty from calibration is too large to propagate linearly")
    if result.answered[i] and np.isnan(result.relative_error[i]):
        out.append("no error bar for this load direction: the fit learned one only for its own")
    return "; ".join(out)


def surrogate_errors(surrogate: Surrogate) -> dict[str, Any]:
    """Held-out error figures."""
    e = surrogate.errors
    figures = {
        "rms_relative_error": e.rms_relative,
        "p95_relative_error": e.p95_relative,
        "max_relative_error": e.max_relative,
        "interior_rms_relative_error": e.rms_interior,
        "interior_max_relative_error": e.max_interior,
        "coverage_of_95_percent_bars": e.coverage95,
        "condition_number": e.condition_number,
        "matrix_rms_relative_error": e.matrix_rms,
        "matrix_max_relative_error": e.matrix_max,
    }
    return {
        "basis": e.basis,
        "degree_or_order": e.degree,
        "target": e.target,
        "terms": e.n_terms,
        "quantity": surrogate.quantity.name,
        "runs_fitted": e.n_train,
        "runs_held_out": e.n_test,
        **{name: None if value is None else rounded(value) for name, value in figures.items()},
    }


def _entries(surrogate: Surrogate, q: Array, rows: Bools) -> dict[Quantity, Array]:
    """Upper triangle of the compliance matrix; of answered rows only, since far outside it may overflow."""
    C = np.full((len(q), 6, 6), np.nan)
    C[rows] = compliance_matrix(surrogate, q[rows])
    return {Quantity(f"c_{a}_{b}"): C[:, i, j] for i, a in enumerate(_AXES) for j, b in enumerate(_AXES) if j >= i}
