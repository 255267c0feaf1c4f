"""The best course through the states of a path, found stretch by stretch, so that paths of any length can be followed.

With gamma given, a path of a million points has more than 1 GB of states. Those of a stretch are made when they are
needed: on the way out, for the cost of reaching each, and again on the way back, for the course. In between only the
numbers of the states that lead there are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

import fem
from machining.posture.courses import Ahead, Gap, Layers, Links, floors, least_cost, summed, trace
from machining.posture.drive import Drive
from machining.posture.points import FIVE, GammaRange, Postures, Sweep, sweep_about, sweep_gamma
from machining.posture.problem import (
    Course,
    Problem,
    States,
    allowed_states,
    at_knots,
    at_points,
    course_of,
    ends_of,
    gap_error,
    is_better,
    least_rate,
    none_left,
    problem_of,
    states_of,
    ways_of,
)
from machining.stiffness.objective import Objective
from machining.task import Task
from machining.toolpaths.path_error import PathError
from robots import Robot
from robots.arrays import Array, Bools, Integers, in_blocks
from robots.inverse.following import STRIDE, is_redundant
from robots.inverse.spherical_wrist import why_not_spherical

# Points of a stretch, and of the longest path whose sweep is kept.
POINTS, KEPT = 8_192, 131_072
# Of an arm whose elbow can turn: least knots of its course, finer courses about the first, rad that its fastest joint
# is turned by in the first of them, and at the points between the knots.
KNOTS, PASSES, ELBOW, WIGGLE = 300, 4, 0.25, 0.03
# Cost of a joint at the end of its range, only to decide between courses that are alike: far below what matters, far
# above rounding.
TIE = 1e-8
# Makes the states of a stretch.
Stretch = Callable[[], States]


def solve(problem: Problem, states: States, links: Links) -> Course | Gap:
    """Best course through the states of a whole path, or where there is none."""
    return solve_along(problem, [lambda: states], links)


def solve_along(problem: Problem, stretches: Sequence[Stretch], links: Links) -> Course | Gap:
    """Best course through the states of stretches that follow one another, or where there is none."""
    if problem.objective.aim == "worst":
        found = _ahead(stretches, links, floors, lambda first: first.merit[first.rows(0)])
        if isinstance(found, Gap):
            return found
        floor = float(found[-1].value.max())
        stretches = [_above(stretch, floor) for stretch in stretches]
    ahead = _ahead(stretches, links, least_cost, lambda first: _first_cost(problem.model.robot, first))
    return ahead if isinstance(ahead, Gap) else course_of(problem, *_back(stretches, ahead))


def _above(stretch: Stretch, floor: float) -> Stretch:
    def states() -> States:
        found = stretch()
        return found.kept(np.asarray(found.layers.merit >= floor))

    return states


def _ahead(
    stretches: Sequence[Stretch],
    links: Links,
    step: Callable[[Layers, Links, Array], Ahead | Gap],
    start: Callable[[Layers], Array],
) -> list[Ahead] | Gap:
    """What is known at the end of each stretch; ``start``: the values of the states of the first layer."""
    found: list[Ahead] = []
    before: Layers | None = None
    first = 0
    for stretch in stretches:
        layers = stretch().layers
        joined = layers if before is None else layers.behind(before)
        value = start(layers) if before is None else found[-1].value
        segments = slice(first if before is None else first - 1, first + layers.n - 1)
        ahead = step(joined, links.at(segments), value)
        if isinstance(ahead, Gap):
            return replace(ahead, after=ahead.after + segments.start)
        found.append(ahead)
        before, first = layers, first + layers.n
    return found


def _first_cost(robot: Robot, layers: Layers) -> Array:
    """Costs of the states of the first layer.

    Of turns that are equally good all along, those nearest to the middle of the joints' ranges cost least: else
    rounding would choose, and the next program or the way home might run into a limit.
    """
    half = np.where(np.isfinite(robot.limits).all(axis=1), 0.5 * np.diff(robot.limits, axis=1)[:, 0], np.inf)
    middle = np.where(np.isinf(half), 0.0, robot.limits.mean(axis=1))
    rows = layers.rows(0)
    away = (((layers.q[rows] - middle) / np.maximum(half, 1e-9)) ** 2).mean(axis=1)
    return np.asarray(layers.cost[rows] + TIE * away)


def _back(stretches: Sequence[Stretch], ahead: Sequence[Ahead]) -> tuple[Postures, Array]:
    """The cheapest course, and the costs (n,) of its states."""
    last = int(np.argmin(ahead[-1].value))
    parts: list[Postures] = []
    costs: list[Array] = []
    for i in range(len(stretches) - 1, -1, -1):
        states = stretches[i]()
        start = states.layers.start
        # The last layer of the stretch before stood in front.
        size = len(ahead[i - 1].value) if i else 0
        course = trace(np.append(0, start + size) if i else start, ahead[i].source, last)
        last, course = int(course[0]), course[min(i, 1) :] - size
        parts.append(states.chosen(course))
        costs.append(states.layers.cost[course])
    gamma, q, value, branch = (
        np.concatenate([getattr(part, name) for part in parts[::-1]]) for name in ("gamma", "q", "value", "branch")
    )
    return Postures(gamma, q, value, branch, parts[0].names), np.concatenate(costs[::-1])


@dataclass(frozen=True, eq=False)
class GivenGamma:
    """A path with gamma (n,) rad given, swept a stretch at a time.

    ``about`` (n, dof) rad: of an arm whose elbow can turn, the course that it keeps to.
    """

    model: fem.ArmModel
    task: Task
    objective: Objective
    gamma: Array
    generator: np.random.Generator | None
    about: Array | None = None

    @cached_property
    def rows(self) -> list[slice]:
        """The points of each stretch."""
        return list(in_blocks(self.task.path.n, POINTS))

    @cached_property
    def whole(self) -> Sweep | None:
        """The sweep of all points where that is kept.

        It is of paths that are not too long, and of arms without a closed form, whose postures are searched for: that
        takes long, and need not end on the same ones again.
        """
        n = self.task.path.n
        if n > KEPT and (self.about is not None or why_not_spherical(self.model.robot) is None):
            return None
        return self._made(slice(0, n))

    def sweep(self, rows: slice) -> Sweep:
        """The sweep of a stretch."""
        return self._made(rows) if self.whole is None else self.whole.at(rows)

    def best_merit(self) -> Array:
        """The largest merit (n,) at each point. Raises PathError where points cannot be reached."""
        best: list[Array] = []
        lost: list[Integers] = []
        first: tuple[Sweep, int] | None = None
        for rows in self.rows:
            sweep = self.sweep(rows)
            best.append(sweep.merit.max(axis=(1, 2)))
            if len(sweep.lost):
                lost.append(sweep.lost + rows.start)
                first = first or (sweep, rows.start)
        if first is not None:
            raise first[0].unreached(np.concatenate(lost), first[1])
        return np.concatenate(best)

    def states(self, problem: Problem, rows: slice) -> States:
        """The states of a stretch. Raises PathError where points of this or a later one have none."""
        try:
            return allowed_states(problem, self.sweep(rows), rows.start)
        except PathError as error:
            raise none_left(error, self._like(error, problem, rows), self.task.path.n) from None

    def _like(self, error: PathError, problem: Problem, rows: slice) -> Integers:
        """Points (k,) of this and later stretches that are without a state for the same reason."""
        points = [error.points + rows.start]
        for later in self.rows[self.rows.index(rows) + 1 :]:
            try:
                allowed_states(problem, self.sweep(later), later.start)
            except PathError as other:
                if other.what == error.what:
                    points.append(other.points + later.start)
        return np.concatenate(points)

    def _made(self, rows: slice) -> Sweep:
        task, objective = self.task.at(rows), self.objective.at(rows, self.task.path.n)
        gamma = self.gamma[rows, None]
        try:
            if self.about is not None:
                # A little room where a limit is met between the knots; none where there are very many points.
                offsets = WIGGLE * FIVE if self.task.path.n <= POINTS else np.zeros(1)
                return sweep_about(self.model, task, objective, gamma, self.about[rows], offsets)
            return sweep_gamma(self.model, task, objective, gamma, generator=self.generator)
        except PathError as error:
            raise objective.not_finite(error.point + rows.start) from None


def course_at(
    model: fem.ArmModel,
    task: Task,
    gamma: float | Array,
    objective: Objective | None = None,
    drive: Drive | None = None,
    *,
    free: Bools | None = None,
    near: Array | None = None,
    generator: np.random.Generator | None = None,
) -> Course:
    """Best course (branch and turns) with gamma given, one for all or (n,) rad: what a program does as it stands.

    On a path of any length; its cost is in units of its own best values.

    Parameters
    ----------
    free : (n - 1,) segments whose steps are not bounded: rapid moves, on which the controller moves as it likes
    near : (n, dof) rad: take the branch and turns nearest to these instead of the best
    generator : as in :func:`robots.inverse_kinematics`

    Raises
    ------
    InputError
        As :func:`machining.optimise_path`.
    """
    objective, drive = objective or Objective(), drive or Drive()
    angle = np.broadcast_to(np.asarray(gamma, dtype=np.float64), (task.path.n,))
    about, rate = near, None
    if is_redundant(model.robot) and near is None:
        about, rate = _elbow_course(model, task, objective, drive, angle, free, generator)
    path = GivenGamma(model, task, objective, angle, generator, about if is_redundant(model.robot) else None)
    problem = problem_of(model, task, objective, GammaRange(), drive, path.best_merit(), generator, free)
    if rate is not None:
        problem = replace(problem, links=problem.links.in_units(rate * problem.ways))

    def stretch(rows: slice) -> Stretch:
        def states() -> States:
            found = path.states(problem, rows)
            return found if near is None else _nearest(found, near[rows])

        # Of a path of one stretch the states are kept for the way back.
        return cache(states) if len(path.rows) == 1 else states

    found = solve_along(problem, [stretch(rows) for rows in path.rows], problem.links)
    if isinstance(found, Gap):
        raise gap_error(problem, found)
    return found


def _elbow_course(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    drive: Drive,
    gamma: Array,
    free: Bools | None,
    generator: np.random.Generator | None,
) -> tuple[Array, float | None]:
    """Course (n, dof) rad of an arm whose elbow can turn with gamma (n,) rad given, and :func:`least_rate`.

    Postures are followed along knots of the path, the best course through them is found, then again with the elbow
    turned less and less about that course. Between the knots the joints go smoothly; they are not on the path there.
    """
    n, every = task.path.n, drive.links(model.robot, task.path, free)
    knots = task.path.even_rows(min(n, max(KNOTS, int(2.0 * ways_of(model.robot, task.path).sum() / STRIDE))))
    if free is not None:
        knots = np.union1d(knots, ends_of(free))
    few, aim = at_knots(task, objective, knots)
    path = GivenGamma(model, few, aim, gamma[knots], generator)
    try:
        problem = problem_of(model, few, aim, GammaRange(), at_points(drive, knots), path.best_merit(), generator)
        links = Links(summed(every.step, knots), np.inf, summed(every.unit, knots), every.weight / len(knots))
        problem = replace(problem, links=links)
        assert path.whole is not None  # noqa: S101 - of arms without a closed form it is kept
        problem = problem.eased(path.whole)
        states = states_of(problem, path.whole)
        best = solve(problem, states, problem.links)
        for i in range(PASSES):
            if isinstance(best, Gap):
                raise gap_error(problem, best)
            trial = solve(problem, problem.states(gamma[knots, None], best.q, ELBOW / 4.0**i), problem.links)
            best = trial if is_better(problem, trial, best) else best
    except PathError as error:
        if len(knots) == n:
            raise
        points = knots[error.points]
        raise error.at(points, f"point {points[0]}, of {len(knots)} where the elbow is chosen") from None
    assert isinstance(best, Course)  # noqa: S101 - gaps have been raised
    between = PchipInterpolator(knots, best.q)(np.arange(n)) if len(knots) > 1 else best.q
    return np.asarray(between), least_rate(model.robot, few.path, path.whole)


def _nearest(states: States, near: Array) -> States:
    """The same states, whose cost is their distance from the postures (n, dof) rad that are wanted."""
    layers = states.layers
    wanted = np.repeat(near, np.diff(layers.start), axis=0)
    return replace(states, layers=replace(layers, cost=((layers.q - wanted) ** 2).sum(axis=1)))
