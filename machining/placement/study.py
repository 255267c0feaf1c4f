"""A placement study: from a cell, a path and a force to where the base should stand, and a map of other positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from machining.cell import Cell, Scene, arm_of, scene_of
from machining.placement.confirming import confirmed
from machining.placement.file import Placement
from machining.placement.placing import How, Placed, place
from machining.placement.problem import Problem
from machining.placement.search import Survey, survey
from machining.programs.posting import PostSettings, post
from machining.toolpaths.conversion import GivenPath
from robots import InputError, ModelDescription

# Positions of the map in the report by the number of coordinates searched; of more, the coarse grid is drawn.
# m; no points are put in between for straightness where only the moves of the file are asked about.
UNBOUND = 1.0
MAP = {1: (121,), 2: (24, 24)}


@dataclass(frozen=True, eq=False)
class PlacedStep:
    """The result: the path as it was given, the placement, the map of the report, what to say about collisions.

    ``undriven``: why the moves between the cuts cannot be driven from there, None where they can or there are none.
    """

    given: GivenPath
    placed: Placed
    map: Survey
    notes: tuple[str, ...]
    undriven: str | None = None

    @property
    def cell(self) -> Cell:
        """The cell."""
        return self.placed.problem.cell


def scene_for(cell: Cell, model: str, description: ModelDescription | None = None) -> tuple[Scene, tuple[str, ...]]:
    """Arm and cell for collisions, and what to say about them; ``description``: as of :func:`machining.cell.arm_of`."""
    scene = scene_of(cell, arm_of(model, description, beam_radius=cell.beam_radius))
    return scene, scene.notes


def place_along(
    problem: Problem,
    given: GivenPath,
    how: How,
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
    placed = place(problem, how, said)
    grid = placed.survey
    if mapped and problem.space.d in MAP:
        if said is not None:
            said("map", 0, 1)
        drawn = survey(replace(problem, goal=placed.problem.goal), MAP[problem.space.d])
        grid = confirmed(drawn, None if said is None else lambda done, total: said("map", done, total))
    return PlacedStep(given, placed, grid, notes, _undriven(placed, given))


def placement_of(placed: Placed, given: GivenPath) -> Placement:
    """What other programs read: :func:`machining.placement.read_placement`."""
    after, cell, robot = placed.after, placed.problem.cell, placed.problem.model.robot
    return Placement(
        robot=robot.name,
        cell=cell.name,
        axes=tuple(axis.name for axis in cell.linear_axes),
        travel=after.e,
        table=after.table,
        gamma=after.course.gamma,
        joints=robot.coordinates,
        q=after.course.q,
        moves=given.moves,
        count=given.count,
    )


def _undriven(placed: Placed, given: GivenPath) -> str | None:
    """Placements are found for the moves that cut; a program has those between them too."""
    if given.motions is None:
        return None
    found = placement_of(placed, given).at_every_move(given.motions.rapid)
    settings = PostSettings(**found, rapid="joint", tolerance=UNBOUND)
    try:
        post(placed.problem.model, placed.problem.cell, given.motions, settings)
    except InputError as error:
        return error.prose
    return None
