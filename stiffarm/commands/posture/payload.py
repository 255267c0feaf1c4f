"""A posture along a path as JSON, as columns of a table, and in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from machining import Course, Objective, limit_distance, singular_distance
from machining.posture.posing import BEFORE, CHOSEN, EACH, FIXED, MillingErrors, Posed
from machining.stiffness.objective import ROOM, shown
from machining.task import ToolPath
from robots import Remark, Robot
from robots.arrays import Array
from robots.inverse.elbow_angle import elbow_angle
from robots.inverse.following import is_redundant
from robots.quantities import rounded, rounded_all, significant
from stiffarm.pages.arm_uncertainty import error_remarks, estimated, interval, share_remarks
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.session.parsing import frame_words, tool_words

KEYS = {CHOSEN: "recommended", BEFORE: "as_programmed", FIXED: "fixed_gamma", EACH: "each_point"}


def quantity(objective: Objective) -> tuple[str, str, float]:
    """Key with unit, words with unit, and the factor from SI to that unit."""
    it = shown(objective.quantity)
    return it.column, it.heading, it.factor


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
        "path_length_mm": rounded(float(1e3 * request.task.path.arc_length[-1])),
        "gamma_grid_deg": {
            "from": rounded(float(np.degrees(request.gammas.lower))),
            "to": rounded(float(np.degrees(request.gammas.upper))),
            "count": request.gammas.count,
        },
        "gamma_counts_from": rounded_all(np.asarray(request.task.reference)),
        "tool_on_flange": tool_words(request.task.T_flange_tool),
        "part_in_base": frame_words(request.task.T_base_part),
        "as_programmed_gamma_deg": rounded(float(np.degrees(request.before))),
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
        f"mean_{key}": rounded(course.mean * factor),
        f"mean_{key}_95": interval(mean, factor),
        f"worst_{key}": rounded(course.worst * factor),
        f"worst_{key}_95": interval(worst, factor),
        "gamma_deg": rounded_all(np.degrees([course.gamma.min(), course.gamma.max()])),
        "branches": sorted({course.names[b] for b in course.branch}),
        **elbow_range(robot, course.q),
        "branch_changes": moves.branch_changes,
        "undrivable_segments": len(moves.undrivable),
        "largest_step_deg": _by_joint(robot.coordinates, np.degrees(moves.largest_step)),
        "peak_speed_deg_per_s": None if np.isnan(peak).all() else _by_joint(robot.coordinates, peak),
        "joint_travel_deg": rounded(float(np.degrees(moves.travel))),
        "least_distance_to_limit_deg": rounded(float(np.degrees(moves.limit_distance))),
        "least_distance_to_singularity": rounded(moves.singular_distance),
    }


def _by_joint(names: tuple[str, ...], values: Array) -> dict[str, float | None]:
    return dict(zip((name.removesuffix("_deg") for name in names), rounded_all(values), strict=True))


def path_columns(path: ToolPath) -> dict[str, list[Any]]:
    """Columns of where the path's points are, mm."""
    places = 1e3 * np.column_stack([path.arc_length, path.points]).T
    return {
        name: rounded_all(column, 9) for name, column in zip(("path_mm", "x_mm", "y_mm", "z_mm"), places, strict=True)
    }


def posture_columns(robot: Robot, course: Course) -> dict[str, list[Any]]:
    """Columns of a course: gamma, branch, joints."""
    joints = zip(robot.coordinates, np.degrees(course.q).T, strict=True)
    elbow = elbow_angle(robot, course.q)
    return {
        "gamma_deg": rounded_all(np.degrees(course.gamma), 9),
        **({} if elbow is None else {"elbow_deg": rounded_all(np.degrees(elbow), 9)}),
        "branch": [course.names[b] for b in course.branch],
        **{name: rounded_all(column, 10) for name, column in joints},
    }


def elbow_range(robot: Robot, q: Array) -> dict[str, list[float | None]]:
    """Least and largest angle of the elbow of a seven-axis arm at poses q (n, dof) rad; nothing of other arms."""
    elbow = elbow_angle(robot, q)
    return {} if elbow is None else {"elbow_deg": rounded_all(np.degrees([elbow.min(), elbow.max()]))}


def columns(posed: Posed) -> dict[str, list[Any]]:
    """Columns over the path's points: where, the recommended posture, and the quantity of the other courses."""
    request, course, robot = posed.request, posed.course, posed.model.robot
    key, _, factor = quantity(request.objective)
    path = request.task.path
    out = {"point": list(range(path.n)), **path_columns(path), **posture_columns(robot, course)}
    out[key] = rounded_all(course.value * factor)
    out |= {f"{KEYS[name]}_{key}": rounded_all(c.value * factor) for name, c in posed.others.items()}
    for name, error in {} if posed.milling is None else posed.milling.errors.items():
        prefix = "" if name == CHOSEN else f"{KEYS[name]}_"
        out |= {
            f"{prefix}error_um": rounded_all(error.normal * 1e6),
            f"{prefix}error_sd_um": rounded_all(error.sd * 1e6),
        }
    out["limit_distance_deg"] = rounded_all(np.degrees(limit_distance(robot, course.q)))
    out["singular_distance"] = rounded_all(singular_distance(robot, course.q))
    return out


