"""All publication figures of a finished map: slices, surfaces in space, main effects; PNG and SVG files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from fem.arm import Arm
from robots import InputError, ModelDescription, Robot, require_one_of
from robots.files.written import written_whole
from stiffarm.commands.maps.figures.effects import swept_effects_figure
from stiffarm.commands.maps.figures.slices import slice_figure, unlike
from stiffarm.commands.maps.figures.space import cloud_figure, iso_figure
from stiffarm.commands.maps.looks import Look, look_of
from stiffarm.commands.maps.planes import planes_of
from stiffarm.pages import style
from stiffarm.pages.band import banded
from stiffarm.pages.rendering import VIEWS, chosen
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.data import MapData
from surrogate.maps.quantities import STIFFNESS_ARRAY

FORMATS: Final = ("png", "svg")
_SVG_DPI: Final = 200
# Fields that are for programs, or say the same as another: no picture of each.
NOT_DRAWN = (
    "worst_direction_x",
    "worst_direction_y",
    "worst_direction_z",
    "jacobian_smallest_singular_value",
    "near_singular",
    "softest_part_share",
)
# Entries of a map's metadata that a reader of a figure needs, in this order.
_FACTS: Final = ("pose", "load")


def draw_map_figures(
    data: MapData,
    description: ModelDescription,
    robot: Robot,
    folder: OutputFolder,
    *,
    quantities: Sequence[str] | None = None,
    formats: Sequence[str] = ("png",),
    notes: list[str] | None = None,
) -> list[str]:
    """Write the figures of a map; returns the names of the files.

    Slices, boxes and cylinders: ``map_<quantity>``. Boxes and cylinders also ``map_<quantity>_surfaces``, in space.
    Joint sweeps: ``map_<quantity>_oblique``, ``_side`` and ``_effects``.

    Parameters
    ----------
    quantities : names of fields; default all that have a value and are for people
    formats : of 'png' (150 dots an inch) and 'svg' (lines and text as vectors, coloured areas as images)
    notes : gets one message where pictures in space were drawn without OpenGL

    Raises
    ------
    InputError
        Unknown quantity or format, or no point of the map is reached.
    """
    wrong = [name for name in formats if name not in FORMATS]
    if wrong or not formats:
        raise InputError("format of figures", code="B002", value=", ".join(wrong) or "none", allowed=", ".join(FORMATS))
    unknown = [name for name in quantities or () if name not in data.fields]
    if unknown:
        raise InputError("quantity of the map", code="B002", value=unknown[0], allowed=", ".join(data.fields))
    data.require_reached("move the grid to where the robot reaches")
    files: list[str] = []
    in_space = data.layout.kind != "slice"
    works, message = chosen(None) if in_space else (True, "")
    for name in _for_people(data) if quantities is None else quantities:
        look = look_of(name, data.fields[name])
        heading = f"{description.title.split(' (')[0]}: {look.label}"
        for suffix, figure in _figures(data, look, description, robot, heading, _facts(data), works):
            files += save_figure(figure, folder, f"map_{name}{suffix}", formats)
    if not works and notes is not None and message not in notes:
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
    look = look_of(name, data.fields[name])
    heading = f"{arm.description.title.split(' (')[0]}: {look.label}"
    works = data.layout.kind == "slice" or chosen(None)[0]
    _, figure = next(_figures(data, look, arm.description, arm.robot, heading, _facts(data), works))
    return figure


def draw_stiffness(data: MapData, arm: Arm, folder: OutputFolder, messages: list[str]) -> list[str]:
    """Draw the stiffness of a joint sweep from both viewpoints; returns names of files, remarks join ``messages``."""
    works, message = chosen(None)
    look = look_of(STIFFNESS_ARRAY, data.fields[STIFFNESS_ARRAY])
    heading = f"Structural stiffness of the {arm.description.title.split(' (')[0]}"
    facts = "; ".join((data.metadata.get("load", "vertical load"), f"stiffness from {_origin(data)}"))
    files: list[str] = []
    for view in VIEWS:
        figure = cloud_figure(data, look, arm.description, arm.robot, heading, facts, works, view)
        files += save_figure(figure, folder, f"stiffness_map_{view}", ("png",))
    if not works and message not in messages:
        messages.append(message)
    return files


def _origin(data: MapData) -> str:
    origin = data.metadata.get("stiffness_from", "model")
    return "the model" if origin == "model" else f"the {origin}"


def _figures(
    data: MapData, look: Look, description: ModelDescription, robot: Robot, heading: str, facts: str, works: bool
) -> Iterator[tuple[str, Figure]]:
    """Endings of the files' names and the figures of one quantity."""
    of_robot = (description, robot, heading, facts)
    if data.layout.kind == "joints":
        for view in VIEWS:
            yield f"_{view}", cloud_figure(data, look, *of_robot, works, view)
        if look.kind != "category":
            yield "_effects", swept_effects_figure(data, look, heading, facts)
        return
    yield "", slice_figure(data, look, unlike(data, look, planes_of(data)), *of_robot)
    thick = min(data.layout.shape) > 1
    if data.layout.kind != "slice" and thick and look.kind not in ("category", "error"):
        yield "_surfaces", iso_figure(data, look, *of_robot, works)


def _facts(data: MapData) -> str:
    return "; ".join(words for key in _FACTS if (words := data.metadata.get(key)))


def save_figure(figure: Figure, folder: OutputFolder, stem: str, formats: Sequence[str]) -> list[str]:
    """Write a figure in each of the formats; returns the names of the files."""
    write: dict[str, Callable[[Figure, Path], None]] = {"png": style.save_png, "svg": save_svg}
    names = [f"{stem}.{ending}" for ending in formats]
    for name, ending in zip(names, formats, strict=True):
        write[ending](figure, folder.path(name))
    return names


def save_svg(figure: Figure, path: Path) -> None:
    """Write a figure as SVG with text as text, whole or not at all. Twice the same is the same file.

    Raises
    ------
    InputError
        The folder does not exist.
    """
    style.require_folder(path)
    text_as_text = mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "stiffarm"})
    with written_whole(path) as draft, style.house_style(), text_as_text, banded(figure) as shape:
        figure.savefig(draft, format="svg", dpi=_SVG_DPI, metadata={"Date": None}, **shape)
