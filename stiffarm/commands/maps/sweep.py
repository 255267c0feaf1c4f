"""A map of the stiffness over joint coordinates, from a surrogate: its file and the pictures from both viewpoints."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem import ArmModel, directional_stiffness
from fem.arm import Arm
from robots import content_hash
from robots.arrays import Array
from robots.progress import Progress
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from surrogate import Surrogate
from surrogate.maps.assembled import computed_map, figures
from surrogate.maps.blocks import Engine
from surrogate.maps.cells import cell_grid
from surrogate.maps.data import MapData
from surrogate.maps.layouts import sweep_layout
from surrogate.maps.quantities import STIFFNESS_ARRAY, Kind, Poses, Quantities, Quantity
from surrogate.maps.vtk_stream import write_vtu
from surrogate.model import predict_compliance


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
    arm: Arm, learned: Surrogate, points: int, layers_deg: tuple[float, ...] | None = None,
    progress: Progress | None = None,
) -> MapData:  # fmt: skip
    """The stiffness under the surrogate's load over the joints, ``points`` values of each.

    Raises
    ------
    InputError
        As :func:`surrogate.maps.layouts.sweep_layout`.
    """
    model, direction = arm.model, learned.load_direction
    metadata = {
        "robot": arm.robot.name,
        "model_hash": content_hash(arm.description),
        "load_direction": " ".join(f"{v + 0.0:.6g}" for v in direction),
        "stiffness_from": f"surrogate ({learned.basis})",
        "links": model.link_kind,
        "load_path": model.load_path,
    }
    quantities = Quantities(model, np.array(direction), learned_rows(learned, model))
    return computed_map(Engine(sweep_layout(arm.robot, points, layers_deg), quantities), metadata, progress)


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
