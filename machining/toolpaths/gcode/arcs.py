"""Centres of G2 and G3 arcs, and drill cycles of G73 and G81 to G89."""

from __future__ import annotations

import math

from machining.toolpaths.arcs import CLOSED
from machining.toolpaths.cycles import Cycle
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

# Indices of the plane's first and second axis and its normal, right-handed: G17 XY, G18 ZX, G19 YZ.
PLANES = {170: (0, 1, 2), 180: (2, 0, 1), 190: (1, 2, 0)}
# Those that rest at the bottom.
RESTS = (730, 820, 830, 840, 860, 890)
CYCLES = {730: "chip", 810: "drill", 820: "drill", 830: "peck", 840: "tap", 850: "bore", 860: "drill", 890: "bore"}


def center(
    block: Block, start: Array, end: Array, plane: int, clockwise: bool, *, scale: float, absolute: bool, slack: float
) -> Array:
    """Centre (3,) m from I, J, K of the plane (from the start, or ``absolute``), or from R.

    R more than 0: at most half a turn; less than 0: more than half a turn (RS-274/NGC). A chord longer than 2 R by
    ``slack`` at most is taken as a diameter.

    Raises
    ------
    StatementError
        Neither I, J, K nor R, or both; R with a full turn; a chord longer than 2 R; an absolute centre cut short.
    """
    first, second, _ = PLANES[plane]
    letters = "IJK"[first], "IJK"[second]
    given = [letter for letter in letters if letter in block.words]
    if "R" in block.words:
        if given:
            raise StatementError("an arc with R and with I, J, K", "one of both", code="P011")
        return _by_radius(block.words["R"] * scale, start, end, plane, clockwise, slack)
    if not given:
        raise StatementError("an arc without centre or radius", f"{letters[0]}, {letters[1]} or R", code="P011")
    out = start.copy()
    # Letters that say themselves which way they are: I=AC(5).
    ways = [block.own.get(letter, absolute) for letter in letters]
    if any(way and letter not in block.words for way, letter in zip(ways, letters, strict=True)):
        raise StatementError("an absolute centre with one coordinate", f"{letters[0]} and {letters[1]}", code="P011")
    for index, letter, way in zip((first, second), letters, ways, strict=True):
        value = block.words.get(letter, 0.0) * scale
        out[index] = value if way else out[index] + value
    return out


def _by_radius(radius: float, start: Array, end: Array, plane: int, clockwise: bool, slack: float) -> Array:
    first, second, _ = PLANES[plane]
    du, dv = float(end[first] - start[first]), float(end[second] - start[second])
    chord = math.hypot(du, dv)
    if chord < CLOSED:
        raise StatementError("a full turn with R", "I, J, K", "post arcs with centres", code="P011")
    if chord / 2.0 - abs(radius) > slack:
        raise StatementError(
            f"arc of radius {abs(radius) * 1e3:.6g} mm between points {chord * 1e3:.6g} mm apart",
            f"a radius of at least {chord * 5e2:.6g} mm",
            code="P011",
        )
    height = math.sqrt(max(radius * radius - chord * chord / 4.0, 0.0))
    # The centre lies left of the way for a counter-clockwise arc of less than half a turn.
    side = height * (-1.0 if clockwise else 1.0) * (-1.0 if radius < 0.0 else 1.0) / chord
    out = start.copy()
    out[first] += du / 2.0 - dv * side
    out[second] += dv / 2.0 + du * side
    return out


def drill_cycle(code: int, start: float, bottom: float, back: float, peck: float, dwell: float) -> Cycle:
    """Cycle about the point of its retract plane R: ``bottom`` and ``back`` m along the normal, as ``start``.

    Raises
    ------
    StatementError
        Pecks missing, or numbers without sense.
    """
    kind = CYCLES[code]
    if kind in ("chip", "peck") and not peck > 0.0:
        raise StatementError("a peck cycle without its peck", "Q more than 0", code="P012")
    made = Cycle(
        start=0.0,
        depth=start - bottom,
        back=back - start,
        pecks=(peck,) if kind in ("chip", "peck") else (),
        chip_break=kind == "chip",
        dwell=dwell if code in RESTS else 0.0,
        feed_out=kind in ("tap", "bore"),
        reverse=kind == "tap",
    )
    return made.checked("Z below R, numbers that make a hole")
