"""``CYCLE/`` statements of APT dialects as :class:`Cycle`."""

from __future__ import annotations

import math

from machining.toolpaths.apt.words import FEED_UNITS, INCH, as_number, in_unit
from machining.toolpaths.cycles import Cycle
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError

# Kinds of cycle: pecks, chip break, leaves at feed, spindle turns back.
KINDS: dict[str, tuple[bool, bool, bool, bool]] = {
    "DRILL": (False, False, False, False),
    "SPDRIL": (False, False, False, False),
    "SPOT": (False, False, False, False),
    "CENTER": (False, False, False, False),
    "FACE": (False, False, False, False),
    "CSINK": (False, False, False, False),
    "CBORE": (False, False, False, False),
    "THRU": (False, False, False, False),
    "DEEP": (True, False, False, False),
    "DEEP2": (True, False, False, False),
    "PECK": (True, False, False, False),
    "BRKCHP": (True, True, False, False),
    "CHIPBREAK": (True, True, False, False),
    "BORE": (False, False, True, False),
    "REAM": (False, False, True, False),
    "TAP": (False, False, True, True),
    "RIGID": (False, False, True, True),
}
# Kinds that may stand behind the first one (CYCLE/DRILL,DEEP); the last decides.
_QUIET = ("AUTO", "DRAG", "ON", "SEC", "NOREVR", "MULTRD", "FLOATING")
_REFUSED = ("NODRAG", "BACK", "BACKBORE", "MANUAL", "MILL", "THREAD", "ORIENT", "CAM")
_PECKS = ("STEP", "STEP1", "1STPECK", "INCR", "SUBPECK", "STEP2", "PECK")
_HEIGHTS = ("RAPTO", "CLEAR", "FEDTO", "DEPTH", "RTRCTO", "RETURN", "DWELL", "TPI")


def cycle(parts: list[str], scale: float) -> tuple[Cycle, list[str]]:
    """Cycle from the items behind ``CYCLE/``, and the words that are not read.

    Heights count from the point of ``GOTO`` along the tool axis. ``FEDTO`` or ``DEPTH``: into the part, whatever the
    sign (Siemens NX writes it negative, SolidWorks CAM positive). ``RAPTO``: height where feed begins; with ``CLEAR``
    the distance from that height on (Creo). ``RTRCTO`` or ``RETURN``: height to return to.

    Raises
    ------
    StatementError
        A kind that is not read, numbers without a word, no depth, values without sense.
    """
    kind, values, feed, unread = _sorted(parts)
    if not kind:
        raise StatementError("a cycle without its kind", ", ".join(KINDS))
    pecks, chip_break, feed_out, reverse = KINDS[kind]
    if "FEDTO" not in values and "DEPTH" not in values:
        raise StatementError("a cycle without its depth", "FEDTO or DEPTH with a number")
    start = values.get("CLEAR", values.get("RAPTO", 0.0))
    if "CLEAR" in values:
        start -= values.get("RAPTO", 0.0)
    steps = tuple(values[word] * scale for word in _PECKS if values.get(word, 0.0) > 0.0) if pecks else ()
    if pecks and not steps:
        unread.append(f"{kind} without its steps, so drilled in one stroke")
    back = values.get("RTRCTO", values.get("RETURN", math.nan))
    made = Cycle(
        start=start * scale,
        depth=abs(values.get("FEDTO", values.get("DEPTH", 0.0))) * scale,
        back=back * scale,
        pecks=steps,
        chip_break=chip_break,
        dwell=values.get("DWELL", 0.0),
        feed_out=feed_out,
        reverse=reverse,
        feed=_feed(feed, values, scale),
    )
    return made.checked("numbers that make a hole"), unread


def _sorted(parts: list[str]) -> tuple[str, dict[str, float], tuple[float, str] | None, list[str]]:
    kind, values, feed, unread = "", {}, None, []
    i = 0
    while i < len(parts):
        word, number = parts[i], as_number(parts[i + 1]) if i + 1 < len(parts) else None
        i += 1 if number is None else 2
        if as_number(word) is not None:
            raise StatementError(
                f"number {word} of a cycle without its word", "words with numbers, such as RAPTO,3,FEDTO,-20,MMPM,250"
            )
        if word in KINDS and (number is None or not kind):
            if number is not None:
                raise StatementError(
                    f"number {parts[i - 1]} of a cycle without its word", "RAPTO, FEDTO, ... before it"
                )
            kind = word
        elif word in _REFUSED or not kind:
            raise StatementError(f"cycle {word!r}", ", ".join(KINDS))
        elif word in FEED_UNITS and number is not None:
            feed = (number, word)
        elif word in (*_HEIGHTS, *_PECKS) and number is not None:
            values[word] = number
        elif word not in _QUIET:
            unread.append(word if number is None else f"{word},{number:g}")
    return kind, values, feed, unread


def _feed(feed: tuple[float, str] | None, values: dict[str, float], scale: float) -> Feed | None:
    """Feed of the cycle, by its own word or by the thread's pitch."""
    if feed is not None:
        return in_unit(*feed, scale)
    return Feed(INCH / values["TPI"], "turn") if values.get("TPI", 0.0) > 0.0 else None
