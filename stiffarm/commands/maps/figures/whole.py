"""All publication figures of a finished map: slices, surfaces in space, main effects."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from fem.arm import Arm
from robots import ModelDescription, Robot, require_one_of
from stiffarm.commands.maps.figures.effects import swept_effects_figure
from stiffarm.commands.maps.figures.slices import slice_figure, unlike
from stiffarm.commands.maps.figures.space import cloud_figure, iso_figure
from stiffarm.commands.maps.looks import Look, kind_of, look_of
from stiffarm.commands.maps.planes import planes_of
from stiffarm.pages.rendering import VIEWS, chosen
from stiffarm.result import Drawing
from surrogate.maps.data import MapData
from surrogate.maps.quantities import STIFFNESS_ARRAY

Draw = Callable[[MapData, str, Arm], Figure]
_CAPTIONS = {
    "": "{}: one plane, or several of a box or a cylinder.",
    "_surfaces": "{}: where it has the same value, cut open towards the viewer.",
    "_oblique": "{} at the tool positions of the sweep; points on the viewer's side of the robot's plane are left out.",
    "_side": "{} at the tool positions of the sweep, seen along y onto the XZ plane.",
    "_effects": "{}: least, mean and largest at each value of a swept coordinate.",
}
# Fields that are for programs, or say the same as another: no picture of each.
NOT_DRAWN = (
    "worst_direction_x",
    "worst_direction_y",
    "worst_direction_z",
    "jacobian_smallest_singular_value",
    "near_singular",
    "softest_part_share",
)


def drawings(data: MapData, arm: Arm, *, every: bool = True) -> tuple[Drawing, ...]:
    """The pictures of a map, drawn when they are asked for.

    Slices, boxes and cylinders: ``map_<quantity>``. Boxes and cylinders also ``map_<quantity>_surfaces``, in space.
    Joint sweeps: ``map_<quantity>_oblique``, ``_side`` and ``_effects``; those of the stiffness ``stiffness_map_...``.
    ``every``: of all fields that have a value and are for people; else the stiffness from both viewpoints.

    Raises
    ------
    InputError
        No point of the map is reached.
    """
    data.require_reached("move the grid to where the robot reaches")
    return tuple(
        Drawing(
            ("stiffness_map" if _is_sweep(data, name) else f"map_{name}") + suffix,
            _CAPTIONS[suffix].format(data.fields[name].label),
            f"map of {data.fields[name].label}",
            partial(draw, data, name, arm),
        )
        for name in (_for_people(data) if every else [STIFFNESS_ARRAY])
        for suffix, draw in _figures(data, name, effects=every)
    )


def _for_people(data: MapData) -> list[str]:
    """Fields with a value that say something of their own."""
    reached = np.asarray(data.reached)
    named = [name for name in data.fields if name not in NOT_DRAWN and not name.startswith("compliance_")]
    return [name for name in named if np.isfinite(np.asarray(data.fields[name].values)[reached]).any()]


def one_figure(data: MapData, name: str, arm: Arm) -> Figure:
    """The figure of one quantity: the slice, the planes of a box or a cylinder, a joint sweep from oblique."""
    require_one_of("quantity of the map", name, data.fields, code="B002")
    return next(_figures(data, name))[1](data, name, arm)


def _is_sweep(data: MapData, name: str) -> bool:
    """Whether this is the stiffness of a joint sweep, whose pictures have names of their own."""
    return data.layout.kind == "joints" and name == STIFFNESS_ARRAY


def _words(data: MapData, look: Look, arm: Arm) -> tuple[str, str]:
    """Heading of a figure, and what a reader needs to know of the map."""
    robot, facts = arm.description.title.split(" (")[0], [data.metadata.get(key) for key in ("pose", "load")]
    if not _is_sweep(data, look.name):
        return f"{robot}: {look.label}", "; ".join(filter(None, facts))
    origin = data.metadata.get("stiffness_from", "model")
    return f"Structural stiffness of the {robot}", f"{facts[1] or 'vertical load'}; stiffness from the {origin}"


def _figures(data: MapData, name: str, *, effects: bool = True) -> Iterator[tuple[str, Draw]]:
    """Endings of the names of a quantity's figures, and what draws them."""
    kind = kind_of(name, data.fields[name])
    if data.layout.kind == "joints":
        for view in VIEWS:
            yield f"_{view}", partial(_cloud, view)
        if effects and kind != "category":
            yield "_effects", _effects
        return
    yield "", _slice
    if data.layout.kind != "slice" and min(data.layout.shape) > 1 and kind not in ("category", "error"):
        yield "_surfaces", _surfaces


def _cloud(view: str, data: MapData, name: str, arm: Arm) -> Figure:
    return cloud_figure(data, *_of(data, name, arm), chosen(None)[0], view)


def _surfaces(data: MapData, name: str, arm: Arm) -> Figure:
    return iso_figure(data, *_of(data, name, arm), chosen(None)[0])


def _effects(data: MapData, name: str, arm: Arm) -> Figure:
    look, _, _, *words = _of(data, name, arm)
    return swept_effects_figure(data, look, *words)


def _slice(data: MapData, name: str, arm: Arm) -> Figure:
    of_robot = _of(data, name, arm)
    return slice_figure(data, of_robot[0], unlike(data, of_robot[0], planes_of(data)), *of_robot[1:])


def _of(data: MapData, name: str, arm: Arm) -> tuple[Look, ModelDescription, Robot, str, str]:
    look = look_of(name, data.fields[name])
    return look, arm.description, arm.robot, *_words(data, look, arm)
