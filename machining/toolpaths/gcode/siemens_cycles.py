"""Drill cycles of Siemens' controls: CYCLE81 to CYCLE85 and CYCLE89 (SINUMERIK 840D sl, manual of cycles)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from machining.toolpaths.cycles import Cycle
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError

Argument = Callable[[int], float]
# What each drills like, and the argument with its rest at the bottom (s), if it has one.
DRILLS = {"CYCLE81": None, "CYCLE82": 5, "CYCLE83": 8, "CYCLE84": 5, "CYCLE85": 5, "CYCLE89": 5}
# Pitch mm of metric threads by their size, for CYCLE84 with MPIT (ISO 261, coarse).
PITCHES = {
    3: 0.5,
    4: 0.7,
    5: 0.8,
    6: 1.0,
    8: 1.25,
    10: 1.5,
    12: 1.75,
    14: 2.0,
    16: 2.0,
    18: 2.5,
    20: 2.5,
    22: 2.5,
    24: 3.0,
    27: 3.0,
    30: 3.5,
    33: 3.5,
    36: 4.0,
    39: 4.0,
    42: 4.5,
    45: 4.5,
    48: 5.0,
}


@dataclass(frozen=True)
class Hole:
    """A cycle along the normal of the plane, in m: where feed begins, where it ends, where the tool goes back to."""

    start: float
    cycle: Cycle


def hole(name: str, given: Sequence[float], scale: float) -> Hole:
    """What a call such as ``CYCLE82(50,0,2,-20,,0.5)`` drills; ``given``: its arguments, NaN where there is none.

    ``scale``: m of its unit of length.

    Raises
    ------
    StatementError
        Planes or depth missing, pecks that get smaller, a tap without its pitch.
    """

    def of(place: int) -> float:
        return given[place] if place < len(given) else math.nan

    back, reference, gap = (of(place) for place in range(3))
    bottom = of(3) if not math.isnan(of(3)) else reference - of(4)
    if not all(map(math.isfinite, (back, reference, gap, bottom))):
        raise StatementError(f"{name} without its planes or its depth", "RTP, RFP, SDIS and DP or DPR", code="P012")
    start, rest = reference + abs(gap), DRILLS[name]
    dwell = 0.0 if rest is None or math.isnan(of(rest)) else of(rest)
    if dwell < 0.0:
        raise StatementError(f"{name} rests for turns of the spindle", "a rest in s", "post the rest in s", code="P012")
    made = Cycle(
        start=0.0,
        depth=scale * (start - bottom),
        back=scale * (back - start),
        pecks=_pecks(of, start, reference, scale) if name == "CYCLE83" else (),
        chip_break=name == "CYCLE83" and of(11) != 1.0,
        dwell=dwell,
        feed_out=name in ("CYCLE84", "CYCLE85", "CYCLE89"),
        reverse=name == "CYCLE84",
        feed=_feed(name, of, scale),
    )
    return Hole(scale * start, made.checked("planes above the bottom of the hole"))


def _pecks(of: Argument, start: float, reference: float, scale: float) -> tuple[float, ...]:
    """The first peck goes to FDEP (or FDPR below the reference), the others are as deep."""
    if of(7) not in (0.0,) and not math.isnan(of(7)):
        raise StatementError(
            "CYCLE83 whose pecks get smaller (DAM)", "DAM 0", "post pecks of one depth, or hole by hole", code="P012"
        )
    first = reference - of(5) if not math.isnan(of(5)) else of(6)
    if math.isnan(first):
        raise StatementError("CYCLE83 without its first peck", "FDEP or FDPR", code="P012")
    return scale * (start - reference + first), scale * first


def _feed(name: str, of: Argument, scale: float) -> Feed | None:
    if name == "CYCLE85" and not math.isnan(of(6)):
        return Feed(scale * of(6), "minute")
    if name != "CYCLE84":
        return None
    pitch = of(8) if not math.isnan(of(8)) else PITCHES.get(int(of(7)) if not math.isnan(of(7)) else 0, math.nan)
    if math.isnan(pitch):
        raise StatementError("CYCLE84 without its pitch", "PIT, or MPIT of a metric thread", code="P012")
    # The sign is that of the thread: left-hand is negative. SST is a spindle speed of the cycle's own.
    if of(10) > 0.0:
        return Feed(scale * abs(pitch) * of(10), "minute")
    return Feed(scale * abs(pitch), "turn")
