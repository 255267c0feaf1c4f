"""Units that may stand in a robot file, by dimension, with their factor to SI; and how large a figure can be."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Final

_DEG: Final = math.pi / 180.0
_ARCMIN: Final = _DEG / 60.0

UNITS: Final = MappingProxyType(
    {
        "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
        "angle": {"rad": 1.0, "deg": _DEG, "mrad": 1e-3},
        "force": {"N": 1.0, "kN": 1e3},
        "torque": {"N m": 1.0, "kN m": 1e3},
        "mass": {"kg": 1.0},
        "density": {"kg/m^3": 1.0},
        "pressure": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
        "rotational stiffness": {
            "N m/rad": 1.0,
            "N mm/rad": 1e-3,
            "kN m/rad": 1e3,
            "N m/arcmin": 1.0 / _ARCMIN,
        },
        "translational stiffness": {"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6},
        "compliance": {"m/N": 1.0, "mm/N": 1e-3, "rad/N": 1.0, "rad/(N m)": 1.0},
        "ratio": {"1": 1.0, "%": 1e-2},
    }
)
"""Dimension -> unit -> factor to the SI unit of that dimension."""

# No arm comes near either end; beyond them products of a few such figures overflow, or vanish in round-off.
RANGES: Final = MappingProxyType(
    {
        "length": (1e-9, 1e3),
        "angle": (1e-9, 1e4),
        "force": (1e-9, 1e9),
        "torque": (1e-9, 1e9),
        "mass": (1e-6, 1e6),
        "density": (1e-3, 1e6),
        "pressure": (1.0, 1e15),
        "rotational stiffness": (1e-3, 1e15),
        "translational stiffness": (1e-3, 1e15),
        "compliance": (1e-18, 1e3),
        "ratio": (1e-9, 1e6),
    }
)
"""Dimension -> smallest figure that must be above zero, and largest magnitude of any, SI."""


def dimension_of(unit: str) -> str:
    """The dimension that has a unit.

    Raises
    ------
    ValueError
        None has it; the message lists the units that are known.
    """
    for dimension, units in UNITS.items():
        if unit in units:
            return dimension
    known = dict.fromkeys(name for units in UNITS.values() for name in units)
    raise ValueError(f"unit {unit!r} is not known; allowed: {', '.join(known)}")


def check_magnitude(dimension: str, unit: str, value: float, *, positive: bool = False) -> None:
    """Raise ValueError for a figure beyond those of any arm; the range in the message is in the figure's own unit."""
    least, most = RANGES[dimension]
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
    known = UNITS[dimension]
    if unit not in known:
        allowed = ", ".join(known)
        raise ValueError(f"unit {unit!r} is not a unit of {dimension}; allowed: {allowed}")
    return known[unit]
