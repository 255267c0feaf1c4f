"""A placement study: from a cell, a path and a force to where the base should stand, and a map of other positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from machining.cell import Cell
from machining.placement.between import undriven, with_links
from machining.placement.confirming import confirmed
from machining.placement.file import Rapid
from machining.placement.placing import How, Placed, Said, place
from machining.placement.problem import Problem
from machining.placement.search import Survey, survey
from machining.toolpaths.conversion import GivenPath
from robots import InputError

# Positions of the map in the report by the number of coordinates searched; of more, the coarse grid is drawn.
MAP = {1: (121,), 2: (24, 24)}


@dataclass(frozen=True, eq=False)
class PlacedStep:
    """The result: the path as it was given, the placement, what to say about collisions.

    ``linked``: the problem with the moves between its cuts; ``undriven``: why these cannot be driven from there, None
    where they can or there are none; ``rapid``: how rapid moves have to go.
    """

    given: GivenPath
    placed: Placed
    linked: Problem
    notes: tuple[str, ...]
    undriven: str | None = None
    rapid: Rapid = "linear"

    @property
    def cell(self) -> Cell:
        """The cell."""
        return self.placed.problem.cell

    @cached_property
    def map(self) -> Survey:
        """What positions are worth, on a grid that is finer than the search's where few coordinates are searched."""
        problem = self.placed.problem
        if problem.space.d not in MAP:
            return self.placed.survey
        return confirmed(survey(replace(self.linked, goal=problem.goal), MAP[problem.space.d]))


def place_along(
    problem: Problem,
    given: GivenPath,
    how: How,
    notes: tuple[str, ...] = (),
    said: Said | None = None,
) -> PlacedStep:
    """Find the placement.

    The whole program of the path can be driven from there, where any place allows that; else its cuts can.

    Raises
    ------
    InputError
        As :func:`machining.placement.place`.
    """
    linked = with_links(problem, given)
    placed, linked = _placed(linked, given, how, said)
    after, rapid = placed.after, "linear" if linked.links is None else linked.links.rapid
    fault = undriven(linked, after.e, after.table, after.course)
    if fault is not None and undriven(linked, after.e, after.table, after.course, "joint") is None:
        fault, rapid = None, "joint"
    return PlacedStep(given, placed, linked, notes, None if fault is None else fault.prose, rapid)


def _placed(problem: Problem, given: GivenPath, how: How, said: Said | None) -> tuple[Placed, Problem]:
    """The placement that drives the whole program, with rapid moves as joint motion if it must; else its cuts."""
    try:
        return place(problem, how, said), problem
    except InputError:
        if problem.links is None:
            raise
    joint = with_links(replace(problem, links=None), given, "joint")
    try:
        return place(joint, how, said), joint
    except InputError:
        return place(replace(problem, links=None), how, said), problem
