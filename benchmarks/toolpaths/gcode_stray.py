"""Words that no control takes, or that mean something else than nothing, put into random programs.

    python benchmarks/toolpaths/gcode_stray.py [--count N] [--first SEED] [--dialect NAME]

One word goes into a block with coordinates of each program (:mod:`gcode_random`). Where the plain interpreter refuses
the program, so must the reader; where it takes it, they agree or the reader refuses. A program that is read although
the word has no meaning in it counts as dropped.
"""

from __future__ import annotations

import random
import re
import tempfile
from collections import Counter
from pathlib import Path

from gcode_random import DROPPED, RIGHT, WRONG, judged, program
from plain_gcode import DIALECTS

from benchmarks.asked import asked

COMMON = (
    "R2",
    "I5",
    "J3",
    "K4",
    "P3",
    "Q2",
    "E0.5",
    "U5",
    "V2",
    "W3",
    "A10",
    "B5",
    "X1E2",
    "Y--3",
    "XY5",
    "G999",
    "M777",
    "M136",
    "G1.5",
    "M3.5",
    "ZZ5",
    "X5 X6",
    "$",
    "#",
    "&5",
    "G0 G1",
    "G90 G91",
    "G17 G18",
    "Y",
    "Z-",
    "X5..5",
    "FOO",
    "F0",
    "X+",
    "G",
    "M",
    "G2 G3",
    "X5Y",
    "!",
    "1.5",
    "-3",
    "~",
)
ISO = (
    "C7",
    "H5 R2",
    "X=5",
    "RND=2",
    "FOO(1)",
    ",R",
    ",X5",
    ",R2 ,C2",
    "G7.1",
    "G54 P2",
    "G55",
    "#<a",
    "D5.5 Q1",
)
SIEMENS = (
    "FOOBAR",
    "FOOBAR(1,2)",
    "FOO=5",
    "FOO[1]=5",
    "RND",
    "RND=",
    "X=DC(5)",
    "X=AC(",
    "ALF=30",
    ",R2",
    "TURN",
    "OFFN=1",
    "CR",
    "ANG",
    "RP",
    "X=IC()",
    "G505",
    "MYSUB",
    "L7",
    "POS[X]=5",
    "DISR=2",
    "TRAANG",
    "TOROT",
    'FOO("A")',
    "SPOF",
)


def strayed(text: str, dialect: str, chance: random.Random) -> tuple[str, str] | None:
    """A program with one word more, and that word; None where no block has coordinates."""
    lines = text.split("\n")
    moving = re.compile(r"^[^(;]*[XYZ][-+=.\d][^(;]*$", re.I)
    able = [k for k, line in enumerate(lines) if moving.match(line)]
    if not able:
        return None
    k, word = chance.choice(able), chance.choice(COMMON + (SIEMENS if dialect == "siemens" else ISO))
    lines[k] += f" {word}"
    return "\n".join(lines), word


def run(seeds: range, dialect: str | None = None) -> tuple[Counter[str], Counter[str]]:
    """Outcomes, and words that were dropped or read wrong."""
    outcomes: Counter[str] = Counter()
    words: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            text, kind = program(seed, dialect)
            made = strayed(text, kind, random.Random(seed))  # noqa: S311
            if made is None:
                continue
            # A program that is refused or wrong without the word says nothing about it.
            if judged(text, kind, Path(folder))[0] != RIGHT:
                outcomes["not judged"] += 1
                continue
            outcome, _ = judged(made[0], kind, Path(folder))
            outcomes[outcome] += 1
            if outcome in (WRONG, DROPPED):
                words[f"{kind}, {outcome}: {made[1]}"] += 1
    return outcomes, words


def main() -> int:
    """Run and print what was dropped."""
    a = asked(__doc__, count=10000, first=0, dialect=DIALECTS)
    outcomes, words = run(range(a.first, a.first + a.count), a.dialect)
    print(dict(outcomes))
    for word, count in words.most_common():
        print(count, word)
    return int(bool(words))


if __name__ == "__main__":
    raise SystemExit(main())
