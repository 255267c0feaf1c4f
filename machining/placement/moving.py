"""The base moving along the path: linear axes and arm share the motion.

States at knots of the path are base position x angle gamma x branch x turns; the course through them is found by the
dynamic programme of :mod:`machining.posture.courses`, with the axes as further joints: their speeds bound the steps,
and motion of arm and axes costs. On finer grids about the course it is found again. Between knots the axes follow a
curve without overshoot, smoothed until speeds, accelerations, joint limits and clearance are kept at all points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from machining.placement.axis_motion import followed
from machining.placement.problem import Problem
from machining.placement.reach import check_reached
from machining.placement.search import coarse_counts, grid_with, with_weights
from machining.placement.sweeping import Sites, distances, sweep_sites
from machining.posture.courses import Gap, Layers, Links, cheapest_course, highest_floor
from machining.posture.drive import FREE_STEP, limit_distance
from machining.posture.points import GammaRange, sweep_gamma
from machining.posture.problem import Course
from robots import InputError, Robot
from robots.arrays import Array, Bools, Integers
from robots.inverse.solutions import why_no_closed_form
from robots.inverse.turns import every_turn
from robots.progress import Progress

# Knots, and the most that an axis moves from one to the next (share of its range); the next where one leads nowhere.
TRIALS = ((40, 0.15), (80, 0.05), (120, 0.02))
# Positions of the grid by the number of coordinates.
POSITIONS = {1: 41, 2: 90, 3: 150}
# Angles gamma on the first grid, and postures of a position that are kept at a knot.
ANGLES, KEEP = 12, 4
# Most that a joint moves from knot to knot, and the distance from its limits that it keeps there, if it can (rad):
# between knots it needs room.
JOINT_STEP, ROOM = np.radians(60.0), np.radians(3.0)
# Finer grids about the course, each half as coarse.
PASSES = 5
# Slopes of K_sf's second term (see machining.placement.steps): each from the course before.
SLOPES = 3


@dataclass(frozen=True, eq=False)
class Moved:
    """A base that moves: coordinates ``x`` (n, d), ``gamma`` (n,) rad, the ``course`` over all points, its merit."""

    problem: Problem
    x: Array
    gamma: Array
    course: Course
    merit: float
    evaluations: int


@dataclass(frozen=True, eq=False)
class _Knots:
    """States at knots: ``layers`` with coordinates x behind the joints, their ``gamma`` and ``value``."""

    layers: Layers
    x: Array
    gamma: Array
    value: Array


def find_moving(
    problem: Problem,
    also: Array | None = None,
    gamma: float | None = None,
    enough: float = -np.inf,
    progress: Progress | None = None,
) -> Moved:
    """Motion of the axes along the path; the turntable rests.

    ``also`` (p, d): further positions of the grid, ``gamma`` a further angle, ``enough`` a merit that must be passed,
    or more knots are tried: those of the best position at rest.

    Raises
    ------
    InputError
        A knot that no position reaches, no course that keeps speeds, or none that stays so when it is followed at all
        points.
    """
    if why_no_closed_form(problem.model.robot) is not None:
        raise InputError(
            f"base moving along the path of {problem.model.robot.name}",
            value="an arm whose inverse kinematics is searched",
            allowed="arms with a closed form",
            remedy="use mode fixed or steps",
        )
    x, angles = grid_with(problem, POSITIONS[min(problem.space.d, 3)], ANGLES, also, gamma)
    count, error = 0, InputError("base moving along the path")
    best: tuple[Array, Array, Course, float] | None = None
    for trial, (many, most) in enumerate(TRIALS):
        rows = problem.path.even_rows(many)
        if problem.free is not None:
            # Both ends of a rapid move, or gamma between them would be mixed from before and after.
            ends = np.flatnonzero(problem.free)
            rows = np.unique(np.concatenate([rows, ends, ends + 1])).astype(np.int64)
        sites = sweep_sites(problem, *problem.space.sites(x), rows, angles)
        problem = with_weights(problem, sites)
        check_reached(problem, sites, ", moving along it")
        try:
            found, looked = _once(problem, sites, x, most, also, lambda k: _say(progress, k, 2 * PASSES))
        except InputError as raised:
            error = raised if trial == 0 else error
            continue
        finally:
            count += len(x)
        count += looked
        if best is None or found[3] > best[3]:
            best = found
        if best[3] > enough:
            break
    if best is None:
        raise error
    return Moved(problem, *best, evaluations=count)


def _once(
    problem: Problem, sites: Sites, x: Array, most: float, also: Array | None, said: Callable[[int], None]
) -> tuple[tuple[Array, Array, Course, float], int]:
    """The course with some knots and step, over all points; and the positions looked at on finer grids."""
    rows, count = sites.rows, 0
    links = _links(problem, rows, most)
    slope = _first_slope(problem, sites)
    knots, course = _found(problem, sites, x, links, slope)
    for _ in range(1, SLOPES):
        if problem.goal.aim != "ksf":
            break
        slope = problem.goal.weights_of_ksf.slope(float(knots.value[course] @ problem.share_of(rows)))
        knots, course = _found(problem, sites, x, links, slope)
    at = knots.x[course], knots.gamma[course]
    h = 0.5 * (problem.space.upper - problem.space.lower) / (np.array(coarse_counts(problem, len(x))) - 1)
    turn = 0.5 * (problem.gamma.upper - problem.gamma.lower) / ANGLES if isinstance(problem.gamma, GammaRange) else 0.0
    for done in range(PASSES):
        said(done)
        finer, looked = _around(problem, rows, at, h, turn, slope)
        count += looked
        found = _course(problem, finer, links)
        if not isinstance(found, Gap):
            at = finer.x[found], finer.gamma[found]
        h, turn = 0.5 * h, 0.5 * turn
    still = None if also is None else also[-1]
    return followed(problem, rows, at, still, lambda k: said(PASSES + k)), count


def _say(progress: Progress | None, done: int, total: int) -> None:
    if progress is not None:
        progress(done, total)


def _first_slope(problem: Problem, sites: Sites) -> float:
    if problem.goal.aim != "ksf":
        return 0.0
    best = np.where(sites.valid, sites.value, 0.0).max(axis=(0, 1, 2))
    return problem.goal.weights_of_ksf.slope(float(best @ problem.share_of(sites.rows)))


def _links(problem: Problem, rows: Integers, share: float) -> Links:
    """What the segments between knots allow together, of joints and axes."""
    robot, space = problem.model.robot, problem.space
    times = np.where(np.isnan(problem.path.times), np.inf, problem.path.times)
    speed = np.array([problem.cell.linear_axes[i].speed or np.inf for i in space.free])
    joint, axis = problem.drive.links(robot, problem.path, problem.free).step, speed * times[:, None]
    if problem.free is not None:
        axis = np.where(problem.free[:, None], np.inf, axis)
    if len(rows) < 2:
        step = np.zeros((0, robot.dof + space.d))
        return Links(step, np.inf, step, 0.0)
    most = share * (space.upper - space.lower)
    joint = np.minimum(np.add.reduceat(joint, rows[:-1], axis=0), JOINT_STEP)
    axis = np.minimum(np.add.reduceat(axis, rows[:-1], axis=0), most)
    step = np.concatenate([joint, axis], axis=1)
    unit = np.concatenate([np.full_like(joint, FREE_STEP), np.broadcast_to(most, axis.shape)], axis=1)
    return Links(step, problem.drive.gamma_step * np.diff(rows).max(), unit, problem.drive.motion / len(rows))


def _found(problem: Problem, sites: Sites, x: Array, links: Links, slope: float) -> tuple[_Knots, Integers]:
    """Best course on the grid of positions."""
    p, g, b, m = sites.valid.shape
    gains = problem.goal.gains(np.where(sites.valid, sites.value, 1.0), problem.path.n, slope)
    merit = np.where(sites.valid, gains, -np.inf).reshape(p, g * b, m)
    order = np.argsort(-merit, axis=1, kind="stable")[:, :KEEP]
    keep = np.zeros(merit.shape, dtype=np.bool_)
    np.put_along_axis(keep, order, True, axis=1)
    # The angle that comes last is the best position's at rest: standing still stays possible.
    keep.reshape(p, g, b, m)[:, -1] = True
    keep &= np.isfinite(merit)
    point, site, posture = np.nonzero(np.moveaxis(keep, 2, 0))
    q = sites.q.reshape(p, g * b, m, -1)[site, posture, point]
    value = sites.value.reshape(p, g * b, m)[site, posture, point]
    knots = _knots(problem, sites.rows, point, q, x[site], sites.gamma[site, posture // b], value, slope)
    found = _course(problem, knots, links)
    if isinstance(found, Gap):
        raise _gap_error(problem, sites.rows, found)
    return knots, found


def _knots(
    problem: Problem, rows: Integers, point: Integers, q: Array, x: Array, gamma: Array, value: Array, slope: float
) -> _Knots:
    """States that may be taken, with their turns and costs; ``point`` ascending places in ``rows``."""
    drive, robot = problem.drive, problem.model.robot
    singular, free = drive.near_singular(robot, q)
    gap = _distances(problem, q, x)
    keep = np.flatnonzero(free & (gap >= problem.clearance))
    turned = every_turn(robot, q[keep])
    near, inside = drive.near_limits(robot, turned.q)
    inside = _with_room(robot, turned.q, inside, point[keep[turned.target]], len(rows))
    row = keep[turned.target[inside]]
    merit = problem.goal.gains(value, problem.path.n, slope)[row]
    scale = float(np.abs(merit).mean()) or 1.0
    tight = drive.clearance * np.maximum(0.0, 1.0 - np.maximum(gap[row], 0.0) / max(drive.clearance_zone, 1e-9)) ** 2
    share = problem.share_of(rows)[point[row]]
    cost = share * (-merit / scale + singular[row] + near[inside] + tight)
    start = np.searchsorted(point[row], np.arange(len(rows) + 1)).astype(np.int64)
    empty = np.flatnonzero(np.diff(start) == 0)
    if len(empty):
        raise _gap_error(problem, rows, Gap(max(0, int(empty[0]) - 1), 0, 0, np.zeros(0), np.inf))
    extended = np.concatenate([turned.q[inside], x[row]], axis=1)
    return _Knots(Layers(start, extended, gamma[row], cost, merit), x[row], gamma[row], value[row])


def _with_room(robot: Robot, q: Array, inside: Bools, point: Integers, m: int) -> Bools:
    """Which poses are kept: those with room to the joint limits; all of a point where there are none of these."""
    roomy = inside & (limit_distance(robot, q) >= ROOM)
    some = np.bincount(point[roomy], minlength=m) > 0
    return np.asarray(np.where(some[point], roomy, inside))


def _distances(problem: Problem, q: Array, x: Array) -> Array:
    if problem.scene is None or not len(q):
        return np.full(len(q), np.inf)
    return distances(problem, q, problem.space.sites(x)[0], problem.space.table)


def _course(problem: Problem, knots: _Knots, links: Links) -> Integers | Gap:
    layers = knots.layers
    if problem.goal.aim != "worst":
        return cheapest_course(layers, links)
    floor = highest_floor(layers, links)
    if isinstance(floor, Gap):
        return floor
    low = layers.merit < floor
    return cheapest_course(replace(layers, cost=np.where(low, layers.cost + 1e6, layers.cost)), links)


def _around(
    problem: Problem, rows: Integers, at: tuple[Array, Array], h: Array, turn: float, slope: float
) -> tuple[_Knots, int]:
    """States on a finer grid about a course: its own, and a step along each coordinate and of gamma to either side."""
    x0, gamma0 = at
    offsets = [np.array(o) for o in product((0.0, -1.0, 1.0), repeat=problem.space.d) if np.count_nonzero(o) < 2]
    gamma = gamma0[:, None] + (turn * np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) if turn else np.zeros(1))
    if isinstance(problem.gamma, GammaRange):
        gamma = problem.gamma.inside(gamma)
    parts = []
    force = problem.forces(problem.space.table)[rows]
    for offset in offsets:
        x = problem.space.inside(x0 + offset * h)
        full = np.zeros((problem.path.n, problem.space.d))
        full[rows] = x
        e, _ = problem.space.sites(full)
        # Only the rows that are looked at are meant; the others stand anywhere.
        task, objective = problem.looked_at(problem.task_at(e, problem.space.table).at(rows), force)
        sweep = sweep_gamma(problem.arm, task, objective, gamma)
        point, g, b = np.nonzero(sweep.valid)
        found = (point, g, b)
        parts.append((point, sweep.q[found], x[point], gamma[point, g], sweep.value[found]))
    point, q, x, angle, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(point, kind="stable")
    return _knots(problem, rows, point[order], q[order], x[order], angle[order], value[order], slope), len(offsets)


def _gap_error(problem: Problem, rows: Integers, gap: Gap) -> InputError:
    a, b = int(rows[gap.after]), int(rows[min(gap.after + 1, len(rows) - 1)])
    return InputError(
        f"base moving along the path: no course leads on from point {a} to {b}",
        allowed="joints and axes within their speeds, clearance and distance from singularities kept",
        remedy="lower the feed, widen the ranges of the axes or of gamma, or move the part",
    )
