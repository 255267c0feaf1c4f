"""The interactive axes map of a posture study."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.cell import arm_of, scene_of
from machining.posture.posing import CHOSEN, Posed
from machining.setup import Setup
from machining.toolpaths.conversion import GivenPath
from robots import ModelDescription
from stiffarm.commands.posture.axes_page import AxesStudy, kept, thinned_angles


def axes_study(
    posed: Posed, setup: Setup, model: str | Path, description: ModelDescription, given: GivenPath | None = None
) -> AxesStudy | None:
    """What the page shows; None for a single point or gamma, and for an arm without any shape to draw.

    ``given``: the path's source, where the cell changes tools along it.
    """
    request, course = posed.request, posed.course
    if request.task.path.n < 2 or request.gammas.count < 3:
        return None
    arm = setup.arm or arm_of(model, description)
    if not arm.bodies:
        return None
    tools = None if given is None else Setup(setup.cell, arm).tools(given)
    scenes = (scene_of(setup.cell, arm),) if tools is None else tools.scenes
    error = None if posed.milling is None else posed.milling.errors[CHOSEN]
    worst = course.value.argmin() if error is None else np.abs(error.normal).argmax()
    rows = kept(request.task.path.n, np.array([worst]))
    task, objective, drive = request.task.at(rows), request.objective, request.drive
    clear = drive.clearance_at
    if clear is not None:
        drive = replace(drive, clearance_at=lambda q, point: clear(q, rows[point]))
    return AxesStudy(
        model=posed.model,
        task=task,
        drive=drive,
        scenes=scenes,
        place=np.zeros(len(rows), dtype=np.int64) if tools is None else tools.place[rows],
        looked=task,
        objective=objective.at(rows, request.task.path.n),
        words=objective.quantity,
        angles=thinned_angles(request.gammas.angles),
        gamma=course.gamma[rows],
        q=course.q[rows],
        value=course.value[rows],
        e=np.zeros((len(rows), len(setup.cell.linear_axes))),
        table=0.0,
        error=None if error is None else error.normal[rows],
        force=None if error is None else error.force[rows],
    )
