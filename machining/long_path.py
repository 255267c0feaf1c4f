"""Posture along a path of very many points: gamma chosen at knots, the arm followed exactly at every point.

CAM programs have a point every few tenths of a millimetre; gamma need not be chosen at each of them. Here the course
of :mod:`machining.path_posture` is found on knots, gamma between them is interpolated without overshoot, and branch and
turns are then chosen again for **all** points, so that limits, steps and singularities are kept everywhere. Where that
fails, knots are added and the search is repeated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

import fem
from machining.courses import Gap, Links
from machining.drive import Drive
from machining.objective import Objective
from machining.path_posture import refine_course
from machining.path_problem import Course, Problem, gap_error, problem_of, solve, states_of
from machining.posture import GammaRange, sweep_gamma
from machining.task import Task, ToolPath
from robots import InputError

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Integers = NDArray[np.int64]

# Knots at first; enough that a smooth surface's gamma is found, few enough for a second's search.
KNOTS = 300
# Searches with more knots before it is given up.
TRIALS = 5
# Turning the tool by a radian counts as much as moving by this many m when knots are spread.
LEVER = 0.5


@dataclass(frozen=True, eq=False)
class LongCourse:
    """A course (as :class:`machining.Course`, one posture a point), and the ``knots`` (k,) where gamma was chosen."""

    course: Course
    knots: Integers


def optimise_long_path(
    model: fem.ArmModel,
    task: Task,
    objective: Objective | None = None,
    gammas: GammaRange | None = None,
    drive: Drive | None = None,
    *,
    free: Bools | None = None,
    knots: int = KNOTS,
    passes: int = 3,
    progress: Callable[[int, int], None] | None = None,
) -> LongCourse:
    """Choose gamma, branch and turns along a path of any length.

    Parameters
    ----------
    free : (n - 1,) segments whose steps are not bounded: rapid moves, on which the controller moves as it likes
    knots : points at which gamma is chosen at first; with as many as points it is :func:`machining.optimise_path`
    passes : as in :func:`machining.optimise_path`
    progress : called with (done, total) steps

    Raises
    ------
    InputError
        As :func:`machining.optimise_path`; the arm has no closed-form inverse kinematics.
    """
    objective, gammas, drive = objective or Objective(), gammas or GammaRange(), drive or Drive()
    links = _links(model, task, drive, free)
    chosen = _spread(task.path, min(knots, task.path.n))
    for trial in range(TRIALS):
        if progress is not None:
            progress(trial, TRIALS)
        gamma = _gamma(model, task, objective, gammas, drive, links, chosen, passes)
        found = _follow(model, task, gamma, objective, drive, links)
        if not isinstance(found, InputError):
            if progress is not None:
                progress(TRIALS, TRIALS)
            return LongCourse(found, chosen)
        if len(chosen) == task.path.n or trial == TRIALS - 1:
            raise found
        chosen = _spread(task.path, min(3 * len(chosen), task.path.n))
    raise AssertionError("unreachable")  # pragma: no cover


def follow_gamma(
    model: fem.ArmModel,
    task: Task,
    gamma: float | Array,
    objective: Objective | None = None,
    drive: Drive | None = None,
    *,
    free: Bools | None = None,
) -> Course:
    """Best branch and turns for a given gamma, one for all points or (n,) rad, on a path of any length.

    Arguments and errors as :func:`optimise_long_path`.
    """
    objective, drive = objective or Objective(), drive or Drive()
    angle = np.broadcast_to(np.asarray(gamma, dtype=np.float64), (task.path.n,))
    found = _follow(model, task, angle, objective, drive, _links(model, task, drive, free))
    if isinstance(found, InputError):
        raise found
    return found


def _links(model: fem.ArmModel, task: Task, drive: Drive, free: Bools | None) -> Links:
    links = drive.links(model.robot, task.path)
    if free is None:
        return links
    if free.shape != (task.path.n - 1,):
        raise InputError("free segments", value=f"shape {free.shape}", allowed=f"({task.path.n - 1},)")
    return replace(links, step=np.where(free[:, None], np.inf, links.step))


def _spread(path: ToolPath, count: int) -> Integers:
    """Knots evenly along the path, where turning of the tool counts as length; first and last point among them."""
    turn = np.linalg.norm(np.diff(path.axes, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(path.lengths + LEVER * turn)])
    if count >= path.n:
        return np.arange(path.n)
    wanted = np.linspace(0.0, way[-1], max(2, count))
    return np.unique(np.clip(np.searchsorted(way, wanted), 0, path.n - 1).astype(np.int64))


def _gamma(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gammas: GammaRange,
    drive: Drive,
    links: Links,
    knots: Integers,
    passes: int,
) -> Array:
    """Gamma (n,) of the best course on the knots, interpolated to all points."""
    knot_task, knot_objective = _at_knots(task, objective, knots)
    sweep = sweep_gamma(model, knot_task, knot_objective, gammas.angles)
    problem = problem_of(model, knot_task, knot_objective, gammas, drive, sweep, None)
    share = np.gradient(knots.astype(np.float64)) / (task.path.n - 1) if len(knots) > 1 else np.ones(1)
    problem = replace(problem, links=_summed(links, knots, task.path.n), share=share)
    states = states_of(problem, sweep)
    found = solve(problem, states, problem.links)
    best = refine_course(problem, states, found, passes) if passes > 0 else found
    if isinstance(best, Gap):
        a, b = knots[best.after], knots[best.after + 1]
        raise gap_error(problem, states, best).at(int(a), f"between points {a} and {b}")
    way = np.arange(task.path.n, dtype=np.float64)
    if len(knots) == task.path.n:
        return best.gamma
    if len(knots) == 1:
        return np.full(task.path.n, best.gamma[0])
    return np.asarray(PchipInterpolator(knots, np.unwrap(best.gamma))(way))


def _at_knots(task: Task, objective: Objective, knots: Integers) -> tuple[Task, Objective]:
    # The feed is in the links already; between knots the way is longer than the chord.
    few = task.at(knots, feed=np.full(len(knots), np.nan))
    forces = objective.forces(task.path.n)
    return few, replace(objective, force=None if forces is None else forces[knots])


def _summed(links: Links, knots: Integers, n: int) -> Links:
    """What the segments between two knots allow together."""
    if len(knots) < 2:
        return replace(links, step=links.step[:0], unit=links.unit[:0])
    many = np.diff(knots)[:, None]
    step = np.add.reduceat(links.step, knots[:-1], axis=0)
    unit = np.add.reduceat(links.unit, knots[:-1], axis=0) / np.sqrt(many)
    gamma_step = links.gamma_step * float(many.min()) if np.isfinite(links.gamma_step) else links.gamma_step
    return Links(step, gamma_step, unit, links.weight / n)


def _follow(
    model: fem.ArmModel, task: Task, gamma: Array, objective: Objective, drive: Drive, links: Links
) -> Course | InputError:
    """Best branches and turns at a given gamma, or what is in the way."""
    try:
        sweep = sweep_gamma(model, task, objective, gamma[:, None])
        problem: Problem = problem_of(model, task, objective, GammaRange(), drive, sweep, None)
        problem = replace(problem, links=replace(links, weight=links.weight / task.path.n))
        states = states_of(problem, sweep)
    except InputError as error:
        return error
    found = solve(problem, states, problem.links)
    return gap_error(problem, states, found) if isinstance(found, Gap) else found
