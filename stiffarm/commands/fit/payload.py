"""A training as JSON-ready dictionaries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from stiffarm.commands.query.errors import surrogate_errors
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


def _parameter_bars(surrogate: Surrogate) -> dict[str, Any] | None:
    p = surrogate.parameters
    if p is None:
        return None
    return {"parameters": list(p.names), "undetermined": list(p.undetermined), "misfit": number(p.misfit)}
