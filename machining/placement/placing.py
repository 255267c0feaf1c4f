"""Place a robot on its linear axes: at rest, in a few steps, or moving along the path; beside where it stands now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np

from machining.cutting.each_tool import ForceOfEach
from machining.placement.between import undriven
from machining.placement.confirming import confirmed, finely
from machining.placement.following import Along, Found, along, follow, merit_of
from machining.placement.holding import held
from machining.placement.moving import find_moving
from machining.placement.problem import Problem
from machining.placement.search import FINE_ROWS, Looker, Survey, find_fixed, find_staying, refined, survey
from machining.placement.space import start_of
from machining.placement.steps import Cut, check_cuts, find_steps
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from machining.stiffness.criterion import Criterion
from robots import InputError, require_at_least, require_one_of
from robots.arrays import Array, Integers
from robots.progress import Progress

Mode = Literal["fixed", "steps", "moving"]
MODES: tuple[Mode, ...] = ("fixed", "steps", "moving")
# Called with what is being done, and (done, total) of it.
Said = Callable[[str, int, int], None]
# First step (m) of the search about the position of one piece of the path.
PIECE_STEP = 0.1
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class How:
    """How the base may move.

    ``mode``: "fixed", one position; "steps", at most ``steps`` of them, each move worth ``cost`` of the merit at least,
    at rapid moves or ``anywhere``; "moving", along the path, axes held still in each cut where all of that costs no
    more than the share ``cost`` of the merit. ``course``: let gamma follow a course along the path too, where that is
    better.

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
        require_one_of("mode of the placement", self.mode, MODES, code="G004")
        require_at_least("steps of the base", self.steps, 2, code="G004", remedy="or mode fixed")
        require_at_least("cost of moving the base, a share of the merit", self.cost, 0.0, code="G004")


@dataclass(frozen=True, eq=False)
class Placed:
    """A placement, beside where the robot stands now.

    ``before``: the axes at 0 (or mid-range) and gamma 0; None where ``why_no_before`` says why. ``staying``: the same
    place with its best gamma; ``why_no_staying``. ``fixed``: the best
    position at rest where the mode is another; ``why_no_fixed``. ``first`` (s,): path points at which the base starts
    to stand elsewhere, 0 first. ``survey``: the coarse grid. ``evaluations``: base positions looked at, each
    over the path. ``notes``: what a user should know.
    """

    problem: Problem
    how: How
    after: Along
    before: Along | None
    why_no_before: str | None
    staying: Along | None
    why_no_staying: str | None
    fixed: Along | None
    why_no_fixed: str | None
    first: Integers
    survey: Survey
    evaluations: int
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Choice:
    """Base positions e (n, k) m, the turntable's angle rad, the course, and where pieces start."""

    e: Array
    table: float
    course: Course
    first: Integers

    @property
    def ends(self) -> list[int]:
        """Points (s,) before which pieces end."""
        return [*self.first[1:].tolist(), len(self.e)]


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
        raise InputError(
            "course of gamma", code="G004", value="one angle", allowed="a range of angles", remedy="give a range"
        )
    if how.mode == "steps":
        check_cuts(problem, how.anywhere)
    surveyed = survey(problem)
    if all(look.why for look in surveyed.grid):
        # Angles between those of the range may be free where these are not.
        surveyed = confirmed(surveyed, _named(said, "position"))
    problem = surveyed.problem
    fixed, why_no_fixed = _or_why(lambda: find_fixed(problem, surveyed, _named(said, "position")), how.mode != "fixed")
    count = len(surveyed.grid) if fixed is None else fixed.evaluations
    rest = None if fixed is None else _standing(problem, fixed.x[None], fixed.course)
    notes: list[str] = []
    if how.mode == "fixed":
        assert rest is not None  # noqa: S101 - it is not optional
        chosen, looked = rest, 0
    elif how.mode == "steps":
        chosen, looked = _in_steps(problem, how, fixed, rest, notes, _named(said, "steps"))
    else:
        chosen, looked = _moving(problem, how, fixed, rest, notes, _named(said, "motion"))
    if how.course:
        chosen = _with_course(problem, chosen, notes)
    e, table = start_of(problem.space)
    before, why_no_before = _or_why(lambda: follow(problem, e, table, 0.0))
    staying, why_no_staying = _or_why(lambda: find_staying(problem, e, table))
    if staying is None and isinstance(problem.gamma, GammaRange):
        # Angles between those of the range may be free where these are not.
        staying, _ = _or_why(lambda: find_staying(finely(problem), e, table))
        why_no_staying = why_no_staying if staying is None else None
    criterion = problem.goal.criterion or _comparable(problem, chosen)

    def told(one: _Choice) -> Along:
        return along(problem, one.e, one.table, one.course, criterion)

    return Placed(
        problem=problem,
        how=how,
        after=told(chosen),
        before=None if before is None else along(problem, _at_all(problem, e), table, before, criterion),
        why_no_before=why_no_before,
        staying=None if staying is None else along(problem, _at_all(problem, e), table, staying.course, criterion),
        why_no_staying=why_no_staying,
        fixed=None if rest is None or how.mode == "fixed" else told(rest),
        why_no_fixed=why_no_fixed,
        first=chosen.first,
        survey=surveyed,
        evaluations=count + looked,
        notes=tuple(notes),
    )


