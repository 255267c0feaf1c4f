"""Arms made up from the KR60-3's table of joints, to set the numbers of a promise on arms that do not test it."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem.arm import Arm
from robots import ModelDescription, load_description

# Sizes against the KR60-3, and how far each length goes its own way (standard deviation of its logarithm).
SIZES, OWN_LENGTHS, OWN_SPRINGS = (0.5, 1.6), 0.25, 0.4
# Tool points lie up to so far (share of the reach) beside the flange in each direction.
TOOL = 0.15


def made_up(seed: int) -> Arm:
    """An arm of other lengths, springs and size; half of them without springs, without links, with a tool."""
    rng = np.random.default_rng([seed, 41])
    known = load_description("kr60-3").model_dump(mode="json", exclude_none=True, by_alias=True)
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    bare, rigid, tool = (bool(rng.random() < 0.5) for _ in range(3))
    known |= {"name": f"made-up-{seed}", "title": f"Made up, {seed}"}
    _times(known["payload"], size**3)
    _times(known["mass"], size**3)
    for joint in known["joint"]:
        for length in ("a", "d"):
            _times(joint["dh"][length], size * np.exp(OWN_LENGTHS * rng.normal()))
        _times(joint["stiffness"], size**3 * np.exp(OWN_SPRINGS * rng.normal()))
        if bare:
            del joint["stiffness"]
    _times(known["flange"]["xyz"], size * np.exp(OWN_LENGTHS * rng.normal()))
    for link in known["link"]:
        _scaled(link, size)
    if rigid:
        known |= {"link": [], "materials": {}}
    if tool:
        way = (rng.uniform(-TOOL, TOOL, 3) * 2.2 * size).tolist()
        known["tool"] = {"xyz": {"value": way, "unit": "m", "source": "assumed"}}
    return Arm.of(ModelDescription.model_validate(known), "rigid" if rigid else "beam")


def _times(quantity: dict[str, Any], factor: float) -> None:
    """A quantity in place, ``factor`` times as large."""
    value = quantity["value"]
    quantity["value"] = [factor * v for v in value] if isinstance(value, list) else factor * value


def _scaled(part: Any, size: float) -> None:
    """All lengths and masses of a link's table, in place, as of an arm ``size`` times as large."""
    if isinstance(part, dict) and {"value", "unit"} <= part.keys():
        _times(part, {"kg": size**3, "m": size, "mm": size}.get(part["unit"], 1.0))
    elif isinstance(part, dict | list):
        for value in part.values() if isinstance(part, dict) else part:
            _scaled(value, size)
