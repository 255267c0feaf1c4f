"""What intervals of machining results rest on: the model's calibration or an assumption, as JSON and as sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fem.arm import Arm
from machining.cutting import Estimated, StiffnessUncertainty, SurfaceError
from robots.arrays import Array
from robots.quantities import Quantity, known_to, length, ranged, relative
from stiffarm.pages.report import KeyFigure
from stiffarm.session import stated as intervals
from stiffarm.session.stated import propagated


def payload(arm: StiffnessUncertainty) -> dict[str, Any]:
    """``source`` is "calibration" or "assumed"; ``left_open``: parameters that the calibration left open."""
    return {
        "source": arm.source,
        "parameters": list(arm.names) if arm.source == "calibration" else [],
        "left_open": list(arm.open_names),
        "rests_on": arm.note,
    }


ERROR = length("error", unit="um")
BY_ROOM = (
    "No stiffness of this arm is known: gamma and branch are chosen by room to the joint limits, distance from "
    "singularities and smoothness, elbow up first, not by stiffness."
)


def sentence(arm: StiffnessUncertainty) -> str:
    """What the intervals rest on, or what chooses where nothing is known that they could rest on."""
    if not arm.names:
        return BY_ROOM
    return f"95 % intervals rest on {arm.note}."


def spread(found: Mapping[Quantity, Sequence[Estimated]]) -> dict[str, Any]:
    """Values and intervals of a :class:`stiffarm.result.Table`, one estimate a row."""
    return {
        "values": {quantity: np.array([one.value for one in some]) for quantity, some in found.items()},
        "intervals": {
            quantity: (np.array([one.low for one in some]), np.array([one.high for one in some]))
            for quantity, some in found.items()
        },
    }


def figure(quantity: Quantity, found: Estimated, label: str) -> KeyFigure:
    """A key figure with its 95 % interval, and the digits that this leaves it."""
    value, low, high = (quantity.factor * end for end in (found.value, found.low, found.high))
    shown = f"{known_to(value, low, high)} {quantity.unit}".strip()
    return KeyFigure(shown, label, f"95 %: {ranged(low, high, quantity.unit, 3)}" if high > low else "")


def error_remarks(error: SurfaceError) -> list[str]:
    """What the intervals of a surface error do not hold."""
    out = [
        f"{name} was left open by the calibration: it may change the surface error by up to "
        f"{ERROR.text(size, unit=True)}, which is in no interval here."
        for name, size in error.left_open.items()
    ]
    if error.is_rough:
        out.append(
            "The calibration knows some law or wall so poorly that the intervals of the surface error, which are to "
            "first order, are too narrow."
        )
    return out


def share_remarks(matters: Mapping[str, float], what: str) -> list[str]:
    """What the intervals of a stiffness do not hold."""
    return [
        f"{name} was left open by the calibration: it may change {what} by {relative(share)}, which is in no interval "
        "here."
        for name, share in matters.items()
    ]


def half_widths(arm: Arm, q: Array, direction: Array, point: Array | None = None) -> Array | None:
    """Half of the 95 % interval of the stiffness along ``direction``, as a share of it, at poses q (n, dof) rad; (n,).

    By the covariance that a calibration left in the model file; None where there is none. ``point`` (3,) m: the tool
    point in the flange frame.
    """
    found = propagated(arm.description, arm.model, q, direction, point)
    return None if found is None else intervals.half_widths(found)
