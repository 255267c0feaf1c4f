"""Posture along a path as one problem, so that the result can be driven; beside it the paper's each-point best.

Gao 2024 (doi:10.1109/ACCESS.2024.3435911, eq. 15) picks each point's best posture by itself. Here the course through
gamma x branch x equivalent turns of the joints is chosen as a whole, by dynamic programming: exact on a grid of gamma,
then again on finer grids around the course found, which never makes it worse but may settle in a local optimum.

The cost of a course is the mean over its points of ``-merit / scale`` plus the costs of :class:`machining.Drive`
(those of segments also over the number of points), ``scale`` the mean of each point's best on the grid. With the aim
"worst" the worst point comes first, and that cost decides among the courses with the same worst point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import fem
from machining.courses import Gap, Layers, Links, cheapest_course, course_cost, highest_floor
from machining.drive import Drive, Smoothness, singular_distance, smoothness
from machining.objective import Objective
from machining.posture import GammaRange, Postures, Sweep, best_postures, sweep_gamma
from machining.task import Task
from robots import InputError
from robots.turns import every_turn

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]

# Angles of a finer grid around a course: four cells to either side.
OFFSETS = np.linspace(-1.0, 1.0, 9)
# Branches whose merits differ by less than this share are equally good.
TIED = 1e-9


@dataclass(frozen=True, eq=False)
class Course:
    """One posture a path point: as :class:`machining.posture.Postures`, with its cost and its motion.

    ``value`` (n,) of the objective; ``mean`` and ``worst`` of it along the path; ``cost`` as this module says.
    """

    gamma: Array
    q: Array
    value: Array
    branch: Integers
    names: tuple[str, ...]
    mean: float
    worst: float
    cost: float
    smoothness: Smoothness


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


@dataclass(frozen=True, eq=False)
class _States:
    layers: Layers
    value: Array
    branch: Integers
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Problem:
    model: fem.ArmModel
    task: Task
    objective: Objective
    gammas: GammaRange
    drive: Drive
    links: Links
    scale: float
    generator: np.random.Generator | None

    def states(self, gamma: Array) -> _States:
        """States for gamma (n, m); InputError where a point has none."""
        sweep = sweep_gamma(self.model, self.task, self.objective, gamma, generator=self.generator)
        return _states(self, sweep)


def optimise_path(
    model: fem.ArmModel,
    task: Task,
    objective: Objective | None = None,
    gammas: GammaRange | None = None,
    drive: Drive | None = None,
    *,
    passes: int = 4,
    generator: np.random.Generator | None = None,
) -> PathPosture:
    """Choose gamma, branch and turns along a whole path.

    Parameters
    ----------
    objective : default the mean k_fs
    gammas : grid of gamma, default a full turn in 5 deg
    drive : limits and costs, default :class:`machining.drive.Drive`
    passes : finer grids after the first, each four times as fine; 0 keeps the grid's course, which is then exact
    generator : as in :func:`robots.inverse_kinematics`

    Raises
    ------
    InputError
        A point that no posture reaches or is allowed at; no course that keeps speeds and jumps (the message says
        where it ends, which joint is in the way, and how near a singularity is).
    """
    objective, gammas, drive = objective or Objective(), gammas or GammaRange(), drive or Drive()
    sweep = sweep_gamma(model, task, objective, gammas.angles, generator=generator)
    sweep.check_reached()
    scale = float(np.abs(sweep.merit.max(axis=(1, 2))).mean()) or 1.0
    links = drive.links(model.robot, task.path)
    links = replace(links, weight=links.weight / task.path.n)
    problem = _Problem(model, task, objective, gammas, drive, links, scale, generator)
    states = _states(problem, sweep)
    found = _solve(problem, states, links)
    best = _refined(problem, states, found, passes) if passes > 0 else found
    if isinstance(best, Gap):
        raise _broken(problem, states, best)
    each = best_postures(
        model, task, objective, gammas, sweep=sweep, starts=3 if passes > 0 else 0, generator=generator
    )
    fixed = _solve(problem, states, replace(links, gamma_step=0.0))
    why = str(_broken(problem, states, fixed)) if isinstance(fixed, Gap) else None
    sure = bool(sweep.sure.all())
    return PathPosture(best, _each_point(problem, each), None if isinstance(fixed, Gap) else fixed, why, scale, sure)


def _states(problem: _Problem, sweep: Sweep) -> _States:
    """All allowed postures of a sweep with all their turns, and their costs."""
    sweep.check_reached()
    robot, drive, n = problem.model.robot, problem.drive, len(sweep.gamma)
    point, at, branch = np.nonzero(sweep.valid)
    q, value = sweep.q[sweep.valid], sweep.value[sweep.valid]
    singular, off_singular = drive.near_singular(robot, q)
    _check_left(n, point[off_singular], "a singularity", "singular_least")
    clear, off_things = drive.near_things(q)
    _check_left(n, point[off_singular & off_things], "an obstacle", "clearance_least")
    keep = np.flatnonzero(off_singular & off_things)
    turned = every_turn(robot, q[keep])
    near, off_limits = drive.near_limits(robot, turned.q)
    row = keep[turned.target[off_limits]]
    _check_left(n, point[row], "a joint limit", "limit_least")
    merit = problem.objective.sign * value
    cost = (-merit / problem.scale + singular + clear)[row] + near[off_limits]
    start = np.searchsorted(point[row], np.arange(n + 1)).astype(np.int64)
    layers = Layers(start, turned.q[off_limits], sweep.gamma[point, at][row], cost / n, merit[row])
    return _States(layers, value[row], branch[row], sweep.names)


def _check_left(n: int, point: Integers, thing: str, least: str) -> None:
    empty = np.flatnonzero(np.bincount(point, minlength=n) == 0)
    if len(empty):
        raise InputError(
            f"path point {int(empty[0])} ({len(empty)} of {n} points): all postures are too near to {thing}",
            allowed=f"a distance of {least} or more",
            remedy=f"move the part, tilt the tool, or lower {least}",
        )


def _solve(problem: _Problem, states: _States, links: Links) -> Course | Gap:
    layers = states.layers
    if problem.objective.aim == "worst":
        floor = highest_floor(layers, links)
        if isinstance(floor, Gap):
            return floor
        states = _kept(states, np.asarray(layers.merit >= floor))
        layers = states.layers
    course = cheapest_course(layers, links)
    return course if isinstance(course, Gap) else _course(problem, states, course)


def _kept(states: _States, keep: Bools) -> _States:
    old = states.layers
    start = np.concatenate([[0], np.cumsum(keep)]).astype(np.int64)[old.start]
    layers = Layers(start, old.q[keep], old.gamma[keep], old.cost[keep], old.merit[keep])
    return _States(layers, states.value[keep], states.branch[keep], states.names)


def _course(problem: _Problem, states: _States, course: Integers) -> Course:
    layers, task = states.layers, problem.task
    q, gamma, value, branch = layers.q[course], layers.gamma[course], states.value[course], states.branch[course]
    return Course(
        gamma=gamma,
        q=q,
        value=value,
        branch=branch,
        names=states.names,
        mean=float(value.mean()),
        worst=float(value.max() if problem.objective.minimised else value.min()),
        cost=course_cost(layers, problem.links, course),
        smoothness=smoothness(problem.model.robot, task.path, problem.links, q, gamma, branch),
    )


def _better(problem: _Problem, new: Course | Gap, old: Course | Gap) -> bool:
    if isinstance(new, Gap) or isinstance(old, Gap):
        return not isinstance(new, Gap)
    if problem.objective.aim == "worst" and new.worst != old.worst:
        return problem.objective.sign * new.worst > problem.objective.sign * old.worst
    return new.cost < old.cost


def _refined(problem: _Problem, states: _States, found: Course | Gap, passes: int) -> Course | Gap:
    """Courses on finer grids around those found, four times as fine each time."""
    best, half = found, problem.gammas.cell
    centres = [] if isinstance(found, Gap) else [found.gamma]
    centres += _between_knots(problem, states)
    for _ in range(passes):
        for centre in centres:
            trial = _around(problem, centre, half)
            if _better(problem, trial, best):
                best = trial
        if isinstance(best, Gap):
            return best
        centres, half = [best.gamma], half / 4.0
    return best


def _around(problem: _Problem, centre: Array, half: float) -> Course | Gap:
    try:
        states = problem.states(problem.gammas.inside(centre[:, None] + half * OFFSETS))
    except InputError:
        # The line between two knots may leave the reach; then there is nothing to gain here.
        return Gap(0, 0, 0, np.zeros(0), np.inf)
    return _solve(problem, states, problem.links)


def _between_knots(problem: _Problem, states: _States) -> list[Array]:
    """Gamma (n,) of the best course through every k-th point, straight between them.

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
    many = np.diff(knots)[:, None]
    summed = np.add.reduceat(step, knots[:-1], axis=0)
    unit = np.add.reduceat(problem.links.unit, knots[:-1], axis=0) / np.sqrt(many)
    gamma_step = problem.drive.gamma_step * stride
    old = states.layers
    rows = np.concatenate([np.arange(old.start[i], old.start[i + 1]) for i in knots])
    start = np.concatenate([[0], np.cumsum(np.diff(old.start)[knots])]).astype(np.int64)
    # A knot stands for the points around it, so that quality and motion keep their proportion.
    weight = np.repeat(np.gradient(knots.astype(np.float64)), np.diff(start))
    layers = Layers(start, old.q[rows], old.gamma[rows], old.cost[rows] * weight, old.merit[rows])
    course = cheapest_course(layers, Links(summed, gamma_step, unit, problem.links.weight))
    if isinstance(course, Gap):
        return []
    return [problem.gammas.inside(np.interp(np.arange(n), knots, np.unwrap(layers.gamma[course])))]


