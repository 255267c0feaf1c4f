"""axes.html: the axes map to drag a course through, with the arm that follows and the path in colours of its error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from scipy.ndimage import label

import fem
from machining.cell import ArmBodies, Scene, scene_of
from machining.placement.study import PlacedStep
from machining.placement.sweeping import distances
from machining.posture.axes_cells import AxesCells, causes_of, errors_of
from machining.posture.axes_map import axes_map
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.posture.posing import CHOSEN, Posed
from machining.setup import Setup
from machining.stiffness.objective import Objective, shown
from machining.task import Task
from machining.toolpaths.conversion import GivenPath
from robots.arrays import Array, Integers
from stiffarm.pages.cell_bodies import body_surfaces, cell_data, placed_in_world
from stiffarm.pages.numbers import typeset
from stiffarm.pages.parts import packed, render_page
from stiffarm.pages.sight import towards
from stiffarm.pages.style import STIFFNESS_COLOURS

NAME = "axes.html"
# Points of the path and angles that the page holds.
MOST_POINTS, MOST_ANGLES = 160, 73
MOST_TRIANGLES = 40_000
COLOURS = 64
# Triangles of a body that sight is judged by.
COARSE = 300
# What must be seen about the worst point, m.
ABOUT = 0.05
# Zones of fewer cells than this share of the map get no name on it.
LEAST_NAMED = 0.004


@dataclass(frozen=True, eq=False)
class AxesStudy:
    """A course along a path, and what its axes map is made of; everything is over the n points that the page holds.

    Attributes
    ----------
    model, task, drive : arm, path on the part, limits
    scenes, place : bodies with each tool, and (n,) whose are there at each point
    looked, objective, words : what the map's colour is of: the task with the directions that it is looked at in, and
        what it is called
    angles : (m,) rad of the map
    gamma, q, value : (n,) rad, (n, dof) rad and (n,) of the objective along the course
    e, table : (n, k) m of the linear axes and rad of the turntable
    error, force : (n,) m along the course and (n, 3) N in base axes; None without a cutting force
    """

    model: fem.ArmModel
    task: Task
    drive: Drive
    scenes: tuple[Scene, ...]
    place: Integers
    looked: Task
    objective: Objective
    words: str
    angles: Array
    gamma: Array
    q: Array
    value: Array
    e: Array
    table: float
    error: Array | None
    force: Array | None


def axes_study(posed: Posed, setup: Setup, given: GivenPath | None = None) -> AxesStudy | None:
    """What the page of `posture` shows; None for a single point or gamma, and for an arm without any shape to draw.

    ``given``: the path's source, where the cell changes tools along it.
    """
    request, course = posed.request, posed.course
    if request.task.path.n < 2 or request.gammas.count < 3:
        return None
    if setup.arm is None or not setup.arm.bodies:
        return None
    tools = None if given is None else setup.tools(given)
    scenes = (scene_of(setup.cell, setup.arm),) if tools is None else tools.scenes
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


# Angles of the map where the search had fewer.
ANGLES = 72


def placement_study(step: PlacedStep, arm: ArmBodies) -> AxesStudy | None:
    """What the page of `place` shows; None for a single point or gamma, and for an arm without any shape to draw."""
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


def kept(n: int, also: Integers) -> Integers:
    """Numbers of the path's points that the page holds: evenly chosen, with some that must be among them."""
    return np.union1d(np.round(np.linspace(0, n - 1, min(n, MOST_POINTS))).astype(np.int64), also)


