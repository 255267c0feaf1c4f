"""Make sets, or fill in a sheet, from the command line."""

from __future__ import annotations

import argparse
from pathlib import Path

from .sets import fill, make


def main() -> None:
    """Read the command line and do it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.screws", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write measurement sets with their hidden truth")
    making.add_argument("out", type=Path)
    making.add_argument("--seed", type=int, default=0)
    for sort, count in (("single", 100), ("none", 50), ("outside", 50), ("pairs", 33)):
        making.add_argument(f"--{sort}", type=int, default=count, help=f"sets of this sort [default: {count}]")
    filling = commands.add_parser("fill", help="fill in a sheet of further set-ups")
    filling.add_argument("set_folder", type=Path)
    filling.add_argument("sheet", type=Path)
    filling.add_argument("out", type=Path)
    filling.add_argument("--visit", type=int, default=1)
    given = parser.parse_args()
    if given.command == "make":
        made = make(given.out, given.seed, given.single, given.none, given.outside, given.pairs)
        print(f"{len(made)} sets in {given.out}")
    else:
        text = fill(given.set_folder, given.sheet.read_text(encoding="utf-8"), given.visit)
        given.out.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
