"""Results as JSON-ready dictionaries: keys with units, null where there is no number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from doe import PoseEffects, SpringEstimate
from stiffarm.commands.run.link_models import LinkModels, Pair
from stiffarm.session.spring_words import at_widest_bound, bound_of
from stiffarm.session.steps import FactorialRuns, RigidJoints, Variant
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


def variant(result: Variant) -> dict[str, Any]:
    """A calibrated variant."""
    out: dict[str, Any] = {
        "scheme": result.scheme,
        "robot": result.description.name,
        "load_path": result.model.load_path,
        "links": result.model.link_kind,
        "readings": len(result.system),
        "parameters": result.parameters,
        "rms_mm": number(result.rms_mm),
        "left_one_pose_out_rms_mm": number(result.left_out.rms_mm),
        "left_out_not_predicted": result.left_out.skipped,
        "remarks": list(result.remarks),
        "poses": _poses(result),
    }
    if result.constant is not None:
        out["residual_sd_mm"] = number(result.constant.sigma_m * 1e3)
        out["degrees_of_freedom"] = result.constant.degrees_of_freedom
        out["springs"] = {s.joint: estimate(s) for s in result.constant.springs}
        out |= {spring_key(s.joint): estimate(s)["k_Nm_per_rad"] for s in result.constant.springs}
    if result.staged is not None:
        out["stages"] = {name: [_pose_fit(fit) for fit in fits] for name, fits in result.staged.fits.items()}
        out["laws"] = {joint: law.model_dump(mode="json") for joint, law in result.staged.laws.items()}
    return out


def _poses(result: Variant) -> list[dict[str, Any]]:
    names = ("dx_mm", "dy_mm", "dz_mm", "rx_mrad", "ry_mrad", "rz_mrad")
    return [
        {
            "pose": result.system.pose[i],
            "component": names[result.system.component[i]],
            "measured": number(result.system.value[i] * 1e3),
            "simulated": number(result.predicted_mm[i]),
            "left_out_error": number(result.left_out.error_m[i] * 1e3),
        }
        for i in range(len(result.system))
    ]


def _pose_fit(fit: Any) -> dict[str, Any]:
    return {
        "pose": fit.pose,
        **{spring_key(joint): number(k) for joint, k in zip(fit.joints, fit.stiffness, strict=True)},
        "error_mm": number(fit.error_mm),
        "matched_within_gauge": fit.matched,
        "runs": fit.runs,
        "rounds": fit.rounds,
        "equivalent_range_Nm_per_rad": {
            joint: [number(a), number(b)] for joint, (a, b) in zip(fit.joints, fit.equivalent, strict=True)
        },
        "remarks": list(fit.remarks),
    }


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


def link_models(compared: LinkModels) -> dict[str, Any]:
    """Every load path and scheme with the run's own links and with those beside them."""
    return {
        "own": compared.own.links,
        "beside": compared.other.links,
        "rigid_joints_readings": {
            side.links: {path: [number(v) for v in alone] for path, alone in side.alone_mm.items()}
            for side in (compared.own, compared.other)
        },
        "calibrations": [_link_pair(pair, compared) for pair in compared.pairs],
    }


def _link_pair(pair: Pair, compared: LinkModels) -> dict[str, Any]:
    better, poses = pair.poses_better()
    return {
        "calibration": pair.own.name,
        "load_path": pair.own.model.load_path,
        "scheme": pair.own.scheme,
        **{
            side.links: {
                "rms_mm": number(one.rms_mm),
                "left_one_pose_out_rms_mm": number(one.left_out.rms_mm),
                "links_bar_and_crank_share": [number(float(v)) for v in side.share[one.name]],
                "poses": _poses(one),
            }
            for side, one in ((compared.own, pair.own), (compared.other, pair.other))
        },
        "left_out_difference_mm": number(pair.left_out_difference_mm),
        "poses_predicted_better": better,
        "poses_predicted": poses,
        "springs": [
            {
                "joint": s.joint,
                **({} if s.where is None else {"stage": s.where[0], "pose": s.where[1]}),
                **{
                    side.links: {
                        "k_Nm_per_rad": None if at_widest_bound(value) else number(value),
                        "interval_Nm_per_rad": [number(low), number(high)],
                    }
                    for side, (value, low, high) in ((compared.own, s.own), (compared.other, s.other))
                },
                "each_within_the_others_interval": {"within": True, "outside": False, "unknown": None}[s.agreement],
            }
            for s in pair.springs
        ],
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
