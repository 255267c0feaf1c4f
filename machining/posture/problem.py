"""Courses of postures along a path: what may be driven, what it costs, which is best; the parts of path optimisation.

A state is a posture that one path point allows: gamma, branch and turns of the joints. The best course through them is
found by :mod:`machining.posture.stretches`; here is what they cost and what is said where there is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import fem
from machining.posture.courses import Gap, Layers, Links, course_cost
from machining.posture.drive import Drive, Smoothness, singular_distance, smoothness
from machining.posture.points import FIVE, GammaRange, Postures, Sweep, sweep_about, sweep_gamma
from machining.stiffness.objective import Objective
from machining.task import Task, ToolPath
from machining.toolpaths.path_error import PathError
from robots import Robot
from robots.arrays import Array, Bools, Integers
from robots.inverse.axis_lines import axis_lines
from robots.inverse.elbow_angle import elbow_angle
from robots.inverse.following import is_redundant
from robots.inverse.turns import every_turn

# Tool axes that differ by less (components of unit vectors) are the same.
SAME_AXIS = 1e-6
# Where the elbow can turn there is nearly always room: being near to limits and singularities costs so much more.
ROOM = 10.0
# Cost of an elbow that hangs straight down: it is nearer to floor and part than one on top.
UP = 0.2
# Least distances: their names in Python, and where a command takes them from.
SINGULAR = "singular_least", "--singular"
CLEARANCE = "clearance_least", "safety_mm of the cell file, --clearance of place, --beam-radius, or --floor"
LIMIT = "limit_least", "--limit-margin"


@dataclass(frozen=True, eq=False)
class Course(Postures):
    """One posture a path point, with its cost and its motion.

    ``value`` (n,) of the objective; ``mean`` and ``worst`` of it along the path; ``cost`` as this module says.
    ``forgone``: gamma is constant, because turning it along the path makes the objective better by this share only.
    """

    mean: float
    worst: float
    cost: float
    smoothness: Smoothness
    forgone: float | None = None


@dataclass(frozen=True, eq=False)
class States:
    """Postures that the points allow, and for each its value of the objective and its branch."""

    layers: Layers
    value: Array
    branch: Integers
    names: tuple[str, ...]

    def kept(self, keep: Bools) -> States:
        """Those of the states (k,) that are to be kept."""
        return States(self.layers.kept(keep), self.value[keep], self.branch[keep], self.names)

    def chosen(self, course: Integers) -> Postures:
        """The states of a course (n,)."""
        layers = self.layers
        return Postures(layers.gamma[course], layers.q[course], self.value[course], self.branch[course], self.names)


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

    def states(self, gamma: Array, about: Array | None = None, half: float = 0.0) -> States:
        """States for gamma (n, m); InputError where a point has none.

        ``about`` (n, dof) rad: of an arm whose elbow can turn, those next to these, up to ``half`` rad to either side.
        """
        if about is None:
            sweep = sweep_gamma(self.model, self.task, self.objective, gamma, generator=self.generator)
        else:
            sweep = sweep_about(self.model, self.task, self.objective, gamma, about, half * FIVE)
        return states_of(self, sweep)

    def eased(self, sweep: Sweep) -> Problem:
        """The problem whose unit of motion is what the arm has to move, where its elbow can turn.

        Such an arm chooses how far its joints travel: that counts against the objective as soon as it is more than the
        postures of ``sweep`` need at least.
        """
        rate = least_rate(self.model.robot, self.task.path, sweep)
        return self if rate is None else replace(self, links=self.links.in_units(self.ways * rate))

    @property
    def ways(self) -> Array:
        """How far the tool goes in each segment (n - 1,), pure numbers."""
        return ways_of(self.model.robot, self.task.path)


def ways_of(robot: Robot, path: ToolPath) -> Array:
    """How far the tool goes in each segment (n - 1,): the way over the arm's length, plus the turn of its axis, rad."""
    turn = np.linalg.norm(np.diff(path.axes, axis=0), axis=1)
    return np.asarray(path.lengths / axis_lines(robot).length + turn)


