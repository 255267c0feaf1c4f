"""Drill cycles 200 to 209 and 240 of Heidenhain's controls, by their Q parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from machining.toolpaths.cycles import PECK_GAP, Cycle
from machining.toolpaths.gcode.siemens_cycles import Hole
from machining.toolpaths.gcode.values import Values
from machining.toolpaths.heidenhain.harmless import CYCLE_QUIET, CYCLE_ZERO
from machining.toolpaths.heidenhain.words import number
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError

_DEPTHS = (200, 201, 203, 204)
# Parameters that each cycle uses, beside those of harmless.py.
DRILLS: dict[int, tuple[int, ...]] = {
    200: (*_DEPTHS, 202, 206, 211),
    201: (*_DEPTHS, 206, 208, 211),
    202: (*_DEPTHS, 206, 208, 211, 214),
    203: (*_DEPTHS, 202, 206, 208, 211, 213, 256),
    205: (*_DEPTHS, 202, 206, 208, 211, 256, 258, 259),
    206: (*_DEPTHS, 206, 211),
    207: (*_DEPTHS, 239),
    209: (*_DEPTHS, 239, 256, 403),
    240: (*_DEPTHS, 206, 211),
}
_PECKING, _TAPPING, _LEAVE_AT_FEED = (200, 203, 205), (206, 207, 209), (201, 202, 203, 205)
# Feed of Q208 from which a control leaves with FMAX (TNC 640, cycles 201 to 205).
FMAX = 99_999.0
PARAMETER = re.compile(r"\s*Q(\d{3,4})\s*=\s*([-+]?\s*(?:Q[LR]?\d+|[\d.,]+)|MAX|AUTO|FMAX|FAUTO|PREDEF)(?=\s|$)")


def parameters(text: str, values: Values, auto: float) -> dict[int, float]:
    """Parameters of a cycle behind its name, by number; NaN for those that the control has from elsewhere.

    ``auto``: the feed of the tool's call, which FAUTO means.

    Raises
    ------
    StatementError
        Text that is no parameter, a parameter twice.
    """
    match = re.search(r"\bQ\d+\s*=", text)
    rest, end = text[match.start() if match else len(text) :], 0
    out: dict[int, float] = {}
    while (found := PARAMETER.match(rest, end)) is not None:
        name, value, end = int(found[1]), found[2], found.end()
        if name in out:
            raise StatementError(f"Q{name} twice", "each parameter once", code="P012")
        word = {"FMAX": math.inf, "FAUTO": auto, "AUTO": auto}.get(value, math.nan)
        out[name] = word if value.isalpha() else number(value, values)
    if rest[end:].strip():
        raise StatementError(f"{rest[end:].strip()[:30]!r} is no parameter of a cycle", "Q200=+2", code="P012")
    return out


def known(cycle: int, given: Mapping[int, float]) -> None:
    """Refuse parameters that ``cycle`` has not, or that ask for what is not read.

    Raises
    ------
    StatementError
        The first of them.
    """
    for name, value in given.items():
        if name in CYCLE_ZERO and value != 0.0:
            raise StatementError(
                f"cycle {cycle} with {CYCLE_ZERO[name]} (Q{name})", f"Q{name} = 0", "post hole by hole", code="P012"
            )
        if name not in DRILLS[cycle] and name not in CYCLE_ZERO and name not in CYCLE_QUIET:
            allowed = ", ".join(f"Q{k}" for k in DRILLS[cycle])
            raise StatementError(f"Q{name} of cycle {cycle} is not read", allowed, "post hole by hole", code="P012")


def hole(cycle: int, q: Mapping[int, float], scale: float) -> Hole:
    """What ``cycle`` drills at the tool's place; ``q``: values of Q parameters by number, ``scale`` m of their unit.

    Raises
    ------
    StatementError
        Parameters missing, or motions that are not read: pecks that get smaller, a lift sideways, a centre by diameter.
    """

    def of(number: int, default: float | None = None) -> float:
        if number in q and not math.isnan(q[number]):
            return q[number]
        if default is None:
            raise StatementError(
                f"cycle {cycle} without Q{number}", "all parameters of the cycle, each with a number", code="P012"
            )
        return default

    known(cycle, {k: v for k, v in q.items() if k in CYCLE_ZERO})
    if cycle == 202 and of(214, 0.0) != 0.0:
        raise StatementError("cycle 202 with a lift sideways (Q214)", "Q214 = 0", "post hole by hole", code="P012")
    if cycle == 209 and of(403, 1.0) not in (0.0, 1.0):
        raise StatementError(
            "cycle 209 that leaves faster than it came (Q403)", "Q403 = 1", "post hole by hole", code="P012"
        )
    breaks = int(of(213, 0.0)) if cycle == 203 else 0
    gap, surface, depth = of(200), of(203, 0.0), of(201)
    if depth > 0.0:
        raise StatementError(f"cycle {cycle} whose depth Q201 is above the surface", "Q201 of 0 or less", code="P012")
    peck = of(202) if cycle in _PECKING else 0.0
    pecks = (scale * (gap + peck), scale * peck) if 0.0 < peck < -depth else ()
    if cycle == 205 and pecks and of(258, 0.0) != of(259, of(258, 0.0)):
        raise StatementError(
            "cycle 205 whose advanced stop changes (Q258, Q259)", "Q259 = Q258", "post hole by hole", code="P012"
        )
    # The sign of a pitch is the hand of the thread.
    feed = Feed(scale * abs(of(239)), "turn") if cycle in (207, 209) else Feed(scale * of(206), "minute")
    # Where Q208 is none or 0, these leave as they came.
    leaving = of(208, 0.0 if 208 not in q else None) if cycle in _LEAVE_AT_FEED else 0.0
    made = Cycle(
        start=0.0,
        depth=scale * (gap - depth),
        back=scale * (max(of(204, gap), gap) - gap),
        pecks=pecks,
        dwell=0.0 if cycle in (207, 209) else of(211, 0.0),
        feed_out=cycle in _TAPPING or (leaving < FMAX and (cycle in (201, 202) or (208 in q and cycle in (203, 205)))),
        reverse=cycle in _TAPPING,
        feed=feed,
        chip_break=breaks > 0,
        breaks=breaks,
        leaving=Feed(scale * leaving, "minute") if 0.0 < leaving < FMAX else None,
        lift=scale * of(256) if 256 in q else PECK_GAP,
        # Cycles 200 and 203 come back to the set-up clearance above the last bottom, 205 to its advanced stop.
        gap=scale * (of(258, 0.0) if cycle == 205 else gap) if pecks else PECK_GAP,
    )
    return Hole(scale * (surface + gap), made.checked("numbers that make a hole"))


def pecked(q: Mapping[int, float], height: float, scale: float) -> Hole:
    """Cycle 1, whose parameters count from the tool's ``height`` m: 1 clearance, 2 depth, 3 peck, 4 rest, 5 feed.

    Raises
    ------
    StatementError
        Parameters missing, or without sense.
    """
    if not {1, 2, 3, 5} <= q.keys() or q[2] > 0.0 or q[1] < 0.0:
        raise StatementError(
            "cycle 1 without its clearance, depth, peck or feed", "CYCL DEF 1.1 to 1.5, a depth below 0", code="P012"
        )
    gap, depth, peck = (scale * q[k] for k in (1, 2, 3))
    pecks = (gap + abs(peck), abs(peck)) if 0.0 < abs(peck) < -depth else ()
    # The advanced stop is the control's: 0.6 mm, for holes deeper than 30 mm a fiftieth of the depth, at most 7 mm.
    stop = 0.6e-3 if -depth <= 30e-3 else min(-depth / 50.0, 7e-3)
    made = Cycle(
        start=0.0, depth=gap - depth, pecks=pecks, dwell=q.get(4, 0.0), feed=Feed(scale * q[5], "minute"), gap=stop
    )
    return Hole(height, made.checked("numbers that make a hole"))
