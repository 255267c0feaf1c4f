"""Words of G-code that are certain to change nothing about where the tool goes and how fast, each with the reason.

By the programming manuals of Fanuc (30i), Haas, Siemens (SINUMERIK 840D sl) and LinuxCNC. A word is used, stands here,
or its block is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

TIP = "the path is that of the tool's tip"
COMPENSATION = "how a compensated contour is met; compensation itself is refused"
SMOOTH = "the control may leave the path by its tolerance; the path is the programmed one"
LIMIT = "a limit that the control watches"
DYNAMICS = "how the machine's axes accelerate"
OFF = "switches off what is refused where it is switched on"
AHEAD = "how far the control reads ahead"
SCREEN = "for the operator's screen"
ORDER = "data of the control; offsets are the caller's"


def shown(code: int) -> str:
    """Code in tenths as it is written: G43.4."""
    return f"G{code // 10}" + (f".{code % 10}" if code % 10 else "")


# Codes in tenths: G64 is 640.
CODES: Mapping[int, str] = {
    80: AHEAD,
    90: "an exact stop",
    110: OFF,
    131: OFF,
    150: OFF,
    400: OFF,
    500: OFF,
    501: OFF,
    670: OFF,
    220: LIMIT,
    230: LIMIT,
    250: LIMIT,
    260: LIMIT,
    430: TIP,
    440: TIP,
    490: TIP,
    491: TIP,
    601: "an exact stop",
    602: "an exact stop",
    610: "an exact stop",
    611: "an exact stop",
    620: "feed at corners",
    6010: "an exact stop",
    6020: "an exact stop",
    6030: "an exact stop",
    600: "an exact stop",
    281: ORDER,
    301: ORDER,
    640: SMOOTH,
    641: SMOOTH,
    6410: SMOOTH,
    6420: SMOOTH,
    6430: SMOOTH,
    6440: SMOOTH,
    6450: SMOOTH,
    1870: SMOOTH,
    4500: COMPENSATION,
    4510: COMPENSATION,
    4600: COMPENSATION,
    4610: COMPENSATION,
    4620: COMPENSATION,
    50: AHEAD,
    51: SMOOTH,
    960: "a way to state the spindle's speed",
    970: "a way to state the spindle's speed",
}
# Their coordinates are those of limits, or name axes.
LIMITS = frozenset((220, 230, 250, 260, 501))
# Letters that belong to a code or, below, to an M function, and that nothing else reads.
WITH_CODE: Mapping[int, str] = {
    80: "P",
    50: "PQR",
    51: "PQR",
    250: "SPQR",
    260: "SPQR",
    430: "HD",
    440: "HD",
    434: "HDP",
    640: "PQ",
    1870: "PE",
    610: "P",
    920: "S",
    960: "SDR",
    970: "S",
    100: "LPXYZABCUVWRIJKQHDF",
}
FUNCTIONS: Mapping[int, str] = {
    10: "clamps a rotary axis",
    11: "frees a rotary axis",
    29: "says that the tap to come is rigid",
    31: "chips are carried off",
    33: "chips are carried off",
    36: "a parts catcher",
    37: "a parts catcher",
    **dict.fromkeys((40, 41, 42, 43, 44, 45), "the spindle's gear"),
    48: "the operator's overrides act",
    49: "the operator's overrides do not act",
    52: "the operator's override",
    **dict.fromkeys((62, 63, 64, 65), "an output of the machine"),
    66: "waits for an input",
    **dict.fromkeys((67, 68), "an output of the machine"),
    **dict.fromkeys((83, 84, 85), "air"),
}
WITH_FUNCTION: Mapping[int, str] = {
    19: "RPQ",
    29: "S",
    48: "P",
    49: "P",
    52: "P",
    62: "P",
    63: "P",
    64: "P",
    65: "P",
    66: "PELQ",
    67: "EQ",
    68: "EQ",
}
# Words of Siemens without a number.
WORDS: Mapping[str, str] = {
    **dict.fromkeys(("CFIN", "CFTCP", "CFC"), COMPENSATION),
    **dict.fromkeys(
        (
            "KONT",
            "NORM",
            "KONTC",
            "KONTT",
            "CUT2D",
            "CUT2DF",
            "CUT3DC",
            "CUT3DF",
            "CUT3DFF",
            "CUT3DFS",
            "CDON",
            "CDOF",
            "CDOF2",
            "TOFFOF",
        ),
        COMPENSATION,
    ),
    **dict.fromkeys(
        (
            "SOFT",
            "BRISK",
            "DRIVE",
            "SOFTA",
            "BRISKA",
            "DRIVEA",
            "FFWON",
            "FFWOF",
            "DYNNORM",
            "DYNPOS",
            "DYNROUGH",
            "DYNSEMIFIN",
            "DYNFINISH",
            "DYNPREC",
            "JERKLIM",
            "RTLION",
            "RTLIOF",
        ),
        DYNAMICS,
    ),
    **dict.fromkeys(("COMPON", "COMPOF", "COMPCAD", "COMPCURV", "COMPSURF", "CPRECON", "CPRECOF"), SMOOTH),
    **dict.fromkeys(
        ("ORIWKS", "ORIMKS", "ORIVECT", "ORIPLANE", "ORIAXES", "ORISON", "ORISOF", "OSOF"),
        "how the tool turns between two directions, which stay as programmed",
    ),
    **dict.fromkeys(("WALIMON", "WALIMOF"), LIMIT),
    **dict.fromkeys(("STOPRE", "STARTFIFO", "STOPFIFO", "FIFOCTRL"), AHEAD),
    **dict.fromkeys(("MSG", "WORKPIECE", "GROUP_BEGIN", "GROUP_END", "GROUP_ADDEND"), SCREEN),
    "FNORM": "the feed is that of each block",
    "CYCLE832": SMOOTH,
    "SUPA": "a place of the machine: a retract",
    "LFOF": OFF,
    "TOFRAMEOF": OFF,
    "TOROTOF": OFF,
    "PAROTOF": OFF,
}
# Named values of Siemens that change nothing either.
VALUES: Mapping[str, str] = dict.fromkeys(("ADIS", "ADISPOS", "CTOL", "OTOL", "ATOL"), SMOOTH)
ALL: Mapping[str, str] = {
    **{shown(code): why for code, why in CODES.items()},
    **{f"M{number}": why for number, why in FUNCTIONS.items()},
    **WORDS,
}
