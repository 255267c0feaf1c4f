"""The controller in a model file: how it counts the angles, where its frames are, and what it speaks."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from robots.schema.quantities import Angle, Angles, Number, Position, Strict


class Placed(Strict):
    """Where something is in the frame before it, and how it is turned there."""

    xyz: Position
    rpy: Angles | None = None


class AxisTerm(Strict):
    """One of the controller's angles with its factor."""

    axis: str
    factor: Number


class ControllerAngle(Strict):
    """A coordinate of the model from the controller's angles: ``q = offset + sum(factor * p)``."""

    coordinate: str
    terms: Annotated[tuple[AxisTerm, ...], Field(min_length=1)]
    offset: Angle | None = None
    note: str | None = None


class Controller(Strict):
    """What the controller shows and takes: ``q = A p + b``, its frames, the program formats that it reads.

    A coordinate without a row in ``angle`` is the axis in the same place, unchanged. ``base``: the controller's robot
    frame in the model's base frame; ``flange``: its flange frame in the model's.
    """

    axes: tuple[str, ...] = ()
    angle: tuple[ControllerAngle, ...] = ()
    formats: tuple[str, ...] = ()
    base: Placed | None = None
    flange: Placed | None = None

    @field_validator("axes")
    @classmethod
    def _name_their_unit(cls, axes: tuple[str, ...]) -> tuple[str, ...]:
        for name in axes:
            if not name.endswith("_deg"):
                raise ValueError(f"{name!r}: the name of a controller's angle must end in _deg")
        return axes
