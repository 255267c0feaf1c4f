"""All publication figures of a finished map: slices, surfaces in space, main effects."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from fem.arm import Arm
from robots import require_one_of
from stiffarm.commands.maps.figures.effects import swept_effects_figure
from stiffarm.commands.maps.figures.slices import slice_figure, unlike
from stiffarm.commands.maps.figures.space import cloud_figure, iso_figure
from stiffarm.commands.maps.looks import Look, look_of
from stiffarm.commands.maps.planes import planes_of
from stiffarm.pages import style
from stiffarm.pages.rendering import VIEWS, chosen
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.data import MapData
from surrogate.maps.quantities import STIFFNESS_ARRAY

# Fields that are for programs, or say the same as another: no picture of each.
NOT_DRAWN = (
    "worst_direction_x",
    "worst_direction_y",
    "worst_direction_z",
    "jacobian_smallest_singular_value",
    "near_singular",
    "softest_part_share",
)


def draw_map_figures(
    data: MapData, arm: Arm, folder: OutputFolder, notes: list[str], *, every: bool = True
) -> list[str]:
    """Write the figures of a map; returns the names of the files.

    Slices, boxes and cylinders: ``map_<quantity>``. Boxes and cylinders also ``map_<quantity>_surfaces``, in space.
    Joint sweeps: ``map_<quantity>_oblique``, ``_side`` and ``_effects``; those of the stiffness ``stiffness_map_...``.

    Parameters
    ----------
    notes : gets one message where pictures in space were drawn without OpenGL
    every : of all fields that have a value and are for people; else the stiffness from both viewpoints

    Raises
    ------
    InputError
        No point of the map is reached.
    """
    data.require_reached("move the grid to where the robot reaches")
    files: list[str] = []
    works, message = (True, "") if data.layout.kind == "slice" else chosen(None)
    for name in _for_people(data) if every else [STIFFNESS_ARRAY]:
        stem = "stiffness_map" if _is_sweep(data, name) else f"map_{name}"
        for suffix, figure in _figures(data, name, arm, works, effects=every):
            files += save_figure(figure, folder, f"{stem}{suffix}")
    if not works and message not in notes:
        notes.append(message)
    return files


def _for_people(data: MapData) -> list[str]:
    """Fields with a value that say something of their own."""
    reached = np.asarray(data.reached)
    named = [name for name in data.fields if name not in NOT_DRAWN and not name.startswith("compliance_")]
    return [name for name in named if np.isfinite(np.asarray(data.fields[name].values)[reached]).any()]


def one_figure(data: MapData, name: str, arm: Arm) -> Figure:
    """The figure of one quantity: the slice, the planes of a box or a cylinder, a joint sweep from oblique."""
    require_one_of("quantity of the map", name, data.fields, code="B002")
    works = data.layout.kind == "slice" or chosen(None)[0]
    return next(_figures(data, name, arm, works))[1]


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


def _figures(data: MapData, name: str, arm: Arm, works: bool, *, effects: bool = True) -> Iterator[tuple[str, Figure]]:
    """Endings of the files' names and the figures of one quantity."""
    look = look_of(name, data.fields[name])
    of_robot = (arm.description, arm.robot, *_words(data, look, arm))
    if data.layout.kind == "joints":
        for view in VIEWS:
            yield f"_{view}", cloud_figure(data, look, *of_robot, works, view)
        if effects and look.kind != "category":
            yield "_effects", swept_effects_figure(data, look, *_words(data, look, arm))
        return
    yield "", slice_figure(data, look, unlike(data, look, planes_of(data)), *of_robot)
    thick = min(data.layout.shape) > 1
    if data.layout.kind != "slice" and thick and look.kind not in ("category", "error"):
        yield "_surfaces", iso_figure(data, look, *of_robot, works)


def save_figure(figure: Figure, folder: OutputFolder, stem: str) -> list[str]:
    """Write a figure as PNG, 150 dots an inch; returns the name of the file."""
    style.save_png(figure, folder.path(f"{stem}.png"))
    return [f"{stem}.png"]
