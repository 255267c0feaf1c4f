"""A placement followed over all points of the path: the base at rest, or its axes carried over from knots; its worth.

Axes that move are smoothed until speeds, accelerations, joint limits and clearance are kept at all points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from machining.cutting import Drawn, Estimated, SurfaceError, drawn_stiffness, surface_error
from machining.placement.problem import Problem
from machining.placement.sweeping import distances
from machining.posture.long_path import KNOTS, optimise_long_path
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from machining.posture.stretches import course_at
from machining.stiffness.cartesian import translational
from machining.stiffness.criterion import Criterion, Terms
from machining.stiffness.indices import directional_stiffness
from robots import InputError
from robots.arrays import Array, Integers

# Weights of smoothing that are tried, from none to nearly a straight line.
SMOOTHING = (0.0, 0.3, 3.0, 30.0, 300.0, 1e4)
# Knots of gamma where it is chosen again for a smoothed motion.
COURSE_KNOTS = 60
# A speed or acceleration on its limit must not fail by rounding.
ROUNDING = 1.0 + 1e-6
# Time (s) in which an axis is up to its speed where a cut begins, and at rest where it ends: what controllers blend
# corners over, and a verification with as much smoothing asks for.
START = 0.1
# Every placement is judged for the same drawn arms.
SEED = 0
# Shares of the motion about its mean position that are tried at each.
SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)


@dataclass(frozen=True, eq=False)
class Found:
    """Best position at rest, or motion: coordinates ``x`` (d,) or (n, d), ``gamma`` rad, one or (n,).

    ``course``: over all points, ``merit`` of it; ``problem``: with the weights of K_sf that were used;
    ``evaluations``: base positions looked at in all.
    """

    problem: Problem
    x: Array
    gamma: float | Array
    course: Course
    merit: float
    evaluations: int


def follow(
    problem: Problem,
    e: Array,
    table: float,
    gamma: float | Array | None,
    rows: Integers | None = None,
    *,
    knots: int = KNOTS,
    passes: int = 3,
) -> Course:
    """Best branch and turns over all points of the path (or some), with limits, steps, singularities and collisions.

    ``e`` (k,) m at rest, or (n, k) point by point; ``gamma`` rad, one or (n,), None: chosen along the path too, on
    ``knots`` with ``passes`` as :func:`machining.posture.long_path.optimise_long_path` does.

    Raises
    ------
    InputError
        As :func:`machining.course_at`.
    """
    rows = np.arange(problem.path.n) if rows is None else rows
    base = np.broadcast_to(e, (len(rows), np.shape(e)[-1]))
    task, objective = problem.looked_at(base, table, rows)
    free = None if problem.free is None or len(rows) < 2 else problem.free[rows[0] : rows[-1]]
    drive, generator = problem.drive, np.random.default_rng(0)
    if problem.scene is not None:
        # Where the base stands at each point decides what is near: branch and gamma are chosen with that in view.
        drive = replace(
            drive,
            clearance_at=lambda q, point: distances(problem, q, base[point], table, rows[point]),
            clearance_least=problem.clearance,
        )
    if gamma is not None:
        return course_at(problem.arm, task, gamma, objective, drive, free=free, generator=generator)
    assert isinstance(problem.gamma, GammaRange)  # noqa: S101 - else there is nothing to choose
    wanted = replace(objective, aim="worst" if problem.goal.aim == "worst" else "mean")
    return optimise_long_path(
        problem.arm, task, wanted, problem.gamma, drive, free=free, knots=knots, passes=passes, generator=generator
    ).course


def merit_of(problem: Problem, course: Course) -> float:
    """Merit of a course over all points of the path."""
    return float(problem.goal.merit(course.value, problem.share, problem.path.n))


def followed(
    problem: Problem,
    rows: Integers,
    at: tuple[Array, Array],
    still: Array | None,
    said: Callable[[int], None],
) -> Found:
    """The motion at all points: axes and gamma between knots, smoothed as much as limits need; the best of those."""
    error: InputError | None = None
    rest = at[0].mean(axis=0) if still is None else still
    between_knots = between(problem, rows, np.unwrap(at[1])[:, None])[:, 0]
    # Gamma as it was found at the knots; if that leads nowhere, chosen again for the smoothed motion.
    for gamma in (between_knots, None) if isinstance(problem.gamma, GammaRange) else (between_knots,):
        best: Found | None = None
        for done, weight in enumerate(SMOOTHING):
            said(done)
            for share in SHARES:
                x = problem.space.inside(between(problem, rows, rest + share * (smoothed(at[0], weight) - rest)))
                try:
                    check_rates(problem, x)
                    e, _ = problem.space.sites(x)
                    course = follow(problem, e, problem.space.table, gamma, knots=COURSE_KNOTS, passes=2)
                except InputError as raised:
                    error = error or raised
                    continue
                merit = merit_of(problem, course)
                if best is None or merit > best.merit:
                    best = Found(problem, x, course.gamma, course, merit, 0)
                break
            if best is not None and gamma is None:
                break
        if best is not None:
            return best
    assert error is not None  # noqa: S101 - every weight was tried
    raise error


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

    What lies between two cuts sets its own pace: an axis starts from rest behind it and comes to rest before it, within
    :data:`START`, for where a cut begins behind a plunge nothing waits for the axis.
    """
    times = problem.path.times.copy()
    free = np.zeros(len(times), dtype=np.bool_) if problem.free is None else problem.free
    times[free] = np.nan
    speed = np.diff(x, axis=0) / times[:, None]
    known = np.where(free[:, None], 0.0, speed)
    pairs = np.where(np.stack([free[1:], free[:-1]]), 0.0, np.stack([times[1:], times[:-1]]))
    half = 0.5 * pairs.sum(axis=0)
    half = np.where(free[1:] != free[:-1], np.minimum(half, START), half)
    return speed, np.diff(known, axis=0) / np.where(half > 0.0, half, np.nan)[:, None]


