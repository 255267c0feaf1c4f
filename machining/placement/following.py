"""A placement followed over all points of the path: branch and turns at given base positions and gamma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from machining.placement.problem import Problem
from machining.placement.sweeping import distances
from machining.posture.long_path import follow_gamma
from machining.posture.path import course_at
from machining.posture.problem import Course
from robots.arrays import Array, Integers
from robots.inverse.solutions import why_no_closed_form


def follow(problem: Problem, e: Array, table: float, gamma: float | Array, rows: Integers | None = None) -> Course:
    """Best branch and turns over all points of the path (or some), with limits, steps, singularities and collisions.

    ``e`` (k,) m at rest. Errors as :func:`machining.posture.long_path.follow_gamma`.
    """
    everywhere = rows is None
    task, objective = problem.looked_at(problem.task_at(e, table), problem.forces(table))
    free = problem.free
    if rows is not None:
        task = task.at(rows)
        force = objective.force
        objective = replace(objective, force=None if force is None else force[rows])
        free = None if free is None or len(rows) < 2 else free[rows[0] : rows[-1]]
    drive = problem.drive
    if problem.scene is not None:
        drive = replace(
            drive, clearance_of=lambda q: distances(problem, q, e, table), clearance_least=problem.clearance
        )
    if why_no_closed_form(problem.model.robot) is None:
        return follow_gamma(problem.arm, task, gamma, objective, drive, free=free)
    if everywhere and free is not None and free.any():
        drive = replace(drive, jump=np.pi)
    return course_at(problem.arm, task, gamma, objective, drive, generator=np.random.default_rng(0))


def merit_of(problem: Problem, course: Course) -> float:
    """Merit of a course over all points of the path."""
    return float(problem.goal.merit(course.value, problem.share, problem.path.n))
