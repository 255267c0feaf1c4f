"""The loop of diagnosing and measuring, on sets of a foreign world: proposed set-ups against random ones.

    python benchmarks/diagnosis/diagnosis_loop.py SETS --out DIR [--kinds single] [--names GLOB] [--jobs 1] [--steps 3]

SETS is a folder of study sets (docs/reference/study_sets.md) whose world can fill in a sheet: ``benchmarks.worlds.X``
with ``fill(set_folder, sheet, visit)``, X as the key says. Every set is diagnosed blind; while nothing is named, the
sheet that the diagnosis proposes (three set-ups) is filled in by the world, and all readings are diagnosed together
again, up to nine set-ups. Beside it the same with as many possible poses drawn at random. Counted as
``benchmarks.diagnosis.study`` counts. DIR gets ``rows.jsonl`` (set by set; a run goes on where it stopped),
``loop.json`` and ``loop.md``.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatch
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks.asked import asked
from benchmarks.diagnosis.study.scores import Row
from benchmarks.diagnosis.study.sets import StudySet, study_sets
from benchmarks.diagnosis.study.step import row
from doe import write_measurements
from doe.diagnosis.proposals.next_readings import NextReadings, at_random
from fem.arm import Arm
from rehearsal.scoring import Share
from robots import InputError
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.step import Diagnosed, diagnose
from stiffarm.request import readings_asked
from stiffarm.session.console import kept_messages
from stiffarm.session.inputs import read_model
from stiffarm.session.json_text import share
from stiffarm.session.zones import zone_of

STEPS, EACH = 3, 3
WAYS = ("proposed", "random")
# What a set comes to: everything hidden named and nothing else; a name of something else; a part of it; no name.
ENDS = ("right", "wrong", "partly", "unsettled")


def end_of(r: Row) -> str:
    """What the verdict on a set comes to. Of nothing hidden, and of what no catalogue has, any name is wrong."""
    if r.kind in ("none", "outside") or not r.named:
        said = {"none": ("none",), "outside": ("unknown", "learned")}.get(r.kind, ())
        return "wrong" if r.named else "right" if r.verdict in said else "unsettled"
    if r.verdict != "named":
        return "wrong" if r.wrong_names else "unsettled"
    return "right" if r.is_named_right else "wrong" if r.wrong_names else "partly"


def judged(one: StudySet, given: Arm, d: Diagnosed) -> dict[str, Any]:
    """Where a set stands after a diagnosis."""
    r = row(one, d, given.robot.joint_names[0], seconds=0.0)
    n = d.proposal
    forecast = (
        None
        if n is None
        else {
            "now": n.before.belief,
            "after": n.after.belief,
            "right": n.after.right,
            "wrong": n.after.wrong,
            "set_ups": len(n.labels),
        }
    )
    return {
        "verdict": r.verdict,
        "named": list(r.named),
        "found": list(r.found),
        "leads_right": r.is_right,
        "end": end_of(r),
        "forecast": forecast,
        "why_none": d.nothing_next,
    }


def filled(one: StudySet, given: Arm, n: NextReadings, visit: int, path: Path) -> None:
    """The sheet of a proposal at ``path``, filled in by the world of the set."""
    write_measurements(n.sheet, path, given.robot, to_fill=n.protocol.columns)
    world = import_module(f"benchmarks.worlds.{one.key.world}")
    text = world.fill(one.folder, path.read_text(encoding="utf-8"), visit)
    path.write_text(text, encoding="utf-8")


def diagnosed(given: Arm, tables: Sequence[Path], next_poses: int) -> Diagnosed:
    """The diagnosis of all tables together, nothing printed."""
    with kept_messages():
        table = readings_asked(given, tables)
        return diagnose(given, table, DiagnoseRequest(next_poses=next_poses, folds=0))


def looped(one: StudySet, given: Arm, first: Diagnosed, way: str, steps: int, folder: Path) -> list[dict[str, Any]]:
    """Where a set stands after each visit, until something is named or there is nothing to measure."""
    out, d, tables = [judged(one, given, first)], first, [one.readings]
    zone = zone_of(given.description, 0.0, (), None)
    while d.found.verdict != "named" and len(out) <= steps and first.proposal is not None:
        visit = len(out)
        n = d.proposal if way == "proposed" else first.proposal
        if n is None:
            break
        if way == "random":
            n = at_random(n, d.found.start, zone, np.random.default_rng([visit, 7]), EACH)
        tables.append(folder / f"{way}{visit}.csv")
        filled(one, given, n, visit, tables[-1])
        last = visit == steps or way == "random"
        d = diagnosed(given, tables, 0 if last else EACH)
        out.append(judged(one, given, d) | {"set_ups": len(n.labels)})
    return out


def run_set(one: StudySet, steps: int = STEPS) -> dict[str, Any]:
    """One set, measured on in both ways; the reason where its readings were refused."""
    key = one.key
    out: dict[str, Any] = {
        "set": one.name,
        "world": key.world,
        "hidden": [h.code for h in key.effects],
        "excess_chi2": key.excess_chi2,
        "tags": dict(key.tags),
    }
    start = time.perf_counter()
    try:
        given = read_model(one.model, one.file.links, one.file.load_path)
        first = diagnosed(given, [one.readings], EACH)
        known = row(one, first, given.robot.joint_names[0], seconds=0.0)
        out |= {"kind": known.kind, "detectable": known.is_detectable}
        with tempfile.TemporaryDirectory() as name:
            for way in WAYS:
                out[way] = looped(one, given, first, way, steps, Path(name))
    except InputError as error:
        out["refused"] = str(error)
    except Exception as error:
        out["failed"] = f"{type(error).__name__}: {error}"
    return out | {"seconds": round(time.perf_counter() - start, 1)}


def at_step(steps: Sequence[dict[str, Any]], k: int) -> dict[str, Any]:
    """Where a set stands after k visits; what ended before stays."""
    return steps[min(k, len(steps) - 1)]


def visits(rows: Sequence[dict[str, Any]]) -> int:
    """The most visits that any set took."""
    return max((len(r[way]) - 1 for r in rows for way in WAYS), default=0)


def ends(rows: Sequence[dict[str, Any]], way: str, k: int) -> dict[str, Share]:
    """How many of the rows come to what after k visits."""
    here = [at_step(r[way], k)["end"] for r in rows]
    return {end: Share(here.count(end), len(here)) for end in ENDS}


def sooner(rows: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """In how many sets proposed, and random, set-ups came to the right name with fewer visits."""
    needed = [[_needed(r[way]) for way in WAYS] for r in rows]
    return sum(p < r for p, r in needed), sum(p > r for p, r in needed)


def _needed(steps: Sequence[dict[str, Any]]) -> int:
    return len(steps) if steps[-1]["end"] == "right" else 99


def forecasts(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What proposals promised by the rivals alone, in sum, beside what came of them at the next diagnosis.

    The figures of :mod:`doe.diagnosis.proposals.foresight` (PROMISED, CAME, ASTRAY, PROPOSALS) are those of the
    detectable and undetectable singles of ``benchmarks/worlds/screws``.
    """
    pairs = [
        (here["forecast"], there["end"])
        for r in rows
        for here, there in zip(r["proposed"], r["proposed"][1:], strict=False)
        if here["forecast"] is not None
    ]
    out: dict[str, Any] = {"proposals": len(pairs)}
    for end in ("right", "wrong"):
        out[end] = {
            "promised": round(float(sum(f[end] for f, _ in pairs)), 2),
            **share(Share(sum(e == end for _, e in pairs), len(pairs))),
        }
    return out


