"""Words of APT files that are certain to change nothing about the path, each with the reason.

By ISO 4343 and the manuals of the vendors. What is in no table here, and is not read, is refused.
"""

from __future__ import annotations

# Major words, whatever stands behind them.
WORDS: dict[str, str] = {
    "AIR": "blows air",
    "ARCSLP": "whether the control is given arcs or lines",
    "AUTOPS": "the part surface lies in the plane of the drawing",
    "CHECK": "limits that the postprocessor checks",
    "CLAMP": "clamps axes",
    "CSI_SET_EXTENSION_LENGTH": "length of the tool out of its holder",
    "CSI_SET_FLUTE_LENGTH": "length of the flutes",
    "DISPLAY": "a picture",
    "END_OP": "a label of the CAM system",
    "END": "the end of the program",
    "END-OF-PATH": "the end of an operation",
    "FINI": "the end of the file",
    "GOUGCK": "collision check of the CAM system",
    "HEAD": "which head of the machine holds the tool",
    "INTOL": "tolerance by which the CAM system has made points",
    "LEADER": "blank tape",
    "LINTOL": "tolerance by which the postprocessor makes points of turning axes",
    "MACHIN": "which postprocessor",
    "MATERL": "material",
    "MAXDPM": "largest speed of rotary axes of the machine",
    "MCHTOL": "speed at corners, by the control",
    "MODE": "milling, absolute coordinates; others are refused",
    "MFGNO": "a label of the CAM system",
    "MULTAX": "points have six numbers, which is seen from them",
    "NOTE": "a text",
    "OP_NAME": "a label of the CAM system",
    "OPSKIP": "no blocks to be skipped; those that may be are refused",
    "OUTTOL": "tolerance by which the CAM system has made points",
    "PARTNO": "name of the part",
    "PIVOTZ": "length from the pivot of the machine's head to the tool",
    "PPRINT": "a text",
    "PSIS": "the part surface that the CAM system has followed",
    "REMARK": "a text",
    "REWIND": "rewinds the tape",
    "SELCTL": "which tool to fetch next",
    "SELECT": "which tool to fetch next",
    "SEQNO": "numbers of blocks",
    "SETUP": "a label of the CAM system",
    "START_OP": "a label of the CAM system",
    "TCP": "points are those of the tip, as always here",
    "TDATA": "data of the tool",
    "TITLE": "a text",
    "TMARK": "a mark at which the program may be begun again",
    "TOLER": "tolerance by which the CAM system has made points",
    "TOOLPATH_TYPE": "a label of the CAM system",
    "TPRINT": "name of the tool",
    "UNLOAD": "puts the tool away",
}
# Display words, and data of splines, which are refused.
DROPPED = ("PAINT", "DISPLY", "LABEL", "CNTRL", "KNOT")
# Minor words with which a major word changes nothing; with others it is refused. None: no word at all.
MINOR: dict[str, frozenset[str]] = {
    "MODE": frozenset(("MILL", "ABSOL")),
    "OPSKIP": frozenset(("OFF",)),
    "RAPID": frozenset(),
    "CUTCOM": frozenset(("OFF", "ON", "LEFT", "RIGHT", "XYPLAN", "YZPLAN", "ZXPLAN", "XZPLAN", "LENGTH", "ADJUST")),
    "TRNTYP": frozenset(("WORLD",)),
    # ADJUST, OFFSET, OSETNO: registers of the tool's length, which the control takes off.
    "LOADTL": frozenset(
        (
            "ADJUST",
            "OFFSET",
            "OSETNO",
            "LENGTH",
            "SPINDL",
            "MILL",
            "DRILL",
            "LARGE",
            "SMALL",
            "HIGH",
            "LOW",
            "AUTO",
            "MANUAL",
            "IN",
            "CLW",
            "CCLW",
            "RPM",
        )
    ),
    "SPINDL": frozenset(
        (
            "RPM",
            "CLW",
            "CCLW",
            "CCW",
            "ON",
            "OFF",
            "STOP",
            "ORIENT",
            "LOCK",
            "SFM",
            "SMM",
            "MPM",
            "CSS",
            "LOW",
            "MEDIUM",
            "HIGH",
            "RANGE",
            "MAXRPM",
            "RADIUS",
        )
    ),
}
# Codes that PREFUN (G) and AUXFUN (M) put into the program, and INSERT with them.
CODES: dict[str, str] = {
    "G8": "speed at corners, by the control",
    "G9": "exact stop",
    "G17": "plane of arcs, which are read from the points",
    "G40": "no compensation",
    "G49": "no length in force",
    "G61": "exact stop",
    "G64": "speed at corners, by the control",
    "G80": "no cycle",
    "G90": "coordinates are absolute, as here",
    "G94": "feed in each minute, as here",
    "M7": "coolant",
    "M8": "coolant",
    "M9": "coolant",
    "M10": "clamps an axis",
    "M11": "releases an axis",
    "M50": "coolant",
    "M51": "coolant",
}
# Words of a cycle that change nothing of its moves.
OF_CYCLE: dict[str, str] = {
    "AUTO": "the tool is changed by the machine",
    "DRAG": "no turn of the spindle before the way out",
    "ON": "the cycle is on",
    "SEC": "a rest is in s, as here",
    "NOREVR": "the spindle keeps its sense",
    "MULTRD": "a thread of several starts",
    "FLOATING": "the tap floats in its holder",
}
