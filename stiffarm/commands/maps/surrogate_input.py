"""A surrogate that a map is drawn from, and the layers of such a map."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem.arm import Arm
from robots import InputError, Robot
from stiffarm.session.parsing import parse_numbers
from surrogate import Surrogate, default_sweep, load_surrogate


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
        raise InputError(f"surrogate {file} is of robot", value=learned.robot, allowed=given.robot.name, remedy=refit)
    if not np.allclose(learned.load_direction, (0.0, 0.0, -1.0), rtol=0.0, atol=1e-9):
        raise InputError(
            f"surrogate {file}: load direction", value=learned.load_direction, allowed="0, 0, -1", remedy=refit
        )
    swept, layer = default_sweep(given.robot)
    held = [name for name in (*swept, layer) if name is not None and name not in learned.inputs]
    if held:
        raise InputError(
            f"surrogate {file} knows only one value of {', '.join(held)}, which the map moves", remedy=refit
        )
    return learned


def parse_layers(robot: Robot, text: str | None) -> tuple[float, ...] | None:
    """Values in deg, ``-90,0,90``, of the coordinate that leaves a map's plane; None if not given."""
    if text is None:
        return None
    name = default_sweep(robot)[1]
    if name is None:
        raise InputError(
            "--layers", value=text, allowed=f"nothing: the map of {robot.name} has no layers", remedy="leave it out"
        )
    low, high = np.degrees(robot.limits[robot.coordinate_index(name)])
    values = parse_numbers(text)
    if values is None or not all(low <= v <= high for v in values) or len(set(values)) < len(values):
        raise InputError(
            "--layers",
            value=text,
            allowed=f"values of {name}, each once, from {low:g} to {high:g} deg",
            remedy="separate them by commas, as in -90,0,90",
        )
    return values
