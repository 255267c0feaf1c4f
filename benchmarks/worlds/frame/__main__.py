"""``python -m benchmarks.worlds.frame make OUT --seed N`` and ``... fill SET SHEET OUT --visit K``."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import fill, make


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.frame", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("make", help="write measurement sets")
    one.add_argument("out", type=Path)
    one.add_argument("--seed", type=int, required=True)
    for kind in ("single", "none", "outside", "pairs"):
        one.add_argument(f"--{kind}", type=int, default=0)
    two = commands.add_parser("fill", help="fill in a sheet of further set-ups")
    two.add_argument("set_folder", type=Path)
    two.add_argument("sheet", type=Path)
    two.add_argument("out", type=Path)
    two.add_argument("--visit", type=int, required=True)
    given = parser.parse_args()
    if given.command == "make":
        make(given.out, given.seed, given.single, given.none, given.outside, given.pairs)
    else:
        filled = fill(given.set_folder, given.sheet.read_text(encoding="utf-8"), given.visit)
        given.out.write_text(filled, encoding="utf-8")


if __name__ == "__main__":
    main()
