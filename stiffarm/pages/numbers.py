"""One way of writing numbers on every page and picture: powers, thousands, minus, micro, and digits that say something.

Texts come from many places, as a terminal shows them: ``1e-06``, ``12500 N/mm``, ``-3 um``, ``+-``. What a page or a
picture shows of them goes through :func:`typeset`, so that the style is decided here alone.
"""

from __future__ import annotations

import math
import re
from typing import Final

# Below this power of ten a number is written out.
_POWERS_FROM: Final = 5
_RAISED: Final = str.maketrans("+-−0123456789", "\u207a⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER: Final = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]?)0*(\d+)(?![\w.])")
_RAISE: Final = re.compile(r"(?<=[a-z0-9])\^(-?\d+)\b")
_MICRO: Final = re.compile(r"\bu(m|rad)\b")
# A minus sign stands before a number and behind nothing that makes it a hyphen, a list or a setting (q2_deg=-70).
_MINUS: Final = re.compile(r"(?<![\w.,=:)\]/+−-])-(?=\.?\d)")
_NUMBER: Final = r"(?<![\w.,/=])\d{4,}(?=(?:\.\d+)?"
# What is counted or measured in such sizes; years, lines and labels have no unit.
_UNIT: Final = (
    r"(?:[\s\u00a0\u202f]?(?:N/mm|N/um|N/µm|N m/rad|N|kN|mm|um|µm|deg|MPa|GPa|Hz|mm/min"
    r"|(?:reachable )?poses|points|readings|runs|set-ups|triangles|places|cells|draws)(?![\w/]))"
)
_THOUSANDS: Final = re.compile(_NUMBER + rf"(?:{_UNIT}|[\s\u00a0]*(?:to|and|→|±)[\s\u00a0]*[\d.,]+{_UNIT}))")
_WHOLE: Final = re.compile(r"[+−-]?\d{4,}(?:\.\d+)?")
_DIGITS: Final = re.compile(r"\d{4,}")


def typeset(text: str) -> str:
    """A text for a page or a picture: ``2·10⁻⁶``, ``12,500 N/mm``, ``−3 µm``, ``±``; all else stays."""
    text = _POWER.sub(lambda m: _power(m[1], m[2], m[3]), text)
    text = _RAISE.sub(lambda m: m[1].translate(_RAISED), text)
    text = _MINUS.sub("−", text.replace("+-", "±").replace(">=", "≥").replace("<=", "≤"))
    return _THOUSANDS.sub(lambda m: grouped(m[0]), _MICRO.sub(r"µ\1", text))


def typeset_cell(text: str) -> str:
    """The same for a cell of a table that holds numbers: one alone has no unit beside it."""
    if _WHOLE.fullmatch(text):
        text = _DIGITS.sub(lambda m: grouped(m[0]), text, count=1)
    return typeset(text)


def grouped(digits: str) -> str:
    """The digits of a whole number in groups of three: ``12,500``."""
    return re.sub(r"(?<=\d)(?=(?:\d{3})+$)", ",", digits)


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and no exponent, in groups of three: ``12,300``, ``0.0123``."""
    if not math.isfinite(value) or value == 0.0:
        return "0" if value == 0.0 else "∞" if value > 0.0 else "−∞" if value < 0.0 else "–"
    if not 1e-6 <= abs(value) < 1e9:
        return typeset(f"{value:.{digits - 1}e}")
    places = digits - 1 - math.floor(math.log10(abs(value)))
    # Rounding may carry into one more digit (999.6): decided by what it gives.
    rounded = round(value, places)
    places = digits - 1 - math.floor(math.log10(abs(rounded)))
    return f"{round(value, places):,.{max(places, 0)}f}".replace("-", "−")


def with_interval(value: float, low: float, high: float, digits: int = 3) -> str:
    """A number with its interval: ``12,300 (11,900 to 12,800)``; ``digits`` of the number, three of the ends."""
    return f"{significant(value, digits)} ({significant(low)} to {significant(high)})"


def percent(value: float) -> str:
    """A probability: ``82 %``; never 0 % or 100 % for what is neither."""
    if 0.0 < value < 0.005:
        return "below 1 %"
    if value >= 0.995:
        return "above 99 %"
    return f"{100.0 * value:.0f} %"


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


def _power(lead: str, sign: str, exponent: str) -> str:
    power = "10" + f"{sign.replace('+', '')}{exponent}".translate(_RAISED)
    if int(exponent) == 0:
        return lead
    if not sign.startswith("-") and int(exponent) < _POWERS_FROM:
        return f"{float(lead) * 10.0 ** int(exponent):,.0f}"
    number = lead.rstrip("0").rstrip(".") if "." in lead else lead
    return power if number == "1" else f"{number}·{power}"
