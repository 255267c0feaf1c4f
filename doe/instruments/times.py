"""When readings were taken: dates and clock times as people write them, in seconds."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Sequence
from typing import Final

# Ways to write times that are no number of seconds, minutes or hours.
FORMS: Final = ("iso", "dmy", "mdy", "clock")
_CLOCK: Final = r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,6}))?)?\s*([ap]m)?"
_ISO: Final = re.compile(rf"(\d{{4}})[-/.](\d{{1,2}})[-/.](\d{{1,2}})(?:[T\s]+{_CLOCK}(?:Z|[+-]\d\d:?\d\d)?)?", re.I)
_DATE: Final = re.compile(rf"(\d{{1,2}})([-/.])(\d{{1,2}})[-/.](\d{{4}})(?:[T\s,]+{_CLOCK})?", re.I)
_ONLY_CLOCK: Final = re.compile(_CLOCK, re.I)
_LAST_MONTH: Final = 12


def time_form(cells: Sequence[str]) -> str | None:
    """How a column writes times: iso, dmy, mdy or clock; None where it writes none, or day and month may be either."""
    filled = [cell.strip() for cell in cells if cell.strip()]
    if not filled:
        return None
    if all(_ISO.fullmatch(cell) for cell in filled):
        return "iso"
    if all(_ONLY_CLOCK.fullmatch(cell) for cell in filled):
        return "clock"
    dates = [_DATE.fullmatch(cell) for cell in filled]
    found = [date for date in dates if date]
    if len(found) < len(dates):
        return None
    # Points stand between day, month and year in that order wherever they are used.
    if all(date[2] == "." for date in found) or any(int(date[1]) > _LAST_MONTH for date in found):
        return "dmy"
    return "mdy" if any(int(date[3]) > _LAST_MONTH for date in found) else None


def seconds(cell: str, form: str) -> float:
    """Seconds of a date and time (since the year 1), or of a clock time (since midnight).

    Raises
    ------
    ValueError
        It is none in this form; the message is the remedy.
    """
    text, wrong = cell.strip(), f"write it as {_EXAMPLES[form]}"
    if form == "clock":
        found = _ONLY_CLOCK.fullmatch(text)
        if not found:
            raise ValueError(wrong)
        return _since_midnight(found.groups(), wrong)
    found = (_ISO if form == "iso" else _DATE).fullmatch(text)
    if not found:
        raise ValueError(wrong)
    parts = found.groups()
    if form == "iso":
        year, month, day, clock = parts[0], parts[1], parts[2], parts[3:]
    else:
        first, second, year, clock = parts[0], parts[2], parts[3], parts[4:]
        day, month = (first, second) if form == "dmy" else (second, first)
    try:
        days = dt.date(int(year), int(month), int(day)).toordinal()
    except ValueError as error:
        raise ValueError(wrong) from error
    return 86400.0 * days + (_since_midnight(clock, wrong) if clock[0] else 0.0)


_EXAMPLES: Final = {
    "iso": "2026-05-31 14:05:00",
    "dmy": "31.05.2026 14:05:00",
    "mdy": "05/31/2026 14:05:00",
    "clock": "14:05:00",
}


def _since_midnight(parts: Sequence[str | None], wrong: str) -> float:
    hour, minute, second, fraction, half = parts
    h, m, s = int(hour or 0), int(minute or 0), int(second or 0)
    if half:
        if not 1 <= h <= 12:
            raise ValueError(wrong)
        h = h % 12 + (12 if half.lower() == "pm" else 0)
    if h > 23 or m > 59 or s > 59:
        raise ValueError(wrong)
    return 3600.0 * h + 60.0 * m + s + (float(f"0.{fraction}") if fraction else 0.0)
