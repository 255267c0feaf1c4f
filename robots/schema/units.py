"""Units that may stand in a robot file, by dimension, with their factor to SI; and how large a figure can be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

_DEG: Final = math.pi / 180.0
_ARCMIN: Final = _DEG / 60.0


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its units with their factor to SI (first the SI unit), and how large a figure can be, SI.

    ``least``: smallest figure of what must be above zero; ``most``: largest magnitude of any. No arm comes near either
    end; beyond them products of a few such figures overflow, or vanish in round-off.
    """

    units: Mapping[str, float]
    least: float
    most: float

    @property
    def si(self) -> str:
        """The SI unit."""
        return next(iter(self.units))


DIMENSIONS: Final[Mapping[str, Dimension]] = MappingProxyType(
    {
        "length": Dimension({"m": 1.0, "mm": 1e-3, "um": 1e-6}, 1e-9, 1e3),
        "angle": Dimension({"rad": 1.0, "deg": _DEG, "mrad": 1e-3}, 1e-9, 1e4),
        "force": Dimension({"N": 1.0, "kN": 1e3}, 1e-9, 1e9),
        "torque": Dimension({"N m": 1.0, "kN m": 1e3}, 1e-9, 1e9),
        "mass": Dimension({"kg": 1.0}, 1e-6, 1e6),
        "density": Dimension({"kg/m^3": 1.0}, 1e-3, 1e6),
        "pressure": Dimension({"Pa": 1.0, "MPa": 1e6, "GPa": 1e9}, 1.0, 1e15),
        "rotational stiffness": Dimension(
            {"N m/rad": 1.0, "N mm/rad": 1e-3, "kN m/rad": 1e3, "N m/arcmin": 1.0 / _ARCMIN}, 1e-3, 1e15
        ),
        "translational stiffness": Dimension({"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6}, 1e-3, 1e15),
        # An SI unit for each pair of kinds of rows.
        "compliance": Dimension({"m/N": 1.0, "mm/N": 1e-3, "rad/N": 1.0, "rad/(N m)": 1.0}, 1e-18, 1e3),
        "time": Dimension({"s": 1.0, "min": 60.0, "h": 3600.0}, 1e-3, 1e9),
        "ratio": Dimension({"1": 1.0, "%": 1e-2}, 1e-9, 1e6),
    }
)


def dimension_of(unit: str) -> str:
    """The dimension that has a unit.

    Raises
    ------
    ValueError
        None has it; the message lists the units that are known.
    """
    for name, dimension in DIMENSIONS.items():
        if unit in dimension.units:
            return name
    known = dict.fromkeys(name for dimension in DIMENSIONS.values() for name in dimension.units)
    raise ValueError(f"unit {unit!r} is not known; allowed: {', '.join(known)}")


def check_magnitude(dimension: str, unit: str, value: float, *, positive: bool = False) -> None:
    """Raise ValueError for a figure beyond those of any arm; the range in the message is in the figure's own unit."""
    least, most = DIMENSIONS[dimension].least, DIMENSIONS[dimension].most
    si = value * factor(dimension, unit)
    if not abs(si) <= most:
        raise ValueError(f"must be at most {most / factor(dimension, unit):g} {unit} in size")
    if positive and not si >= least:
        raise ValueError(f"must be at least {least / factor(dimension, unit):g} {unit}")


def factor(dimension: str, unit: str) -> float:
    """Factor that turns a value in ``unit`` into SI.

    Raises
    ------
    ValueError
        The unit is not one of this dimension; the message lists those that are.
    """
    known = DIMENSIONS[dimension].units
    if unit not in known:
        allowed = ", ".join(known)
        raise ValueError(f"unit {unit!r} is not a unit of {dimension}; allowed: {allowed}")
    return known[unit]
