"""Words of Heidenhain's language in the middle of a contour, as :mod:`gcode_traps`."""

from __future__ import annotations

from gcode_traps import EITHER, LAST, READ, REFUSED, RETRACT, SQUARE, START, Trap


def program(text: str) -> str:
    """A program that has come down at (0, 0, 0), with numbers before its blocks."""
    lines = [
        "BEGIN PGM PART MM",
        "TOOL CALL 1 Z S2000",
        "L X+0 Y+0 Z+5 R0 FMAX M3",
        "L Z+0 F600",
        *text.splitlines(),
        "M30",
        "END PGM PART MM",
    ]
    return "".join(f"{n} {line}\n" for n, line in enumerate(lines))


def trap(name: str, text: str, right: str, path: str = SQUARE) -> Trap:
    """A trap of this language."""
    return Trap(name, "h", program(text), right, path if right in (READ, EITHER) else "")


def blocks(right: str, *texts: str) -> list[Trap]:
    """Traps of blocks of their own behind the first side."""
    return [trap(f"block {x}", f"L X+20\n{x}\nL Y+20\nL X+0\nL Z+5 FMAX", right) for x in texts]


def words(right: str, *texts: str) -> list[Trap]:
    """Traps of words in the block of the first side."""
    return [trap(f"word {x}", f"L X+20 {x}\nL Y+20\nL X+0\nL Z+5 FMAX", right) for x in texts]


def machine(text: str) -> Trap:
    """A place of the machine, then X and Y across, then down."""
    return trap(f"machine {text}", f"L X+20\n{text}\nL X+50 Y+50 FMAX\nL Z+5 FMAX\nL Z+0 F600", RETRACT, "")


DATUM = "CYCL DEF 247 SETTING DATUM ~\n  Q339={} ;DATUM NUMBER"
TRAPS: list[Trap] = [
    *words(REFUSED, "I5", "R5", "PR+5", "RL", "RR", "IX", "X+30", "A+10", "M136", "Q1", "M120 LA5 ZZ"),
    *words(READ, "M8", "; X50", "R0"),
    *words(EITHER, "M128", "M97", "M120 LA5"),
    *blocks(
        REFUSED,
        "M136",
        "CALL LBL 9",
        "CALL PGM TNC:\\A.H",
        "FN 9: IF +1 EQU +1 GOTO LBL 3",
        "TCH PROBE 400",
        "CYCL DEF 26.0 AXIS-SPEC. SCALING\nCYCL DEF 26.1 X 2 CCX+0",
        "CYCL DEF 11.0 SCALING\nCYCL DEF 11.1 SCL 2",
        "CYCL DEF 8.0 MIRROR IMAGE\nCYCL DEF 8.1 X",
        "CYCL DEF 27.0 CYLINDER SURFACE\nCYCL DEF 27.1 LBL 9",
        "CYCL DEF 14.0 CONTOUR",
        "FUNCTION TCPM F TCP ZZ",
        "SPL X+20 Y+5",
        "FPOL X+0 Y+0\nFL PR+5",
        "APPR LT X+20 Y+5 LEN5 R0",
        "APPR LN X+20 Y+5 LEN5 R0",
        "APPR CT X+20 Y+5 CCA90 R+5 R0",
        "APPR LCT X+20 Y+5 R5 R0",
        "DEP LT LEN5",
        "DEP LN LEN+5",
        "DEP CT CCA90 R+5",
        "DEP LCT X+20 Y+5 R5",
        "BLUB",
        "L XY5",
        "L X+20 X+30",
    ),
    *blocks(
        EITHER,
        "CYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T0.05",
        "M126",
        "M107",
        "STOP",
        "CYCL DEF 9.0 DWELL\nCYCL DEF 9.1 V.ZEIT 1",
        "* - A HEADING",
        "TOOL DEF 3",
        "M90",
        "BLK FORM 0.1 Z X+0 Y+0 Z-9",
    ),
    trap(
        "RND",
        "L X+20\nRND R5\nL Y+20\nL X+0\nL Z+5 FMAX",
        READ,
        f"{START} L15,0,0 A20,5,0@15,5,+ L20,20,0 L0,20,0 R0,20,5",
    ),
    trap(
        "RND F",
        "L X+20\nRND R5 F200\nL Y+20\nL X+0\nL Z+5 FMAX",
        EITHER,
        f"{START} L15,0,0 A20,5,0@15,5,+f200 L20,20,0 L0,20,0 R0,20,5",
    ),
    trap(
        "M103 slows plunging",
        "L X+20 M103 F20\nL Z-5\nL Y+20\nL Z+5 FMAX",
        EITHER,
        f"{START} L20,0,0 L20,0,-5f120 L20,20,-5 R20,20,5",
    ),
    trap("CHF", "L X+20\nCHF 4\nL Y+20\nL X+0\nL Z+5 FMAX", READ, f"{START} L16,0,0 L20,4,0 L20,20,0 L0,20,0 R0,20,5"),
    trap("IY", "L X+20\nL IY+20\nL IX-20\nL Z+5 FMAX", READ, SQUARE),
    trap("LP", "L X+20\nCC X+0 Y+0\nLP PR+20 PA+90\nL Z+5 FMAX", READ, f"{START} L20,0,0 L0,20,0 R0,20,5"),
    trap("a preset", f"L X+20\n{DATUM.format('+1')}\nL Y+20\nL X+0\nL Z+5 FMAX", EITHER),
    trap("two presets", f"{DATUM.format('+1')}\nL X+20\n{DATUM.format('+2')}\nL Y+20\nL X+0\nL Z+5 FMAX", REFUSED, ""),
    trap(
        "a label",
        "L X+20\nLBL 1\nL IY+10\nLBL 0\nCALL LBL 1 REP1\nL X+0\nL Z+5 FMAX",
        EITHER,
        f"{START} L20,0,0 L20,10,0 {LAST}",
    ),
    trap(
        "datum shift",
        "L X+20\nCYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+10\nL Y+20\nL X+0\nL Z+5 FMAX",
        READ,
        f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5",
    ),
    trap(
        "rotation",
        "L X+20\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+90\nL X+20 Y+20\nL X+0\nL Z+5 FMAX",
        EITHER,
        f"{START} L20,0,0 L-20,20,0 L-20,0,0 R-20,0,5",
    ),
    machine("L Z-1 FMAX M91"),
    machine("L Z-1 R0 FMAX M92"),
    machine("M140 MB MAX"),
    machine("L M140 MB MAX"),
    trap(
        "M140 MB 50",
        "L X+20\nL M140 MB 50\nL X+50 Y+50 FMAX\nL Z+5 FMAX",
        EITHER,
        f"{START} L20,0,0 R20,0,50 R50,50,50 R50,50,5",
    ),
]
