"""A posture in words, for the terminal and for the page."""

from __future__ import annotations

import numpy as np

from machining.posture.posing import CHOSEN, Posed
from stiffarm.pages.arm_uncertainty import error_remarks, share_remarks


def gain_words(posed: Posed, name: str) -> str:
    """By how much the recommended course is better in the mean than another, with its 95 % interval."""
    gain = posed.gain(name)
    ends = (gain.value, gain.low, gain.high)
    if not np.isfinite(gain.value) or gain.value >= 3.0:
        said = [f"{factor:.3g}" for factor in ends]
        return f"{said[0]} times better ({said[1]} to {said[2]})"
    said = [f"{100.0 * (factor - 1.0):+.1f}" for factor in ends]
    return f"{said[0]} % ({said[1]} to {said[2]})"


def mean_interval(posed: Posed, name: str, factor: float) -> str:
    """95 % interval of a course's mean."""
    mean, _ = posed.estimated(name)
    return f"{mean.low * factor:.3g} to {mean.high * factor:.3g}"


def remarks(posed: Posed) -> list[str]:
    """What a user must know about the result."""
    request, moves = posed.request, posed.course.smoothness
    out = []
    if posed.why_no_before is not None:
        out.append(
            f"As programmed (gamma {np.degrees(request.before):.4g} deg) it cannot be driven: {posed.why_no_before}."
        )
    if posed.found.why_no_fixed is not None:
        out.append(f"No single gamma can be driven along the whole path: {posed.found.why_no_fixed}.")
    if request.left_out:
        out.append(f"Effects of the model that are not in this: {', '.join(request.left_out)}.")
    if request.drive.speed is None:
        out.append("Joint speeds were not looked at: give --speed, or a cell file with joint speeds.")
    elif np.isnan(request.task.path.times).any():
        out.append("Points without a feed: between them joint speeds could not be looked at.")
    if request.drive.clearance_of is None:
        out.append("Collisions were not looked at: give a cell file with --cell.")
    if posed.milling is None:
        out.append("No error was predicted: give --force or --milling.")
    if not posed.found.sure:
        out.append("This arm's inverse kinematics is searched; some postures may have been missed.")
    if moves.singular_distance < request.drive.singular_zone:
        out.append(f"The course comes near a singularity (distance {moves.singular_distance:.2g}).")
    if moves.limit_distance < request.drive.limit_zone:
        out.append(f"The course comes within {np.degrees(moves.limit_distance):.3g} deg of a joint limit.")
    if posed.milling is not None and posed.milling.comparison is not None:
        change = posed.milling.comparison.changes["rms"]
        if change.verdict == "larger" and not request.objective.minimised:
            out.append(
                f"This course is better in {request.objective.quantity} and yet leaves a larger error under the force "
                'given: for the error itself ask for --quantity "normal displacement".'
            )
    out += share_remarks(posed.drawn[CHOSEN].matters, f"the mean {request.objective.quantity}")
    out += [] if posed.milling is None else error_remarks(posed.milling.errors[CHOSEN])
    if moves.branch_changes:
        out.append(
            f"The course changes its branch {moves.branch_changes} times, through poses where two branches meet."
        )
    return out
