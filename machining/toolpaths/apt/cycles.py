"""``CYCLE/`` statements of APT dialects as :class:`Cycle`."""

from __future__ import annotations

import math

from machining.toolpaths.apt.harmless import OF_CYCLE
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
_REFUSED = ("NODRAG", "BACK", "BACKBORE", "MANUAL", "MILL", "THREAD", "ORIENT", "CAM")
_PECKS = ("STEP", "STEP1", "1STPECK", "INCR", "SUBPECK", "STEP2", "PECK")
_HEIGHTS = ("RAPTO", "CLEAR", "FEDTO", "DEPTH", "RTRCTO", "RETURN", "DWELL", "TPI")


def cycle(parts: list[str], scale: float) -> Cycle:
    """Cycle from the items behind ``CYCLE/``.

    Heights count from the point of ``GOTO`` along the tool axis. ``FEDTO`` or ``DEPTH``: into the part, whatever the
    sign (Siemens NX writes it negative, SolidWorks CAM positive). ``RAPTO``: height where feed begins; with ``CLEAR``
    the distance from that height on (Creo). ``RTRCTO`` or ``RETURN``: height to return to.

    Raises
    ------
    StatementError
        A kind or a word that is not read, numbers without a word, no depth, values without sense.
    """
    kind, values, feed = _sorted(parts)
    if not kind:
        raise StatementError("a cycle without its kind", ", ".join(KINDS), code="P012")
    pecks, chip_break, feed_out, reverse = KINDS[kind]
    if "FEDTO" not in values and "DEPTH" not in values:
        raise StatementError("a cycle without its depth", "FEDTO or DEPTH with a number", code="P012")
    start = values.get("CLEAR", values.get("RAPTO", 0.0))
    if "CLEAR" in values:
        start -= values.get("RAPTO", 0.0)
    steps = tuple(values[word] * scale for word in _PECKS if values.get(word, 0.0) > 0.0) if pecks else ()
    # DEEP without steps is one stroke: in Siemens NX it has "Increment: None".
    if pecks and not steps and kind != "DEEP":
        raise StatementError(f"{kind} without its steps", "STEP with a number", code="P012")
    for one, other in (("FEDTO", "DEPTH"), ("RTRCTO", "RETURN")):
        if one in values and other in values:
            raise StatementError(f"{one} and {other} of a cycle", "one of them", code="P012")
    if not pecks and any(word in values for word in _PECKS):
        raise StatementError(f"{kind} with steps", "DEEP or BRKCHP for pecks, no steps for one stroke", code="P012")
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
    return made.checked("numbers that make a hole")


def _sorted(parts: list[str]) -> tuple[str, dict[str, float], tuple[float, str] | None]:
    kind, values, feed = "", dict[str, float](), None
    i = 0
    while i < len(parts):
        word, number = parts[i], as_number(parts[i + 1]) if i + 1 < len(parts) else None
        i += 1 if number is None else 2
        if as_number(word) is not None:
            raise StatementError(
                f"number {word} of a cycle without its word",
                "words with numbers, such as RAPTO,3,FEDTO,-20,MMPM,250",
                code="P012",
            )
        if word in KINDS and (number is None or not kind):
            if number is not None:
                raise StatementError(
                    f"number {parts[i - 1]} of a cycle without its word", "RAPTO, FEDTO, ... before it", code="P012"
                )
            kind = word
        elif word in _REFUSED or not kind:
            raise StatementError(f"cycle {word!r}", ", ".join(KINDS), code="P012")
        elif word in FEED_UNITS and number is not None:
            if feed is not None:
                raise StatementError("two feeds of a cycle", "one feed", code="P012")
            feed = (number, word)
        elif word in (*_HEIGHTS, *_PECKS) and number is not None:
            if word in values:
                raise StatementError(f"{word} of a cycle twice", "each word once", code="P012")
            values[word] = number
        elif word not in OF_CYCLE or number is not None:
            text = word if number is None else f"{word},{number:g}"
            raise StatementError(
                f"{text} of a cycle is not read", ", ".join((*_HEIGHTS, *_PECKS, *OF_CYCLE)), code="P012"
            )
    return kind, values, feed


def _feed(feed: tuple[float, str] | None, values: dict[str, float], scale: float) -> Feed | None:
    """Feed of the cycle, by its own word or by the thread's pitch."""
    if feed is not None:
        return in_unit(*feed, scale)
    return Feed(INCH / values["TPI"], "turn") if values.get("TPI", 0.0) > 0.0 else None
