"""A training as JSON-ready dictionaries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stiffarm.session.json_text import number

if TYPE_CHECKING:
    from surrogate import Surrogate, Trained


def trained(result: Trained) -> dict[str, Any]:
    """All surrogates of a training, best first."""
    best = result.best
    return {
        "best": best.basis,
        "quantity": best.quantity.name,
        "whole_turns_do_not_matter": [n for n, p in zip(best.inputs, best.periodic, strict=True) if p],
        "fixed_coordinates_would_change_it_by": {n: number(v) for n, v in best.fixed_influence.items()},
        "calibration_uncertainty": _parameter_bars(best),
        "surrogates": [surrogate_errors(s) for s in result.surrogates],
        "not_fitted": dict(result.refused),
        "refinement": list(result.rounds),
    }


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


def _parameter_bars(surrogate: Surrogate) -> dict[str, Any] | None:
    p = surrogate.parameters
    if p is None:
        return None
    return {"parameters": list(p.names), "undetermined": list(p.undetermined), "misfit": number(p.misfit)}
