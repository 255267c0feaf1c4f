"""Quantities of a model file: numbers with a unit and a source, checked as they are read."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

from robots.arrays import Array
from robots.schema.units import check_magnitude, dimension_of, factor

# Of numbers without a unit of their own: squares of them, and products of a few, stay within what a float holds.
LARGEST_NUMBER = 1e30


class Strict(BaseModel):
    """A table of a file: unknown keys are refused, values never change, numbers are finite and of a sane size."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _sane_size(cls, value: Any) -> Any:
        if any(abs(number) > LARGEST_NUMBER for number in _numbers_in(value)):
            raise ValueError(f"numbers must be at most {LARGEST_NUMBER:g} in size")
        return value


def _numbers_in(value: Any) -> Iterator[float]:
    """Numbers of a field, those of tables in it left to their own checks."""
    if isinstance(value, int | float):
        yield value
    elif isinstance(value, list | tuple | dict):
        for entry in value.values() if isinstance(value, dict) else value:
            yield from _numbers_in(entry)


def _nonzero(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not max(map(abs, direction)) > 1e-9:
        raise ValueError("the direction must not have length zero")
    return direction


Direction = Annotated[tuple[float, float, float], AfterValidator(_nonzero)]

# Neither "12" nor true is a number, though pydantic's own reading takes both.
Number = Annotated[float, Field(strict=True)]


class Quantity(Strict):
    """A number (or a list of them) with its unit and the source of the figure.

    ``dimension``, an argument of the classes below: what the unit must be of; none: the unit may be any.
    """

    dimension: ClassVar[str] = ""

    value: float | tuple[float, ...]
    unit: str
    source: str
    note: str | None = None

    def __init_subclass__(cls, dimension: str | None = None) -> None:
        if dimension is not None:
            cls.dimension = dimension

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, unit: str) -> str:
        factor(cls.dimension or dimension_of(unit), unit)
        return unit

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        for number in self.value if isinstance(self.value, tuple) else (self.value,):
            check_magnitude(dimension_of(self.unit), self.unit, number, positive=isinstance(self, _Positive))
        return self

    @property
    def si_array(self) -> Array:
        """The values in SI units, shape (m,)."""
        return np.atleast_1d(np.asarray(self.value, dtype=np.float64)) * factor(self.dimension, self.unit)


class Scalar(Quantity):
    """One number, not a list."""

    value: Number

    @property
    def si(self) -> float:
        """The value in SI units."""
        return self.value * factor(self.dimension, self.unit)


class _Positive(Scalar):
    value: Annotated[Number, Field(gt=0.0)]


class _Triple(Quantity):
    value: Annotated[tuple[Number, ...], Field(min_length=3, max_length=3)]


class _Range(Quantity):
    value: tuple[Number, ...]

    @field_validator("value")
    @classmethod
    def _ordered_pair(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if len(value) != 2 or not value[0] < value[1]:
            raise ValueError("must be a pair [lower, upper] with lower < upper")
        return value


class Length(Scalar, dimension="length"):
    """A length, which may be zero or negative."""


class PositiveLength(_Positive, dimension="length"):
    """A length greater than zero."""


class Position(_Triple, dimension="length"):
    """Three lengths x, y, z."""


class Angle(Scalar, dimension="angle"):
    """An angle."""


class Angles(_Triple, dimension="angle"):
    """Roll, pitch, yaw about fixed x, y, z, as in URDF."""


class AngleRange(_Range, dimension="angle"):
    """Lower and upper angle."""


class Mass(_Positive, dimension="mass"):
    """A mass."""


class Density(_Positive, dimension="density"):
    """A mass density."""


class Modulus(_Positive, dimension="pressure"):
    """An elastic modulus."""


class Ratio(Scalar, dimension="ratio"):
    """A pure number."""


class PoissonsRatio(Ratio):
    """A Poisson's ratio: an isotropic material is stable only between -1 and 0.5."""

    @model_validator(mode="after")
    def _stable(self) -> Self:
        if not -1.0 < self.si < 0.5:
            raise ValueError(f"Poisson's ratio {self.si:g} is not between -1 and 0.5")
        return self


class RotationalStiffness(_Positive, dimension="rotational stiffness"):
    """A stiffness against rotation."""


class TranslationalStiffness(_Positive, dimension="translational stiffness"):
    """A stiffness against displacement."""


class Compliance(Scalar, dimension="compliance"):
    """A displacement per force, rotation per force or rotation per moment; may be negative off a diagonal."""
