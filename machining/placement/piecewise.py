"""From a cut path to what is driven: each piece's position refined by itself, all points followed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from machining.placement.following import follow
from machining.placement.problem import Problem
from machining.placement.search import FINE_ROWS, Looker, refined
from machining.placement.steps import Cut
from machining.posture.problem import Course
from robots import InputError
from robots.arrays import Array, Integers

# First step (m) of the search about a piece's position.
PIECE_STEP = 0.1


@dataclass(frozen=True, eq=False)
class Choice:
    """Base positions e (n, k) m, the course, and where pieces start."""

    e: Array
    table: float
    course: Course
    first: Integers


def drive_pieces(problem: Problem, cut: Cut) -> tuple[Choice, int]:
    """Each piece's position refined by itself, kept where the whole gains; driven over all points."""
    n = problem.path.n
    ends = [*cut.first[1:], n]
    x, gamma, count = cut.x.copy(), cut.gamma.copy(), 0
    courses = []
    for i, (a, b) in enumerate(zip(cut.first, ends, strict=True)):
        rows = np.arange(a, b)
        trials = [(x[i], float(gamma[i]))]
        if len(rows) > 2:
            part = _piece(problem, rows)
            looker = Looker(part)
            look = refined(
                looker, looker.at(x[i][None], part.sure_rows(FINE_ROWS))[0], np.full(part.space.d, PIECE_STEP)
            )
            if look.rank[0]:
                trials.append((look.x, look.gamma))
            count += looker.count
        courses.append(_best_of(problem, rows, trials))
        x[i] = courses[-1][1]
    e, table = problem.space.sites(x)
    length = np.diff([*cut.first, n])
    whole = joined([course for course, _ in courses])
    return Choice(np.repeat(e, length, axis=0), float(table[0]), whole, np.asarray(cut.first)), count


def _best_of(problem: Problem, rows: Integers, trials: list[tuple[Array, float]]) -> tuple[Course, Array]:
    best: tuple[float, Course, Array] | None = None
    error: InputError | None = None
    share = problem.share[rows] / problem.share[rows].sum()
    for x, gamma in trials:
        e, table = problem.space.sites(x[None])
        try:
            course = follow(problem, e[0], float(table[0]), gamma, rows)
        except InputError as fault:
            error = error or fault
            continue
        merit = float(problem.goal.merit(course.value, share, problem.path.n))
        if best is None or merit > best[0]:
            best = merit, course, x
    if best is None:
        assert error is not None  # noqa: S101 - there is a trial
        raise error
    return best[1], best[2]


def _piece(problem: Problem, rows: Integers) -> Problem:
    """The problem of one piece of the path."""
    path = problem.home.at(rows).path
    free = None if problem.free is None else problem.free[rows[0] : rows[-1]]
    return replace(problem, path=path, free=free, reference=problem.home.reference)


def joined(courses: list[Course]) -> Course:
    """Courses of pieces as one; costs and motion are those of the first and mean nothing for the whole."""
    first = courses[0]
    return replace(
        first,
        gamma=np.concatenate([c.gamma for c in courses]),
        q=np.concatenate([c.q for c in courses]),
        value=np.concatenate([c.value for c in courses]),
        branch=np.concatenate([c.branch for c in courses]),
    )
