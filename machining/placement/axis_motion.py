"""Axes that move along the path: from knots to all points, smooth enough for speeds, accelerations and the arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from machining.placement.following import merit_of
from machining.placement.problem import Problem
from machining.placement.sweeping import distances
from machining.posture.long_path import follow_gamma, optimise_long_path
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from robots import InputError
from robots.arrays import Array, Integers

# Weights of smoothing that are tried, from none to nearly a straight line.
SMOOTHING = (0.0, 0.3, 3.0, 30.0, 300.0, 1e4)
# Knots of gamma where it is chosen again for a smoothed motion.
COURSE_KNOTS = 60
# A speed or acceleration on its limit must not fail by rounding.
ROUNDING = 1.0 + 1e-6
# Shares of the motion about its mean position that are tried at each.
SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)


def followed(
    problem: Problem,
    rows: Integers,
    at: tuple[Array, Array],
    still: Array | None,
    said: Callable[[int], None],
) -> tuple[Array, Array, Course, float]:
    """The course at all points: axes and gamma between knots, smoothed as much as limits need; the best of those."""
    error: InputError | None = None
    rest = at[0].mean(axis=0) if still is None else still
    gamma = between(problem, rows, np.unwrap(at[1])[:, None])[:, 0]
    for chosen in (False, True) if isinstance(problem.gamma, GammaRange) else (False,):
        best: tuple[Array, Array, Course, float] | None = None
        for done, weight in enumerate(SMOOTHING):
            said(done)
            for share in SHARES:
                x = problem.space.inside(between(problem, rows, rest + share * (smoothed(at[0], weight) - rest)))
                fault = axis_fault(problem, x)
                if fault is not None:
                    error = error or fault
                    continue
                try:
                    course = follow_moving(problem, x, None if chosen else gamma)
                except InputError as raised:
                    error = error or raised
                    continue
                merit = merit_of(problem, course)
                if best is None or merit > best[3]:
                    best = x, course.gamma, course, merit
                break
            if best is not None and chosen:
                break
        if best is not None:
            return best
    assert error is not None  # noqa: S101 - every weight was tried
    raise error


def follow_moving(problem: Problem, x: Array, gamma: Array | None) -> Course:
    """Best branch and turns for a base moving through x (n, d), at gamma (n,) rad, or with gamma chosen too.

    InputError where it cannot be driven or collides.
    """
    e, _ = problem.space.sites(x)
    table = problem.space.table
    task, objective = problem.looked_at(problem.task_at(e, table), problem.forces(table))
    drive = problem.drive
    if problem.scene is not None:
        # Where the base stands at each point decides what is near: branch and gamma are chosen with that in view.
        drive = replace(
            drive,
            clearance_at=lambda q, point: distances(problem, q, e[point], table),
            clearance_least=problem.clearance,
        )
    if gamma is not None:
        course = follow_gamma(problem.arm, task, gamma, objective, drive, free=problem.free)
    else:
        assert isinstance(problem.gamma, GammaRange)  # noqa: S101 - else there is nothing to choose
        wanted = replace(objective, aim="worst" if problem.goal.aim == "worst" else "mean")
        course = optimise_long_path(
            problem.arm, task, wanted, problem.gamma, drive, free=problem.free, knots=COURSE_KNOTS, passes=2
        ).course
    gap = distances(problem, course.q, e, table)
    if (gap < problem.clearance).any():
        row = int(np.argmin(gap))
        raise InputError(
            f"base moving along the path: clearance at point {row}",
            value=f"{max(gap[row], 0.0) * 1e3:.3g} mm",
            allowed=f"{problem.clearance * 1e3:g} mm",
            remedy="keep the ranges of the axes away from what is in the way",
        )
    return course


def between(problem: Problem, rows: Integers, values: Array) -> Array:
    """Values (m, c) at some points carried over to all (n, c), without overshoot."""
    if len(rows) == problem.path.n:
        return values
    turn = np.linalg.norm(np.diff(problem.path.axes, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(np.maximum(problem.path.lengths + turn, 1e-9))])
    return np.asarray(PchipInterpolator(way[rows], values)(way))


def smoothed(values: Array, weight: float) -> Array:
    """Values (m, c) with least squares of second differences, ``weight`` against staying (Whittaker 1923)."""
    m = len(values)
    if weight == 0.0 or m < 3:
        return values
    D = np.diff(np.eye(m), 2, axis=0)
    return np.asarray(np.linalg.solve(np.eye(m) + weight * D.T @ D, values))


def axis_rates(problem: Problem, x: Array) -> tuple[Array, Array]:
    """Speeds (n - 1, d) m/s and accelerations (n - 2, d) m/s^2 of the axes at the path's feed; NaN without one.

    Rapid moves set their own pace: an axis starts from rest after one and comes to rest before one.
    """
    times = problem.path.times.copy()
    free = np.zeros(len(times), dtype=np.bool_) if problem.free is None else problem.free
    times[free] = np.nan
    speed = np.diff(x, axis=0) / times[:, None]
    known = np.where(free[:, None], 0.0, speed)
    pairs = np.where(np.stack([free[1:], free[:-1]]), 0.0, np.stack([times[1:], times[:-1]]))
    half = 0.5 * pairs.sum(axis=0)
    return speed, np.diff(known, axis=0) / np.where(half > 0.0, half, np.nan)[:, None]


def axis_fault(problem: Problem, x: Array) -> InputError | None:
    """What an axis would have to do beyond its speed or acceleration, or None."""
    speed, acceleration = axis_rates(problem, x)
    for d, number in enumerate(problem.space.free):
        axis = problem.cell.linear_axes[number]
        for what, unit, rate, most in (
            ("speed", "mm/s", speed[:, d], axis.speed),
            ("acceleration", "mm/s^2", acceleration[:, d], axis.acceleration),
        ):
            if most is None or not len(rate):
                continue
            size = np.where(np.isnan(rate), 0.0, np.abs(rate))
            if size.max() > most * ROUNDING:
                return InputError(
                    f"{what} of axis {axis.name} at point {int(np.argmax(size))}",
                    value=f"{size.max() * 1e3:.3g} {unit}",
                    allowed=f"{most * 1e3:g} {unit}",
                    remedy="lower the feed, or use mode fixed or steps",
                )
    return None
