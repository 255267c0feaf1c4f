"""What the G and M codes of a milling program mean here: modes, codes kept, codes refused."""

from __future__ import annotations

from typing import Literal

from machining.toolpaths.gcode.arcs import CYCLES, PLANES

# Codes in tenths: G43.4 is 434. Those that set one mode, and to what.
SETS: dict[int, tuple[str, int | bool | None]] = {
    **{code: ("motion", code) for code in (0, 10, 20, 30, *CYCLES)},
    800: ("motion", None),
    **{code: ("plane", code) for code in PLANES},
    **{code: ("absolute", code == 900) for code in (900, 910)},
    **{code: ("arc_absolute", code == 901) for code in (901, 911)},
    **{code: ("back_to_initial", code == 980) for code in (980, 990)},
}
FeedMode = Literal["inverse", "minute", "turn"]
FEED_MODES: dict[int, FeedMode] = {930: "inverse", 940: "minute", 950: "turn"}
LENGTHS = {200: 25.4e-3, 210: 1e-3, 7000: 25.4e-3, 7100: 1e-3}
OFFSETS = {540: "G54", 550: "G55", 560: "G56", 570: "G57", 580: "G58", 590: "G59"} | {
    591: "G59.1",
    592: "G59.2",
    593: "G59.3",
}
TCP_ON = (434, 2340)
# Codes kept as events: path control, exact stop, limits, cancels, length offsets, parking.
QUIET = (
    80, 81, 90, 110, 131, 150, 220, 230, 250, 260, 270, 400, 500, 501, 600, 601, 602, 610, 611, 620, 630, 640, 641,
    642, 643, 644, 645, 670, 690, 921, 922, 923, 960, 970, 430, 431, 440, 490, 491, 1870,
)  # fmt: skip
# Codes of cutter compensation, and those that have a meaning of their own.
COMPENSATED = (410, 411, 420, 421)
OWN = (40, 50, 51, 100, 280, 300, 520, 530, 700, 710, 920, *COMPENSATED)
# Codes that move the tool, or move or turn its coordinates, in a way that is not read here.
REFUSED = {
    50: "a spline", 51: "a quadratic spline", 52: "a NURBS", 53: "a NURBS", 60: "a NURBS", 62: "a NURBS",
    70: "diameters for X", 120: "a circular pocket", 130: "a circular pocket", 121: "polar interpolation",
    160: "polar coordinates", 171: "a plane of U V W", 181: "a plane of U V W", 191: "a plane of U V W",
    290: "a return from home", 310: "probing", 320: "threading", 330: "threading", 331: "rigid tapping",
    382: "probing", 383: "probing", 384: "probing", 385: "probing", 435: "tool axes as vectors", 510: "scaling",
    511: "mirroring", 650: "a macro call", 660: "a macro call", 680: "turned coordinates", 682: "a tilted plane",
    720: "a cycle of lathes", 740: "left-hand tapping", 750: "a cycle of lathes", 760: "threading or fine boring",
    870: "back boring", 880: "boring with a stop by hand", 2540: "a tilted plane", 1070: "cylindrical interpolation",
    71: "cylindrical interpolation", 161: "polar coordinates",
}  # fmt: skip
# M codes: calls move the tool as another program says.
CALLS = (97, 98, 198)
ENDS = (2, 30, 99)
STOPS = {0: "STOP", 1: "OPSTOP", 2: "END", 30: "END", 60: "STOP", 99: "END"}
COOLANT = {7: "MIST", 8: "FLOOD", 9: "OFF", 88: "THRU", 89: "OFF"}
REMEDY_MACRO = "post the program without variables, loops and subprograms, or let the control's simulator write it out"


def shown(code: int) -> str:
    """Code as it is written: G43.4."""
    return f"G{code // 10}" + (f".{code % 10}" if code % 10 else "")


KNOWN = frozenset((*SETS, *OWN, *QUIET, *TCP_ON, *FEED_MODES, *LENGTHS, *OFFSETS))
