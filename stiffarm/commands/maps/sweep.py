"""A stiffness map over joint coordinates: its .vtu and the pictures from both viewpoints."""

from __future__ import annotations

from typing import Any

import numpy as np

from robots import ModelDescription, Robot
from robots.arrays import Array
from stiffarm.pages.rendering import render_map
from stiffarm.pages.robot_drawing import draw_robot
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from surrogate import StiffnessMap, write_vtu
from surrogate.maps.data import MapData
from surrogate.maps.vtk_files import STIFFNESS_ARRAY, grid_cells

VIEWS = ("oblique", "side")


def middle_pose(robot: Robot) -> Array:
    """A pose to draw the robot in: mid-range, moved towards zero until it can be taken."""
    zero = np.clip(0.0, robot.limits[:, 0], robot.limits[:, 1])
    middle = robot.limits.mean(axis=1)
    trials = middle + np.linspace(0.0, 1.0, 21)[:, None] * (zero - middle)
    reachable = np.flatnonzero(robot.reachable(trials))
    return np.asarray(trials[reachable[0] if reachable.size else 0])


def write(
    made: StiffnessMap,
    description: ModelDescription,
    robot: Robot,
    folder: OutputFolder,
    pictures: bool = True,
) -> dict[str, Any]:
    """Write ``stiffness_map.vtu`` and the PNGs; returns file names and figures."""
    write_vtu(made, folder.path("stiffness_map.vtu"))
    files, messages = ["stiffness_map.vtu"], list[str]()
    if pictures:
        files += draw(made, description, robot, folder, messages)
    return {"files": files, **figures_of(made), "messages": messages}


def draw(
    made: StiffnessMap, description: ModelDescription, robot: Robot, folder: OutputFolder, messages: list[str]
) -> list[str]:
    """Draw a map from both viewpoints; returns names of files, remarks join ``messages``."""
    pose = middle_pose(robot)
    bodies = draw_robot(description, robot, pose)
    shown = ", ".join(
        f"{n.removesuffix('_deg')} {v:g}" for n, v in zip(robot.coordinates, np.degrees(pose), strict=True)
    )
    origin = made.metadata.get("stiffness_from", "the model")
    load = made.metadata.get("load", "vertical load")
    files = []
    for view in VIEWS:
        name = f"stiffness_map_{view}.png"
        picture = render_map(
            made,
            bodies,
            folder.path(name),
            view=view,
            title=f"Structural stiffness of the {description.title.split(' (')[0]}",
            subtitle=f"{load}; stiffness from {origin}; robot drawn at {shown} deg",
        )
        files.append(name)
        if picture.message and picture.message not in messages and picture.renderer != "pyvista":
            messages.append(picture.message)
    return files


def figures_of(made: StiffnessMap) -> dict[str, Any]:
    """Number of poses and cells, and the range of the stiffness."""
    stiffness = made.stiffness * 1e-3
    return {
        "points": len(stiffness),
        "cells": 0 if made.cells is None else len(made.cells),
        "stiffness_N_per_mm": {
            "min": number(float(stiffness.min())),
            "median": number(float(np.median(stiffness))),
            "max": number(float(stiffness.max())),
        },
    }


def swept(data: MapData) -> StiffnessMap:
    """Those poses of a joint sweep that can be taken, with the cells between them; it has a stiffness."""
    reached = np.asarray(data.reached)
    # Coordinates that sweep have cells between their values, a layer has none to the next.
    shape = data.layout.shape[data.layout.layers :]
    cells, count = [], 0
    for keep in reached.reshape(-1, int(np.prod(shape))):
        cells.append(grid_cells(shape, keep) + count)
        count += int(keep.sum())
    return StiffnessMap(
        positions=np.asarray(data.points)[reached],
        stiffness=np.asarray(data.fields[STIFFNESS_ARRAY].values)[reached] * 1e3,
        joints={name: np.degrees(np.asarray(data.q[:, i])[reached]) for i, name in enumerate(data.coordinates)},
        metadata=data.metadata,
        cells=np.vstack(cells),
    )