def _require_driven(problem: Problem, choice: _Choice) -> None:
    """Raise InputError where moves between the cuts cannot be driven, not with rapid moves as joint motion either."""
    fault = undriven(problem, choice.e, choice.table, choice.course)
    if fault is not None and undriven(problem, choice.e, choice.table, choice.course, "joint") is not None:
        raise fault


def _named(said: Said | None, what: str) -> Progress | None:
    return None if said is None else lambda done, total: said(what, done, total)


def _or_why(find: Callable[[], T], optional: bool = True) -> tuple[T | None, str | None]:
    """What is found, or why there is none where that is ``optional``."""
    try:
        return find(), None
    except InputError as error:
        if not optional:
            raise
        return None, error.prose


def _at_all(problem: Problem, e: Array) -> Array:
    """Travels (n, k) m at all points, from those at rest (k,) or (1, k), or point by point."""
    return np.broadcast_to(e, (problem.path.n, e.shape[-1]))


def _standing(problem: Problem, x: Array, course: Course, first: Integers | None = None) -> _Choice:
    """The choice of coordinates x (1, d) at rest, or (n, d) point by point."""
    e, table = problem.space.sites(x)
    return _Choice(_at_all(problem, e), float(table[0]), course, np.zeros(1, np.int64) if first is None else first)


def _comparable(problem: Problem, chosen: _Choice) -> Criterion:
    """Weights of K_sf where it was not the aim, so that it can be told all the same."""
    stiff, rows = replace(problem, goal=replace(problem.goal, aim="mean")), np.arange(problem.path.n)
    task, objective = stiff.looked_at(chosen.e, chosen.table, rows)
    k = objective.values(problem.arm, chosen.course.q, task, rows)
    return Criterion.comparable(float(f"{k.mean():.1e}"), problem.path.n)


def _resting_table(problem: Problem, fixed: Found | None) -> tuple[Problem, Array | None]:
    """Steps and motion are those of linear axes: the turntable rests where it is best for one position.

    Besides, the coordinates (1, d) of that position.
    """
    space = problem.space
    if space.turns:
        if not space.free:
            raise InputError(
                "base in steps or moving",
                code="G005",
                value="only the turntable has a range",
                allowed="a linear axis with a range",
            )
        at = space.table if fixed is None else float(fixed.x[-1])
        problem = replace(problem, space=space.without_table(at))
    return problem, None if fixed is None else fixed.x[None, : problem.space.d]


def _in_steps(
    problem: Problem, how: How, fixed: Found | None, rest: _Choice | None, notes: list[str], progress: Progress | None
) -> tuple[_Choice, int]:
    resting, also = _resting_table(problem, fixed)
    cuts = find_steps(resting, how.steps, anywhere=how.anywhere, cost=how.cost, also=also, progress=progress)
    count, error = cuts[0].evaluations, InputError("base moved in steps", code="G006")
    for number, cut in enumerate(cuts):
        try:
            choice, looked = _drive_pieces(resting, cut)
            _require_driven(problem, choice)
        except InputError as fault:
            error = fault if number == 0 else error
            continue
        count += looked
        merit = merit_of(problem, choice.course)
        net = merit - (len(choice.first) - 1) * how.cost * abs(merit)
        if rest is not None and net <= merit_of(problem, rest.course):
            break
        return choice, count
    if rest is None:
        raise error
    notes.append(f"Moving the base brings less than {100.0 * how.cost:g} % a time: one position is taken.")
    return rest, count


