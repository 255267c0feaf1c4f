"""``python -m benchmarks.worlds.shopfloor make OUT --seed N``, or ``fill SETFOLDER SHEET.csv OUT.csv --visit K``."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.worlds.shopfloor import fill, make


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.shopfloor", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="Write measurement sets with hidden effects into a folder.")
    making.add_argument("out", type=Path)
    making.add_argument("--seed", type=int, required=True)
    for name, count in (("single", 100), ("none", 50), ("outside", 50), ("pairs", 33)):
        making.add_argument(f"--{name}", type=int, default=count)
    filling = commands.add_parser("fill", help="Fill in a sheet of further set-ups of a set.")
    filling.add_argument("set_folder", type=Path)
    filling.add_argument("sheet", type=Path)
    filling.add_argument("out", type=Path)
    filling.add_argument("--visit", type=int, default=1)
    return parser


def main() -> None:
    """Run one of the two commands."""
    given = _parser().parse_args()
    if given.command == "make":
        make(given.out, given.seed, given.single, given.none, given.outside, given.pairs)
        return
    text = fill(given.set_folder, given.sheet.read_text(encoding="utf-8"), given.visit)
    given.out.write_text(text, encoding="utf-8", newline="")


if __name__ == "__main__":
    main()
