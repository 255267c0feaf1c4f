"""Courses of postures along a path: what may be driven, what it costs, which is best; the parts of path optimisation.

A state is a posture that one path point allows: gamma, branch and turns of the joints. :mod:`machining.posture.courses`
finds the cheapest course through them; here is what they cost and what is said where there is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import fem
from machining.posture.courses import Gap, Layers, Links, cheapest_course, course_cost, highest_floor
from machining.posture.drive import Drive, Smoothness, singular_distance, smoothness
from machining.posture.points import GammaRange, Postures, Sweep, sweep_gamma
from machining.stiffness.objective import Objective
from machining.task import Task
from machining.toolpaths.path_error import PathError
from robots import Robot
from robots.arrays import Array, Bools, Integers
from robots.inverse.turns import every_turn

# Cost of a joint at the end of its range, only to decide between courses that are alike: far below what matters, far
# above rounding.
TIE = 1e-8
# Least distances: their names in Python, and where a command takes them from.
SINGULAR = "singular_least", "--singular"
CLEARANCE = "clearance_least", "safety_mm of the cell file, or --clearance of place"
LIMIT = "limit_least", "--limit-margin"


@dataclass(frozen=True, eq=False)
class Course(Postures):
    """One posture a path point, with its cost and its motion.

    ``value`` (n,) of the objective; ``mean`` and ``worst`` of it along the path; ``cost`` as this module says.
    """

    mean: float
    worst: float
    cost: float
    smoothness: Smoothness


@dataclass(frozen=True, eq=False)
class States:
    """Postures that the points allow, and for each its value of the objective and its branch."""

    layers: Layers
    value: Array
    branch: Integers
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Problem:
    """All that a course depends on.

    ``links``: allowed steps; ``scale``: the unit of its cost; ``share`` (n,): part of each point in the mean.
    """

    model: fem.ArmModel
    task: Task
    objective: Objective
    gammas: GammaRange
    drive: Drive
    links: Links
    scale: float
    share: Array
    generator: np.random.Generator | None

    def states(self, gamma: Array) -> States:
        """States for gamma (n, m); InputError where a point has none."""
        sweep = sweep_gamma(self.model, self.task, self.objective, gamma, generator=self.generator)
        return states_of(self, sweep)


def problem_of(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gammas: GammaRange,
    drive: Drive,
    sweep: Sweep,
    generator: np.random.Generator | None,
    free: Bools | None = None,
) -> Problem:
    """The problem whose states a sweep holds; InputError where a point cannot be reached.

    ``free`` (n - 1,): segments whose steps are not bounded.
    """
    sweep.check_reached()
    scale = float(np.abs(sweep.merit.max(axis=(1, 2))).mean()) or 1.0
    links = drive.links(model.robot, task.path, free)
    links = replace(links, weight=links.weight / task.path.n)
    share = np.full(task.path.n, 1.0 / task.path.n)
    return Problem(model, task, objective, gammas, drive, links, scale, share, generator)


def states_of(problem: Problem, sweep: Sweep) -> States:
    """All allowed postures of a sweep with all their turns, and their costs."""
    sweep.check_reached()
    n = len(sweep.gamma)
    point, at, branch = np.nonzero(sweep.valid)
    value = sweep.value[sweep.valid]
    row, q, soft = allowed(problem.model.robot, problem.drive, sweep.q[sweep.valid], point, n)
    merit = problem.objective.sign * value[row]
    cost = (soft - merit / problem.scale) * problem.share[point[row]]
    start = np.searchsorted(point[row], np.arange(n + 1)).astype(np.int64)
    return States(Layers(start, q, sweep.gamma[point, at][row], cost, merit), value[row], branch[row], sweep.names)


def allowed(robot: Robot, drive: Drive, q: Array, point: Integers, n: int) -> tuple[Integers, Array, Array]:
    """Those of poses q (k, dof) rad at ``point`` (k,) of n path points that may be taken, with all their turns.

    Their rows (s,), angles (s, dof) rad and costs (s,) of being near to singularities, things and limits.

    Raises
    ------
    PathError
        A point at which none may be taken.
    """
    singular, off_singular = drive.near_singular(robot, q)
    _check_left(n, point[off_singular], "a singularity", SINGULAR)
    clear, off_things = drive.near_things(q, point)
    _check_left(n, point[off_singular & off_things], "an obstacle", CLEARANCE)
    keep = np.flatnonzero(off_singular & off_things)
    turned = every_turn(robot, q[keep])
    near, off_limits = drive.near_limits(robot, turned.q)
    row = keep[turned.target[off_limits]]
    _check_left(n, point[row], "a joint limit", LIMIT)
    return row, turned.q[off_limits], (singular + clear)[row] + near[off_limits]


def _check_left(n: int, point: Integers, thing: str, least: tuple[str, str]) -> None:
    empty = np.flatnonzero(np.bincount(point, minlength=n) == 0)
    if len(empty):
        raise PathError(
            empty,
            f"path point {int(empty[0])} ({len(empty)} of {n} points): all postures are too near to {thing}",
            allowed=f"a distance of {least[0]} or more",
            remedy=f"move the part, tilt the tool, or lower that distance: {least[1]} ({least[0]} in Python)",
        )


def solve(problem: Problem, states: States, links: Links) -> Course | Gap:
    """Best course through the states, or where there is none."""
    layers = states.layers
    if problem.objective.aim == "worst":
        floor = highest_floor(layers, links)
        if isinstance(floor, Gap):
            return floor
        states = _kept(states, np.asarray(layers.merit >= floor))
        layers = states.layers
    course = cheapest_course(_near_middle(problem.model.robot, layers), links)
    return course if isinstance(course, Gap) else course_of(problem, states, course)


def _near_middle(robot: Robot, layers: Layers) -> Layers:
    """Of turns that are equally good all along, those nearest to the middle of the joints' ranges at the first point.

    Else rounding would choose, and the next program or the way home might run into a limit.
    """
    half = np.where(np.isfinite(robot.limits).all(axis=1), 0.5 * np.diff(robot.limits, axis=1)[:, 0], np.inf)
    middle = np.where(np.isinf(half), 0.0, robot.limits.mean(axis=1))
    rows = layers.rows(0)
    cost = layers.cost.copy()
    cost[rows] += TIE * (((layers.q[rows] - middle) / np.maximum(half, 1e-9)) ** 2).mean(axis=1)
    return replace(layers, cost=cost)


def _kept(states: States, keep: Bools) -> States:
    old = states.layers
    start = np.concatenate([[0], np.cumsum(keep)]).astype(np.int64)[old.start]
    layers = Layers(start, old.q[keep], old.gamma[keep], old.cost[keep], old.merit[keep])
    return States(layers, states.value[keep], states.branch[keep], states.names)


def course_of(problem: Problem, states: States, course: Integers) -> Course:
    """What a course of states (n,) comes to."""
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


def is_better(problem: Problem, new: Course | Gap, old: Course | Gap) -> bool:
    """Whether one course is better than another by the objective's aim; any is better than none."""
    if isinstance(new, Gap) or isinstance(old, Gap):
        return not isinstance(new, Gap)
    if problem.objective.aim == "worst" and new.worst != old.worst:
        return problem.objective.sign * new.worst > problem.objective.sign * old.worst
    return new.cost < old.cost


def gap_error(problem: Problem, states: States, gap: Gap) -> PathError:
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
    return PathError(
        gap.after,
        f"path cannot be driven from point {gap.after} to {gap.after + 1}",
        value=f"{value}; distance to the nearest singularity there {near:.2g}",
        allowed=f"at most {np.degrees(step[joint]):.3g} deg of {robot.joint_names[joint]}",
        remedy="lower the feed, give points closer together, a finer grid or more range of gamma, or move the part",
    )


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
    sweep = sweep_gamma(model, task, objective, angle[:, None], generator=generator)
    problem = problem_of(model, task, objective, GammaRange(), drive, sweep, generator, free)
    states = states_of(problem, sweep)
    if near is not None:
        layers = states.layers
        wanted = np.repeat(near, np.diff(layers.start), axis=0)
        states = replace(states, layers=replace(layers, cost=((layers.q - wanted) ** 2).sum(axis=1)))
    found = solve(problem, states, problem.links)
    if isinstance(found, Gap):
        raise gap_error(problem, states, found)
    return found
