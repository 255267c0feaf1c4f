"""Axes that move near and then hold still: of a motion along the path those axes that are not needed while cutting.

An axis that rests in a cut can be clamped, and adds neither its drive's error nor its speed to it. Of stacked axes as a
rule one has to move and the others bring little. Each is tried at rest over each run of cuts, moving between runs only;
what costs least is held, as long as all of it together costs no more than a share of the merit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from machining.placement.following import Found, check_rates, follow, merit_of
from machining.placement.freedom import run_starts
from machining.placement.problem import Problem
from robots import InputError
from robots.arrays import Array, Integers
from robots.progress import Progress, report_progress

# Where an axis is tried at rest: shares of the way it makes over a run, from its lowest to its highest place there.
PLACES = (0.5, 0.25, 0.75, 0.0, 1.0)
# An axis that moves less than this over every run (m) is at rest.
STILL = 1e-9


def held(
    problem: Problem, found: Found, cost: float, progress: Progress | None = None
) -> tuple[Found, tuple[str, ...]]:
    """The motion with axes held still over each run, and the names of those that are.

    Parameters
    ----------
    found : a motion along the path, coordinates (n, d)
    cost : share of the merit that may be given up, for all axes together
    """
    least = found.merit - cost * abs(found.merit)
    best, names = found, list[str]()
    left = [j for j in range(problem.space.d) if _moves(problem, found.x, j)]
    while left:
        report_progress(progress, problem.space.d - len(left), problem.space.d)
        trials = {j: _at_rest(problem, best, j) for j in left}
        kept = {j: one for j, one in trials.items() if one is not None and one.merit >= least}
        if not kept:
            break
        axis = max(kept, key=lambda j: kept[j].merit)
        best = kept[axis]
        left.remove(axis)
        names.append(problem.space.names[axis])
    return best, tuple(names)


def _moves(problem: Problem, x: Array, axis: int) -> bool:
    return any(np.ptp(run) > STILL for run in np.split(x[:, axis], _cuts(problem)))


def _cuts(problem: Problem) -> Integers:
    return run_starts(problem, np.arange(problem.path.n))[1:]


def _at_rest(problem: Problem, found: Found, axis: int) -> Found | None:
    """The best of the motions with one axis at rest over each run; None where none can be driven."""
    best: Found | None = None
    runs = np.split(np.arange(problem.path.n), _cuts(problem))
    for place in PLACES:
        x = found.x.copy()
        for run in runs:
            low, high = x[run, axis].min(), x[run, axis].max()
            x[run, axis] = low + place * (high - low)
        try:
            check_rates(problem, x)
            e, _ = problem.space.sites(x)
            course = follow(problem, e, problem.space.table, found.gamma)
        except InputError:
            continue
        merit = merit_of(problem, course)
        if best is None or merit > best.merit:
            best = replace(found, x=x, gamma=course.gamma, course=course, merit=merit)
    return best
