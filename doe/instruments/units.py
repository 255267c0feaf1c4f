"""Units as people write them: which one a word names, and its factor to the unit of the table."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Final

from robots.constants import STANDARD_GRAVITY as GRAVITY
from robots.schema.units import DIMENSIONS

_POUND: Final = 0.45359237  # kg, exact: international yard and pound agreement of 1959
_INCH: Final = 0.0254  # m, exact: as above

# Dimension: units with their factor to SI.
UNITS: Final[Mapping[str, Mapping[str, float]]] = {
    "length": {
        **DIMENSIONS["length"].units,
        "cm": 1e-2,
        "inch": _INCH,
        "mil": 1e-3 * _INCH,
        "ft": 12 * _INCH,
        "1/100mm": 1e-5,
        "1/1000mm": 1e-6,
    },
    "angle": {
        **DIMENSIONS["angle"].units,
        "urad": 1e-6,
        "arcmin": math.pi / 10800,
        "arcsec": math.pi / 648000,
        "gon": math.pi / 200,
    },
    "force": {**DIMENSIONS["force"].units, "kgf": GRAVITY, "lbf": _POUND * GRAVITY},
    "moment": {
        "Nm": 1.0,
        "Nmm": 1e-3,
        "kNm": 1e3,
        "kgfm": GRAVITY,
        "kgfcm": 1e-2 * GRAVITY,
        "lbfin": _POUND * GRAVITY * _INCH,
        "lbfft": _POUND * GRAVITY * 12 * _INCH,
    },
    "mass": {"kg": 1.0, "g": 1e-3, "t": 1e3, "lb": _POUND},
    "temperature": {"C": 1.0, "F": 1.0, "K": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "iso": 1.0, "dmy": 1.0, "mdy": 1.0, "clock": 1.0},
}
# Words with one meaning, in small letters; what is not here is taken as a unit's own name.
_WORDS: Final = {
    "millimeter": "mm",
    "millimeters": "mm",
    "millimetre": "mm",
    "millimetres": "mm",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "micron": "um",
    "microns": "um",
    "micrometer": "um",
    "micrometre": "um",
    "inches": "inch",
    "in": "inch",
    "inch": "inch",
    '"': "inch",
    "thou": "mil",
    "mils": "mil",
    "feet": "ft",
    "0.01mm": "1/100mm",
    "0,01mm": "1/100mm",
    "0.001mm": "1/1000mm",
    "0,001mm": "1/1000mm",
    "hundredths mm": "1/100mm",
    "degree": "deg",
    "degrees": "deg",
    "\u00b0": "deg",
    "radian": "rad",
    "radians": "rad",
    "newton": "N",
    "newtons": "N",
    "kp": "kgf",
    "n m": "Nm",
    "n*m": "Nm",
    "n\u00b7m": "Nm",
    "nmm": "Nmm",
    "n mm": "Nmm",
    "knm": "kNm",
    "kn m": "kNm",
    "kn": "kN",
    "n": "N",
    "lbs": "lb",
    "pounds": "lb",
    "kilogram": "kg",
    "kilograms": "kg",
    "\u00b0c": "C",
    "degc": "C",
    "deg c": "C",
    "celsius": "C",
    "\u00b0f": "F",
    "degf": "F",
    "deg f": "F",
    "fahrenheit": "F",
    "kelvin": "K",
    "sec": "s",
    "seconds": "s",
    "minutes": "min",
    "hours": "h",
    "lbf in": "lbfin",
    "in lbf": "lbfin",
    "lbf ft": "lbfft",
    "ft lbf": "lbfft",
    "kgf m": "kgfm",
    "kgf cm": "kgfcm",
}
_NAMES: Final = {unit: dimension for dimension, units in UNITS.items() for unit in units}
# What a table's columns are in, by dimension, with its factor to SI.
TABLE_UNITS: Final = {
    "length": ("mm", 1e-3),
    "angle": ("deg", math.pi / 180),
    "force": ("N", 1.0),
    "moment": ("Nm", 1.0),
    "mass": ("kg", 1.0),
    "temperature": ("C", 1.0),
    "time": ("s", 1.0),
    "turn": ("mrad", 1e-3),
}


def unit_of(word: str) -> str | None:
    """The unit that a word names; None where it names none."""
    plain = word.strip().replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00ba", "\u00b0")
    if plain in _NAMES:
        return plain
    plain = re.sub(r"\s+", " ", plain.lower())
    return _WORDS.get(plain) or (plain if plain in _NAMES and plain not in _SMALL else None)


# Small letters that would be another unit, or a word, than the capital: c, f, k.
_SMALL: Final = frozenset(unit.lower() for unit in _NAMES if unit.lower() != unit) - frozenset(_NAMES)


def dimension(unit: str) -> str:
    """What a unit measures."""
    return _NAMES[unit]


def converted(value: float, unit: str, to: str) -> float:
    """A value in a unit, in that of the table for ``to`` (a dimension, or "turn" for small rotations)."""
    if unit == "F":
        return (value - 32.0) / 1.8
    if unit == "K":
        return value - 273.15
    own = UNITS[_NAMES[unit]][unit]
    # A unit of the table itself stays as it was written, to the last digit.
    target, factor = TABLE_UNITS[to]
    return value if unit == target else value * own / factor
