"""Quantities of a model file: numbers with a unit and a source, checked as they are read."""

from __future__ import annotations

import math
from collections.abc import Iterator
from numbers import Real
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, field_validator, model_validator

from robots.arrays import Array
from robots.schema.units import check_magnitude, factor

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


class Quantity(Strict):
    """A number (or a list of them) with its unit and the source of the figure."""

    dimension: ClassVar[str] = ""

    value: float | tuple[float, ...]
    unit: str
    source: str
    note: str | None = None

    @field_validator("value", mode="before")
    @classmethod
    def _finite_numbers(cls, value: Any) -> Any:
        # Before pydantic's own reading, which takes "12" for 12 and true for 1.
        for entry in value if isinstance(value, list | tuple) else (value,):
            if isinstance(entry, bool) or not isinstance(entry, Real):
                raise ValueError("must be a number or a list of numbers")  # noqa: TRY004 - as below
            if not math.isfinite(entry):
                raise ValueError("must be a finite number")
        return value

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, unit: str) -> str:
        factor(cls.dimension, unit)
        return unit

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        for number in self.value if isinstance(self.value, tuple) else (self.value,):
            check_magnitude(self.dimension_here, self.unit, number, positive=isinstance(self, _Positive))
        return self

    @property
    def dimension_here(self) -> str:
        """The dimension; of quantities that may be in any unit, that of their unit."""
        return self.dimension

    @property
    def si(self) -> float:
        """The single value in SI units."""
        if isinstance(self.value, tuple):
            raise TypeError("this quantity is a list; use si_array")
        return self.value * factor(self.dimension, self.unit)

    @property
    def si_array(self) -> Array:
        """The values in SI units, shape (m,)."""
        return np.atleast_1d(np.asarray(self.value, dtype=np.float64)) * factor(self.dimension, self.unit)


class Scalar(Quantity):
    """One number, not a list."""

    @field_validator("value")
    @classmethod
    def _one(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if isinstance(value, tuple):
            raise ValueError("must be one number, not a list")  # noqa: TRY004 - pydantic wants ValueError
        return value


class _Positive(Scalar):
    @field_validator("value")
    @classmethod
    def _above_zero(cls, value: float) -> float:
        if not value > 0.0:
            raise ValueError("must be greater than zero")
        return value


class _Triple(Quantity):
    @field_validator("value")
    @classmethod
    def _three(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if not isinstance(value, tuple) or len(value) != 3:
            raise ValueError("must be a list of three numbers")
        return value


class _Range(Quantity):
    @field_validator("value")
    @classmethod
    def _ordered_pair(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if not isinstance(value, tuple) or len(value) != 2 or not value[0] < value[1]:
            raise ValueError("must be a pair [lower, upper] with lower < upper")
        return value


class Length(Scalar):
    """A length, which may be zero or negative."""

    dimension = "length"


class PositiveLength(_Positive):
    """A length greater than zero."""

    dimension = "length"


class Position(_Triple):
    """Three lengths x, y, z."""

    dimension = "length"


class Angle(Scalar):
    """An angle."""

    dimension = "angle"


class Angles(_Triple):
    """Roll, pitch, yaw about fixed x, y, z, as in URDF."""

    dimension = "angle"


class AngleRange(_Range):
    """Lower and upper angle."""

    dimension = "angle"


class Mass(_Positive):
    """A mass."""

    dimension = "mass"


class Density(_Positive):
    """A mass density."""

    dimension = "density"


class Modulus(_Positive):
    """An elastic modulus."""

    dimension = "pressure"


class Ratio(Scalar):
    """A pure number."""

    dimension = "ratio"


class PoissonsRatio(Ratio):
    """A Poisson's ratio: an isotropic material is stable only between -1 and 0.5."""

    @model_validator(mode="after")
    def _stable(self) -> Self:
        if not -1.0 < self.si < 0.5:
            raise ValueError(f"Poisson's ratio {self.si:g} is not between -1 and 0.5")
        return self


class RotationalStiffness(_Positive):
    """A stiffness against rotation."""

    dimension = "rotational stiffness"


class TranslationalStiffness(_Positive):
    """A stiffness against displacement."""

    dimension = "translational stiffness"


class Compliance(Scalar):
    """A displacement per force, rotation per force or rotation per moment; may be negative off a diagonal."""

    dimension = "compliance"
