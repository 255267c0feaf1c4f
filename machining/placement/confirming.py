"""A survey that can be drawn: what it bars no angle and no branch frees, what it leaves open is free at every point.

A coarse survey looks at some points of the path and at angles some degrees apart. Here every position is looked at
again: where it was barred, at angles :data:`STEP` apart and finer about the one that comes nearest; where it is free,
at all points of the path.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from machining.placement.freedom import best_merits, runs_of
from machining.placement.problem import Problem
from machining.placement.search import COARSE_ROWS, Look, Looker, Survey, look_of
from machining.placement.sweeping import Sites, sweep_sites
from machining.posture.points import GammaRange
from robots.arrays import Integers
from robots.inverse.solutions import why_no_closed_form
from robots.progress import Progress, report_progress

# Angles gamma that are looked at before a position is called barred are so far apart at most, rad.
STEP = np.radians(2.0)
# Rounds in which points of the path that bar a position join those that are looked at, and how many join at a time.
ROUNDS, JOIN = 8, 12


def confirmed(surveyed: Survey, progress: Progress | None = None) -> Survey:
    """The survey looked at again; as it is where poses are searched, not solved, and so never all known."""
    problem = surveyed.problem
    if why_no_closed_form(problem.model.robot) is not None:
        return surveyed
    fine = finely(problem)
    grid = []
    for done, look in enumerate(surveyed.grid):
        report_progress(progress, done, len(surveyed.grid))
        grid.append(_again(fine, look))
    return replace(surveyed, problem=fine, grid=tuple(grid), angles=len(fine.angles))


def finely(problem: Problem) -> Problem:
    """The problem with angles gamma at most :data:`STEP` apart, where it has a range of them."""
    if not isinstance(problem.gamma, GammaRange) or problem.gamma.cell <= STEP:
        return problem
    whole = problem.gamma
    return replace(problem, gamma=GammaRange.of_degrees(*np.degrees([whole.lower, whole.upper, STEP])))


def _again(problem: Problem, look: Look) -> Look:
    """One position looked at again."""
    coarse = problem.sure_rows(COARSE_ROWS)
    rows, looker = coarse, Looker(problem)
    if look.why:
        look = looker.at(look.x[None], rows)[0]
    for _ in range(ROUNDS):
        if look.why:
            return look
        sites, whole = _everywhere(problem, look)
        if not whole.why:
            assert whole.values is not None  # noqa: S101 - it is free
            return replace(whole, values=whole.values[np.searchsorted(sites.rows, coarse)])
        rows = np.union1d(rows, _in_between(problem, sites, whole)).astype(np.int64)
        look = looker.at(look.x[None], rows)[0]
    return whole


def _everywhere(problem: Problem, look: Look) -> tuple[Sites, Look]:
    """The position with its angle at all points of the path."""
    e, table = problem.space.sites(look.x[None])
    sites = sweep_sites(problem, e, table, np.arange(problem.path.n), np.array([look.gamma]))
    runs = runs_of(problem, sites)
    return sites, look_of(problem, look.x, sites, 0, runs, best_merits(problem, sites, runs)[0])


def _in_between(problem: Problem, sites: Sites, look: Look) -> Integers:
    """Points of the path that bar a position which looked free without them, some of them."""
    if look.stopped is not None:
        return np.array([look.stopped.point])
    start = runs_of(problem, sites).start
    lost = []
    for a, b in zip(start, [*start[1:], len(sites.rows)], strict=True):
        valid = sites.valid[0, 0, :, a:b]
        lost.append(a + np.flatnonzero(~valid[int(valid.sum(axis=1).argmax())]))
    every = np.concatenate(lost)
    return every[:: max(1, len(every) // JOIN)]