def least_rate(robot: Robot, path: ToolPath, sweep: Sweep) -> float | None:
    """Least joint motion (rad, root mean square of the joints) a way of 1 along a path, of the columns of a sweep.

    None of an arm whose elbow cannot turn, and where nothing moves.
    """
    if not is_redundant(robot) or path.n < 2:
        return None
    with np.errstate(invalid="ignore"):
        step = np.sqrt((np.diff(np.where(sweep.valid[..., None], sweep.q, np.nan), axis=0) ** 2).mean(axis=3))
    least = np.where(np.isnan(step), np.inf, step).min(axis=(1, 2))
    known = np.isfinite(least)
    way, moved = float(ways_of(robot, path)[known].sum()), float(least[known].sum())
    return moved / way if min(moved, way) > 0.0 else None


def problem_of(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gammas: GammaRange,
    drive: Drive,
    best: Array,
    generator: np.random.Generator | None,
    free: Bools | None = None,
) -> Problem:
    """The problem at whose points the best merit is ``best`` (n,).

    ``free`` (n - 1,): segments whose steps are not bounded.
    """
    scale = float(np.abs(best).mean()) or 1.0
    if is_redundant(model.robot):
        drive = replace(drive, limit=ROOM * drive.limit, singular=ROOM * drive.singular)
    links = drive.links(model.robot, task.path, free)
    links = replace(links, weight=links.weight / task.path.n)
    share = np.full(task.path.n, 1.0 / task.path.n)
    return Problem(model, task, objective, gammas, drive, links, scale, share, generator)


def ends_of(free: Bools) -> Integers:
    """Points (k,) at the ends of free segments."""
    segments = np.flatnonzero(free)
    return np.union1d(segments, segments + 1).astype(np.int64)


def at_knots(task: Task, objective: Objective, knots: Integers) -> tuple[Task, Objective]:
    """A task and its objective at some points (k,) of the path."""
    # The feed is in the links already; between knots the way is longer than the chord.
    few = task.at(knots, feed=np.full(len(knots), np.nan))
    forces = objective.forces(task.path.n)
    return few, replace(objective, force=None if forces is None else forces[knots])


def at_points(drive: Drive, knots: Integers) -> Drive:
    """The drive of some points (k,) of a path, whose clearance is asked by their number on the whole path."""
    clearance_at = drive.clearance_at
    if clearance_at is None:
        return drive
    return replace(drive, clearance_at=lambda q, point: clearance_at(q, knots[point]))


def states_of(problem: Problem, sweep: Sweep) -> States:
    """All allowed postures of a sweep of the whole path with all their turns; InputError where a point has none."""
    sweep.check_reached()
    try:
        return allowed_states(problem, sweep)
    except PathError as error:
        raise none_left(error, error.points, len(sweep.gamma)) from None


def allowed_states(problem: Problem, sweep: Sweep, first: int = 0) -> States:
    """The same of a sweep of points from ``first`` on; PathError, in the sweep's numbers, where a point has none."""
    n = len(sweep.gamma)
    point, at, branch = np.nonzero(sweep.valid)
    value = sweep.value[sweep.valid]
    row, q, soft = allowed(problem.model.robot, problem.drive, sweep.q[sweep.valid], point, n, first)
    merit = problem.objective.sign * value[row]
    elbow = elbow_angle(problem.model.robot, q)
    if elbow is not None:
        soft = soft + UP * np.sin(0.5 * elbow) ** 2
    cost = (soft - merit / problem.scale) * problem.share[first + point[row]]
    start = np.searchsorted(point[row], np.arange(n + 1)).astype(np.int64)
    return States(Layers(start, q, sweep.gamma[point, at][row], cost, merit), value[row], branch[row], sweep.names)


