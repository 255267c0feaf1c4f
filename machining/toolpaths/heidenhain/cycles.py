"""Drill cycles 200 to 209 and 240 of Heidenhain's controls, by their Q parameters."""

from __future__ import annotations

from collections.abc import Mapping

from machining.toolpaths.cycles import Cycle
from machining.toolpaths.gcode.siemens_cycles import Hole
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError

DRILLS = (200, 201, 202, 203, 205, 206, 207, 209, 240)
_PECKING, _TAPPING, _LEAVE_AT_FEED = (200, 203, 205), (206, 207, 209), (201, 202)


def hole(cycle: int, q: Mapping[int, float], scale: float) -> Hole:
    """What ``cycle`` drills at the tool's place; ``q``: values of Q parameters by number, ``scale`` m of their unit.

    Raises
    ------
    StatementError
        Parameters missing, or motions that are not read: pecks that get smaller, a lift sideways, a centre by diameter.
    """

    def of(number: int, default: float | None = None) -> float:
        if number in q:
            return q[number]
        if default is None:
            raise StatementError(f"cycle {cycle} without Q{number}", "all parameters of the cycle, each with a number")
        return default

    for number, what in ((212, "pecks that get smaller"), (214, "a lift sideways"),
                         (343, "a depth by its diameter"), (379, "a deepened start"), (257, "chips broken"),
                         (435, "chips broken")):  # fmt: skip
        meant = number != 214 or cycle == 202
        if meant and of(number, 0.0) != 0.0:
            raise StatementError(f"cycle {cycle} with {what} (Q{number})", f"Q{number} = 0", "post hole by hole")
    breaks = int(of(213, 0.0)) if cycle == 203 else 0
    gap, surface, depth = of(200), of(203, 0.0), of(201)
    if depth > 0.0:
        raise StatementError(f"cycle {cycle} whose depth Q201 is above the surface", "Q201 of 0 or less")
    peck = of(202) if cycle in _PECKING else 0.0
    pecks = (scale * (gap + peck), scale * peck) if 0.0 < peck < -depth else ()
    # The sign of a pitch is the hand of the thread.
    feed = Feed(scale * abs(of(239)), "turn") if cycle in (207, 209) else Feed(scale * of(206), "minute")
    made = Cycle(
        start=0.0, depth=scale * (gap - depth), back=scale * (max(of(204, gap), gap) - gap), pecks=pecks,
        dwell=0.0 if cycle in (207, 209) else of(211, 0.0), feed_out=cycle in (*_TAPPING, *_LEAVE_AT_FEED),
        reverse=cycle in _TAPPING, feed=feed, chip_break=breaks > 0, breaks=breaks,
    )  # fmt: skip
    return Hole(scale * (surface + gap), made.checked("numbers that make a hole"))


def pecked(q: Mapping[int, float], height: float, scale: float) -> Hole:
    """Cycle 1, whose parameters count from the tool's ``height`` m: 1 clearance, 2 depth, 3 peck, 4 rest, 5 feed.

    Raises
    ------
    StatementError
        Parameters missing, or without sense.
    """
    if not {1, 2, 3, 5} <= q.keys() or q[2] > 0.0:
        raise StatementError(
            "cycle 1 without its clearance, depth, peck or feed", "CYCL DEF 1.1 to 1.5, a depth below 0"
        )
    gap, depth, peck = (scale * q[k] for k in (1, 2, 3))
    pecks = (gap + abs(peck), abs(peck)) if 0.0 < abs(peck) < -depth else ()
    made = Cycle(
        start=0.0, depth=gap - depth, pecks=pecks, dwell=q.get(4, 0.0), feed=Feed(scale * q[5], "minute")
    )  # fmt: skip
    return Hole(height, made.checked("numbers that make a hole"))
