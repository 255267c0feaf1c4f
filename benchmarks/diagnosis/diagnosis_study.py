"""How often is the missing effect named? Blind sets with a hidden effect, with none, with strangers, with two.

    python benchmarks/diagnosis/diagnosis_study.py [--single 300] [--none 200] [--outside 100] [--pairs 60] [--seed 0]
        [--reads z|xyz] [--ablations] [--workers 2] [--write docs/validation/diagnosis_study.md] [--json FILE]

The sets come from ``tests/blind`` and the package ``rehearsal``, which shares no code with what is tested and uses
other laws than the catalogue.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from diagnosis_cases import ABLATIONS, DETECTABLE, Row, SetSpec, family, run_set, suite

Job = tuple[SetSpec, int, str]
CONFIDENT = 0.95


def one(job: Job) -> Row:
    spec, seed, ablation = job
    return run_set(spec, seed, ABLATIONS[ablation])


def share(values: Iterable[bool]) -> str:
    some = list(values)
    return f"{100.0 * sum(some) / len(some):.1f} % of {len(some)}" if some else "none"


def lines(rows: Sequence[Row], reads: str) -> list[tuple[str, str, str]]:
    """Aim, its target, and what was measured."""
    single = [r for r in rows if r.group == "single"]
    seen, unseen = [r for r in single if r.excess >= DETECTABLE], [r for r in single if r.excess < DETECTABLE]
    none, strange = [r for r in rows if r.group == "none"], [r for r in rows if r.group == "outside"]
    pairs = [r for r in rows if r.group == "pair"]

    def first(r: Row) -> str:
        return r.found[0] if r.found else r.verdict

    def right(r: Row, of: Callable[[str], str]) -> bool:
        return of(first(r)) == of(r.effects[0])

    def same(code: str) -> str:
        return code

    out = [
        ("right family, detectable", "98 %" if reads == "xyz" else "95 %", share(right(r, family) for r in seen)),
        ("exact code, detectable", "85 %", share(right(r, same) for r in seen)),
        ("truth inside set95, detectable", "95 %", share(r.effects[0] in r.set95 for r in seen)),
        ("verdict named, detectable", "", share(r.verdict == "named" for r in seen)),
        (
            "confident wrong family (p > 0.95), all single sets", "at most 3 %",
            share(r.sure > 0 and r.probability > CONFIDENT and not right(r, family) for r in single),
        ),
        (
            "more effects named than there are", "",
            share(r.sure > 1 for r in single),
        ),
        (
            "undetectable: none or ambiguous", "95 %",
            share(r.verdict in ("none", "ambiguous") for r in unseen),
        ),
        (
            "undetectable: the same, or rightly named", "",
            share(r.verdict in ("none", "ambiguous") or (r.verdict == "named" and right(r, family)) for r in unseen),
        ),
        (
            "undetectable: true code in not_testable or set95", "95 %",
            share(r.effects[0] in (*r.not_testable, *r.set95) or right(r, same) for r in unseen),
        ),
        ("false alarms, no effect", "at most 3 %", share(r.verdict != "none" for r in none)),
        ("false alarms, no effect, 1.5 % set-up scatter", "at most 3 %",
         share(r.verdict != "none" for r in none if r.setup >= 0.015)),
        ("out of catalogue: unknown", "95 %", share(r.verdict == "unknown" for r in strange)),
        (
            "the same, where no single effect can imitate it (excess left 30 or more)", "",
            share(r.verdict == "unknown" for r in strange if r.imitation >= DETECTABLE),
        ),
        (
            "out of catalogue: one effect named for sure", "",
            share(r.verdict == "named" for r in strange),
        ),
        ("pairs: at least one right (family)", "98 %",
         share(bool({*map(family, r.found)} & {*map(family, r.effects)}) for r in pairs)),
        ("pairs: both right (family)", "80 %",
         share({*map(family, r.found)} >= {*map(family, r.effects)} for r in pairs)),
    ]  # fmt: skip
    judged = [r for r in seen if np.isfinite(r.before) and r.before > 0.0]
    if judged:
        ratio = np.array([r.after / r.before for r in judged])
        out += [
            ("error on unread poses, after / before, median", "0.2", f"{np.median(ratio):.2f} of {len(ratio)}"),
            ("error on unread poses grew", "at most 3 %", share((ratio > 1.0).tolist())),
        ]
    out.append(("seconds a set, median", "", f"{np.median([r.seconds for r in rows]):.1f}"))
    return out


def by_family(rows: Sequence[Row]) -> list[tuple[str, int, int, int, int]]:
    """Per family: sets, detectable, of these right family and exact."""
    seen: dict[str, list[Row]] = {}
    for r in rows:
        if r.group == "single":
            seen.setdefault(r.effects[0].partition(":")[0], []).append(r)
    out = []
    for kind, some in sorted(seen.items()):
        able = [r for r in some if r.excess >= DETECTABLE]
        good = [r for r in able if r.found and family(r.found[0]) == family(r.effects[0])]
        out.append((kind, len(some), len(able), len(good), sum(r.found[0] == r.effects[0] for r in good)))
    return out


def run(jobs: Sequence[Job], workers: int) -> list[Row]:
    """All sets, in order, with a count on stderr."""
    start, rows = time.perf_counter(), []
    with get_context("spawn").Pool(workers) as pool:
        for k, row in enumerate(pool.imap(one, jobs), 1):
            rows.append(row)
            left = (time.perf_counter() - start) / k * (len(jobs) - k)
            if k % 10 == 0 or k == len(jobs):
                sys.stderr.write(f"{k}/{len(jobs)} sets, {left:.0f} s left\n")
    return rows


def page(results: dict[str, list[Row]], reads: str, command: str) -> str:
    """The table."""
    rows = next(iter(results.values()))
    out = [f"## Reading {'Z only' if reads == 'z' else 'X, Y and Z'}\n\n`{command}`\n\n"]
    out.append("| | target | " + " | ".join(results) + " |\n|---|---|" + "---|" * len(results) + "\n")
    tables = [lines(some, reads) for some in results.values()]
    for line in zip(*tables, strict=True):
        out.append(f"| {line[0][0]} | {line[0][1]} | " + " | ".join(one[2] for one in line) + " |\n")
    out.append("\n| effect | sets | detectable | right family | exact |\n|---|---|---|---|---|\n")
    out += [f"| {' | '.join(map(str, line))} |\n" for line in by_family(rows)]
    return "".join(out)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for name, count in (("single", 300), ("none", 200), ("outside", 100), ("pairs", 60)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reads", choices=("z", "xyz"), default="z")
    parser.add_argument("--ablations", action="store_true", help="also without parts of the method")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--write", type=Path, help="page to write")
    parser.add_argument("--json", type=Path, help="file for all rows")
    a = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sets = suite(a.single, a.none, a.outside, a.pairs, seed=a.seed, reads=a.reads)
    results = {}
    for name in ABLATIONS if a.ablations else list(ABLATIONS)[:1]:
        sys.stderr.write(f"{name}: {len(sets)} sets\n")
        results[name] = run([(spec, seed, name) for spec, seed in sets], a.workers)
        if a.json:
            plain = {key: [r.as_dict() for r in rows] for key, rows in results.items()}
            a.json.write_text(json.dumps(plain, indent=1))
    text = page(results, a.reads, f"python benchmarks/diagnosis/diagnosis_study.py {' '.join(sys.argv[1:])}")
    if a.write:
        a.write.write_text(text)
    sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