def groups(rows: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Sets by kind, the detectable ones of them, and those of them that were unsettled at first."""
    out: dict[str, list[dict[str, Any]]] = {}
    for kind in dict.fromkeys(r["kind"] for r in rows):
        mine = [r for r in rows if r["kind"] == kind]
        out[kind] = mine
        if any(not r["detectable"] for r in mine) and kind != "none":
            out[f"{kind}, detectable"] = [r for r in mine if r["detectable"]]
        unsettled = [r for r in mine if r["proposed"][0]["end"] == "unsettled" and (r["detectable"] or kind == "none")]
        out[f"{kind}, {'' if kind == 'none' else 'detectable and '}unsettled at first"] = unsettled
    return {name: some for name, some in out.items() if some}


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Everything counted."""
    ran = [r for r in rows if "proposed" in r]
    out: dict[str, Any] = {
        "sets": len(rows),
        "refused": sum("refused" in r for r in rows),
        "failed": sum("failed" in r for r in rows),
        "groups": {},
    }
    for name, some in groups(ran).items():
        won, lost = sooner(some)
        out["groups"][name] = {
            "sets": len(some),
            **{
                way: [
                    {"set_ups": EACH * k, **{end: share(s) for end, s in ends(some, way, k).items()}}
                    for k in range(visits(ran) + 1)
                ]
                for way in WAYS
            },
            "sooner_right": {
                "proposed": won,
                "random": lost,
                "p": binomtest(won, won + lost).pvalue if won + lost else 1.0,
            },
            "forecasts": forecasts(some),
        }
    return out


def page(content: dict[str, Any]) -> str:
    """The tables as text."""
    out = [f"{content['sets']} sets, {content['refused']} refused, {content['failed']} failed.\n"]
    for name, g in content["groups"].items():
        set_ups = [step["set_ups"] for step in g["proposed"]]
        out += [
            f"\n## {name}: {g['sets']} sets\n",
            "| | " + " | ".join(f"{n} set-ups" for n in set_ups) + " |",
            "|---" * (len(set_ups) + 1) + "|",
        ]
        for way in WAYS:
            for end in ENDS:
                cells = [_cell(step[end]) for step in g[way]]
                out.append(f"| {way}: {end} | " + " | ".join(cells) + " |")
        s, f = g["sooner_right"], g["forecasts"]
        out.append(
            f"\nProposed set-ups were right sooner in {s['proposed']} sets, random ones in {s['random']} "
            f"(sign test: p = {s['p']:.2g})."
        )
        if f["proposals"]:
            told = ", ".join(f"{end} {f[end]['promised']:.1f}, came {_cell(f[end])}" for end in ("right", "wrong"))
            out.append(f"Of {f['proposals']} proposals, promised by the next diagnosis: {told}.")
    return "\n".join(out) + "\n"


def _cell(s: dict[str, Any]) -> str:
    low, high = s["interval95"]
    return f"{s['count']} of {s['of']} ({100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    """Run the loop."""
    a = asked(__doc__, "sets", out={"type": Path, "required": True}, kinds="single", names="*", steps=STEPS, jobs=1)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    a.out.mkdir(parents=True, exist_ok=True)
    kept = a.out / "rows.jsonl"
    rows = [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()] if kept.exists() else []
    done = {r["set"] for r in rows}
    kinds = {0: "none", 1: "single"}
    wanted = [
        s
        for s in study_sets(a.sets)
        if kinds.get(len(s.key.effects), "pair") in a.kinds.split(",") and fnmatch(s.name, a.names)
    ]
    todo = [s for s in wanted if s.name not in done]
    with ProcessPoolExecutor(max(min(a.jobs, len(todo)), 1), get_context("spawn")) as pool:
        for finished in as_completed([pool.submit(partial(run_set, steps=a.steps), one) for one in todo]):
            r = finished.result()
            rows.append(r)
            with kept.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(r) + "\n")
            told = {way: (r[way][-1]["end"], len(r[way]) - 1) for way in WAYS if way in r}
            print(
                f"{r['set']} {','.join(r['hidden'])}: {told or r.get('refused') or r.get('failed')} {r['seconds']} s",
                file=sys.stderr,
            )
    content = summary(rows) | {"rows": rows}
    (a.out / "loop.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    (a.out / "loop.md").write_text(page(content), encoding="utf-8")
    sys.stdout.write(page(content))


if __name__ == "__main__":
    main()