def check_rates(problem: Problem, x: Array) -> None:
    """Raise InputError for what an axis would have to do beyond its speed or acceleration."""
    speed, acceleration = axis_rates(problem, x)
    for d, number in enumerate(problem.space.free):
        axis = problem.cell.linear_axes[number]
        for what, unit, rate, most in (
            ("speed", "mm/s", speed[:, d], axis.speed),
            ("acceleration", "mm/s^2", acceleration[:, d], axis.acceleration),
        ):
            size = np.where(np.isnan(rate), 0.0, np.abs(rate))
            if most is not None and size.max(initial=0.0) > most * ROUNDING:
                raise InputError(
                    f"{what} of axis {axis.name} at point {int(np.argmax(size))}",
                    code="G006",
                    value=f"{size.max() * 1e3:.3g} {unit}",
                    allowed=f"{most * 1e3:g} {unit}",
                    remedy="lower the feed, or use mode fixed or steps",
                )


@dataclass(frozen=True, eq=False)
class Along:
    """A placement at n path points.

    ``e`` (n, k) m of all linear axes, ``table`` rad; ``course``: the postures; ``stiffness`` (n,) N/m along the
    cutting force; ``error``: the surface error; ``terms`` of K_sf;
    ``mean`` and ``worst`` stiffness N/m; ``merit`` of the goal, large is good. ``drawn``: the stiffness for arms drawn
    from what is uncertain about this one, the same for every placement; ``share`` (n,) of each point in its mean;
    ``criterion``: the weights of K_sf.
    """

    e: Array
    table: float
    course: Course
    stiffness: Array
    error: SurfaceError
    terms: Terms
    mean: float
    worst: float
    merit: float
    drawn: Drawn
    share: Array
    criterion: Criterion

    @property
    def k_sf(self) -> float:
        """K_sf, a pure number."""
        return float(self.terms.value)

    def estimated(self) -> dict[str, Estimated]:
        """K_sf ("K_sf"), mean and worst stiffness ("mean", "worst", N/m) with 95 % intervals."""
        return {name: self.drawn.estimated(of) for name, of in self._statistics().items()}

    def gain(self, other: Along, of: Literal["mean", "worst"] = "mean") -> Estimated:
        """Mean (or worst) stiffness over that of another placement of the same arm, with its 95 % interval."""
        return self.drawn.ratio(other.drawn, self._statistics()[of])

    def _statistics(self) -> dict[str, Callable[[Array], Array]]:
        return {
            "K_sf": lambda k: self.criterion.terms(k, self.share).value,
            "mean": lambda k: np.asarray(k @ self.share),
            "worst": lambda k: np.asarray(k.min(axis=-1)),
        }

    @property
    def error_rms(self) -> float:
        """RMS of the surface error, m."""
        return self.error.statistics()["rms"]


def along(problem: Problem, e: Array, table: float, course: Course, criterion: Criterion) -> Along:
    """Evaluate a course of postures at base positions e (n, k) m, point by point."""
    task = problem.task_at(e, table)
    force = problem.forces(table)
    stiffness = directional_stiffness(translational(problem.arm, course.q, task.tip), force)
    share = problem.share if not problem.goal.minimised else np.full(len(e), 1.0 / len(e))
    error = surface_error(problem.arm, task, course.q, problem.force, stiffness=problem.uncertainty)
    drawn = drawn_stiffness(
        problem.arm,
        task,
        course.q,
        problem.uncertainty,
        lambda C, point: directional_stiffness(C, force[point]),
        np.random.default_rng(SEED),
    )
    value = np.abs(error.normal) if problem.goal.minimised else stiffness
    return Along(
        e=e,
        table=table,
        course=course,
        stiffness=stiffness,
        error=error,
        terms=criterion.terms(stiffness, share),
        mean=float(stiffness @ share),
        worst=float(stiffness.min()),
        drawn=drawn,
        share=share,
        criterion=criterion,
        merit=float(problem.goal.merit(value, problem.share, problem.path.n)),
    )
