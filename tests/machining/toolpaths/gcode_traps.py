"""Words in the middle of a contour that a reader must not pass over, with the path that each controller makes of them.

The contour is a square of 20 mm: down, (20, 0), here the word, (20, 20), (0, 20), up. A path is written as R x,y,z for
a rapid move, L x,y,z for one at feed, A x,y,z@u,v,+ for an arc about (u, v) in XY, against the clock for +; ``f`` and a
number behind it where the feed is not 600 mm/min, f? where it does not matter, f! where it is not known. Worked out by
hand from the controllers' programming manuals.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from moves_compared import UNKNOWN, Move

# What is right: reading it so; that or refusing it; refusing it alone; a retract before anything across.
READ, EITHER, REFUSED, RETRACT = "read", "either", "refused", "retract"
HEAD = {
    "nc": "G21 G90 G17 G94 G54\n",
    "ngc": "G21 G90 G17 G94 G54\n",
    "mpf": "G71 G90 G17 G94 G54\n",
}
START = "R0,0,5 L0,0,0"
SQUARE = f"{START} L20,0,0 L20,20,0 L0,20,0 R0,20,5"
LAST = "L20,20,0 L0,20,0 R0,20,5"


@dataclass(frozen=True)
class Trap:
    """A program, the ending of its file, what is right of it, and its path."""

    name: str
    ending: str
    program: str
    right: str
    path: str = ""

    @property
    def moves(self) -> list[Move]:
        """The path as moves."""
        return [_move(word) for word in self.path.split()]


def _move(word: str) -> Move:
    found = re.fullmatch(r"([RLA])([^@f]+)(?:@([^f]+))?(?:f(.+))?", word)
    assert found is not None, word
    x, y, z = (float(v) for v in found[2].split(","))
    feed = 600.0 if found[4] is None else {"?": math.nan, "!": UNKNOWN}.get(found[4]) or float(found[4])
    if found[1] != "A":
        return Move((x, y, z), found[1] == "R", feed)
    u, v, sense = found[3].split(",")
    return Move((x, y, z), False, feed, (float(u), float(v), 0.0), 2, 1 if sense == "+" else -1)


def body(text: str, ending: str = "nc") -> str:
    """A program that has come down at (0, 0, 0)."""
    return f"{HEAD[ending]}G0 X0 Y0 Z5\nG1 Z0 F600\n{text}\nM30\n"


def block(line: str, ending: str = "nc") -> str:
    """The square with blocks of their own behind its first side."""
    return body(f"G1 X20\n{line}\nG1 Y20\nX0\nG0 Z5", ending)


def word(text: str, ending: str = "nc") -> str:
    """The square with a word in the block of its first side."""
    return body(f"G1 X20 {text}\nY20\nX0\nG0 Z5", ending)


def second(text: str, ending: str = "nc") -> str:
    """The square with another block for its second side."""
    return body(f"G1 X20\n{text}\nX0\nG0 Z5", ending)


def trap(name: str, program: str, right: str = REFUSED, path: str = "", ending: str = "nc") -> Trap:
    """A trap; words that are read or refused leave the square as it is unless a path is given."""
    return Trap(name, ending, program, right, path or (SQUARE if right in (READ, EITHER) else ""))


def words(right: str, *texts: str, ending: str = "nc") -> list[Trap]:
    """Traps of one word each in the block of the first side."""
    return [trap(f"word {text}", word(text, ending), right, ending=ending) for text in texts]


def blocks(right: str, *texts: str, ending: str = "nc") -> list[Trap]:
    """Traps of one block each behind the first side."""
    return [trap(f"block {text}", block(text, ending), right, ending=ending) for text in texts]


def machine(line: str, ending: str = "nc") -> Trap:
    """A place of the machine, then X and Y across, then down to Z5."""
    text = body(f"G1 X20\n{line}\nG90 G0 X50 Y50\nG0 Z5\nG1 Z0", ending)
    return Trap(f"machine {line}", ending, text, RETRACT)


CORNERS = [
    trap("corner ,R5", word(",R5"), EITHER, f"{START} L15,0,0 A20,5,0@15,5,+ L20,20,0 L0,20,0 R0,20,5"),
    trap("corner ,C2", word(",C2"), EITHER, f"{START} L18,0,0 L20,2,0 L20,20,0 L0,20,0 R0,20,5"),
    trap(
        "corner ,R5 twice",
        body("G1 X20 ,R5\nY20 ,R4\nX0\nG0 Z5"),
        EITHER,
        f"{START} L15,0,0 A20,5,0@15,5,+ L20,16,0 A16,20,0@16,16,+ L0,20,0 R0,20,5",
    ),
    trap("corner ,R25 has no room", word(",R25"), REFUSED),
    trap("corner ,R5 at the end", body("G1 X20\nY20\nX0 ,R5\nG0 Z5"), REFUSED),
    trap(
        "corner ,C2 G91",
        body("G91 G1 X20 ,C2\nY20\nX-20\nG90 G0 Z5"),
        EITHER,
        f"{START} L18,0,0 L20,2,0 L20,20,0 L0,20,0 R0,20,5",
    ),
]

FEEDS = [
    trap(
        "G95 with the spindle on",
        body("S1000 M3\nG95 G1 X20 F0.1\nY20\nX0\nG94 F600\nG0 Z5"),
        READ,
        f"{START} L20,0,0f100 L20,20,0f100 L0,20,0f100 R0,20,5",
    ),
    trap(
        "G95 with the spindle off",
        body("G95 G1 X20 F0.1\nY20\nX0\nG0 Z5"),
        EITHER,
        f"{START} L20,0,0f! L20,20,0f! L0,20,0f! R0,20,5",
    ),
    trap(
        "G93",
        body("G93 G1 X20 F30\nY20 F15\nG94 X0 F600\nG0 Z5"),
        READ,
        f"{START} L20,0,0f600 L20,20,0f300 L0,20,0 R0,20,5",
    ),
    trap("G93 without F", body("G93 G1 X20 F30\nY20\nG94 X0 F600\nG0 Z5"), REFUSED),
    trap(
        "G94 behind G95 without F",
        body("S1000 M3\nG95 G1 X20 F0.1\nG94 Y20\nX0\nG0 Z5"),
        EITHER,
        f"{START} L20,0,0f100 L20,20,0f! L0,20,0f! R0,20,5",
    ),
    trap(
        "feed of inches",
        body("G1 X20\nG20 G1 Y1 F10\nG21 X0 F600\nG0 Z5"),
        READ,
        f"{START} L20,0,0 L20,25.4,0f254 L0,25.4,0 R0,25.4,5",
    ),
    trap("F0", word("F0"), REFUSED),
    trap("F-100", word("F-100"), REFUSED),
    trap("M136", block("M136"), REFUSED),
    trap("F twice", word("F300 F200"), REFUSED),
]

ORIGINS = [
    trap("G92", block("G92 X10"), READ, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap("G92.1", second("G92 X10\nG1 Y20\nG92.1"), EITHER, SQUARE, "ngc"),
    trap("G92.2", second("G92 X10\nG1 Y20\nG92.2"), EITHER, SQUARE, "ngc"),
    trap(
        "G92.3", second("G92 X10\nG92.2\nG1 Y20\nG92.3"), EITHER, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5", "ngc"
    ),
    trap("G92.3 without G92", block("G92.3"), EITHER, SQUARE, "ngc"),
    trap("G52", block("G52 X10"), READ, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap("G52 replaced", block("G52 X10\nG52 X5 Y1"), EITHER, f"{START} L20,0,0 L20,21,0 L5,21,0 R5,21,5"),
    # Without a word for it the first offset is in force.
    trap("G55 behind motion", block("G55").replace(" G54", ""), REFUSED),
    trap("G54 behind motion", block("G54").replace(" G54", "", 1), EITHER),
    # G68 turns what comes: (x 20, y 20) about the origin by 90 deg is (-20, 20), with x from the turned frame.
    trap(
        "G68",
        body("G1 X20\nG68 X0 Y0 R90\nG1 X20 Y20\nX0\nG69\nG0 Z5"),
        EITHER,
        f"{START} L20,0,0 L-20,20,0 L-20,0,0 R-20,0,5",
    ),
    trap("G68 twice", body("G1 X20\nG68 X0 Y0 R90\nG1 X20 Y20\nG68 X0 Y0 R90\nG1 X0 Y10\nG69\nG0 Z5"), REFUSED),
    trap(
        "G68 in G91",
        body("G1 X20\nG68 X0 Y0 R90\nG91 G1 X20\nG90 G69\nG0 Z5"),
        EITHER,
        f"{START} L20,0,0 L20,20,0 R20,20,5",
    ),
    *blocks(
        REFUSED,
        "G55",
        "G54.1 P3",
        "G54 P3",
        "G54.2 P1",
        "G54.4 P1",
        "G154 P5",
        "G110",
        "G10 L2 P1 X10",
        "G10 L20 P1 X10",
        "G51 X0 Y0 P2",
        "G51.1 X0",
        "M21",
        "G101 X0",
        "G68.3",
        "#5221=10",
        "#5211=10",
        "G16",
    ),
    *blocks(EITHER, "G50", "G50.1 X0", "G69", "G15", "G54"),
]

STRAY = [
    *words(
        REFUSED,
        "R2",
        "I5 J3",
        "K5",
        "P3",
        "Q2",
        "C2",
        "E0.5",
        "U5",
        "V5",
        "W5",
        "A10",
        "B10",
        "L2",
        "XY5",
        "X30",
        "Y",
        "J--5",
        "Y5.5.5",
        "Y1E2",
        "H1.5 R0",
        "Z-",
        "Y#1",
        "/2 Y5",
        "Y5 $",
    ),
    trap("G1 XY5", second("G1 XY5"), REFUSED),
    trap("G0 G1", second("G0 G1 Y20"), REFUSED),
    trap("G2 G1", second("G2 G1 Y20 R10"), REFUSED),
    trap("G90 G91", second("G90 G91 G1 Y20"), REFUSED),
    trap("G17 G18", second("G17 G18 G1 Y20"), REFUSED),
    trap("G20 G21", second("G20 G21 G1 Y20"), REFUSED),
    trap("G1 X1E2", second("G1 X1E2"), REFUSED),
    trap("G1 X2 0", body("G1 X2 0\nY20\nX0\nG0 Z5"), EITHER, SQUARE),
    trap("G28.5", block("G28.5"), REFUSED),
    trap("R and I J of one arc", second("G3 Y20 R10 I0 J10"), REFUSED),
    trap("an arc without centre", second("G3 Y20"), REFUSED),
    trap("an arc with K in XY", second("G3 Y20 J10 K3"), REFUSED),
    trap("an arc with Q", second("G3 Y20 J10 Q3"), REFUSED),
    trap("R of a full circle", second("G3 X20 Y0 R10"), REFUSED),
    # The start is 0.1 + 0.2 mm, the end 0.3: a full circle, as LinuxCNC has it within 1e-6 rad.
    trap(
        "a circle behind sums",
        body("G91 G1 X0.1\nX0.2\nG90 G3 X0.3 Y0 I5 J0\nG1 X0 Y20\nG0 Z5"),
        READ,
        f"{START} L0.1,0,0 L0.3,0,0 A0.3,0,0@5.3,0,+ L0,20,0 R0,20,5",
    ),
    # The end is written in inches to six decimals, 1e-5 mm beside the start: rounding, no arc of 10 nm.
    trap(
        "a circle behind a change of units",
        body("G1 X20 Y10\nG20 F20\nG2 X0.787402 Y0.393701 I0.19685039 J0\nG21 G1 X0 Y20 F600\nG0 Z5"),
        READ,
        f"{START} L20,10,0 A20,10,0@25,10,-f508 L0,20,0 R0,20,5",
    ),
    trap(
        "a circle the other way",
        body("G91 G1 X0.1\nX0.2\nG90 G2 X0.3 Y0 I5 J0\nG1 X0 Y20\nG0 Z5"),
        READ,
        f"{START} L0.1,0,0 L0.3,0,0 A0.3,0,0@5.3,0,- L0,20,0 R0,20,5",
    ),
    trap("D1", word("D1"), EITHER),
    trap("H2", word("H2"), EITHER),
    *words(REFUSED, "G41 D1", "G42 D1", "G41.1 D1", "G45 D1"),
    trap("G43 H1 with Z", body("G1 X20\nG43 H1 Z0\nG1 Y20\nX0\nG0 Z5"), EITHER, SQUARE),
    trap("behind the second %", f"%\nO1\n{block('M8')}%\nG1 X50\n", EITHER),
    trap("0x1A at the end", block("M8") + "\x1a", READ),
    trap("0x1A in the middle", block("\x1a"), REFUSED),
    trap("M2 in the middle", block("M2"), EITHER, f"{START} L20,0,0"),
    trap("no space", body("G01X20.Y0.F600\nN30Y20.\nX0.\nG00Z5."), READ, SQUARE),
    trap("small letters", block("m8").lower(), READ),
    trap("a comment in brackets", block("(X50 Y50)"), READ),
    trap("a comment in a block", word("(G91 X50)"), READ),
    trap("a comment behind ;", word("; ,R5"), READ),
    trap("brackets in brackets", block("( X50 ( Y50 ) Z3 )"), EITHER),
]

CALLS = [
    *blocks(
        REFUSED,
        "M98 P100",
        "M97 P10",
        "G65 P9000",
        "G65 P9000 X50",
        "G66 P9000",
        "M198 P100",
        "O<cut> call",
        "IF [#1 GT 0] GOTO 10",
        "IF [1 EQ 1] THEN #1=5",
        "WHILE [#1 LT 3] DO1",
        "GOTO 10",
        "M428",
        "M100",
        "G100",
        "#3000=1",
        "M98",
    ),
    trap(
        "M98 in the file",
        "O1\n" + block("M98 P100") + "O100\nG91 G1 Y10\nG90\nM99\n",
        READ,
        f"{START} L20,0,0 L20,10,0 {LAST}",
    ),
    trap(
        "M98P100", "O1\n" + block("M98P100") + "O100\nG91 G1 Y10\nG90\nM99\n", READ, f"{START} L20,0,0 L20,10,0 {LAST}"
    ),
    trap(
        "M98 with L",
        "O1\n" + block("M98 P100 L2") + "O100\nG91 G1 Y5\nG90\nM99\n",
        READ,
        f"{START} L20,0,0 L20,5,0 L20,10,0 {LAST}",
    ),
    trap(
        "M98 P30100",
        "O1\n" + block("M98 P30100") + "O100\nG91 G1 Y5\nG90\nM99\n",
        EITHER,
        f"{START} L20,0,0 L20,5,0 L20,10,0 L20,15,0 {LAST}",
    ),
    trap("M99 P", "O1\n" + block("M98 P100") + "O100\nG91 G1 Y10\nG90\nM99 P10\n", REFUSED),
    trap("M70 to M72", second("M70\nG91 G1 Y20\nM72"), EITHER, SQUARE, "ngc"),
    trap("M73", second("M73\nG91\nG90 G1 Y20"), EITHER, SQUARE, "ngc"),
]

MODES = [
    *blocks(
        REFUSED,
        "G112",
        "G12.1",
        "G112 X5 C5",
        "G150 X0 Y0 Z-5 P100 I1",
        "G107",
        "G107 C20",
        "G7.1 C20",
        "G31 Y10",
        "G38.2 Y10",
        "G33 Z-5 K1",
        "G76 Z-5 R2 Q1",
        "G76 P1 Z-5 I-1 J1 K1",
        "G12 I5 D1",
        "G13 I5 D1",
        "G47 P0",
        "G70 I5 J0 L6",
        "G72 I5 L6",
        "G5 I1 J1 P1 Q1 X5 Y5",
        "G5.2 X1 Y1",
        "G6.2 K0 X1 Y1",
        "G17.1",
        "G60 X30",
        "G27 X30",
        "G29 X30",
        "G37 Z-5",
        "G87 Z-5 R2",
        "G88 Z-5 R2",
        "G254",
        "G43.5 I0 J0 K1 X30",
        "G80 X30",
        "G81 X10 Z-5 R2 K-1",
        "G136 X5",
        "G143 X5 A5",
        "G999",
        "M888",
        "G32 Z-5 F1",
    ),
    *blocks(
        READ,
        "G5.1 Q1",
        "G61",
        "G64",
        "G09",
        "G40",
        "G49",
        "M8",
        "M9",
        "G4 P1",
        "G4 X1.",
        "G97 S1000",
        "S3000 M3",
        "M1",
        "T2",
        "N5",
        "",
        "G98",
        "G80",
        "G18\nG17",
    ),
    *blocks(
        EITHER,
        "G64 P0.1",
        "G61 G64 P0.1",
        "G187 P1 E0.05",
        "G5 P10000",
        "G08 P1",
        "G62",
        "G63",
        "G61.1",
        "G103 P1",
        "M48",
        "M62 P1",
        "M66 P0 L3 Q2",
        "M67 E0 Q5",
        "G22 X50 Y50 Z0 I0 J0 K-50",
        "G92 S3000",
        "G8",
        "G68.2 X0 Y0",
        "G53.1 P1",
        "M29 S500",
        "M19",
        "M10",
        "G23",
        "G4 P1 (X9)",
    ),
    trap("G7", block("G7"), REFUSED, ending="ngc"),
    trap(
        "G7 X is a diameter",
        body("G1 X20\nG7\nG1 Y20\nX10\nG0 Z5", "ngc"),
        EITHER,
        f"{START} L20,0,0 L20,20,0 L5,20,0 R5,20,5",
        "ngc",
    ),
    trap(
        "G81",
        body("G0 Z5\nG99 G81 X10 Y10 Z-3 R2 F600\nX20\nG80\nG0 X0 Y0 Z5"),
        READ,
        f"{START} R0,0,5 R10,10,5 R10,10,2 L10,10,-3 R10,10,2 R20,10,2 L20,10,-3 R20,10,2 R0,0,5",
    ),
    machine("G53 G0 Z0"),
    machine("G28 Z5"),
    machine("G91 G28 Z0"),
    machine("G91 G30 Z0"),
    machine("G30 P2 Z5"),
    machine("G0 G53 Z0"),
]

# Words that hold together, or do not; some controls add what others replace.
TOGETHER = [
    trap("G92 then G52", block("G92 X10\nG52 X5")),
    trap("G52 then G92", block("G52 X5\nG92 X10")),
    trap("G68 then G52", block("G68 X0 Y0 R90\nG52 X10")),
    trap("G68 then G92", block("G68 X0 Y0 R90\nG92 X10")),
    trap("G91 G68", block("G91 G68 X0 Y0 R90\nG90")),
    trap("G52 then G68.2", block("G52 X5\nG68.2 X10 I0 J0 K0")),
    trap("G68.2 then G68", block("G68.2 X0 Y0 Z0 I90 J0 K0\nG68 X0 Y0 R90")),
    trap("G92 then G69", block("G92 X10\nG69"), READ, f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5"),
    trap(
        "G92 between G92.2 and G92.3",
        block("G92 X10\nG92.2\nG92 Y5\nG92.3"),
        READ,
        f"{START} L20,0,0 L20,15,0 L0,15,0 R0,15,5",
        "ngc",
    ),
    trap(
        "G52 then G68 and G69",
        block("G52 X10\nG68 X0 Y0 R90\nG69"),
        READ,
        f"{START} L20,0,0 L20,20,0 L10,20,0 R10,20,5",
    ),
    trap("two blocks in a line", body("G1 X20 N20 Y20\nX0\nG0 Z5")),
    trap("O within a block", word("O5")),
    trap("O before words", second("O5 G1 Y20")),
    trap("a title within", block("% X5")),
    trap("a title before", f"%TITLE X5\n{block('M8')}", READ),
    *[
        trap(f"{c} {w}", body(f"G0 Z5\nG99 {c} X10 Y10 Z-6 R2 {w} F100\nG80\nG0 X0 Y0 Z5"))
        for c, w in (("G81", "Q2"), ("G81", "P1"), ("G85", "P1"), ("G84", "Q2"), ("G82", "Q2"), ("G82", "I1"))
    ],
    trap(
        "G81 P0 Q0",
        body("G0 Z5\nG99 G81 X10 Y10 Z-3 R2 P0 Q0 F600\nG80\nG0 X0 Y0 Z5"),
        READ,
        f"{START} R0,0,5 R10,10,5 R10,10,2 L10,10,-3 R10,10,2 R0,0,5",
    ),
    *blocks(REFUSED, "G110 X5", "G10 L10 P1 R5", "G10 P1 R5", "G28.1 X5", "M98 P100.5"),
    *blocks(READ, "G28.1", "G60"),
    trap(",R then G18", body("G1 X20 ,R5\nG18 Y20\nX0\nG17 G0 Z5")),
]

TRAPS: list[Trap] = [*CORNERS, *FEEDS, *ORIGINS, *STRAY, *CALLS, *MODES, *TOGETHER]
