"""One way of writing numbers on every page and picture: powers, thousands, minus, micro, and digits that say something.

Texts come from many places, as a terminal shows them: ``1e-06``, ``12500 N/mm``, ``-3 um``, ``+-``. What a page or a
picture shows of them goes through :func:`typeset`, so that the style is decided here alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
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


def _power(lead: str, sign: str, exponent: str) -> str:
    power = "10" + f"{sign.replace('+', '')}{exponent}".translate(_RAISED)
    if int(exponent) == 0:
        return lead
    if not sign.startswith("-") and int(exponent) < _POWERS_FROM:
        return f"{float(lead) * 10.0 ** int(exponent):,.0f}"
    number = lead.rstrip("0").rstrip(".") if "." in lead else lead
    return power if number == "1" else f"{number}·{power}"


def naturally(labels: Iterable[str]) -> list[str]:
    """Different labels in the order in which people count: pose 9 before pose 10."""

    def key(label: str) -> list[tuple[bool, float, str]]:
        parts = re.split(r"(\d+(?:\.\d+)?)", label)
        return [(not part[:1].isdigit(), float(part) if part[:1].isdigit() else 0.0, part) for part in parts if part]

    return sorted(dict.fromkeys(labels), key=key)