def _drive_pieces(problem: Problem, cut: Cut) -> tuple[_Choice, int]:
    """Each piece's position refined by itself, kept where the whole gains; driven over all points."""
    ends = [*cut.first[1:], problem.path.n]
    x, count = cut.x.copy(), 0
    courses = []
    for i, (a, b) in enumerate(zip(cut.first, ends, strict=True)):
        rows = np.arange(a, b)
        trials = [(x[i], float(cut.gamma[i]))]
        if len(rows) > 2:
            looker = Looker(_piece(problem, rows))
            start = looker.at(x[i][None], looker.problem.sure_rows(FINE_ROWS))[0]
            look = refined(looker, start, np.full(problem.space.d, PIECE_STEP))
            if look.rank[0]:
                trials.append((look.x, look.gamma))
            count += looker.count
        course, x[i] = _best_of(problem, rows, trials)
        courses.append(course)
    points = np.repeat(x, np.diff([*cut.first, problem.path.n]), axis=0)
    return _standing(problem, points, _joined(courses), np.asarray(cut.first)), count


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
    force, goal = problem.goal.force, problem.goal
    return replace(
        problem,
        path=problem.home.at(rows).path,
        goal=replace(goal, force=force.at(force.tool[rows])) if isinstance(force, ForceOfEach) else goal,
        tools=None if problem.tools is None else problem.tools.at(rows),
        free=None if problem.free is None else problem.free[rows[0] : rows[-1]],
        reference=problem.home.reference,
        links=None,
    )


def _joined(courses: list[Course]) -> Course:
    """Courses of pieces as one; costs and motion are those of the first and mean nothing for the whole."""
    first = courses[0]
    return replace(
        first,
        gamma=np.concatenate([c.gamma for c in courses]),
        q=np.concatenate([c.q for c in courses]),
        value=np.concatenate([c.value for c in courses]),
        branch=np.concatenate([c.branch for c in courses]),
    )


def _moving(
    problem: Problem, how: How, fixed: Found | None, rest: _Choice | None, notes: list[str], progress: Progress | None
) -> tuple[_Choice, int]:
    resting, also = _resting_table(problem, fixed)
    gamma = None if fixed is None else float(fixed.gamma)
    enough = -np.inf if rest is None else merit_of(problem, rest.course)
    try:
        moved = find_moving(resting, also, gamma, enough, progress)
    except InputError as error:
        if rest is None:
            raise
        notes.append(f"The base stays at rest, because no motion was found: {error.prose}.")
        return rest, 0
    if rest is not None and moved.merit <= enough + how.cost * abs(enough):
        notes.append(f"Moving along the path brings no more than {100.0 * how.cost:g} % here: the base stays at rest.")
        return rest, moved.evaluations
    still, names = held(resting, moved, how.cost, progress)
    if names and (rest is None or still.merit > enough):
        given_up = 100.0 * (moved.merit - still.merit) / abs(moved.merit)
        notes.append(
            f"Holding still in each cut: {', '.join(names)}. Moving {'it' if len(names) == 1 else 'them'} along would "
            f"bring {given_up:.2g} % of the aim."
        )
        moved = still
    choice = _standing(resting, moved.x, moved.course)
    try:
        _require_driven(problem, choice)
    except InputError as error:
        if rest is None:
            raise
        notes.append(f"The base stays at rest, because moving between the cuts cannot be driven: {error.prose}.")
        return rest, moved.evaluations
    return choice, moved.evaluations


def _with_course(problem: Problem, chosen: _Choice, notes: list[str]) -> _Choice:
    """Gamma as a course along the path, piece by piece, where the whole gains by it."""
    pieces = [np.arange(a, b) for a, b in zip(chosen.first, chosen.ends, strict=True)]
    try:
        course = _joined([follow(problem, chosen.e[rows], chosen.table, None, rows) for rows in pieces])
        _require_driven(problem, replace(chosen, course=course))
    except InputError as error:
        notes.append(f"Gamma stays as it is, because no course of it was found: {error.prose}.")
        return chosen
    if merit_of(problem, course) <= merit_of(problem, chosen.course):
        notes.append("A course of gamma along the path brings nothing more.")
        return chosen
    return replace(chosen, course=course)
