"""``python -m benchmarks.worlds.motors make OUT --seed N`` and ``... fill SET SHEET OUT --visit K``."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import fill, make

KINDS = ("single", "none", "outside", "pairs")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.motors", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write measurement sets")
    making.add_argument("out", type=Path)
    making.add_argument("--seed", type=int, required=True)
    for kind in KINDS:
        making.add_argument(f"--{kind}", type=int, default=0)
    filling = commands.add_parser("fill", help="fill in a sheet of further set-ups")
    for name in ("set_folder", "sheet", "out"):
        filling.add_argument(name, type=Path)
    filling.add_argument("--visit", type=int, required=True)
    a = parser.parse_args()
    if a.command == "make":
        make(a.out, a.seed, *(getattr(a, kind) for kind in KINDS))
    else:
        a.out.write_text(fill(a.set_folder, a.sheet.read_text(encoding="utf-8"), a.visit), encoding="utf-8")


if __name__ == "__main__":
    main()