def thinned_angles(angles: Array) -> Array:
    """Angles of the map, every second, third ... of many."""
    return angles[:: -(-len(angles) // MOST_ANGLES)]


def axes_page(study: AxesStudy, title: str) -> str:
    """The page as HTML text; what comes from files is escaped."""
    scripts = ("page_matrices.js", "shop_scene.js", "axes_page.js")
    return render_page("axes_page.html.j2", axes_data(study), scripts, title=title)


def cells_of(study: AxesStudy) -> AxesCells:
    """The map by cell."""
    made = axes_map(
        study.model,
        study.looked,
        study.objective,
        study.drive,
        study.angles,
        postures=True,
        generator=np.random.default_rng(0),
    )
    cause, causes = causes_of(made, study.model.robot, study.scenes, study.place, study.e, study.table)
    error = None
    if study.error is not None and study.force is not None:
        error = errors_of(made, study.task, study.model, study.force, study.q, study.error)
    return AxesCells(made, cause, causes, error)


def axes_data(study: AxesStudy) -> dict[str, Any]:
    """Everything that the page shows; arrays as base64, little end first, angles in deg, lengths in mm."""
    cells = cells_of(study)
    made, what = cells.map, shown(study.objective.quantity)
    assert made.q is not None  # noqa: S101 - it was made with postures
    names = {member.body.name for scene in study.scenes for member in scene.members}
    value = what.factor * made.value
    return {
        **cell_data(study.scenes[0], MOST_TRIANGLES, study.scenes[1:]),
        "tool": packed(study.place, "<u1"),
        "n": len(study.gamma),
        "m": len(study.angles),
        "closed": bool(np.ptp(study.angles) + np.median(np.diff(study.angles)) > 2.0 * np.pi - 1e-6),
        "length": packed(1e3 * study.task.path.arc_length, "<f4"),
        "gamma": packed(np.degrees(study.angles), "<f4"),
        "tips": packed(study.task.path.points, "<f4"),
        "q": packed(made.q, "<f4"),
        "travel": packed(study.e, "<f4"),
        "table": study.table,
        "zone": packed(made.zone, "<u1"),
        "cause": packed(cells.cause, "<u1"),
        "causes": [{"words": cause, "bodies": _bodies(cause, names)} for cause in cells.causes],
        "labels": labels_of(cells),
        "value": packed(value, "<f4"),
        "error": None if cells.error is None else packed(1e6 * cells.error, "<f4"),
        "course": {
            "gamma": packed(np.degrees(study.gamma), "<f4"),
            "q": packed(study.q, "<f4"),
            "value": packed(what.factor * study.value, "<f4"),
            "error": None if study.error is None else packed(1e6 * study.error, "<f4"),
        },
        "axes": [name.removesuffix("_deg") for name in study.model.robot.coordinates],
        "quantity": {"name": typeset(study.words), "unit": typeset(what.unit), "small": study.objective.minimised},
        "eye": eye_of(study).tolist(),
        "range": [float(v) for v in _range(value)],
        "colours": [to_hex(STIFFNESS_COLOURS(x)) for x in np.linspace(0.0, 1.0, COLOURS)],
    }


def eye_of(study: AxesStudy) -> Array:
    """From the worst point of the course to an eye that sees it past the arm and the fixtures."""
    bad = study.value * (1.0 if study.objective.minimised else -1.0) if study.error is None else np.abs(study.error)
    i = int(bad.argmax())
    scene = study.scenes[study.place[i]]
    surfaces = body_surfaces(scene, COARSE)
    placed = placed_in_world(scene, surfaces, study.q[i], study.e[i], study.table)
    others = [x[b.triangles] for b, x in zip(surfaces, placed, strict=True) if b.kind not in ("part", "cutter")]
    cell = scene.cell
    place = (cell.T_world_part(np.array([study.table]))[0] @ np.append(study.task.path.points[i], 1.0))[:3]
    base = cell.T_world_base(study.e[i][None])[0, :3, 3]
    # Not the point alone: what is about it is looked at too.
    about = place + ABOUT * np.array([[0.0, 0.0, 0.3], [1, 0, 0.5], [-1, 0, 0.5], [0, 1, 0.5], [0, -1, 0.5], [0, 0, 1]])
    return towards(base, place, [about], np.concatenate(others))


def _bodies(cause: str, names: set[str]) -> list[str]:
    """The bodies that a cause names."""
    first, _, second = cause.removesuffix(" too near").partition(" and ")
    return [name for name in (first, second) if name in names]


def _range(value: Array) -> Array:
    """What the colours reach over: the middle 96 % of the map."""
    finite = value[np.isfinite(value)]
    if not finite.size:
        return np.array([0.0, 1.0])
    low, high = np.percentile(finite, [2.0, 98.0])
    return np.array([low, high if high > low else low + 1.0])


def labels_of(cells: AxesCells) -> list[dict[str, Any]]:
    """Names of zones, each where its largest patch is broadest: place along the path (mm) and gamma (deg)."""
    out = []
    for k, words in enumerate(cells.causes):
        patches, count = label(cells.cause == k)
        sizes = np.bincount(patches.ravel(), minlength=count + 1)[1:]
        if k == 0 or not count or sizes.max() < LEAST_NAMED * patches.size:
            continue
        i, j = np.nonzero(patches == 1 + int(sizes.argmax()))
        # Of the cells of the patch that which is nearest to its middle.
        away = [(k - k.mean()) / max(float(np.ptp(k)), 1.0) for k in (i, j)]
        at = int(np.hypot(*away).argmin())
        out.append(
            {
                "words": words,
                "at": float(1e3 * cells.map.length[i[at]]),
                "gamma": float(np.degrees(cells.map.gamma[j[at]])),
                "cells": int(sizes.max()),
            }
        )
    return sorted(out, key=lambda one: -one["cells"])
