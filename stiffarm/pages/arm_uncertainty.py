"""What intervals of machining results rest on: the model's calibration or an assumption, as JSON and as sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fem.arm import Arm
from machining.cutting import Estimated, StiffnessUncertainty, SurfaceError
from robots.arrays import Array
from robots.quantities import rounded
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


BY_ROOM = (
    "No stiffness of this arm is known: gamma and branch are chosen by room to the joint limits, distance from "
    "singularities and smoothness, elbow up first, not by stiffness."
)


def sentence(arm: StiffnessUncertainty) -> str:
    """What the intervals rest on, or what chooses where nothing is known that they could rest on."""
    if not arm.names:
        return BY_ROOM
    return f"95 % intervals rest on {arm.note}."


def interval(value: Estimated, factor: float = 1.0) -> list[float | None]:
    """The ends of a 95 % interval."""
    return [rounded(value.low * factor), rounded(value.high * factor)]


def estimated(value: Estimated, factor: float = 1e6) -> dict[str, float | None]:
    """A value with its 95 % interval."""
    return {
        "value": rounded(value.value * factor),
        "low95": rounded(value.low * factor),
        "high95": rounded(value.high * factor),
    }


def error_remarks(error: SurfaceError) -> list[str]:
    """What the intervals of a surface error do not hold."""
    out = [
        f"{name} was left open by the calibration: it may change the surface error by up to {size * 1e6:.2g} um, which "
        "is in no interval here."
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
        f"{name} was left open by the calibration: it may change {what} by {100.0 * share:.2g} %, which is in no "
        "interval here."
        for name, share in matters.items()
    ]


def half_widths(arm: Arm, q: Array, direction: Array, point: Array | None = None) -> Array | None:
    """Half of the 95 % interval of the stiffness along ``direction``, as a share of it, at poses q (n, dof) rad; (n,).

    By the covariance that a calibration left in the model file; None where there is none. ``point`` (3,) m: the tool
    point in the flange frame.
    """
    found = propagated(arm.description, arm.model, q, direction, point)
    return None if found is None else intervals.half_widths(found)
