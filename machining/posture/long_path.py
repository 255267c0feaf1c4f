"""Posture along a path of very many points: gamma chosen at knots, the arm followed exactly at every point.

CAM programs have a point every few tenths of a millimetre; gamma need not be chosen at each of them. Here the course
of :mod:`machining.posture.path` is found on knots, gamma between them is interpolated without overshoot, and branch and
turns are then chosen again for **all** points, so that limits, steps and singularities are kept everywhere. Where that
fails, knots are added and the search is repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

import fem
from machining.posture.courses import Gap, Links, summed
from machining.posture.drive import Drive
from machining.posture.path import refine_course
from machining.posture.points import GammaRange, sweep_gamma
from machining.posture.problem import (
    Course,
    at_knots,
    at_points,
    constant_axis,
    ends_of,
    gap_error,
    kept_constant,
    problem_of,
    states_of,
)
from machining.posture.stretches import GivenGamma, course_at, solve
from machining.stiffness.objective import Objective
from machining.task import Task
from machining.toolpaths.path_error import PathError
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.inverse.following import is_redundant
from robots.progress import Progress, report_progress

# Knots at first; enough that a smooth surface's gamma is found, few enough for a second's search.
KNOTS = 300
# Searches with less change of gamma, or more knots, where the last one failed, before it is given up.
TRIALS = 20
# Cells of the grid that gamma changes by from knot to knot at first.
CELLS = 2.0


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
    generator: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> LongCourse:
    """Choose gamma, branch and turns along a path of any length.

    Parameters
    ----------
    free : (n - 1,) segments whose steps are not bounded: rapid moves, on which the controller moves as it likes
    knots : points at which gamma is chosen at first; with as many as points it is :func:`machining.optimise_path`
    passes, generator : as in :func:`machining.optimise_path`
    progress : called with (done, total) steps

    Raises
    ------
    InputError
        As :func:`machining.optimise_path`.
    """
    objective, gammas, drive = objective or Objective(), gammas or GammaRange(), drive or Drive()
    if drive.turn_gain > 0.0 and drive.gamma_step > 0.0 and constant_axis(task):
        again = partial(
            optimise_long_path,
            model,
            task,
            objective,
            gammas,
            free=free,
            knots=knots,
            passes=passes,
            generator=generator,
        )
        turning = again(drive=replace(drive, turn_gain=0.0), progress=progress)
        try:
            constant = again(drive=replace(drive, turn_gain=0.0, gamma_step=0.0)).course
        except InputError:
            return turning
        return replace(turning, course=kept_constant(objective, drive, turning.course, constant))
    search = _Search(model, task, objective, gammas, drive, free, passes, generator)
    chosen = task.path.even_rows(min(knots, task.path.n))
    if free is not None:
        # Both ends of a rapid move: gamma may change there as it likes.
        chosen = np.union1d(chosen, ends_of(free))
    rate = _first_rate(chosen, drive.gamma_step, gammas.cell)
    for trial in range(TRIALS):
        report_progress(progress, trial, TRIALS)
        try:
            found, error = search.course(chosen, rate)
        except InputError:
            if trial > 0:
                raise
            # Gamma has to change faster than is usual.
            rate = np.full(task.path.n - 1, drive.gamma_step)
            continue
        if isinstance(error, Course):
            report_progress(progress, TRIALS, TRIALS)
            return LongCourse(error, chosen)
        more = _tighter(chosen, rate, found.gamma, error.points, gammas.cell)
        if (len(more) == len(chosen) == task.path.n) or trial == TRIALS - 1:
            raise error
        chosen = more
    raise AssertionError("unreachable")  # pragma: no cover


@dataclass(frozen=True, eq=False)
class _Search:
    """A search on knots, followed at all points."""

    model: fem.ArmModel
    task: Task
    objective: Objective
    gammas: GammaRange
    drive: Drive
    free: Bools | None
    passes: int
    generator: np.random.Generator | None

    def course(self, knots: Integers, rate: Array) -> tuple[Course, Course | PathError]:
        """Best course on the knots, and the course of all points, or what is in its way.

        Raises
        ------
        InputError
            No course on the knots alone.
        """
        task, objective = at_knots(self.task, self.objective, knots)
        sweep = sweep_gamma(self.model, task, objective, self.gammas.angles, generator=self.generator)
        drive = at_points(self.drive, knots)
        problem = problem_of(self.model, task, objective, self.gammas, drive, sweep.best_merit(), self.generator)
        n, links = self.task.path.n, self.drive.links(self.model.robot, self.task.path, self.free)
        share = np.gradient(knots.astype(np.float64)) / (n - 1) if len(knots) > 1 else np.ones(1)
        problem = replace(problem, links=_between_knots(links, rate, knots, n), share=share).eased(sweep)
        states = states_of(problem, sweep)
        found = solve(problem, states, problem.links)
        if isinstance(found, Gap) and self.passes == 0:
            raise _at_points(gap_error(problem, found), knots)
        if not isinstance(found, Gap):
            # Before the finer grids: a change of gamma that leads out of reach is no use refining.
            lost = self._lost(_between(knots, found.gamma, n))
            if lost is not None:
                return found, lost
        best = refine_course(problem, states, found, self.passes) if self.passes > 0 else found
        if isinstance(best, Gap):
            raise _at_points(gap_error(problem, best), knots)
        followed = self._follow(_between(knots, best.gamma, n))
        if isinstance(followed, PathError) and not isinstance(found, Gap) and best is not found:
            coarse = self._follow(_between(knots, found.gamma, n))
            followed = followed if isinstance(coarse, PathError) else coarse
        return best, followed

    def _lost(self, gamma: Array) -> PathError | None:
        if is_redundant(self.model.robot):
            return None  # Following the elbow would have to be done twice.
        try:
            GivenGamma(self.model, self.task, self.objective, gamma, self.generator).best_merit()
        except PathError as error:
            return error
        return None

    def _follow(self, gamma: Array) -> Course | PathError:
        try:
            return course_at(
                self.model, self.task, gamma, self.objective, self.drive, free=self.free, generator=self.generator
            )
        except PathError as error:
            return error


def _between(knots: Integers, gamma: Array, n: int) -> Array:
    """Gamma (n,) at all points from that at the knots, without overshoot."""
    if len(knots) == n:
        return gamma
    if len(knots) == 1:
        return np.full(n, gamma[0])
    return np.asarray(PchipInterpolator(knots, np.unwrap(gamma))(np.arange(n, dtype=np.float64)))


def _first_rate(knots: Integers, most: float, cell: float) -> Array:
    """What gamma may change by from point to point (n - 1,) rad at first.

    Between knots some points apart no more than two cells of the grid: then it cannot pass from one range of gamma to
    another through what is barred between them, for the knots would see that.
    """
    many = np.diff(knots)
    return np.repeat(np.where(many > 1, np.minimum(most, CELLS * cell / np.maximum(many, 1)), most), many)


def _tighter(knots: Integers, rate: Array, gamma: Array, bad: Integers, cell: float) -> Integers:
    """What to change where gamma between knots went wrong: knots with those to add; ``rate`` is changed in place.

    A change of gamma that is larger than a cell of the grid is halved. A small one goes astray only because what is
    allowed moves between the knots: there are too few.
    """
    segments = np.unique(np.clip(np.searchsorted(knots, bad, side="right") - 1, 0, len(knots) - 2))
    change = np.abs(np.diff(np.unwrap(gamma)))[segments]
    added = [knots]
    for k, moved in zip(segments, change, strict=True):
        a, b = int(knots[k]), int(knots[k + 1])
        if moved > cell:
            rate[a:b] = np.minimum(rate[a:b], 0.5 * moved / (b - a))
        else:
            inside = bad[(bad > a) & (bad < b)]
            middle = int(inside[len(inside) // 2]) if len(inside) else (a + b) // 2
            added.append(np.unique([(a + middle) // 2, middle, (middle + b) // 2]))
    return np.unique(np.concatenate(added))


def _at_points(error: PathError, knots: Integers) -> PathError:
    a, b = knots[error.point], knots[min(error.point + 1, len(knots) - 1)]
    return error.at(int(a), f"between points {a} and {b}")


def _between_knots(links: Links, rate: Array, knots: Integers, n: int) -> Links:
    """What the segments between two knots allow together."""
    unit = summed(links.unit, knots) / np.sqrt(np.diff(knots))[:, None]
    return Links(summed(links.step, knots), summed(rate, knots), unit, links.weight / n)
