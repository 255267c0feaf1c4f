"""The command line of the surveyed world."""

from __future__ import annotations

import argparse
from pathlib import Path

from .sets import make


def main() -> None:
    """Write sets."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds.survey")
    parser.add_argument("command", choices=["make"])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--single", type=int, default=100)
    parser.add_argument("--none", type=int, default=60)
    a = parser.parse_args()
    make(a.out, a.seed, a.single, a.none)


if __name__ == "__main__":
    main()
