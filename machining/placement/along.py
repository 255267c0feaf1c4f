"""What a placement comes to along the path: stiffness, the criterion, the predicted surface error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cutting import SurfaceError, surface_error
from machining.placement.problem import Problem
from machining.posture.problem import Course
from machining.stiffness.cartesian import translational
from machining.stiffness.criterion import Criterion, Terms
from machining.stiffness.indices import directional_stiffness
from robots.arrays import Array, Integers


@dataclass(frozen=True, eq=False)
class Along:
    """A placement at n path points.

    ``e`` (n, k) m of all linear axes, ``table`` rad; ``gamma`` (n,) rad, ``q`` (n, dof) rad, ``branch`` (n,) into
    ``names``; ``stiffness`` (n,) N/m along the cutting force; ``error``: the surface error; ``terms`` of K_sf;
    ``mean`` and ``worst`` stiffness N/m; ``merit`` of the goal, large is good.
    """

    e: Array
    table: float
    gamma: Array
    q: Array
    branch: Integers
    names: tuple[str, ...]
    stiffness: Array
    error: SurfaceError
    terms: Terms
    mean: float
    worst: float
    merit: float

    @property
    def k_sf(self) -> float:
        """K_sf, a pure number."""
        return float(self.terms.value)

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
    error = surface_error(problem.arm, task, course.q, problem.force)
    value = np.abs(error.normal) if problem.goal.minimised else stiffness
    return Along(
        e=e,
        table=table,
        gamma=course.gamma,
        q=course.q,
        branch=course.branch,
        names=course.names,
        stiffness=stiffness,
        error=error,
        terms=criterion.terms(stiffness, share),
        mean=float(stiffness @ share),
        worst=float(stiffness.min()),
        merit=float(problem.goal.merit(value, problem.share, problem.path.n)),
    )
