"""``python -m benchmarks.worlds.equilibrium make OUT --seed N`` and ``... fill SET SHEET OUT --visit K``."""

from __future__ import annotations

import argparse
from pathlib import Path

from .sets import fill, make


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.equilibrium", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write measurement sets")
    making.add_argument("out", type=Path)
    making.add_argument("--seed", type=int, required=True)
    for name, count in (("single", 100), ("none", 50), ("outside", 50), ("pairs", 33)):
        making.add_argument(f"--{name}", type=int, default=count)
    filling = commands.add_parser("fill", help="fill in a sheet of further set-ups")
    filling.add_argument("set_folder", type=Path)
    filling.add_argument("sheet", type=Path)
    filling.add_argument("out", type=Path)
    filling.add_argument("--visit", type=int, required=True)
    given = parser.parse_args()
    if given.command == "make":
        folders = make(given.out, given.seed, given.single, given.none, given.outside, given.pairs)
        print(f"{len(folders)} sets in {given.out}")
    else:
        given.out.write_text(
            fill(given.set_folder, given.sheet.read_text(encoding="utf-8"), given.visit), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
