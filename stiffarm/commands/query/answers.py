"""What a surrogate answered, as rows for files and screens, and its error figures as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.statics.small_displacements import FLAG
from fem.statics.stated import stiffness_ends
from robots.arrays import Array
from robots.quantities import rounded, rounded_all
from stiffarm.session.console import say, show_table
from surrogate import QueryResult, Surrogate, compliance_matrix
from surrogate.model import COMPLIANCE

# Columns of the compliance matrix, upper triangle.
_AXES = ("x", "y", "z", "rx", "ry", "rz")
# Rows whose flags the screen spells out; files have all.
_FLAGS_SHOWN = 20
_ROWS_SHOWN = 50


def value_name(surrogate: Surrogate) -> tuple[str, float]:
    """Name with unit of what a surrogate answers on screens and in files, and the factor from SI to that unit."""
    if surrogate.quantity.name == COMPLIANCE:
        return "stiffness_N_per_mm", 1e-3
    if surrogate.quantity.unit == "N/m":
        return f"{surrogate.quantity.name}_N_per_mm", 1e-3
    return surrogate.quantity.name, 1.0


def query_columns(surrogate: Surrogate, poses_deg: Array, result: QueryResult) -> dict[str, Array]:
    """Angles, value and its 95 % interval, NaN where not known: what a data frame shows beside the flags."""
    name, factor = value_name(surrogate)
    value, bar = factor * result.value, np.where(np.isfinite(result.relative_error), result.relative_error, np.nan)
    low, high = stiffness_ends(value, bar)
    high = np.where(np.isfinite(high), high, np.nan)
    return {**dict(zip(surrogate.inputs, poses_deg.T, strict=True)), name: value, "low95": low, "high95": high}


def query_rows(
    surrogate: Surrogate, poses_deg: Array, labels: Sequence[str], result: QueryResult, *, matrix: bool = False
) -> list[dict[str, Any]]:
    """Query answers, one row a pose; ``matrix``: with the compliance matrix (SI)."""
    matrices = None
    if matrix:
        # Of answered rows only: far outside it may overflow, which would be refused.
        matrices = np.full((len(poses_deg), 6, 6), np.nan)
        matrices[result.answered] = compliance_matrix(surrogate, np.radians(poses_deg)[result.answered])
    columns: dict[str, Sequence[Any]] = {
        "pose": labels,
        # In full: a bar may be far below the sixth digit.
        **{n: _known(v, v.tolist()) for n, v in query_columns(surrogate, poses_deg, result).items()},
        "relative_error95": rounded_all(result.relative_error),
        "relative_error95_surrogate": rounded_all(result.model_error),
        "relative_error95_calibration": rounded_all(result.parameter_error),
        "max_relative_error_seen": [rounded(surrogate.errors.max_relative)] * len(poses_deg),
        "inside_domain": result.inside_domain.tolist(),
        "reachable": result.reachable.tolist(),
        "error_is_lower_bound": [i in result.open for i in range(len(poses_deg))],
        "near_singular": _known(result.singularity, result.near_singular.tolist()),
        FLAG: result.beyond_small.tolist(),
        "flags": flag_words(result).tolist(),
    }
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if matrices is not None:
        for row, C, answered in zip(rows, matrices, result.answered.tolist(), strict=True):
            row.update(_entries(C, answered))
    return rows


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
    return {
        "basis": e.basis,
        "degree_or_order": e.degree,
        "target": e.target,
        "terms": e.n_terms,
        "quantity": surrogate.quantity.name,
        "runs_fitted": e.n_train,
        "runs_held_out": e.n_test,
        "rms_relative_error": rounded(e.rms_relative),
        "p95_relative_error": rounded(e.p95_relative),
        "max_relative_error": rounded(e.max_relative),
        "interior_rms_relative_error": rounded(e.rms_interior),
        "interior_max_relative_error": rounded(e.max_interior),
        "coverage_of_95_percent_bars": rounded(e.coverage95),
        "condition_number": rounded(e.condition_number),
        "matrix_rms_relative_error": None if e.matrix_rms is None else rounded(e.matrix_rms),
        "matrix_max_relative_error": None if e.matrix_max is None else rounded(e.matrix_max),
    }


def show_answers(surrogate: Surrogate, rows: Sequence[dict[str, Any]]) -> None:
    """The rows as a table on the screen, and below it what is to be known of some."""
    name, _ = value_name(surrogate)
    unit = "N/mm" if name.endswith("N_per_mm") else ""
    what = "Structural stiffness" if name.startswith("stiffness") else surrogate.quantity.name
    show_table(
        f"{what} of {surrogate.robot}" + (f", {unit}" if unit else ""),
        ["pose", *(n.removesuffix("_deg") for n in surrogate.inputs), unit or "value", "95 % +-", "flags"],
        [
            [
                r["pose"],
                *(f"{r[n]:g}" for n in surrogate.inputs),
                "-" if r[name] is None else f"{r[name]:.6g}",
                "-" if r["relative_error95"] is None else f"{100.0 * r['relative_error95']:.2g} %",
                "see below" if r["flags"] else "",
            ]
            for r in rows[:_ROWS_SHOWN]
        ],
    )
    if len(rows) > _ROWS_SHOWN:
        say(f"(the first {_ROWS_SHOWN} of {len(rows)} rows; --out DIR or --json has all)")
    for r in rows[:_FLAGS_SHOWN]:
        if r["flags"]:
            say(f"pose {r['pose']}: {r['flags']}")


def _entries(C: Any, answered: bool) -> dict[str, float | None]:
    return {
        f"c_{a}_{b}": rounded(float(C[i, j])) if answered else None
        for i, a in enumerate(_AXES)
        for j, b in enumerate(_AXES)
        if j >= i
    }
