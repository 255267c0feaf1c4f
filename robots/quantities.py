"""Quantities as users meet them: name, unit, digits and how a number is written, once for every output.

A :class:`Quantity` knows how its SI value is shown: in which unit, with how many digits, under which column of a file
and which label of an axis. Screens, pages, CSV, JSON, data frames and figures write numbers through it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from robots.constants import N_PER_M_TO_N_PER_MM
from robots.errors import require_one_of

# Numbers from 1e-6 to 1e9 are written out; others as powers of ten.
WRITTEN_OUT: Final = (1e-6, 1e9)
# A relative error below this is round-off.
ROUND_OFF: Final = 1e-6
INFINITE: Final = "∞"
UNKNOWN: Final = "–"
_RAISED: Final = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_DEGREES: Final = 180.0 / math.pi


@dataclass(frozen=True)
class Quantity:
    """A quantity of results: SI value times ``factor`` is in ``unit`` (empty: a pure number).

    ``key``: its name in code and files; ``label``: what people read; ``digits``: significant digits for people, 0 for
    whole numbers; ``stored``: significant digits in files; ``words``: what writes its SI value for people, in place of
    all this.
    """

    key: str
    unit: str = ""
    factor: float = 1.0
    label: str = ""
    digits: int = 4
    stored: int = 6
    words: Callable[[float], str] | None = None

    @property
    def column(self) -> str:
        """Its key in JSON, CSV and data frames: ``k_fs_N_per_mm``."""
        return self.column_of()

    def column_of(self, what: str = "") -> str:
        """The key of something in its unit, as of an end of its interval: ``k_fs_low95_N_per_mm``."""
        unit = self.unit.replace("/", "_per_").replace(" ", "").replace("%", "percent")
        return "_".join(filter(None, (self.key, what, unit)))

    @property
    def name(self) -> str:
        """What people read: its label, else its key."""
        return self.label or self.key

    @property
    def heading(self) -> str:
        """Above a column that people read: ``k_fs, N/mm``."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def axis(self) -> str:
        """Beside an axis of a figure: ``k_fs (N/mm)``."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    def stored_value(self, value: float) -> float | None:
        """The number for a file, in the shown unit; None for what is not known or infinite."""
        number = rounded(float(value) * self.factor, self.stored if self.digits else 15)
        return number if self.digits or number is None else round(number)

    def stored_values(self, values: Iterable[float]) -> list[float | None]:
        """The same for each of some values."""
        return [self.stored_value(value) for value in values]

    def text(self, value: float, *, unit: bool = False) -> str:
        """The number for people: ``12,300``, with ``unit`` ``12,300 N/mm``; ``∞``, and ``–`` for what is not known."""
        if self.words is not None:
            return self.words(float(value)) if math.isfinite(value) else UNKNOWN
        number = float(value) * self.factor
        shown = significant(number, self.digits) if self.digits else f"{number:,.0f}".replace("nan", UNKNOWN)
        return f"{shown} {self.unit}" if unit and self.unit else shown

    def between(self, low: float, high: float) -> str:
        """An interval with its unit: ``230 to 330 N/mm``; open above it is ``at least 230 N/mm``."""
        return ranged(float(low) * self.factor, float(high) * self.factor, self.unit)


@dataclass(frozen=True)
class Probability(Quantity):
    """A probability in percent: never 0 or 100 for what is neither."""

    unit: str = "%"
    factor: float = 100.0

    def text(self, value: float, *, unit: bool = False) -> str:
        """As :func:`percent`."""
        return percent(value) if unit else percent(value).removesuffix(" %")


def angle(key: str, label: str = "") -> Quantity:
    """An angle, rad, shown in degrees and stored with digits that give it back."""
    return Quantity(key.removesuffix("_deg"), "deg", _DEGREES, label, stored=9)


def stiffness(key: str, label: str = "") -> Quantity:
    """A stiffness against displacement, N/m, shown in N/mm."""
    return Quantity(key, "N/mm", N_PER_M_TO_N_PER_MM, label)


def length(key: str, label: str = "", unit: str = "mm") -> Quantity:
    """A length, m, shown in mm or um."""
    return Quantity(key, unit, {"mm": 1e3, "um": 1e6}[unit], label)


def count(key: str, label: str = "") -> Quantity:
    """A whole number of something."""
    return Quantity(key, label=label, digits=0)


def stored(values: Mapping[Quantity, float]) -> dict[str, float | None]:
    """Numbers for JSON by their columns."""
    return {quantity.column: quantity.stored_value(value) for quantity, value in values.items()}


def _table(*some: Quantity) -> dict[str, Quantity]:
    return {one.key: one for one in some}


QUANTITIES: Final = _table(
    stiffness("stiffness", "stiffness along the load"),
    stiffness("k_fs"),
    stiffness("nspi"),
    stiffness("rayleigh"),
    stiffness("directional"),
    stiffness("weakest"),
    stiffness("strongest"),
    stiffness("mean"),
    stiffness("average"),
    Quantity("isotropy"),
    length("displacement", unit="um"),
    length("normal_displacement", "normal displacement", unit="um"),
    Quantity("room"),
    Quantity("share", "%", 100.0, digits=2),
    angle("joint_limit", "distance to the nearest joint limit"),
    Quantity("singularity", label="smallest singular value"),
    Quantity("stiffness_share_taken_by_load", label="share of the joint stiffness that the load takes away"),
    length("dx"),
    length("dy"),
    length("dz"),
    Quantity("rx", "mrad", 1e3),
    Quantity("ry", "mrad", 1e3),
    Quantity("rz", "mrad", 1e3),
)
"""Quantities that several results have, by key; joint coordinates are made by :func:`angle`."""


def quantity(key: str) -> Quantity:
    """A quantity of :data:`QUANTITIES` by its key or name.

    Raises
    ------
    InputError
        No such quantity.
    """
    key = key.replace(" ", "_")
    require_one_of("quantity", key, QUANTITIES, code="S015")
    return QUANTITIES[key]


def rounded(value: float, digits: int = 6) -> float | None:
    """A number for a file, with that many significant digits and no minus zero; None for NaN and infinity."""
    return float(f"{value:.{digits}g}") + 0.0 if math.isfinite(value) else None


def rounded_all(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """The same for each of some values."""
    return [rounded(float(value), digits) for value in values]


def interval_json(low: float, high: float, digits: int = 6) -> list[float | None] | None:
    """Ends for JSON: null where there is none, and for an interval of which nothing is known."""
    return [rounded(low, digits), rounded(high, digits)] if math.isfinite(low) or math.isfinite(high) else None


def significant(value: float, digits: int = 3) -> str:
    """A number for people, with so many significant digits, in groups: ``12,300``, ``0.0123``, ``1.2·10⁻⁷``."""
    if not math.isfinite(value) or value == 0.0:
        return "0" if value == 0.0 else INFINITE if value > 0.0 else f"−{INFINITE}" if value < 0.0 else UNKNOWN
    if not WRITTEN_OUT[0] <= abs(value) < WRITTEN_OUT[1]:
        lead, _, power = f"{value:.{digits - 1}e}".partition("e")
        lead = lead.rstrip("0").rstrip(".") if "." in lead else lead
        raised = f"10{str(int(power)).translate(_RAISED)}"
        return (raised if lead == "1" else f"{lead}·{raised}").replace("-", "−")
    places = digits - 1 - math.floor(math.log10(abs(value)))
    # Rounding may carry into one more digit (999.6): decided by what it gives.
    places = digits - 1 - math.floor(math.log10(abs(round(value, places))))
    return f"{round(value, places):,.{max(places, 0)}f}".replace("-", "−")


def percent(value: float) -> str:
    """A probability: ``82 %``; never 0 % or 100 % for what is neither."""
    if 0.0 < value < 0.005:
        return "below 1 %"
    if value >= 0.995:
        return "above 99 %"
    return f"{100.0 * value:.0f} %"


def relative(value: float) -> str:
    """A relative error: ``12 %``, ``0.34 %``; round-off, and what is beyond ten times the value, are only called so."""
    if 0.0 < value < ROUND_OFF:
        return "below 0.0001\u00a0%"
    if value >= 10.0:
        return "more than tenfold"
    return f"{value * 100:.0f}\u00a0%" if value >= 0.1 else f"{value * 100:.2g}\u00a0%"


def change(factor: float) -> str:
    """A factor as a change: ``+12 %``, ``−0.3 %``; from threefold on it is ``3.20 times``."""
    if not factor < 3.0:
        return f"{significant(factor)} times"
    more = 100.0 * (factor - 1.0)
    return f"{more:+.0f} %".replace("-", "−") if abs(more) >= 9.5 else f"{more:+.1f} %".replace("-", "−")


def known_to(value: float, low: float, high: float) -> str:
    """A number with the digits that its interval leaves it: 44,717 within 20,000 and 90,000 is ``45,000``."""
    return _to_place(value, high - low)


def ranged(low: float, high: float, unit: str = "", digits: int = 2) -> str:
    """``230 to 330 N/mm``, with the digits that tell the ends apart; open above it is ``at least 230 N/mm``.

    ``digits``: so many of each end in any case.
    """
    behind = f" {unit}" if unit else ""
    if math.isinf(high):
        return f"at least {significant(low, digits)}{behind}"
    return f"{_to_place(low, high - low, digits)} to {_to_place(high, high - low, digits)}{behind}"


def _to_place(value: float, width: float, least: int = 2) -> str:
    """A number to the digit that a quarter of this width has first, but ``least`` digits of it in any case."""
    if not (math.isfinite(width) and width > 0.0 and value != 0.0 and math.isfinite(value)):
        return significant(value, least)
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(width / 4.0)) + 1
    return significant(value, min(max(digits, least), 6))
