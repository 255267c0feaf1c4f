"""How often a diagnosis by positions is right, on sets of the foreign world `survey`, blind.

    python -m benchmarks.worlds.survey make SETS --seed N
    python benchmarks/absolute/position_study.py SETS [--page]

Every set is diagnosed once by its model and its table; keys are read afterwards. ``rows.jsonl`` in SETS keeps what came
of each, and a run that was stopped goes on. ``--page`` writes docs/validation/positions_diagnosis.md.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.asked import asked
from doe.absolute.missing.diagnose import diagnose_positions
from doe.absolute.table import read_absolute
from fem.arm import Arm
from rehearsal.scoring import Share
from robots import InputError, load_description

ROOT = Path(__file__).parents[2]
# Runs before the one on the page: every one that was made is told.
EARLIER = """
## Runs before

Seed 1223030620: the right family led in 82 of 100 sets, a name was given in 0 of 60 without anything, a wrong name in 3
of 160. What came of it: a first effect needs no more evidence than its probability asks for; shifts alone, a payload's
mass alone and a gear's first order alone are shapes of their own; what was moved at once is sought at 31 times, not 15.

Seed 1587236851 (of commit `de9b4ff2`): the right family led in 87 of 100 sets, a name was given in 5 of 60 without
anything (payloads in all five, on the arm whose links' centres of mass weigh most), a wrong name in 7 of 160. What came
of it: links' masses are free within 4 % beside every candidate, what settles is drift too, a rail's bow is asked for by
itself. The world has been looked at since, so the runs above are blind to their sets and not to their kind.
"""
PAGE = ROOT / "docs" / "validation" / "positions_diagnosis.md"


def diagnosed(folder: Path) -> dict[str, Any]:
    """What the program says of a set, its key unseen."""
    begin = time.process_time()
    try:
        arm = Arm.of(load_description(str(folder / "model.toml")), "rigid")
        tables = (read_absolute(folder / f"{name}.csv", arm.robot) for name in ("positions", "unseen"))
        data, unseen = tables
        m = diagnose_positions(arm.model, data, holdout=unseen)
    except InputError as error:
        return {"name": folder.name, "verdict": "refused", "reason": str(error), "named": [], "found": []}
    assert m.holdout is not None
    return {
        "name": folder.name,
        "verdict": m.verdict,
        "reason": m.reason,
        "named": [one.candidate.code for one in m.effects],
        "found": [one.candidate.code for one in m.found],
        "probability": m.found[0].probability if m.found else None,
        "unseen_mm": [1e3 * p.rms_m for p in m.holdout[1:]],
        "seconds": time.process_time() - begin,
    }


def family(code: str) -> str:
    """What a code says in front of its colon."""
    return code.partition(":")[0]


def share(rows: list[dict[str, Any]], holds: Callable[[dict[str, Any]], bool]) -> str:
    """A count with its exact interval."""
    s = Share(sum(bool(holds(r)) for r in rows), len(rows))
    low, high = s.interval95
    return f"{s.count} of {s.of} ({100.0 * low:.0f} to {100.0 * high:.0f} %)"


def page(rows: list[dict[str, Any]], command: str) -> str:
    """The page."""
    single = [r for r in rows if r["code"]]
    none = [r for r in rows if not r["code"]]

    def leads(r: dict[str, Any]) -> bool:
        return bool(r["found"]) and family(r["found"][0]) == family(r["code"])

    def wrong(r: dict[str, Any]) -> bool:
        return any(family(code) != family(r["code"]) for code in r["named"])

    shrunk = [r["unseen_mm"][1] / r["unseen_mm"][0] for r in single if r.get("unseen_mm")]
    grew = [r for r in single if r.get("unseen_mm")]
    seconds = np.median([r["seconds"] for r in rows if "seconds" in r])
    out = [
        "# Diagnosis by positions: how often it is right",
        "",
        f"**The right family leads in {share(single, leads)} sets with one thing hidden; a name was given in "
        f"{share(none, lambda r: bool(r['named']))} sets with nothing hidden.** The sets are from an independent "
        "simulator (`benchmarks/worlds/survey`: Pinocchio, its own laws, a tracker's noise, every arm with errors "
        "of geometry and gears). Sizes were drawn before the program was run, so that without the effect "
        "chi-square rises by 30 or more after fitting geometry, frames and declared springs. Each set was "
        "diagnosed once, blind.",
        "",
        f"`{command}`",
        "",
        "| of | share, 95 % interval |",
        "|---|---|",
        f"| right family leads | {share(single, leads)} |",
        f"| exact code leads | {share(single, lambda r: r['found'][:1] == [r['code']])} |",
        f"| named, and nothing else | {share(single, lambda r: r['named'] and not wrong(r))} |",
        f"| a wrong name, all sets | {share(rows, wrong)} |",
        f"| nothing hidden: a name | {share(none, lambda r: bool(r['named']))} |",
        f"| nothing hidden: anything but none | {share(none, lambda r: r['verdict'] != 'none')} |",
        f"| error at other poses grew | {share(grew, lambda r: r['unseen_mm'][1] > r['unseen_mm'][0])} |",
        "",
        f"Errors at other poses fall to {np.median(shrunk):.2f} times those with geometry alone (median). A "
        f"diagnosis takes {seconds:.1f} s of processor time (median).",
        "",
        "| hidden | sets | right family leads | named, and nothing else |",
        "|---|---|---|---|",
    ]
    for kind in dict.fromkeys(family(r["code"]) for r in single):
        mine = [r for r in single if family(r["code"]) == kind]
        good = sum(bool(r["named"]) and not wrong(r) for r in mine)
        out.append(f"| {kind} | {len(mine)} | {sum(map(leads, mine))} | {good} |")
    out += ["", "## Not right", "", "| set | hidden | chi-square | verdict | found |", "|---|---|---|---|---|"]
    for r in rows:
        if (r["code"] and not leads(r)) or wrong(r) or (not r["code"] and r["verdict"] != "none"):
            found = ", ".join(f"{c}{'' if c in r['named'] else ' (not sure)'}" for c in r["found"]) or "-"
            out.append(
                f"| {r['name']} | {r['code'] or 'nothing'} | {r['excess_chi2']:.0f} | {r['verdict']} | {found} |"
            )
    return "\n".join(out) + "\n" + EARLIER


def main() -> None:
    """Diagnose, score, write."""
    a = asked(__doc__, "sets", page=False)
    kept = a.sets / "rows.jsonl"
    done = {r["name"]: r for r in map(json.loads, kept.read_text().splitlines())} if kept.exists() else {}
    folders = sorted(p.parent for p in a.sets.glob("*/key.json"))
    with kept.open("a", encoding="utf-8") as stream:
        for k, folder in enumerate(folders, start=1):
            if folder.name not in done:
                done[folder.name] = diagnosed(folder)
                stream.write(json.dumps(done[folder.name]) + "\n")
                stream.flush()
                print(f"{k} of {len(folders)}: {folder.name} {done[folder.name]['verdict']}", file=sys.stderr)
    rows = [done[f.name] | json.loads((f / "key.json").read_text(encoding="utf-8")) for f in folders]
    seed = (a.sets / "seed.txt").read_text().strip() if (a.sets / "seed.txt").exists() else "N"
    text = page(rows, f"python -m benchmarks.worlds.survey make SETS --seed {seed}")
    if a.page:
        PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