def allowed(
    robot: Robot, drive: Drive, q: Array, point: Integers, n: int, first: int = 0
) -> tuple[Integers, Array, Array]:
    """Those of poses q (k, dof) rad at ``point`` (k,) of n path points from ``first`` on that may be taken.

    Their rows (s,), and with all their turns angles (s, dof) rad and costs (s,) of being near to singularities, things
    and limits.

    Raises
    ------
    PathError
        A point at which none may be taken.
    """
    singular, off_singular = drive.near_singular(robot, q)
    _check_left(n, point[off_singular], "a singularity", SINGULAR)
    clear, off_things = drive.near_things(q, first + point)
    clash = "an obstacle"
    if drive.nearest_of is not None and off_singular.any():
        # Only where nothing is left is it worth knowing what is in the way.
        gone = np.bincount(point[off_singular & off_things], minlength=n) == 0
        if gone.any():
            first_gone = off_singular & (point == np.argmax(gone))
            clash = f"an obstacle ({drive.nearest_of(q[first_gone])})" if first_gone.any() else clash
    _check_left(n, point[off_singular & off_things], clash, CLEARANCE)
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
            f"all postures are too near to {thing}",
            code="G002",
            allowed=f"a distance of {least[0]} or more",
            remedy=f"move the part, tilt the tool, or lower that distance: {least[1]} ({least[0]} in Python)",
        )


def none_left(error: PathError, points: Integers, n: int) -> PathError:
    """The error of :func:`allowed` for all such points (k,) of a path's n."""
    return error.at(points, f"path point {int(points[0])} ({len(points)} of {n} points)")


def course_of(problem: Problem, found: Postures, cost: Array) -> Course:
    """What the postures of a course come to, whose states have ``cost`` (n,)."""
    links, value = problem.links, found.value
    elbow = elbow_angle(problem.model.robot, found.q)
    if elbow is not None:
        # Columns are postures that were followed: no branches, and none of them is left for another.
        low, high = np.degrees([elbow.min(), elbow.max()])
        found = replace(found, branch=np.zeros_like(found.branch), names=(f"elbow {low:.3g} to {high:.3g} deg",))
    return Course(
        gamma=found.gamma,
        q=found.q,
        value=value,
        branch=found.branch,
        names=found.names,
        mean=float(value.mean()),
        worst=float(value.max() if problem.objective.minimised else value.min()),
        cost=course_cost(links, found.q, cost),
        smoothness=smoothness(problem.model.robot, problem.task.path, links, found.q, found.gamma, found.branch),
    )


def is_better(problem: Problem, new: Course | Gap, old: Course | Gap) -> bool:
    """Whether one course is better than another by the objective's aim; any is better than none."""
    if isinstance(new, Gap) or isinstance(old, Gap):
        return not isinstance(new, Gap)
    if problem.objective.aim == "worst" and new.worst != old.worst:
        return problem.objective.sign * new.worst > problem.objective.sign * old.worst
    return new.cost < old.cost


def constant_axis(task: Task) -> bool:
    """Whether the tool axis is the same along the whole path, as in 2.5-D milling."""
    axes = task.path.axes
    return bool(np.abs(axes - axes[:1]).max(initial=0.0) < SAME_AXIS)


def kept_constant(objective: Objective, drive: Drive, turning: Course, constant: Course | None) -> Course:
    """The course with constant gamma if turning gains no more than the drive's ``turn_gain``, else the turning one."""
    if constant is None:
        return turning
    ours, other = (c.worst if objective.aim == "worst" else c.mean for c in (turning, constant))
    gain = (ours / other if not objective.minimised else other / ours) - 1.0
    return replace(constant, forgone=max(gain, 0.0)) if gain <= drive.turn_gain else turning


def gap_error(problem: Problem, gap: Gap) -> PathError:
    """Say where the path cannot be driven on, what is in the way, and how near a singularity is."""
    robot, step = problem.model.robot, problem.links.step[gap.after]
    dq = np.abs(gap.poses[1] - gap.poses[0])
    share = dq / step
    joint = int(np.argmax(share))
    near = float(singular_distance(robot, gap.poses).min())
    if gap.excess > 1.0:
        value = (
            f"{robot.joint_names[joint]} would have to move {np.degrees(dq[joint]):.3g} deg at once "
            f"({share[joint]:.3g} times what speed and jump allow)"
        )
    else:
        value = "gamma would have to change by more than allowed"
    return PathError(
        gap.after,
        f"path cannot be driven from point {gap.after} to {gap.after + 1}",
        code="G003",
        value=f"{value}; distance to the nearest singularity there {near:.2g}",
        allowed=f"at most {np.degrees(step[joint]):.3g} deg of {robot.joint_names[joint]}",
        remedy="lower the feed, give points closer together, a finer grid or more range of gamma, or move the part",
    )
