"""Random G-code programs read by the project and by a plain interpreter, move by move.

    python benchmarks/toolpaths/gcode_random.py [--count N] [--first SEED] [--dialect NAME] [--keep FOLDER]

Each program (:mod:`gcode_random`) is read by :func:`machining.toolpaths.read_toolpath` and by :mod:`plain_gcode`,
which share no code. A program is right where every move agrees (ends to 0.2 um, arcs to 5 um, rapid or feed, feeds),
refused where the reader refuses it, and else wrong. A refusal is allowed; none may be wrong. ``--keep`` writes the
programs that are wrong into a folder.
"""

from __future__ import annotations

import random
import re
import tempfile
from collections import Counter
from pathlib import Path

from gcode_writer import Fanuc, LinuxCnc
from gcode_writer_siemens import Siemens
from moves_compared import disagreement
from plain_gcode import DIALECTS, moves

from benchmarks.asked import asked
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.reading import read_toolpath
from robots import InputError

SUFFIX = {"fanuc": ".nc", "linuxcnc": ".ngc", "siemens": ".mpf"}


def program(seed: int, dialect: str | None = None) -> tuple[str, str]:
    """A program's text and its dialect."""
    while True:
        chance = random.Random(seed)  # noqa: S311 - the programs of a seed are the same each time
        kind = dialect or chance.choice(DIALECTS)
        writer = {"fanuc": Fanuc, "linuxcnc": LinuxCnc, "siemens": Siemens}[kind](chance, kind)
        try:
            text = writer.written()
            if moves(text, kind):
                return text, kind
        except ValueError:
            pass
        # A construct did not fit to where the tool was.
        seed += 1_000_000_007


# Dropped: read although the plain interpreter refuses it.
RIGHT, REFUSED, WRONG, DROPPED = "right", "refused", "wrong", "dropped"


def judged(text: str, dialect: str, folder: Path) -> tuple[str, str]:
    """What comes of a program, and why."""
    file = folder / f"program{SUFFIX[dialect]}"
    file.write_text(text, encoding="ascii")
    try:
        m = read_toolpath(file, kind="gcode", options=ReadOptions())
        known = moves(text, dialect)
    except InputError as error:
        line = next((x for x in str(error).splitlines() if ", line " in x), str(error))
        return REFUSED, _short(line)
    except ValueError as error:
        return DROPPED, str(error)
    wrong = disagreement(1e3 * m.points, m.rapid, 60e3 * m.feed, known)
    return (WRONG, wrong) if wrong else (RIGHT, "")


def _short(line: str) -> str:
    """A refusal without its place and its numbers."""
    return re.sub(r"[-+]?\d*\.?\d+", "#", re.sub(r"^.*?, line \d+: ", "", line).partition(": got")[0])[:80]


def run(seeds: range, dialect: str | None = None, keep: Path | None = None) -> tuple[Counter[tuple[str, str]], Counter]:
    """Outcomes by dialect, and reasons of refusals and of what is wrong."""
    outcomes, why = Counter(), Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            text, kind = program(seed, dialect)
            outcome, reason = judged(text, kind, Path(folder))
            outcomes[kind, outcome] += 1
            if outcome == REFUSED:
                why[f"{kind}, refused: {reason}"] += 1
            if outcome == WRONG:
                why[f"{kind}, wrong, seed {seed}: {reason}"] += 1
                if keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{seed}{SUFFIX[kind]}").write_text(f"; {reason}\n{text}", encoding="ascii")
    return outcomes, why


def main() -> int:
    """Run and print a table."""
    a = asked(__doc__, count=100000, first=0, dialect=DIALECTS, keep=Path)
    outcomes, why = run(range(a.first, a.first + a.count), a.dialect, a.keep)
    print("| dialect | programs | right | refused | wrong |\n|---|---|---|---|---|")
    for kind in DIALECTS:
        n = [outcomes[kind, x] for x in (RIGHT, REFUSED, WRONG)]
        print(f"| {kind} | {sum(n)} | {n[0]} | {n[1]} | {n[2]} |")
    for reason, count in why.most_common(60):
        print(count, reason)
    return int(any(outcomes[kind, WRONG] for kind in DIALECTS))


if __name__ == "__main__":
    raise SystemExit(main())
