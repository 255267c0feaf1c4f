"""A posture along a path as JSON and as table rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from machining import Course, Objective, limit_distance, singular_distance
from machining.posture.posing import BEFORE, CHOSEN, EACH, FIXED, MillingErrors, Posed
from machining.stiffness.units import shown
from robots.arrays import Array
from stiffarm.pages.arm_uncertainty import estimated, interval
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.session.json_text import number
from stiffarm.session.parsing import frame_words

KEYS = {CHOSEN: "recommended", BEFORE: "as_programmed", FIXED: "fixed_gamma", EACH: "each_point"}


def quantity(objective: Objective) -> tuple[str, str, float]:
    """Key with unit, words with unit, and the factor from SI to that unit."""
    it = shown(objective.quantity)
    return it.column, f"{it.quantity}, {it.unit}" if it.unit else it.quantity, it.factor


def payload(posed: Posed) -> dict[str, Any]:
    """Everything that was found, keys with units."""
    request = posed.request
    key, _, factor = quantity(request.objective)
    courses = {KEYS[name]: (name, course) for name, course in ({CHOSEN: posed.course} | posed.others).items()}
    not_found = {KEYS[BEFORE]: posed.why_no_before, KEYS[FIXED]: posed.found.why_no_fixed}
    return {
        "robot": posed.model.robot.name,
        "quantity": key,
        "aim": request.objective.aim,
        "points": request.task.path.n,
        "path_length_mm": number(float(posed.arc_mm[-1])),
        "gamma_grid_deg": {
            "from": number(float(np.degrees(request.gammas.lower))),
            "to": number(float(np.degrees(request.gammas.upper))),
            "count": request.gammas.count,
        },
        "gamma_counts_from": [number(float(v)) for v in np.asarray(request.task.reference)],
        "tool_on_flange": frame_words(request.task.T_flange_tool),
        "part_in_base": frame_words(request.task.T_base_part),
        "as_programmed_gamma_deg": number(float(np.degrees(request.before))),
        "all_solutions_found": posed.found.sure,
        "stiffness_uncertainty": arm_uncertainty(posed.stiffness),
        "courses": {name: _course(posed, *course, key, factor) for name, course in courses.items()},
        "gain": {KEYS[name]: estimated(posed.gain(name), 1.0) for name in posed.others},
        "not_found": {name: why for name, why in not_found.items() if why is not None},
    } | ({} if posed.milling is None else {"surface_error": milling(posed.milling, request.seed)})


def milling(found: MillingErrors, seed: int) -> dict[str, Any]:
    """Predicted surface errors with 95 % intervals, um, and whether the change can be told."""
    out: dict[str, Any] = {
        KEYS[name]: {
            f"{statistic}_um": estimated(value)
            for statistic, value in error.estimated(np.random.default_rng(seed)).items()
        }
        for name, error in found.errors.items()
    }
    if found.comparison is not None:
        out["against"] = KEYS[found.against or BEFORE]
        out["change"] = {
            name: {"verdict": c.verdict, "difference_um": estimated(c.difference), "factor": estimated(c.factor, 1.0)}
            for name, c in found.comparison.changes.items()
        }
        out["rests_on"] = list(found.comparison.notes)
    return out


def _course(posed: Posed, name: str, course: Course, key: str, factor: float) -> dict[str, Any]:
    moves, robot = course.smoothness, posed.model.robot
    mean, worst = posed.estimated(name)
    peak = np.degrees(moves.peak_speed)
    return {
        f"mean_{key}": number(course.mean * factor),
        f"mean_{key}_95": interval(mean, factor),
        f"worst_{key}": number(course.worst * factor),
        f"worst_{key}_95": interval(worst, factor),
        "gamma_deg": [number(float(v)) for v in np.degrees([course.gamma.min(), course.gamma.max()])],
        "branches": sorted({course.names[b] for b in course.branch}),
        "branch_changes": moves.branch_changes,
        "undrivable_segments": len(moves.undrivable),
        "largest_step_deg": _by_joint(robot.coordinates, np.degrees(moves.largest_step)),
        "peak_speed_deg_per_s": None if np.isnan(peak).all() else _by_joint(robot.coordinates, peak),
        "joint_travel_deg": number(float(np.degrees(moves.travel))),
        "least_distance_to_limit_deg": number(float(np.degrees(moves.limit_distance))),
        "least_distance_to_singularity": number(moves.singular_distance),
    }


def _by_joint(names: tuple[str, ...], values: Array) -> dict[str, float | None]:
    return {name.removesuffix("_deg"): number(float(v)) for name, v in zip(names, values, strict=True)}


def rows(posed: Posed) -> list[dict[str, Any]]:
    """One row a path point: where, the recommended posture, and the quantity of the other courses."""
    request, course, robot = posed.request, posed.course, posed.model.robot
    key, _, factor = quantity(request.objective)
    path = request.task.path
    limit = np.degrees(limit_distance(robot, course.q))
    singular = singular_distance(robot, course.q)
    out = []
    for i in range(path.n):
        row: dict[str, Any] = {"point": i, "path_mm": number(float(posed.arc_mm[i]), 9)}
        row |= {f"{a}_mm": number(float(v), 9) for a, v in zip("xyz", path.points[i] * 1e3, strict=True)}
        row["gamma_deg"] = number(float(np.degrees(course.gamma[i])), 9)
        row["branch"] = course.names[course.branch[i]]
        row |= {name: number(float(v), 10) for name, v in zip(robot.coordinates, np.degrees(course.q[i]), strict=True)}
        row[key] = number(float(course.value[i] * factor))
        row |= {f"{KEYS[name]}_{key}": number(float(c.value[i] * factor)) for name, c in posed.others.items()}
        if posed.milling is not None:
            for name, error in posed.milling.errors.items():
                prefix = "" if name == CHOSEN else f"{KEYS[name]}_"
                row[f"{prefix}error_um"] = number(float(error.normal[i] * 1e6))
                row[f"{prefix}error_sd_um"] = number(float(error.sd[i] * 1e6))
        row["limit_distance_deg"], row["singular_distance"] = number(float(limit[i])), number(float(singular[i]))
        out.append(row)
    return out
