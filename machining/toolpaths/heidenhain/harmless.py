"""What of a conversational program is certain to change nothing about the path, each with the reason.

By the user's manuals of TNC 426 to TNC 640. What is in no table here, and is not read, is refused.
"""

from __future__ import annotations

MOVES = frozenset(("X", "Y", "Z", "IX", "IY", "IZ"))
ROTARY = frozenset(("A", "B", "C", "IA", "IB", "IC"))
_ENDS = {"R0", "RL", "RR", "FMAX", "FAUTO"}
_ARC = {"R0", "RL", "RR", "FAUTO", "DR+", "DR-"}
_NORMAL, _TOOL = {"NX", "NY", "NZ"}, {"TX", "TY", "TZ"}
# Words that a statement of motion uses; any other one has no meaning there. FMAX of an arc is a rapid arc.
WORDS: dict[str, frozenset[str]] = {
    "L": frozenset(MOVES | ROTARY | {"F"} | _ENDS),
    "LP": frozenset(MOVES | ROTARY | {"PR", "PA", "IPR", "IPA", "F"} | _ENDS),
    "LN": frozenset(MOVES | ROTARY | _NORMAL | _TOOL | {"F"} | _ENDS),
    "C": frozenset(MOVES | {"F"} | _ARC),
    "CP": frozenset(MOVES | {"PA", "IPA", "F"} | _ARC),
    "CR": frozenset(MOVES | {"R", "F"} | _ARC),
    "CT": frozenset(MOVES | {"F"} | _ARC - {"DR+", "DR-"}),
    "CTP": frozenset(MOVES | {"PR", "PA", "IPR", "IPA", "F"} | _ARC - {"DR+", "DR-"}),
    "CC": MOVES,
}
# Words that say the same thing twice, in different ways.
EITHER = (
    *(("XYZABC"[k], "I" + "XYZABC"[k]) for k in range(6)),
    ("PA", "IPA"),
    ("PR", "IPR"),
    ("F", "FMAX"),
    ("F", "FAUTO"),
    ("FMAX", "FAUTO"),
    ("R0", "RL"),
    ("R0", "RR"),
    ("RL", "RR"),
    ("DR+", "DR-"),
)
# Words behind an M function that are its own.
OF_MISC: dict[int, tuple[str, ...]] = {
    103: ("F",),
    112: ("T", "A"),
    118: (*"XYZABC",),
    120: ("LA",),
    124: ("T",),
    128: ("F",),
    138: (*"ABC",),
}
USED_MISC = frozenset((0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 13, 14, 19, 30, 89, 91, 92, 99, 128, 129, 140))
_MISC: dict[int, str] = {
    10: "clamps an axis (ISO 6983)",
    11: "releases an axis (ISO 6983)",
    90: "keeps the speed at corners of uncompensated lines, within what the drives can",
    94: "shows rotary axes below 360 deg",
    97: "small steps of compensated contours; those are refused",
    98: "open corners of compensated contours; those are refused",
    101: "fetches a sister tool when the first one is worn",
    102: "ends M101",
    107: "suppresses a message about the sister tool",
    108: "ends M107",
    111: "ends M109 and M110, which are refused",
    113: "ends M112, which is refused",
    115: "ends M114, which is refused",
    116: "feed of rotary axes that move alone; with the tool point held F is that of the tip",
    117: "ends M116",
    118: "adds what the operator turns by hand",
    120: "looks ahead in compensated contours; refused",
    126: "rotary axes take the shorter way, as here",
    127: "ends M126",
    134: "exact stop of rotary axes",
    135: "ends M134",
    137: "feed in each minute, as here",
    141: "lets the probe retract by hand",
    145: "ends M144, which is refused",
    148: "lifts off when the power fails",
    149: "ends M148",
    150: "suppresses a message about limit switches",
}
# M functions that change path or feed, and are never left out.
CHANGES: dict[int, str] = {
    103: "another feed into the part",
    105: "factors of the control",
    106: "factors of the control",
    109: "feed of the edge in arcs",
    110: "feed of the edge in arcs",
    112: "corners rounded within a tolerance",
    114: "rotary axes of the machine",
    124: "points left out",
    130: "coordinates of the plane that is not tilted",
    136: "feed in each turn of the spindle",
    138: "rotary axes that do not count",
    142: "modes taken back",
    143: "a rotation taken back",
    144: "rotary axes of the machine",
    197: "corners rounded",
}
_CYCLES: dict[int, str] = {
    13: "turns the spindle to an angle",
    32: "tolerance of the control's own smoothing",
    332: "tuning of the machine for weight, speed or surface",
    358: "tuning of the machine",
    392: "tuning of the machine for the weight of the part (ATC)",
}
ALL: dict[str, str] = {
    **{f"M{number}": why for number, why in _MISC.items()},
    **{f"cycle {number}": why for number, why in _CYCLES.items()},
}
# Patterns of whole statements.
STATEMENTS: dict[str, str] = {
    r"BLK FORM\b.*": "the blank, for the control's picture",
    r"TOOL DEF\b.*|TOOL DEF\d.*": "the tool to be fetched next, or data of the tool table",
    r"\*.*": "a heading",
    r"FN\s*1[56]\s*:.*": "prints a text",
    r"FN\s*38\s*:.*": "sends a message",
    r"FUNCTION MODE MILL": "milling, as here",
    r"LBL\s*(?:\"[^\"]+\"|\d+)": "a label; calls of it are read",
}
# Parameters of drill cycles that change nothing here, and those that are read for 0 alone: what they would ask for.
CYCLE_QUIET: dict[int, str] = {
    205: "smallest peck where pecks get smaller; that is refused",
    210: "rest above the hole: time alone",
    253: "feed to a deepened start; that is refused",
    336: "angle of the spindle for a lift sideways; that is refused",
    344: "diameter for a depth by it; that is refused",
}
CYCLE_ZERO: dict[int, str] = {
    212: "pecks that get smaller",
    257: "chips broken",
    343: "a depth by its diameter",
    379: "a deepened start",
    395: "a depth of the tool's cylindrical part",
    435: "chips broken",
}
