"""The base moving along the path: linear axes and arm share the motion.

States at knots of the path are base position x angle gamma x branch x turns; the course through them is found by the
dynamic programme of :mod:`machining.posture.courses`, with the axes as further joints: their speeds bound the steps,
and motion of arm and axes costs. On finer grids about the course it is found again. Between knots the axes follow a
curve without overshoot, smoothed until speeds, accelerations, joint limits and clearance are kept at all points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from machining.placement.following import Found, followed
from machining.placement.problem import Problem
from machining.placement.search import coarse_counts, grid_with, with_weights
from machining.placement.sweeping import Sites, check_reached, distances, sweep_sites
from machining.posture.courses import Gap, Layers, Links, cheapest_course, highest_floor, summed
from machining.posture.drive import FREE_STEP, limit_distance
from machining.posture.points import GammaRange, sweep_gamma
from machining.posture.problem import allowed, none_left
from machining.toolpaths.path_error import PathError
from robots import InputError
from robots.arrays import Array, Integers
from robots.inverse.solutions import why_no_closed_form
from robots.progress import Progress, report_progress

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
) -> Found:
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
            code="R004",
            value="an arm whose inverse kinematics is searched",
            allowed="arms with a closed form",
            remedy="use mode fixed or steps",
        )
    x, angles = grid_with(problem, POSITIONS[min(problem.space.d, 3)], ANGLES, also, gamma)
    count, error = 0, InputError("base moving along the path", code="G003")
    best: Found | None = None
    for trial, (many, most) in enumerate(TRIALS):
        rows = problem.path.even_rows(many)
        if problem.free is not None:
            # Both ends of a rapid move, or gamma between them would be mixed from before and after.
            ends = np.flatnonzero(problem.free)
            rows = np.unique(np.concatenate([rows, ends, ends + 1])).astype(np.int64)
        sites = sweep_sites(problem, *problem.space.sites(x), rows, angles)
        problem = with_weights(problem, sites)
        check_reached(problem, sites, ", moving along it")
        count += len(x)
        try:
            found = _once(problem, sites, x, most, also, progress)
        except InputError as raised:
            error = raised if trial == 0 else error
            continue
        count += found.evaluations
        if best is None or found.merit > best.merit:
            best = found
        if best.merit > enough:
            break
    if best is None:
        raise error
    return replace(best, evaluations=count)


def _once(
    problem: Problem, sites: Sites, x: Array, most: float, also: Array | None, progress: Progress | None
) -> Found:
    """The course with some knots and step, over all points; it counts the positions looked at on finer grids."""
    rows, count = sites.rows, 0
    links = _links(problem, rows, most)
    slope = _slope(problem, rows, np.where(sites.valid, sites.value, 0.0).max(axis=(0, 1, 2)))
    for _ in range(SLOPES):
        knots, course = _found(problem, sites, x, links, slope)
        last, slope = slope, _slope(problem, rows, knots.value[course])
        if slope == last:
            break
    at = knots.x[course], knots.gamma[course]
    h = 0.5 * (problem.space.upper - problem.space.lower) / (np.array(coarse_counts(problem, len(x))) - 1)
    turn = 0.5 * (problem.gamma.upper - problem.gamma.lower) / ANGLES if isinstance(problem.gamma, GammaRange) else 0.0

    def said(done: int) -> None:
        report_progress(progress, done, 2 * PASSES)

    for done in range(PASSES):
        said(done)
        finer, looked = _around(problem, rows, at, h, turn, slope)
        count += looked
        found = _course(problem, finer, links)
        if not isinstance(found, Gap):
            at = finer.x[found], finer.gamma[found]
        h, turn = 0.5 * h, 0.5 * turn
    still = None if also is None else also[-1]
    return replace(followed(problem, rows, at, still, lambda k: said(PASSES + k)), evaluations=count)


def _slope(problem: Problem, rows: Integers, value: Array) -> float:
    """Slope of K_sf's second term at values (m,) of some points; 0 for other goals, which are sums."""
    if problem.goal.aim != "ksf":
        return 0.0
    return problem.goal.weights_of_ksf.slope(float(value @ problem.share_of(rows)))


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
    joint, axis = np.minimum(summed(joint, rows), JOINT_STEP), np.minimum(summed(axis, rows), most)
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
    drive, robot, m = problem.drive, problem.model.robot, len(rows)
    if problem.scene is not None:
        e, _ = problem.space.sites(x)
        near = distances(problem, q, e, problem.space.table, rows[point])
        drive = replace(drive, clearance_at=lambda _, __: near, clearance_least=problem.clearance)
    try:
        row, turned, soft = allowed(robot, drive, q, point, m)
    except PathError as error:
        lost = none_left(error, rows[error.points], problem.path.n)
        raise lost.at(lost.points, "base moving along the path") from None
    # Poses with room to the joint limits; all of a point where there are none of these.
    roomy = limit_distance(robot, turned) >= ROOM
    kept = roomy | (np.bincount(point[row[roomy]], minlength=m) == 0)[point[row]]
    row, turned, soft = row[kept], turned[kept], soft[kept]
    merit = problem.goal.gains(value, problem.path.n, slope)[row]
    scale = float(np.abs(merit).mean()) or 1.0
    cost = problem.share_of(rows)[point[row]] * (soft - merit / scale)
    start = np.searchsorted(point[row], np.arange(m + 1)).astype(np.int64)
    extended = np.concatenate([turned, x[row]], axis=1)
    return _Knots(Layers(start, extended, gamma[row], cost, merit), x[row], gamma[row], value[row])


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
    (x0, gamma0), d = at, problem.space.d
    offsets = np.vstack([np.zeros(d), -np.eye(d), np.eye(d)])
    gamma = gamma0[:, None] + (turn * np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) if turn else np.zeros(1))
    if isinstance(problem.gamma, GammaRange):
        gamma = problem.gamma.inside(gamma)
    parts = []
    for offset in offsets:
        x = problem.space.inside(x0 + offset * h)
        e, _ = problem.space.sites(x)
        task, objective = problem.looked_at(e, problem.space.table, rows)
        sweep = sweep_gamma(problem.arm, task, objective, gamma)
        found = point, g, _ = np.nonzero(sweep.valid)
        parts.append((point, sweep.q[found], x[point], gamma[point, g], sweep.value[found]))
    point, q, x, angle, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(point, kind="stable")
    return _knots(problem, rows, point[order], q[order], x[order], angle[order], value[order], slope), len(offsets)


def _gap_error(problem: Problem, rows: Integers, gap: Gap) -> InputError:
    a, b = int(rows[gap.after]), int(rows[min(gap.after + 1, len(rows) - 1)])
    return InputError(
        f"base moving along the path: no course leads on from point {a} to {b}",
        code="G003",
        allowed="joints and axes within their speeds, clearance and distance from singularities kept",
        remedy="lower the feed, widen the ranges of the axes or of gamma, or move the part",
    )
