"""``python -m tests.blind FOLDER``: write the sets of a study, for `benchmarks.diagnosis.study`."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from .sets import make, unseen
from .study import suite


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.blind", description=__doc__)
    parser.add_argument("folder", type=Path, help="every set gets a folder in it")
    for name, count in (("single", 300), ("none", 200), ("out", 100), ("pairs", 60)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reads", choices=("z", "xyz"), default="z")
    parser.add_argument("--load-axes", choices=("z", "xyz"), default="z")
    parser.add_argument("--poses", type=int, default=27)
    a = parser.parse_args(arguments)
    changes = {"reads": a.reads, "load_axes": a.load_axes, "poses": a.poses}
    seen: Counter[str] = Counter()
    for spec, seed in suite(a.single, a.none, a.out, a.pairs, a.seed, **changes):
        made = make(spec, seed)
        made.write(a.folder, unseen(spec, seed))
        seen[f"{spec.group}, {'detectable' if made.key['detectable'] else 'not detectable'}"] += 1
    for name, count in sorted(seen.items()):
        sys.stdout.write(f"{name}: {count}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
