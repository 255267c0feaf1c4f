"""Error figures of a surrogate as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stiffarm.session.json_text import number

if TYPE_CHECKING:
    from surrogate import Surrogate


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
