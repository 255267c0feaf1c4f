"""What a surrogate answered, as rows for files and screens, and its error figures as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fem.statics.small_displacements import FLAG
from stiffarm.session.console import say, show_table
from stiffarm.session.intervals import stiffness_interval
from stiffarm.session.json_text import number
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


def query_rows(
    surrogate: Surrogate, poses_deg: Any, labels: Sequence[str], result: QueryResult, *, matrix: bool = False
) -> list[dict[str, Any]]:
    """Query answers, one row a pose; ``matrix``: with the compliance matrix (SI)."""
    name, factor = value_name(surrogate)
    matrices = None
    if matrix:
        # Of answered rows only: far outside it may overflow, which would be refused.
        matrices = np.full((len(poses_deg), 6, 6), np.nan)
        matrices[result.answered] = compliance_matrix(surrogate, np.radians(poses_deg)[result.answered])
    near = result.near_singular
    rows = []
    for i, (label, row) in enumerate(zip(labels, poses_deg, strict=True)):
        value, bar = float(factor * result.value[i]), float(result.relative_error[i])
        rows.append(
            {
                "pose": label,
                # In full: a bar may be far below the sixth digit.
                **{n: float(v) for n, v in zip(surrogate.inputs, row, strict=True)},
                name: value if np.isfinite(value) else None,
                **_interval(value, bar),
                "relative_error95": _finite(bar),
                "relative_error95_surrogate": _finite(result.model_error[i]),
                "relative_error95_calibration": _finite(result.parameter_error[i]),
                "max_relative_error_seen": number(surrogate.errors.max_relative),
                "inside_domain": bool(result.inside_domain[i]),
                "reachable": bool(result.reachable[i]),
                "error_is_lower_bound": i in result.open,
                "near_singular": None if np.isnan(result.singularity[i]) else bool(near[i]),
                FLAG: bool(result.beyond_small[i]),
                "flags": flags(result, i),
                **({} if matrices is None else _entries(matrices[i], bool(result.answered[i]))),
            }
        )
    return rows


def _interval(value: float, bar: float) -> dict[str, float | None]:
    """The 95 % interval; of the compliance, so that it is the one that all others show."""
    if not (np.isfinite(bar) and np.isfinite(value)):
        return {"low95": None, "high95": None}
    low, high = stiffness_interval(value, bar)
    return {"low95": low, "high95": _finite(high)}


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
        "rms_relative_error": number(e.rms_relative),
        "p95_relative_error": number(e.p95_relative),
        "max_relative_error": number(e.max_relative),
        "interior_rms_relative_error": number(e.rms_interior),
        "interior_max_relative_error": number(e.max_interior),
        "coverage_of_95_percent_bars": number(e.coverage95),
        "condition_number": number(e.condition_number),
        "matrix_rms_relative_error": None if e.matrix_rms is None else number(e.matrix_rms),
        "matrix_max_relative_error": None if e.matrix_max is None else number(e.matrix_max),
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


def _finite(value: float) -> float | None:
    return number(float(value)) if np.isfinite(value) else None


def _entries(C: Any, answered: bool) -> dict[str, float | None]:
    return {
        f"c_{a}_{b}": number(float(C[i, j])) if answered else None
        for i, a in enumerate(_AXES)
        for j, b in enumerate(_AXES)
        if j >= i
    }