def course_cells(posed: Posed, name: str, course: Course) -> tuple[str, ...]:
    """Cells of a course in tables: name, mean, its 95 % interval, worst point, range of gamma."""
    _, _, factor = quantity(posed.request.objective)
    mean, _ = posed.estimated(name)
    gamma = np.degrees([course.gamma.min(), course.gamma.max()])
    known = posed.request.objective.quantity != ROOM
    return (
        name,
        significant(course.mean * factor, 4),
        f"{significant(mean.low * factor)} to {significant(mean.high * factor)}" if known else "",
        significant(course.worst * factor, 4),
        f"{gamma[0]:.4g}" if np.ptp(gamma) < 1e-6 else f"{gamma[0]:.4g} to {gamma[1]:.4g}",
    )


def gain_words(posed: Posed, name: str) -> str:
    """By how much the recommended course is better in the mean than another, with its 95 % interval."""
    gain = posed.gain(name)
    ends = (gain.value, gain.low, gain.high)
    if not np.isfinite(gain.value) or gain.value >= 3.0:
        said = [f"{factor:.3g}" for factor in ends]
        return f"{said[0]} times better ({said[1]} to {said[2]})"
    said = [f"{100.0 * (factor - 1.0):+.1f}" for factor in ends]
    if posed.request.objective.quantity == ROOM:
        return f"{said[0]} %"
    return f"{said[0]} % ({said[1]} to {said[2]})"


def remarks(posed: Posed) -> list[str]:
    """What a user must know about the result."""
    request, moves = posed.request, posed.course.smoothness
    out: list[str] = []
    if posed.why_no_before is not None:
        out.append(
            Remark(
                f"As programmed (gamma {np.degrees(request.before):.4g} deg) the arm cannot follow the path: "
                f"{posed.why_no_before}.",
                code="W049",
            )
        )
    if posed.found.why_no_fixed is not None:
        out.append(f"With no single gamma can the arm follow the whole path: {posed.found.why_no_fixed}.")
    if posed.course.forgone is not None:
        out.append(
            f"Gamma is constant: turning it along the path would gain {100.0 * posed.course.forgone:.2g} % only "
            f"(--turn-gain {100.0 * request.drive.turn_gain:.3g})."
        )
    if request.left_out:
        out.append(f"Effects of the model that are not included: {', '.join(request.left_out)}.")
    if request.drive.speed is None:
        out.append(
            Remark("Joint speeds were not checked: give --speed, or a cell file with joint speeds.", code="W034")
        )
    elif np.isnan(request.task.path.times).any():
        out.append(Remark("Some points have no feed: between them joint speeds could not be checked.", code="W034"))
    if request.drive.clearance_of is None and request.drive.clearance_at is None:
        out.append(Remark("Collisions were not checked: no shape of the arm is known.", code="W033"))
    if posed.milling is None and request.objective.quantity != ROOM:
        out.append("No error was predicted: give --force or --milling.")
    if is_redundant(posed.model.robot):
        out.append(
            Remark(
                f"This arm reaches each point in postures without number: some of them, found from random starts, were "
                f"followed along the path, and the {posed.course.names[0]} was chosen together with gamma; some "
                "postures may have been missed.",
                code="W044",
            )
        )
    elif not posed.found.sure:
        out.append(
            Remark("This arm's inverse kinematics is searched; some postures may have been missed.", code="W044")
        )
    if moves.singular_distance < request.drive.singular_zone:
        out.append(
            Remark(f"The course comes near a singularity (distance {moves.singular_distance:.2g}).", code="W035")
        )
    if moves.limit_distance < request.drive.limit_zone:
        out.append(
            Remark(f"The course comes within {np.degrees(moves.limit_distance):.3g} deg of a joint limit.", code="W036")
        )
    if posed.milling is not None and posed.milling.comparison is not None:
        change = posed.milling.comparison.changes["rms"]
        if change.verdict == "larger" and not request.objective.minimised:
            out.append(
                Remark(
                    f"This course is better in {request.objective.quantity} and yet leaves a larger error under the "
                    'force given: to optimise the error itself, use --quantity "normal displacement".',
                    code="W046",
                )
            )
    out += share_remarks(posed.drawn[CHOSEN].matters, f"the mean {request.objective.quantity}")
    out += [] if posed.milling is None else error_remarks(posed.milling.errors[CHOSEN])
    if moves.branch_changes:
        out.append(
            Remark(
                f"The course changes its branch {moves.branch_changes} times, through poses where two branches meet.",
                code="W035",
            )
        )
    return out
