"""What a placement comes to along the path: stiffness, the criterion, the predicted surface error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from machining.cutting import Drawn, Estimated, SurfaceError, drawn_stiffness, surface_error
from machining.placement.problem import Problem
from machining.posture.problem import Course
from machining.stiffness.cartesian import translational
from machining.stiffness.criterion import Criterion, Terms
from machining.stiffness.indices import directional_stiffness
from robots.arrays import Array

# Every placement is judged for the same drawn arms.
SEED = 0


@dataclass(frozen=True, eq=False)
class Along:
    """A placement at n path points.

    ``e`` (n, k) m of all linear axes, ``table`` rad; ``course``: the postures; ``stiffness`` (n,) N/m along the
    cutting force; ``error``: the surface error; ``terms`` of K_sf;
    ``mean`` and ``worst`` stiffness N/m; ``merit`` of the goal, large is good. ``drawn``: the stiffness for arms drawn
    from what is uncertain about this one, the same for every placement; ``share`` (n,) of each point in its mean.
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

    def gain(self, other: Along) -> Estimated:
        """Mean stiffness over that of another placement of the same arm, with its 95 % interval."""
        return self.drawn.ratio(other.drawn, self._statistics()["mean"])

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
        problem.arm, task, course.q, problem.uncertainty, lambda C, point: directional_stiffness(C, force[point]),
        np.random.default_rng(SEED),
    )  # fmt: skip
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
