"""Posture along a path as one problem, so that the result can be driven; beside it the paper's each-point best.

Gao 2024 (doi:10.1109/ACCESS.2024.3435911, eq. 15) picks each point's best posture by itself. Here the course through
gamma x branch x equivalent turns of the joints is chosen as a whole, by dynamic programming: exact on a grid of gamma,
then again on finer grids around the course found, which never makes it worse but may settle in a local optimum.

The cost of a course is the mean over its points of ``-merit / scale`` plus the costs of :class:`machining.Drive`
(those of segments also over the number of points), ``scale`` the mean of each point's best on the grid. With the aim
"worst" the worst point comes first, and that cost decides among the courses with the same worst point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import fem
from machining.posture.courses import Gap, Layers, Links, cheapest_course, summed
from machining.posture.drive import Drive
from machining.posture.points import OFFSETS, GammaRange, Postures, Sweep, best_postures, sweep_gamma
from machining.posture.problem import (
    Course,
    Problem,
    States,
    constant_axis,
    course_of,
    gap_error,
    is_better,
    kept_constant,
    problem_of,
    states_of,
)
from machining.posture.stretches import solve
from machining.stiffness.objective import Objective
from machining.task import Task
from robots import InputError
from robots.arrays import Array
from robots.inverse.following import is_redundant
from robots.inverse.turns import every_turn
from robots.progress import Progress

# Branches whose merits differ by less than this share are equally good.
TIED = 1e-9
# Rad that the elbow's fastest joint is turned to either side of a course at most, and in cells of gamma.
ELBOW, ELBOW_CELLS = 0.25, 3.0


@dataclass(frozen=True, eq=False)
class PathPosture:
    """Result of :func:`optimise_path`.

    ``course`` can be driven; ``each_point`` is the paper's best of each point by itself, its joints turned for the
    least motion; ``fixed`` is the best course with one gamma of the grid, None if there is none (``why_no_fixed``).
    ``scale`` is what costs are measured in. ``sure``: the inverse kinematics found all solutions on the grid; if not
    (arms that are searched), there may be a better course.
    """

    course: Course
    each_point: Course
    fixed: Course | None
    why_no_fixed: str | None
    scale: float
    sure: bool


def optimise_path(
    model: fem.ArmModel,
    task: Task,
    objective: Objective | None = None,
    gammas: GammaRange | None = None,
    drive: Drive | None = None,
    *,
    passes: int = 4,
    generator: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> PathPosture:
    """Choose gamma, branch and turns along a whole path.

    Parameters
    ----------
    objective : default the mean k_fs
    gammas : grid of gamma, default a full turn in 5 deg
    drive : limits and costs, default :class:`machining.posture.drive.Drive`
    passes : finer grids after the first, each four times as fine; 0 keeps the grid's course, which is then exact
    generator : as in :func:`robots.inverse_kinematics`
    progress : called with (done, total) steps

    Raises
    ------
    InputError
        A point that no posture reaches or is allowed at; no course that keeps speeds and jumps (the message says
        where it ends, which joint is in the way, and how near a singularity is).
    """
    objective, gammas, drive = objective or Objective(), gammas or GammaRange(), drive or Drive()
    sweep = sweep_gamma(model, task, objective, gammas.angles, generator=generator)
    said = _Said(progress, passes)
    problem = problem_of(model, task, objective, gammas, drive, sweep.best_merit(), generator)
    said.next()
    problem = problem.eased(sweep)
    states = states_of(problem, sweep)
    found = solve(problem, states, problem.links)
    said.next()
    best = refine_course(problem, states, found, passes, said.next) if passes > 0 else found
    if isinstance(best, Gap):
        raise gap_error(problem, best)
    # What is refined point by point leads nowhere where the elbow can turn.
    starts = 3 if passes > 0 and not is_redundant(model.robot) else 0
    each = best_postures(model, task, objective, gammas, sweep=sweep, starts=starts, generator=generator)
    said.next()
    fixed = solve(problem, states, replace(problem.links, gamma_step=0.0))
    why = str(gap_error(problem, fixed)) if isinstance(fixed, Gap) else None
    sure = bool(sweep.sure.all())
    said.next()
    fixed_course = None if isinstance(fixed, Gap) else fixed
    if drive.turn_gain > 0.0 and constant_axis(task) and fixed_course is not None and np.ptp(best.gamma) > 0.0:
        still = replace(problem, drive=replace(drive, gamma_step=0.0), links=replace(problem.links, gamma_step=0.0))
        constant = refine_course(still, states, fixed_course, passes) if passes > 0 else fixed_course
        best = kept_constant(objective, drive, best, None if isinstance(constant, Gap) else constant)
    return PathPosture(best, _each_point(problem, each, sweep), fixed_course, why, problem.scale, sure)


class _Said:
    """Counts the steps of a search for whoever shows them."""

    def __init__(self, progress: Progress | None, passes: int) -> None:
        self.progress, self.done, self.total = progress, 0, passes + 4

    def next(self) -> None:
        self.done += 1
        if self.progress is not None:
            self.progress(self.done, self.total)


def refine_course(
    problem: Problem,
    states: States,
    found: Course | Gap,
    passes: int,
    said: Callable[[], None] = lambda: None,
) -> Course | Gap:
    """Courses on finer grids around those found, four times as fine each time; ``said`` is called after each."""
    best, half = found, problem.gammas.cell
    centres = [] if isinstance(found, Gap) else [(found.gamma, found.q)]
    centres += _between_knots(problem, states)
    for _ in range(passes):
        for centre in centres:
            trial = _around(problem, *centre, half)
            if is_better(problem, trial, best):
                best = trial
        said()
        if isinstance(best, Gap):
            return best
        centres, half = [(best.gamma, best.q)], half / 4.0
    return best


def _around(problem: Problem, centre: Array, q: Array, half: float) -> Course | Gap:
    about = q if is_redundant(problem.model.robot) else None
    try:
        trial = problem.gammas.inside(centre[:, None] + half * OFFSETS)
        states = problem.states(trial, about, min(ELBOW, ELBOW_CELLS * half))
    except InputError:
        # The line between two knots may leave the reach; then there is nothing to gain here.
        return Gap(0, np.zeros((2, 0)), np.inf)
    return solve(problem, states, problem.links)


def _between_knots(problem: Problem, states: States) -> list[tuple[Array, Array]]:
    """Gamma (n,) and joints (n, dof) of the best course through every k-th point, straight between them.

    On a path of close points no joint can follow a whole cell of gamma from one point to the next, and the grid's
    course would be stuck at one gamma. From knot to knot there is time for two cells.
    """
    step, n = problem.links.step, problem.task.path.n
    if n < 3 or not np.isfinite(step).any() or problem.drive.gamma_step < 2.0 * problem.gammas.cell / n:
        return []
    stride = int(np.ceil(2.0 * problem.gammas.cell / np.median(step.min(axis=1))))
    if stride < 2:
        return []
    knots = np.unique(np.append(np.arange(0, n, stride), n - 1))
    unit = summed(problem.links.unit, knots) / np.sqrt(np.diff(knots))[:, None]
    links = Links(summed(step, knots), problem.drive.gamma_step * stride, unit, problem.links.weight)
    old = states.layers
    rows = np.concatenate([np.arange(old.start[i], old.start[i + 1]) for i in knots])
    start = np.concatenate([[0], np.cumsum(np.diff(old.start)[knots])]).astype(np.int64)
    # A knot stands for the points around it, so that quality and motion keep their proportion.
    weight = np.repeat(np.gradient(knots.astype(np.float64)), np.diff(start))
    layers = Layers(start, old.q[rows], old.gamma[rows], old.cost[rows] * weight, old.merit[rows])
    course = cheapest_course(layers, links)
    if isinstance(course, Gap):
        return []
    gamma = problem.gammas.inside(np.interp(np.arange(n), knots, np.unwrap(layers.gamma[course])))
    q = np.stack([np.interp(np.arange(n), knots, joint) for joint in layers.q[course].T], axis=1)
    return [(gamma, q)]


def _each_point(problem: Problem, each: Postures, known: Sweep) -> Course:
    """The paper's choice; nothing keeps it from jumping.

    Of branches equally good (a wrist flip changes nothing in an arm of rigid links) and of turns, those that move
    least are taken. Gamma stays as it was chosen: between two peaks of nearly the same height it may go back and forth.
    """
    robot, drive, n = problem.model.robot, problem.drive, len(each.q)
    if is_redundant(robot):
        # All that was found at the gamma chosen: there is no branch to come back to.
        sweep = known.at_angles(np.abs(known.gamma - each.gamma[:, None]).argmin(axis=1))
    else:
        sweep = sweep_gamma(
            problem.model, problem.task, problem.objective, each.gamma[:, None], generator=problem.generator
        )
    best = sweep.merit.max(axis=(1, 2), keepdims=True)
    point, _, branch = found = np.nonzero(sweep.valid & (sweep.merit >= best - TIED * np.abs(best)))
    q, value = sweep.q[found], sweep.value[found]
    turned = every_turn(robot, q)
    row = turned.target
    soft = drive.near_singular(robot, q)[0] + drive.near_things(q, point)[0]
    soft -= problem.objective.sign * value / problem.scale
    cost = (soft[row] + drive.near_limits(robot, turned.q)[0]) / n
    start = np.searchsorted(point[row], np.arange(n + 1)).astype(np.int64)
    layers = Layers(start, turned.q, each.gamma[point[row]], np.zeros(len(row)), value[row])
    free = Links(np.full_like(problem.links.step, np.inf), np.inf, problem.links.unit, 1.0)
    course = cheapest_course(layers, free)
    assert not isinstance(course, Gap)  # noqa: S101 - without limits there are no gaps
    return course_of(problem, States(layers, value[row], branch[row], sweep.names).chosen(course), cost[course])
