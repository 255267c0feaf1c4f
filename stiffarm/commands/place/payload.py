"""A placement as JSON and as columns of a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from machining.placement import Along, axis_rates, placement_content
from machining.placement.between import placement_of
from machining.placement.study import PlacedStep
from robots.quantities import rounded, rounded_all
from stiffarm.commands.posture.payload import path_columns, posture_columns
from stiffarm.pages.arm_uncertainty import estimated, interval
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty

# Every placement's error is drawn with the same arms and forces.
SEED = 0
CHOSEN, FIXED, STAYING, BEFORE = "recommended", "best position at rest", "present place, best gamma", "as it stands"
KEYS = {
    CHOSEN: "recommended",
    FIXED: "fixed_position",
    STAYING: "present_place_best_gamma",
    BEFORE: "as_it_stands",
}


def named(step: PlacedStep) -> dict[str, Along]:
    """The placements to compare, by what they are called; the recommended one first."""
    placed = step.placed
    found = {CHOSEN: placed.after, FIXED: placed.fixed, STAYING: placed.staying, BEFORE: placed.before}
    return {name: one for name, one in found.items() if one is not None}


def payload(step: PlacedStep) -> dict[str, Any]:
    """Everything that was found, keys with units."""
    placed, problem = step.placed, step.placed.problem
    others = {name: one for name, one in named(step).items() if name != CHOSEN}
    not_found = {
        KEYS[BEFORE]: placed.why_no_before,
        KEYS[STAYING]: placed.why_no_staying,
        KEYS[FIXED]: placed.why_no_fixed,
    }
    after = placed.after
    return placement_content(placement_of(problem, step.given, after.e, after.table, after.course, step.rapid)) | {
        "between_cuts_undriven": step.undriven,
        "aim": problem.goal.aim,
        "mode": placed.how.mode,
        "by_length": problem.goal.by_length,
        "alpha_mm2_per_N2": rounded(placed.after.criterion.alpha),
        "beta_mm4_per_N4": rounded(placed.after.criterion.beta),
        "path_points": problem.path.n,
        "path_length_mm": rounded(1e3 * problem.path.arc_length[-1]),
        "ranges": {
            name: {f"from_{unit}": rounded(float(a * f)), f"to_{unit}": rounded(float(b * f))}
            for name, unit, f, a, b in zip(
                problem.space.names,
                problem.space.units,
                problem.space.shown,
                problem.space.lower,
                problem.space.upper,
                strict=True,
            )
        },
        "base_positions_looked_at": placed.evaluations,
        "pieces_start_at_point": placed.first.tolist(),
        "stiffness_uncertainty": arm_uncertainty(problem.uncertainty),
        "placements": {KEYS[name]: _summary(step, one) for name, one in named(step).items()},
        "gain": {KEYS[name]: estimated(placed.after.gain(one), 1.0) for name, one in others.items()},
        "gain_of_worst": {KEYS[name]: estimated(placed.after.gain(one, "worst"), 1.0) for name, one in others.items()},
        "not_found": {name: why for name, why in not_found.items() if why is not None},
        "notes": [*placed.notes, *step.notes],
    }


def _summary(step: PlacedStep, one: Along) -> dict[str, Any]:
    error, stiffness = one.error.estimated(np.random.default_rng(SEED)), one.estimated()
    axes = step.cell.linear_axes
    return {
        "K_sf": rounded(one.k_sf),
        "K_sf_95": interval(stiffness["K_sf"]),
        "K_sf_squares": rounded(float(one.terms.squares)),
        "K_sf_mean": rounded(float(one.terms.mean)),
        "mean_stiffness_N_per_mm": rounded(one.mean * 1e-3),
        "mean_stiffness_N_per_mm_95": interval(stiffness["mean"], 1e-3),
        "worst_stiffness_N_per_mm": rounded(one.worst * 1e-3),
        "worst_stiffness_N_per_mm_95": interval(stiffness["worst"], 1e-3),
        "rms_error_um": rounded(error["rms"].value * 1e6),
        "rms_error_um_95": interval(error["rms"], 1e6),
        "worst_error_um": rounded(error["worst"].value * 1e6),
        "worst_error_um_95": interval(error["worst"], 1e6),
        "axes_mm": {
            axis.name: rounded_all((column.min() * 1e3, column.max() * 1e3))
            for axis, column in zip(axes, one.e.T, strict=True)
        },
        "turntable_deg": rounded(float(np.degrees(one.table))),
        "gamma_deg": rounded_all(np.degrees([one.course.gamma.min(), one.course.gamma.max()])),
        "joint_travel_deg": rounded(float(np.degrees(np.abs(np.diff(one.course.q, axis=0)).sum()))),
    }


def columns(step: PlacedStep) -> dict[str, list[Any]]:
    """Columns over the path's points: where, base, gamma, joints, stiffness and error, and the same of the others."""
    given, after = step.given, step.placed.after
    out = {"point": list(range(given.path.n)), "move": given.moves.tolist(), **path_columns(given.path)}
    out |= {f"e{j + 1}_mm": rounded_all(column * 1e3, 9) for j, column in enumerate(after.e.T)}
    out["turntable_deg"] = rounded_all(np.full(given.path.n, np.degrees(after.table)), 9)
    out |= posture_columns(step.placed.problem.model.robot, after.course)
    for name, one in named(step).items():
        prefix = "" if name == CHOSEN else f"{KEYS[name]}_"
        out[f"{prefix}stiffness_N_per_mm"] = rounded_all(one.stiffness * 1e-3)
        out[f"{prefix}error_um"] = rounded_all(one.error.normal * 1e6)
        if name == CHOSEN:
            out["error_sd_um"] = rounded_all(one.error.sd * 1e6)
    return out


def peak_rates(step: PlacedStep) -> list[tuple[str, float, float]]:
    """Name, peak speed m/s and peak acceleration m/s^2 of each axis searched; NaN without a feed."""
    problem = step.placed.problem
    x = step.placed.after.e[:, list(problem.space.free)]
    speed, acceleration = axis_rates(problem, x)
    names = problem.space.names[: x.shape[1]]
    return [(name, _peak(speed[:, j]), _peak(acceleration[:, j])) for j, name in enumerate(names)]


def _peak(rate: Any) -> float:
    size = np.abs(rate[np.isfinite(rate)])
    return float(size.max()) if size.size else float("nan")
