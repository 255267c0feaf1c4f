"""Results as JSON-ready dictionaries: keys with units, null where there is no number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from doe import PoseEffects
from stiffarm.session.spring_words import SpringEstimate, bound_of
from stiffarm.session.steps import FactorialRuns, RigidJoints
from surrogate import Surrogate, Trained


def number(value: float, digits: int = 6) -> float | None:
    """A JSON number with that many significant digits; None for NaN and infinity."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def spring_key(joint: str) -> str:
    """``k2_Nm_per_rad`` for joint ``j2``, ``k_waist_Nm_per_rad`` for other names."""
    short = joint.removeprefix("j")
    return f"k{short if short.isdigit() else '_' + joint}_Nm_per_rad"


def estimate(spring: SpringEstimate) -> dict[str, Any]:
    """A constant spring with its interval; no plain number where it stands at a bound or is not determined."""
    known = spring.status in ("determined", "one-sided")
    out = {
        "k_Nm_per_rad": number(spring.stiffness) if known else None,
        "interval95_Nm_per_rad": [number(v) for v in spring.interval],
        "status": spring.status,
    }
    bound = bound_of(spring)
    return out | ({} if bound is None else {"bound": bound, "bound_Nm_per_rad": number(spring.stiffness)})


def effects(results: Sequence[PoseEffects]) -> list[dict[str, Any]]:
    """Sensitivity effects by pose."""
    return [
        {
            "pose": e.pose,
            "effect_mm": {joint: number(v) for joint, v in zip(e.joints, e.effect_mm, strict=True)},
            "share": {joint: number(v) for joint, v in zip(e.joints, e.share, strict=True)},
            "ranking": list(e.ranking),
        }
        for e in results
    ]


def rigid(result: RigidJoints) -> dict[str, Any]:
    """The rigid-joint model against the readings."""
    return {
        "poses": list(result.pose),
        "measured_mm": [number(v) for v in result.measured_mm],
        "simulated_mm": [number(v) for v in result.simulated_mm],
        "factor_measured_over_simulated": [number(v) for v in result.factor],
        "median_factor": number(float(np.median(result.factor))),
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


def factorial(runs: FactorialRuns) -> dict[str, Any]:
    """The factorial runs as columns."""
    columns = {name: [number(v) for v in runs.poses_deg[:, i]] for i, name in enumerate(runs.inputs)}
    return columns | {"stiffness_N_per_mm": [number(v) for v in runs.stiffness_N_per_mm]}
