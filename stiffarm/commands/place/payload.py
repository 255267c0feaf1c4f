"""A placement as JSON and as table rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from machining.placement import Along, Placement, axis_rates, placement_content
from machining.placement.study import PlacedStep
from stiffarm.pages.arm_uncertainty import estimated, interval
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.session.json_text import number

# Every placement's error is drawn with the same arms and forces.
SEED = 0
CHOSEN, FIXED, BEFORE = "recommended", "best position at rest", "as it stands"
KEYS = {CHOSEN: "recommended", FIXED: "fixed_position", BEFORE: "as_it_stands"}


def named(step: PlacedStep) -> dict[str, Along]:
    """The placements to compare, by what they are called; the recommended one first."""
    placed = step.placed
    found = {CHOSEN: placed.after, FIXED: placed.fixed, BEFORE: placed.before}
    return {name: one for name, one in found.items() if one is not None}


def placement_of(step: PlacedStep) -> Placement:
    """What other programs read: :func:`machining.placement.read_placement`."""
    after, given = step.placed.after, step.request.given
    return Placement(
        robot=step.model.robot.name,
        cell=step.request.cell.name,
        axes=tuple(axis.name for axis in step.request.cell.linear_axes),
        travel=after.e,
        table=after.table,
        gamma=after.gamma,
        joints=step.model.robot.coordinates,
        q=after.q,
        moves=given.moves,
        count=given.count,
    )


def payload(step: PlacedStep) -> dict[str, Any]:
    """Everything that was found, keys with units."""
    placed, request = step.placed, step.request
    problem = placed.problem
    others = {name: one for name, one in named(step).items() if name != CHOSEN}
    not_found = {KEYS[BEFORE]: placed.why_no_before, KEYS[FIXED]: placed.why_no_fixed}
    return placement_content(placement_of(step)) | {
        "aim": problem.goal.aim,
        "mode": request.how.mode,
        "by_length": problem.goal.by_length,
        "alpha_mm2_per_N2": number(placed.criterion.alpha),
        "beta_mm4_per_N4": number(placed.criterion.beta),
        "path_points": problem.path.n,
        "path_length_mm": number(float(step.arc_mm[-1])),
        "ranges": {
            name: {f"from_{unit}": number(float(a * f)), f"to_{unit}": number(float(b * f))}
            for name, unit, f, a, b in zip(
                problem.space.names, problem.space.units, problem.space.shown, problem.space.lower,
                problem.space.upper, strict=True,
            )
        },
        "base_positions_looked_at": placed.evaluations,
        "pieces_start_at_point": placed.first.tolist(),
        "stiffness_uncertainty": arm_uncertainty(problem.uncertainty),
        "placements": {KEYS[name]: _summary(step, one) for name, one in named(step).items()},
        "gain": {KEYS[name]: estimated(placed.after.gain(one), 1.0) for name, one in others.items()},
        "not_found": {name: why for name, why in not_found.items() if why is not None},
        "notes": [*placed.notes, *step.notes],
    }  # fmt: skip


def _summary(step: PlacedStep, one: Along) -> dict[str, Any]:
    error, stiffness = one.error.estimated(np.random.default_rng(SEED)), one.estimated()
    axes = step.request.cell.linear_axes
    return {
        "K_sf": number(one.k_sf),
        "K_sf_95": interval(stiffness["K_sf"]),
        "K_sf_squares": number(float(one.terms.squares)),
        "K_sf_mean": number(float(one.terms.mean)),
        "mean_stiffness_N_per_mm": number(one.mean * 1e-3),
        "mean_stiffness_N_per_mm_95": interval(stiffness["mean"], 1e-3),
        "worst_stiffness_N_per_mm": number(one.worst * 1e-3),
        "worst_stiffness_N_per_mm_95": interval(stiffness["worst"], 1e-3),
        "rms_error_um": number(error["rms"].value * 1e6),
        "rms_error_um_95": interval(error["rms"], 1e6),
        "worst_error_um": number(error["worst"].value * 1e6),
        "worst_error_um_95": interval(error["worst"], 1e6),
        "axes_mm": {
            axis.name: [number(float(v)) for v in (column.min() * 1e3, column.max() * 1e3)]
            for axis, column in zip(axes, one.e.T, strict=True)
        },
        "turntable_deg": number(float(np.degrees(one.table))),
        "gamma_deg": [number(float(v)) for v in np.degrees([one.gamma.min(), one.gamma.max()])],
        "joint_travel_deg": number(float(np.degrees(np.abs(np.diff(one.q, axis=0)).sum()))),
    }


def rows(step: PlacedStep) -> list[dict[str, Any]]:
    """One row a path point: where, base, gamma, joints, stiffness and error, and the same of the others."""
    path, placed, given = step.request.given.path, step.placed, step.request.given
    after, robot = placed.after, step.model.robot
    others = {KEYS[name]: one for name, one in named(step).items() if name != CHOSEN}
    out = []
    for i in range(path.n):
        row: dict[str, Any] = {"point": i, "move": int(given.moves[i]), "path_mm": number(float(step.arc_mm[i]), 9)}
        row |= {f"{a}_mm": number(float(v), 9) for a, v in zip("xyz", path.points[i] * 1e3, strict=True)}
        row |= {f"e{j + 1}_mm": number(float(v * 1e3), 9) for j, v in enumerate(after.e[i])}
        row["turntable_deg"] = number(float(np.degrees(after.table)), 9)
        row["gamma_deg"] = number(float(np.degrees(after.gamma[i])), 9)
        row["branch"] = after.names[after.branch[i]]
        row |= {name: number(float(v), 10) for name, v in zip(robot.coordinates, np.degrees(after.q[i]), strict=True)}
        row["stiffness_N_per_mm"] = number(float(after.stiffness[i] * 1e-3))
        row["error_um"] = number(float(after.error.normal[i] * 1e6))
        row["error_sd_um"] = number(float(after.error.sd[i] * 1e6))
        for key, one in others.items():
            row[f"{key}_stiffness_N_per_mm"] = number(float(one.stiffness[i] * 1e-3))
            row[f"{key}_error_um"] = number(float(one.error.normal[i] * 1e6))
        out.append(row)
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
