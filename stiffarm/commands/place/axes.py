"""The interactive axes map of a placement: gamma along the path where the base should stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from machining.cell import ArmBodies, scene_of
from machining.placement.study import PlacedStep
from machining.placement.sweeping import distances
from machining.posture.points import GammaRange
from machining.setup import Setup
from robots.arrays import Array, Integers
from stiffarm.commands.posture.axes_page import AxesStudy, kept, thinned_angles

# Angles of the map where the search had fewer.
ANGLES = 72


def axes_study(step: PlacedStep, arm: ArmBodies) -> AxesStudy | None:
    """What the page shows; None for a single point or gamma, and for an arm without any shape to draw."""
    problem, after = step.placed.problem, step.placed.after
    if problem.path.n < 2 or not isinstance(problem.gamma, GammaRange):
        return None
    scene = problem.scene or scene_of(step.cell, arm)
    if not scene.arm.bodies:
        return None
    tools = problem.tools
    if tools is not None and not tools.scenes:
        tools = Setup(step.cell, scene.arm).tools(step.given)
    error = after.error
    rows = kept(problem.path.n, np.array([np.abs(error.normal).argmax(), after.stiffness.argmin()]))
    e, table = after.e[rows], after.table
    looked, objective = problem.looked_at(e, table, rows)

    def clear(q: Array, point: Integers) -> Array:
        return distances(problem, q, e[point], table, rows[point])

    drive = replace(problem.drive, clearance_at=clear, clearance_least=problem.clearance)
    task = problem.task_at(e, table, rows)
    return AxesStudy(
        model=problem.arm,
        task=task,
        drive=problem.drive if problem.scene is None else drive,
        scenes=(scene,) if tools is None else tools.scenes,
        place=np.zeros(len(rows), dtype=np.int64) if tools is None else tools.place[rows],
        looked=looked,
        objective=objective,
        words="surface error" if problem.goal.minimised else "stiffness along the force",
        angles=thinned_angles(replace(problem.gamma, count=max(problem.gamma.count, ANGLES)).angles),
        gamma=after.course.gamma[rows],
        q=after.course.q[rows],
        value=objective.values(problem.arm, after.course.q[rows], looked, np.arange(len(rows))),
        e=e,
        table=table,
        error=error.normal[rows],
        force=error.force[rows],
    )