def _each_point(problem: _Problem, each: Postures) -> Course:
    """The paper's choice; nothing keeps it from jumping.

    Of branches equally good (a wrist flip changes nothing in an arm of rigid links) and of turns, those that move
    least are taken. Gamma stays as it was chosen: between two peaks of nearly the same height it may go back and forth.
    """
    robot, drive, n = problem.model.robot, problem.drive, len(each.q)
    sweep = sweep_gamma(
        problem.model, problem.task, problem.objective, each.gamma[:, None], generator=problem.generator
    )
    best = sweep.merit.max(axis=(1, 2), keepdims=True)
    point, _, branch = found = np.nonzero(sweep.valid & (sweep.merit >= best - TIED * np.abs(best)))
    q, value = sweep.q[found], sweep.value[found]
    turned = every_turn(robot, q)
    row = turned.target
    soft = drive.near_singular(robot, q)[0] + drive.near_things(q)[0] - problem.objective.sign * value / problem.scale
    cost = (soft[row] + drive.near_limits(robot, turned.q)[0]) / n
    start = np.searchsorted(point[row], np.arange(n + 1)).astype(np.int64)
    layers = Layers(start, turned.q, each.gamma[point[row]], np.zeros(len(row)), value[row])
    free = Links(np.full_like(problem.links.step, np.inf), np.inf, problem.links.unit, 1.0)
    course = cheapest_course(layers, free)
    assert not isinstance(course, Gap)  # noqa: S101 - without limits there are no gaps
    return _course(problem, _States(replace(layers, cost=cost), value[row], branch[row], sweep.names), course)


def _broken(problem: _Problem, states: _States, gap: Gap) -> InputError:
    """Say where the path cannot be driven on, what is in the way, and how near a singularity is."""
    robot, step = problem.model.robot, problem.links.step[gap.after]
    share = np.abs(gap.dq) / step
    joint = int(np.argmax(share))
    near = float(singular_distance(robot, states.layers.q[[gap.before, gap.behind]]).min())
    if gap.excess > 1.0:
        value = (
            f"{robot.joint_names[joint]} would have to move {np.degrees(abs(gap.dq[joint])):.3g} deg at once "
            f"({share[joint]:.3g} times what speed and jump allow)"
        )
    else:
        value = "gamma would have to change by more than allowed"
    return InputError(
        f"path cannot be driven from point {gap.after} to {gap.after + 1}",
        value=f"{value}; distance to the nearest singularity there {near:.2g}",
        allowed=f"at most {np.degrees(step[joint]):.3g} deg of {robot.joint_names[joint]}",
        remedy="lower the feed, give points closer together, a finer grid or more range of gamma, or move the part",
    )
