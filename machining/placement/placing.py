"""Place a robot on its linear axes: at rest, in a few steps, or moving along the path; beside where it stands now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from machining.placement.along import Along, along
from machining.placement.following import follow, merit_of
from machining.placement.moving import find_moving
from machining.placement.piecewise import Choice, drive_pieces, joined
from machining.placement.problem import Problem
from machining.placement.search import Found, Survey, find_fixed, survey
from machining.placement.space import start_of
from machining.placement.steps import check_cuts, find_steps
from machining.placement.sweeping import distances
from machining.posture.long_path import optimise_long_path
from machining.posture.points import GammaRange
from machining.stiffness.criterion import Criterion
from robots import InputError
from robots.arrays import Array, Integers
from robots.progress import Progress

Mode = Literal["fixed", "steps", "moving"]
MODES: tuple[Mode, ...] = ("fixed", "steps", "moving")
# Called with what is being done, and (done, total) of it.
Said = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class How:
    """How the base may move.

    ``mode``: "fixed", one position; "steps", at most ``steps`` of them, each move worth ``cost`` of the merit at least,
    at rapid moves or ``anywhere``; "moving", along the path. ``course``: let gamma follow a course along the path
    too, where that is better.

    Raises
    ------
    InputError
        No such mode, fewer than two steps, a cost that is negative, a course of a single gamma.
    """

    mode: Mode = "fixed"
    steps: int = 3
    anywhere: bool = False
    cost: float = 0.01
    course: bool = False

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise InputError("mode of the placement", value=self.mode, allowed=", ".join(MODES))
        if self.steps < 2:
            raise InputError("steps of the base", value=self.steps, allowed="2 or more", remedy="or mode fixed")
        if not (np.isfinite(self.cost) and self.cost >= 0.0):
            raise InputError("cost of moving the base", value=self.cost, allowed="0 or more, a share of the merit")


@dataclass(frozen=True, eq=False)
class Placed:
    """A placement, beside where the robot stands now.

    ``before``: the axes at 0 (or mid-range) and gamma 0; None where ``why_no_before`` says why. ``fixed``: the best
    position at rest where the mode is another; ``why_no_fixed``. ``first`` (s,): path points at which the base starts
    to stand elsewhere, 0 first. ``survey``: the coarse grid. ``evaluations``: base positions looked at, each
    over the path. ``notes``: what a user should know. ``criterion``: the weights of K_sf that all were judged by.
    """

    problem: Problem
    how: How
    after: Along
    before: Along | None
    why_no_before: str | None
    fixed: Along | None
    why_no_fixed: str | None
    first: Integers
    survey: Survey
    evaluations: int
    notes: tuple[str, ...]
    criterion: Criterion


def place(problem: Problem, how: How | None = None, said: Said | None = None) -> Placed:
    """Find the placement.

    Raises
    ------
    InputError
        As :func:`machining.placement.search.find_fixed`, :func:`machining.placement.steps.find_steps` and
        :func:`machining.placement.moving.find_moving`; an arm that cannot be moved along the path.
    """
    how = how or How()
    if how.course and not isinstance(problem.gamma, GammaRange):
        raise InputError("course of gamma", value="one angle", allowed="a range of angles", remedy="give a range")
    if how.mode == "steps":
        check_cuts(problem, how.anywhere)
    surveyed = survey(problem)
    problem = surveyed.problem
    fixed, why_no_fixed = _fixed(problem, surveyed, _named(said, "position"), optional=how.mode != "fixed")
    count = len(surveyed.grid) if fixed is None else fixed.evaluations
    rest = None if fixed is None else _at_rest(problem, fixed)
    notes: list[str] = []
    if how.mode == "fixed":
        assert rest is not None  # noqa: S101 - it is not optional
        chosen = rest
    elif how.mode == "steps":
        chosen, looked = _in_steps(problem, how, fixed, rest, notes, said)
        count += looked
    else:
        chosen, looked = _moving(problem, fixed, rest, notes, said)
        count += looked
    if how.course:
        chosen = _with_course(problem, chosen, notes)
    before, why_no_before = _before(problem)
    criterion = problem.goal.criterion or _comparable(problem, chosen)
    return Placed(
        problem=problem,
        how=how,
        after=_along(problem, chosen, criterion),
        before=None if before is None else _along(problem, before, criterion),
        why_no_before=why_no_before,
        fixed=None if rest is None or how.mode == "fixed" else _along(problem, rest, criterion),
        why_no_fixed=why_no_fixed,
        first=chosen.first,
        survey=surveyed,
        evaluations=count,
        notes=tuple(notes),
        criterion=criterion,
    )


def _named(said: Said | None, what: str) -> Progress | None:
    return None if said is None else lambda done, total: said(what, done, total)


def _fixed(
    problem: Problem, surveyed: Survey, progress: Progress | None, *, optional: bool
) -> tuple[Found | None, str | None]:
    try:
        return find_fixed(problem, surveyed, progress), None
    except InputError as error:
        if not optional:
            raise
        return None, str(error)


def _at_rest(problem: Problem, found: Found) -> Choice:
    e, table = problem.space.sites(found.x[None])
    return Choice(np.tile(e, (problem.path.n, 1)), float(table[0]), found.course, np.zeros(1, dtype=np.int64))


def _before(problem: Problem) -> tuple[Choice | None, str | None]:
    e, table = start_of(problem.space)
    try:
        course = follow(problem, e, table, 0.0)
    except InputError as error:
        return None, str(error)
    return Choice(np.tile(e, (problem.path.n, 1)), table, course, np.zeros(1, dtype=np.int64)), None


def _comparable(problem: Problem, chosen: Choice) -> Criterion:
    """Weights of K_sf where it was not the aim, so that it can be told all the same."""
    stiff = replace(problem, goal=replace(problem.goal, aim="mean"))
    task, objective = stiff.looked_at(problem.task_at(chosen.e, chosen.table), problem.forces(chosen.table))
    k = objective.values(problem.arm, chosen.course.q, task, np.arange(problem.path.n))
    return Criterion.comparable(float(f"{k.mean():.1e}"), problem.path.n)


def _along(problem: Problem, chosen: Choice, criterion: Criterion) -> Along:
    return along(problem, chosen.e, chosen.table, chosen.course, criterion)


def _resting_table(problem: Problem, fixed: Found | None) -> Problem:
    """Steps and motion are those of linear axes: the turntable rests where it is best for one position."""
    space = problem.space
    if not space.turns:
        return problem
    if not space.free:
        raise InputError(
            "base in steps or moving", value="only the turntable has a range", allowed="a linear axis with a range"
        )
    at = space.table if fixed is None else float(fixed.x[-1])
    return replace(problem, space=space.without_table(at))


def _also(problem: Problem, fixed: Found | None) -> Array | None:
    return None if fixed is None else fixed.x[None, : problem.space.d]


def _in_steps(
    problem: Problem, how: How, fixed: Found | None, rest: Choice | None, notes: list[str], said: Said | None
) -> tuple[Choice, int]:
    resting = _resting_table(problem, fixed)
    cuts = find_steps(
        resting, how.steps, anywhere=how.anywhere, cost=how.cost, also=_also(resting, fixed),
        progress=_named(said, "steps"),
    )  # fmt: skip
    count, error = cuts[0].evaluations, InputError("base moved in steps")
    for number, cut in enumerate(cuts):
        try:
            choice, looked = drive_pieces(resting, cut)
        except InputError as fault:
            error = fault if number == 0 else error
            continue
        count += looked
        if rest is not None and _net(how, choice, resting) <= _merit(problem, rest):
            break
        return choice, count
    if rest is None:
        raise error
    notes.append(f"Moving the base brings less than {100.0 * how.cost:g} % a time: one position is taken.")
    return rest, count


def _net(how: How, choice: Choice, problem: Problem) -> float:
    merit = _merit(problem, choice)
    return merit - (len(choice.first) - 1) * how.cost * abs(merit)


def _merit(problem: Problem, choice: Choice) -> float:
    return merit_of(problem, choice.course)


def _moving(
    problem: Problem, fixed: Found | None, rest: Choice | None, notes: list[str], said: Said | None
) -> tuple[Choice, int]:
    resting = _resting_table(problem, fixed)
    gamma = None if fixed is None else fixed.gamma
    try:
        enough = -np.inf if rest is None else _merit(problem, rest)
        moved = find_moving(resting, _also(resting, fixed), gamma, enough, _named(said, "motion"))
    except InputError as error:
        if rest is None:
            raise
        notes.append(f"The base stays at rest, because no motion was found: {error}.")
        return rest, 0
    if rest is not None and moved.merit <= _merit(problem, rest):
        notes.append("Moving along the path brings nothing here: the base stays at rest.")
        return rest, moved.evaluations
    e, table = resting.space.sites(moved.x)
    return Choice(e, float(table[0]), moved.course, np.zeros(1, dtype=np.int64)), moved.evaluations


def _clearance(problem: Problem, table: float, e: Array, q: Array) -> Array:
    return distances(problem, q, e, table)


def _with_course(problem: Problem, chosen: Choice, notes: list[str]) -> Choice:
    """Gamma as a course along the path, piece by piece, where the whole gains by it."""
    assert isinstance(problem.gamma, GammaRange)  # noqa: S101 - place has seen to it
    task, objective = problem.looked_at(problem.task_at(chosen.e, chosen.table), problem.forces(chosen.table))
    objective = replace(objective, aim="worst" if problem.goal.aim == "worst" else "mean")
    courses = []
    try:
        for a, b in zip(chosen.first, [*chosen.first[1:], problem.path.n], strict=True):
            rows = np.arange(a, b)
            force = objective.force
            part = replace(objective, force=None if force is None else force[rows])
            free = None if problem.free is None or b - a < 2 else problem.free[a : b - 1]
            drive = problem.drive
            if problem.scene is not None and not np.ptp(chosen.e[rows], axis=0).any():
                drive = replace(
                    drive,
                    clearance_of=partial(_clearance, problem, chosen.table, chosen.e[a]),
                    clearance_least=problem.clearance,
                )
            courses.append(optimise_long_path(problem.arm, task.at(rows), part, problem.gamma, drive, free=free).course)
    except InputError as error:
        notes.append(f"Gamma stays as it is, because no course of it was found: {error}.")
        return chosen
    found = replace(chosen, course=joined(courses))
    collides = (distances(problem, found.course.q, found.e, found.table) < problem.clearance).any()
    if collides or _merit(problem, found) <= _merit(problem, chosen):
        notes.append("A course of gamma along the path brings nothing more.")
        return chosen
    return found
