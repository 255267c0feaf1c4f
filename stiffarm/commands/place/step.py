"""The step `place`: from a cell, a path and a force to where the robot's base should stand, or how it should move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import fem
from machining import Drive, GammaRange, read_path
from machining.cell import Cell, Scene, arm_of, scene_of
from machining.cutting import StiffnessUncertainty
from machining.placement import Goal, How, Placed, Problem, Survey, place, space_of, survey
from machining.task import ToolPath
from machining.toolpaths import read_toolpath, to_tool_path
from machining.toolpaths.neutral import MARK
from machining.toolpaths.source import content
from robots import InputError
from robots.arrays import Array, Bools, Integers

# Positions of the map in the report by the number of coordinates searched; of more, the coarse grid is drawn.
MAP = {1: (121,), 2: (24, 24)}


@dataclass(frozen=True, eq=False)
class GivenPath:
    """A path and where it comes from.

    ``free`` (n - 1,): rapid moves between its runs; ``moves`` (n,) of the source that end at its points, ``count`` of
    them in all.
    """

    path: ToolPath
    free: Bools
    moves: Integers
    count: int


@dataclass(frozen=True, eq=False)
class PlaceRequest:
    """What is asked: all but the model and the scene; ``stiffness``: as :class:`machining.placement.Problem` has it."""

    cell: Cell
    given: GivenPath
    goal: Goal
    gamma: float | GammaRange
    drive: Drive
    how: How
    ranges: dict[str, tuple[float, float]]
    table: float | tuple[float, float]
    clearance: float
    stiffness: StiffnessUncertainty | None = None


@dataclass(frozen=True, eq=False)
class PlacedStep:
    """The result: the placement, the map of the report, what to say about collisions."""

    request: PlaceRequest
    model: fem.ArmModel
    placed: Placed
    map: Survey
    notes: tuple[str, ...]

    @property
    def arc_mm(self) -> Array:
        """Length (n,) mm of the path up to each point."""
        return np.concatenate([[0.0], np.cumsum(self.request.given.path.lengths)]) * 1e3


def path_from(file: Path) -> GivenPath:
    """A path from CSV (with its normals), or the cutting moves of a CLS, APT or G-code file.

    Raises
    ------
    InputError
        As :func:`machining.read_path`, :func:`machining.toolpaths.read_toolpath` and
        :func:`machining.toolpaths.to_tool_path`.
    """
    if file.suffix.lower() == ".csv" and not _is_motions(file):
        path = read_path(file)
        return GivenPath(path, np.zeros(path.n - 1, dtype=np.bool_), np.arange(path.n), path.n)
    motions = read_toolpath(file)
    cutting = to_tool_path(motions)
    return GivenPath(cutting.path, np.diff(cutting.moves) > 1, cutting.moves, motions.n)


def scene_for(cell: Cell, model: str) -> tuple[Scene | None, tuple[str, ...]]:
    """Arm and cell for collisions, and what to say about them; None where the arm has no shape."""
    try:
        scene = scene_of(cell, arm_of(model))
    except InputError as error:
        if "no body has a shape" not in str(error):
            raise
        return None, (f"Collisions were not looked at: {error}.",)
    return scene, scene.notes


def place_along(
    model: fem.ArmModel,
    request: PlaceRequest,
    scene: Scene | None,
    notes: tuple[str, ...] = (),
    said: Callable[[str, int, int], None] | None = None,
    *,
    mapped: bool = True,
) -> PlacedStep:
    """Find the placement; ``mapped``: look at the finer grid of the report's map too.

    Raises
    ------
    InputError
        As :func:`machining.placement.place`.
    """
    problem = Problem(
        model=model,
        space=space_of(request.cell, request.ranges, table=request.table),
        path=request.given.path,
        goal=request.goal,
        gamma=request.gamma,
        drive=request.drive,
        scene=scene,
        clearance=request.clearance,
        free=request.given.free if request.given.free.any() else None,
        stiffness=request.stiffness,
    )
    placed = place(problem, request.how, said)
    grid = placed.survey
    if mapped and problem.space.d in MAP:
        if said is not None:
            said("map", 0, 1)
        grid = survey(replace(problem, goal=placed.problem.goal), MAP[problem.space.d])
    return PlacedStep(request, model, placed, grid, notes)


def _is_motions(file: Path) -> bool:
    return content(file).startswith(MARK.encode())
