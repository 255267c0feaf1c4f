"""A placement study: from a cell, a path and a force to where the base should stand, and a map of other positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import fem
from machining.cell import Cell, Scene, arm_of, scene_of
from machining.cutting import StiffnessUncertainty
from machining.placement.placing import How, Placed, place
from machining.placement.problem import Goal, Problem
from machining.placement.search import Survey, survey
from machining.placement.space import space_of
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.toolpaths.given import GivenPath
from robots import InputError
from robots.arrays import Array

# Positions of the map in the report by the number of coordinates searched; of more, the coarse grid is drawn.
MAP = {1: (121,), 2: (24, 24)}


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
