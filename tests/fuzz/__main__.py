"""``python -m tests.fuzz``: throw mutated files at every reader, check what must not change, kill long commands."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import time
from pathlib import Path

# Before numpy is loaded anywhere: two workers with two threads each would fight for two cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("STIFFARM_CACHE", "off")
os.environ.setdefault("MPLBACKEND", "Agg")

from . import workers

DAY_SEED = 20261122


def main(arguments: list[str] | None = None) -> int:
    """Exit 0 if nothing failed, 1 if anything did."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=100_000, help="inputs in all")
    parser.add_argument("--seconds", type=float, default=600.0, help="stop trying inputs after so long")
    parser.add_argument("--seed", type=int, default=DAY_SEED, help="the same seed draws the same inputs")
    parser.add_argument("--kills", type=int, default=100, help="commands killed at random moments")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", action="append", default=[], help="a reader's name; may be given several times")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), help="where failing inputs go")
    parser.add_argument("--no-metamorphic", action="store_true", help="leave out the changes that must not matter")
    parser.add_argument(
        "--replay", type=Path, nargs="+", help="try saved inputs, named READER/FILE, and say what they do"
    )
    a = parser.parse_args(arguments)
    if a.replay:
        return replay(a.replay)
    failed = attack(a)
    if not a.only and not a.no_metamorphic:
        failed += metamorphic()
    if not a.only:
        failed += kills(a.kills, a.seed, a.out)
    return 1 if failed else 0


def attack(a: argparse.Namespace) -> int:
    """Mutated files through the readers; the number of kinds of failures."""
    begun = time.monotonic()

    def said(tally: workers.Tally, spent: float) -> None:
        done = tally.passed + tally.failed
        print(f"fuzz: {done} of {a.count} inputs, {spent:.0f} s, {tally.failed} failed", file=sys.stderr, flush=True)

    tally = workers.run(a.seed, a.count, a.seconds, a.processes, tuple(a.only), said)
    for finding in tally.findings.values():
        save(finding, a.out)
    if "FUZZ_TIMES" in os.environ:
        for name in sorted(tally.by_reader, key=lambda n: -tally.seconds[n]):
            n, t = tally.by_reader[name], tally.seconds[name]
            print(f"  {name:32} {n:7} inputs {t:7.1f} s {1e3 * t / n:7.2f} ms each")
    done = tally.passed + tally.failed
    if done < a.count:
        print(f"fuzz: time is up after {done} of {a.count} inputs")
    print(f"fuzz: {tally.passed} passed, {tally.failed} failed in {time.monotonic() - begun:.0f} s, seed {a.seed}")
    return len(tally.findings)


def save(finding: workers.Finding, out: Path) -> None:
    """Keep a failing input, and say how to see it again."""
    folder = out / folder_of(finding.reader)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{finding.signature}{finding.suffix}"
    path.write_bytes(finding.data)
    print(f"FAILED {finding.words}\n  again: {sys.executable} -m tests.fuzz --replay {path}")


def folder_of(reader: str) -> str:
    """The folder of a reader's saved inputs and cases."""
    return reader.replace(": ", "-").replace(" ", "_")


def replay(paths: list[Path]) -> int:
    """Try saved inputs, each in the folder of its reader."""
    import tempfile

    from .registry import readers
    from .samples import Sample
    from .trial import attempt

    table = {folder_of(name): name for name in readers()}
    failed = 0
    for path in paths:
        name = table[path.parent.name]
        with tempfile.TemporaryDirectory() as folder:
            suffix = path.name[path.name.index(".") :] if "." in path.name else ""
            fault = attempt(name, readers()[name].run, Sample(suffix, path.read_bytes()), Path(folder))
        print(f"{path}: {fault or 'right answer, or refused cleanly'}")
        failed += fault is not None
    return 1 if failed else 0


def metamorphic() -> int:
    """Changes that must not matter; the number of those that did."""
    from .metamorphic import CHECKS, failures

    found = failures()
    for words in found:
        print(f"FAILED {words}")
    print(f"metamorphic: {len(CHECKS) - len(found)} passed, {len(found)} failed")
    return len(found)


def kills(count: int, seed: int, out: Path) -> int:
    """Commands killed at random moments; the number of folders that were not old, new or healed."""
    if not count or importlib.util.find_spec(f"{__package__}.kills") is None:
        return 0
    from . import kills as killing

    found: list[str] = killing.run(count, seed, out)
    for words in found:
        print(f"FAILED {words}")
    print(f"kills: {count - len(found)} passed, {len(found)} failed")
    return len(found)


if __name__ == "__main__":
    sys.exit(main())
