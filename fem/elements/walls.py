"""A link's flexibility as a function of its wall: condensed at a few walls, interpolated in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import chebyshev

from fem.free.base import Flexibility, Parameter
from fem.free.kinds import WALLS
from fem.free.parameters import parameter
from fem.model import ArmModel, link_part
from robots import InputError, ModelDescription
from robots.arrays import Array

# Wall times flexibility is nearly constant for thin walls; nine walls over a factor of four leave 1e-7.
NODES = 9


def wall_flexibilities(
    description: ModelDescription, model: ArmModel, parameters: Sequence[Parameter]
) -> dict[str, Flexibility]:
    """By link whose sections a parameter varies: wall (m) -> flexibility and derivative by ln(wall), half to double.

    Raises
    ------
    InputError
        A link that is not there, or whose section has no room for twice its wall.
    """
    return {
        name: _flexibility(description, model, name)
        for name in dict.fromkeys(p.place for p in parameters if p.kind.has_sections)
    }


def _flexibility(description: ModelDescription, model: ArmModel, name: str) -> Flexibility:
    p = parameter(model, f"{name}.wall")
    low, high = np.log(p.lower), np.log(p.upper)
    x = chebyshev.chebpts1(NODES)
    walls = np.exp(0.5 * (low + high) + 0.5 * (high - low) * x)
    samples = np.stack([t * _condensed(description, model, name, float(t / p.value)) for t in walls])
    shape = samples.shape[1:]
    series = chebyshev.chebfit(x, samples.reshape(NODES, -1), NODES - 1)
    slope = chebyshev.chebder(series)

    def at(wall: float) -> tuple[Array, Array]:
        z = (2.0 * np.log(wall) - low - high) / (high - low)
        scaled = chebyshev.chebval(z, series).reshape(shape)
        F = scaled / wall
        return F, chebyshev.chebval(z, slope).reshape(shape) * 2.0 / (high - low) / wall - F

    return at


def _condensed(description: ModelDescription, model: ArmModel, name: str, ratio: float) -> Array:
    """Flexibility of the link with all its walls ``ratio`` times as thick."""
    data = description.model_dump(by_alias=True)
    link = next(one for one in data["link"] if one["name"] == name)
    for kinds, key in ((("shell", "solid"), "surface"), (("solid",), "solid")):
        if link.get(key) is not None and model.link_kind in kinds:
            raise InputError(
                f"parameter {name}.wall", code="M001", value=f"a prepared {key}", allowed="links with a section"
            )
    for key in WALLS:
        if link.get(key) is not None:
            link[key]["wall"] = {**link[key]["wall"], "value": link[key]["wall"]["value"] * ratio}
    try:
        changed = ModelDescription.model_validate(data)
    except ValueError as error:
        raise InputError(
            f"parameter {name}.wall: {ratio:.3g} times its wall does not fit its section", code="M001"
        ) from error
    return link_part(changed, model, name).element.flexibility
