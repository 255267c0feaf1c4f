"""A map of the stiffness over joint coordinates from a surrogate: what it takes, its file, pictures from both sides."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fem import ArmModel, directional_stiffness
from fem.arm import Arm
from robots import InputError, Robot, content_hash
from robots.arrays import Array
from robots.progress import Progress
from stiffarm.session.caution import warned
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_numbers
from surrogate import Surrogate, default_sweep, load_surrogate
from surrogate.maps.assembled import figures, swept_map
from surrogate.maps.cells import cell_grid
from surrogate.maps.data import MapData
from surrogate.maps.quantities import STIFFNESS_ARRAY, Kind, Poses, Quantities, Quantity
from surrogate.maps.vtk_stream import write_vtu
from surrogate.model import predict_compliance


def read_surrogate_for_map(given: Arm, file: Path) -> Surrogate:
    """A surrogate that can stand for this robot in the 3-D map.

    Raises
    ------
    InputError
        Another robot's, of another load than the vertical one, or without a coordinate that the map moves.
    """
    learned = load_surrogate(file)
    refit = "fit one for this map (`stiffarm fit`)"
    if learned.robot != given.robot.name:
        raise InputError(
            f"surrogate {file} is of robot", code="A010", value=learned.robot, allowed=given.robot.name, remedy=refit
        )
    if not np.allclose(learned.load_direction, (0.0, 0.0, -1.0), rtol=0.0, atol=1e-9):
        raise InputError(
            f"surrogate {file}: load direction",
            code="A010",
            value=learned.load_direction,
            allowed="0, 0, -1",
            remedy=refit,
        )
    swept, layer = default_sweep(given.robot)
    held = [name for name in (*swept, layer) if name is not None and name not in learned.inputs]
    if held:
        raise InputError(
            f"surrogate {file} knows only one value of {', '.join(held)}, which the map moves",
            code="A010",
            remedy=refit,
        )
    return learned


def parse_layers(robot: Robot, text: str | None) -> tuple[float, ...] | None:
    """Values in deg, ``-90,0,90``, of the coordinate that leaves a map's plane; None if not given."""
    if text is None:
        return None
    name = default_sweep(robot)[1]
    if name is None:
        raise InputError(
            "--layers",
            code="A004",
            value=text,
            allowed=f"nothing: the map of {robot.name} has no layers",
            remedy="leave it out",
        )
    low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
    values = parse_numbers(text)
    if values is None or not all(low <= v <= high for v in values) or len(set(values)) < len(values):
        raise InputError(
            "--layers",
            code="A004",
            value=text,
            allowed=f"values of {name}, each once, from {low:g} to {high:g} deg",
            remedy="separate them by commas, as in -90,0,90",
        )
    return values


def learned_rows(learned: Surrogate, model: ArmModel) -> tuple[Quantity, ...]:
    """Rows of the stiffness (N/mm) by a surrogate, and by the model under the same load beside it."""
    columns = [model.robot.coordinate_index(name) for name in learned.inputs]

    def from_surrogate(p: Poses) -> list[Array]:
        return [1e-3 / predict_compliance(learned, p.q[:, columns])]

    def exact(p: Poses) -> list[Array]:
        return [1e-3 * directional_stiffness(p.model, p.q, p.direction)]

    return (
        Quantity("learned", (Kind(STIFFNESS_ARRAY, "N/mm", "stiffness along the load"),), from_surrogate),
        Quantity("model", (Kind("model_stiffness_N_per_mm", "N/mm", "stiffness by the model"),), exact),
    )


def learned_map(
    arm: Arm,
    learned: Surrogate,
    points: int,
    layers_deg: tuple[float, ...] | None = None,
    progress: Progress | None = None,
) -> MapData:
    """The stiffness under the surrogate's load over the joints, ``points`` values of each.

    Raises
    ------
    InputError
        As :func:`surrogate.maps.layouts.sweep_layout`.
    """
    model, direction = arm.model, learned.load_direction
    metadata = {
        "model_hash": content_hash(arm.description),
        "load_direction": " ".join(f"{v + 0.0:.6g}" for v in direction),
        "stiffness_from": f"surrogate ({learned.basis})",
        "links": model.link_kind,
        "load_path": model.load_path,
    } | warned(arm)
    quantities = Quantities(model, np.array(direction), learned_rows(learned, model))
    return swept_map(quantities, points, layers_deg, metadata, progress)


def write(made: MapData, arm: Arm, folder: OutputFolder, pictures: bool = True) -> dict[str, Any]:
    """Write ``stiffness_map.vtu`` and the PNGs; returns file names and figures.

    Raises
    ------
    InputError
        No pose can be taken.
    """
    made.require_reached("use other values of --layers")
    write_vtu(made, folder.path("stiffness_map.vtu"))
    files, messages = ["stiffness_map.vtu"], list[str]()
    if pictures:
        from stiffarm.commands.maps.figures.whole import draw_stiffness

        files += draw_stiffness(made, arm, folder, messages)
    return {"files": files, **figures_of(made), "messages": messages}


def figures_of(made: MapData) -> dict[str, Any]:
    """Number of poses and cells, and the range of the stiffness, of a sweep of joints."""
    stiffness = figures(made.fields[STIFFNESS_ARRAY].values)
    assert stiffness is not None  # noqa: S101 - the map has poses
    return {
        "points": int(np.count_nonzero(made.reached)),
        "cells": int(np.count_nonzero(cell_grid(made.layout, made.reached).first)),
        "stiffness_N_per_mm": {
            "min": number(stiffness.least),
            "median": number(stiffness.median),
            "max": number(stiffness.greatest),
        },
    }
