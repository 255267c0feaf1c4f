"""What a diagnosis makes of made-up tables like the XR701's (xr701_tables.py), and of the real one.

    python benchmarks/diagnosis/xr701_power.py TABLES --out DIR [--names GLOB] [--jobs 1]

Every table goes through `stiffarm diagnose` as the real readings do by default from the serial chain: all 27 readings,
beam links, no options. Reported by what is hidden: whether the load path is named, has 80 % or is in the 95 % set,
false alarms where it is not hidden, whether the two odd readings hardly count, and how probable it is that something
beyond the load path is missing, where every reading at 150 N is 0.1 mm short and where none is. DIR gets ``study.json``
(the strict scores of `benchmarks.diagnosis.study`), ``power.json`` and ``power.md``.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from fnmatch import fnmatch
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.asked import asked
from benchmarks.diagnosis.study import report
from benchmarks.diagnosis.study.scores import Row
from benchmarks.diagnosis.study.sets import StudySet, study_sets
from benchmarks.diagnosis.study.step import row
from fem.arm import Arm
from rehearsal.scoring import Share
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.result import result_of
from stiffarm.commands.diagnose.step import Diagnosed, diagnose
from stiffarm.request import readings_asked
from stiffarm.session.console import kept_messages
from stiffarm.session.inputs import read_model
from stiffarm.session.json_text import share

PATH, SURE = "load-path", 0.8
Outcome = dict[str, Any]


def diagnosed(given: Arm, tables: Sequence[Path]) -> Diagnosed:
    """As `stiffarm diagnose` does by default, without what moves no verdict: further set-ups and folds."""
    with kept_messages():
        table = readings_asked(given, tables)
        return diagnose(given, table, DiagnoseRequest(next_poses=0, folds=0))


def told(d: Diagnosed) -> Outcome:
    """What a diagnosis says of the load path, of odd readings, and of what may be missing beside the path."""
    content = result_of(d).as_json
    looks = [{c["code"]: c["probability"] for c in look["candidates"]} for look in content["steps"]]
    found = {e["code"]: e["probability"] for e in (*content["effects"], *content["provisional"])}
    last = looks[-1] if looks else {}
    return {
        "verdict": content["verdict"],
        "named": [e["code"] for e in content["effects"]],
        "found": list(found),
        "path_probability": max([found.get(PATH, 0.0), *(look.get(PATH, 0.0) for look in looks[:1])]),
        "path_in_set95": PATH in content["set95"],
        "beyond_path": sum(p for code, p in last.items() if code not in ("none", PATH)) if last else None,
        "odd_lines": sorted(r["line"] for r in content["outliers"]),
        "noise": content["noise"],
    }


def run_set(one: StudySet) -> tuple[Row, Outcome]:
    """One table, blind, beside its key."""
    start = time.perf_counter()
    given = read_model(one.model, one.file.links, one.file.load_path)
    d = diagnosed(given, [one.readings])
    scored = row(one, d, given.robot.joint_names[0], seconds=time.perf_counter() - start)
    extra = one.key.model_extra or {}
    return scored, {"set": one.name, **one.key.tags, "truly_odd": extra.get("odd_lines", []), **told(d)}


def counted(outcomes: Iterable[Outcome], holds: Callable[[Outcome], bool]) -> dict[str, Any]:
    """In how many outcomes something holds, with the exact interval."""
    some = [bool(holds(o)) for o in outcomes]
    return share(Share(sum(some), len(some)))


def is_sure(o: Outcome) -> bool:
    """Whether the load path is named for sure, whatever is open beside it."""
    return o["verdict"] in ("named", "ambiguous") and PATH in o["named"]


def of_cell(some: Sequence[Outcome]) -> dict[str, Any]:
    """What is counted of tables that hide the same."""
    beyond = [o["beyond_path"] for o in some if o["beyond_path"] is not None]
    return {
        "tables": len(some),
        "path_named": counted(some, is_sure),
        "path_probable": counted(some, lambda o: o["path_probability"] >= SURE),
        "path_in_set95": counted(some, lambda o: o["path_in_set95"]),
        "another_name": counted(some, lambda o: any(code != PATH for code in o["named"])),
        "odd_both_flagged": counted(some, lambda o: bool(o["truly_odd"]) and {*o["truly_odd"]} <= {*o["odd_lines"]}),
        "others_flagged": counted(some, lambda o: bool({*o["odd_lines"]} - {*o["truly_odd"]})),
        "beyond_path_median": float(np.median(beyond)) if beyond else None,
        "beyond_path_probable": counted(some, lambda o: (o["beyond_path"] or 0.0) >= SURE),
        "verdicts": {v: sum(o["verdict"] == v for o in some) for v in sorted({o["verdict"] for o in some})},
    }


def power(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """By what is hidden, one by one and in all."""
    cells = {}
    for path in (True, False):
        mine = [o for o in outcomes if o["path"] == path]
        title = "path hidden" if path else "serial arm, nothing to find of the path"
        cells[f"{title}: all"] = of_cell(mine)
        for odd in (False, True):
            for short in (False, True):
                some = [o for o in mine if (o["odd"], o["shortfall"]) == (odd, short)]
                with_ = [word for word, there in (("two odd readings", odd), ("shortfall", short)) if there]
                cells[f"{title}: {' and '.join(with_) or 'no more'}"] = of_cell(some)
    return {name: cell for name, cell in cells.items() if cell["tables"]}


COLUMNS = (
    ("path_named", "path named"),
    ("path_probable", "80 % or more"),
    ("path_in_set95", "in the 95 % set"),
    ("another_name", "another name"),
    ("odd_both_flagged", "both odd ones hardly count"),
    ("others_flagged", "others hardly count"),
    ("beyond_path_probable", "beyond the path: 80 % or more"),
)


def page(cells: dict[str, Any], real: Outcome) -> str:
    """The table as text, the real readings beside it."""
    heads = ["hidden", "tables", *(title for _, title in COLUMNS), "beyond the path, median", "verdicts"]
    out = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for name, c in cells.items():
        counts = [
            f"{c[key]['count']} ({100 * c[key]['interval95'][0]:.0f} to {100 * c[key]['interval95'][1]:.0f} %)"
            for key, _ in COLUMNS
        ]
        middle = "-" if c["beyond_path_median"] is None else f"{100 * c['beyond_path_median']:.0f} %"
        verdicts = ", ".join(f"{verdict} {n}" for verdict, n in c["verdicts"].items())
        out.append("| " + " | ".join([name, str(c["tables"]), *counts, middle, verdicts]) + " |")
    out += ["", "The real 27 readings, serial chain:", "", "```json", json.dumps(real, indent=1), "```"]
    return "\n".join(out) + "\n"


def real_readings() -> Outcome:
    """The bundled readings, from the serial chain."""
    return told(diagnosed(read_model("xr701", None, "serial"), ()))


def main() -> None:
    """Run all tables, and the real one."""
    a = asked(__doc__, "tables", out={"type": Path, "required": True}, names="*", jobs=1)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    rows, outcomes = [], []
    sets = [one for one in study_sets(a.tables) if fnmatch(one.name, a.names)]
    with ProcessPoolExecutor(a.jobs, get_context("spawn")) as pool:
        for k, (scored, outcome) in enumerate(pool.map(run_set, sets), start=1):
            rows.append(scored)
            outcomes.append(outcome)
            if k % 10 == 0:
                print(f"{k} of {len(sets)}", file=sys.stderr)
    real, cells = real_readings(), power(outcomes)
    a.out.mkdir(parents=True, exist_ok=True)
    texts = {
        "study.json": json.dumps(report.study(rows), indent=1),
        "power.json": json.dumps({"cells": cells, "real": real, "tables": outcomes}, indent=1),
        "power.md": page(cells, real),
    }
    for name, text in texts.items():
        (a.out / name).write_text(text.rstrip() + "\n", encoding="utf-8")
    sys.stdout.write(texts["power.md"])


if __name__ == "__main__":
    main()
