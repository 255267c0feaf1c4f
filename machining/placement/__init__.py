"""Placement of the robot on its linear axes: where the base stands, or how it moves, for the stiffest cut."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from machining.placement.file import Placement, placement_content, read_placement
    from machining.placement.following import Along, Found, axis_rates, follow
    from machining.placement.moving import find_moving
    from machining.placement.placing import MODES, How, Placed, place
    from machining.placement.problem import AIMS, Goal, Problem, on_axes
    from machining.placement.search import Look, Survey, find_fixed, survey
    from machining.placement.space import Space, space_of, start_of
    from machining.placement.steps import find_steps
    from machining.placement.study import PlacedStep, place_along
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "AIMS",
    "MODES",
    "Along",
    "Found",
    "Goal",
    "How",
    "Look",
    "Placed",
    "PlacedStep",
    "Placement",
    "Problem",
    "Space",
    "Survey",
    "axis_rates",
    "find_fixed",
    "find_moving",
    "find_steps",
    "follow",
    "on_axes",
    "place",
    "place_along",
    "placement_content",
    "read_placement",
    "space_of",
    "start_of",
    "survey",
]
