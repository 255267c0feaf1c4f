"""Whether the power analysis of a sheet comes true: what it states, and 200 sets through the diagnosis, blind.

    python benchmarks/diagnosis/power_study.py make DIR --plan check --seed 2026 --each 20
    python benchmarks/diagnosis/power_study.py run DIR
    python benchmarks/diagnosis/power_study.py show DIR
    python benchmarks/diagnosis/power_study.py page DIR --tuned OTHER

``make`` writes one sheet for each of two robots and, for each of five effects, ``--each`` sets made by the world of
rehearsals, each with another truth; what the power analysis states of them goes into ``stated.json`` before any set is
diagnosed. ``run`` diagnoses the sets as `benchmarks.diagnosis.study` does, one process; stopped, it goes on where it
was (``rows.jsonl``). ``show`` prints how the constants of doe/power/chances.py do on the sets so far. ``page`` writes
docs/validation/power.md and keeps what came of the sets in benchmarks/diagnosis/runs/power.json.

The constants were set on the plan "tune" (seed 11, 12 sets of each): five effects, two sheets. The plan "check" has
five other effects, other sheets and another seed; they were chosen before any of its sets was diagnosed.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from pydantic import TypeAdapter  # noqa: E402

from benchmarks.diagnosis.study.scores import Row  # noqa: E402
from benchmarks.diagnosis.study.sets import study_sets  # noqa: E402
from benchmarks.diagnosis.study.step import run_set  # noqa: E402
from doe import write_measurements  # noqa: E402
from doe.power.chances import CEILING, FREEDOM, LEFT, SPREAD, Chance  # noqa: E402
from rehearsal import family, hide  # noqa: E402
from robots.arm_class import arm_class  # noqa: E402
from stiffarm.commands.rehearse.command import RehearseRequest  # noqa: E402
from stiffarm.commands.rehearse.power.step import power  # noqa: E402
from stiffarm.commands.rehearse.sheet import SetUps  # noqa: E402
from stiffarm.commands.rehearse.step import prepared, set_ups_of  # noqa: E402
from stiffarm.session.inputs import read_model  # noqa: E402

DRAWS = 60


@dataclass(frozen=True)
class Plan:
    """Effects, and for each robot its sheet: poses, and axes that are read; ``seed`` of its poses."""

    effects: tuple[str, ...]
    sheets: dict[str, tuple[int, str]]
    seed: int


PLANS = {
    "tune": Plan(
        ("backlash:j2", "friction:j3", "angle-dependent-stiffness:j3", "joint-tilt:j3", "joint-zero-offset:j2"),
        {"kr60-3": (9, "xyz"), "xr701": (12, "z")},
        3,
    ),
    "check": Plan(
        ("payload", "friction:j2", "hardening:j3", "gravity-compensator:j2", "load-misalignment"),
        {"kr60-3": (12, "z"), "xr701": (9, "xyz")},
        8,
    ),
}
ROWS: TypeAdapter[Row] = TypeAdapter(Row)
PAGE = ROOT / "docs" / "validation" / "power.md"
KEPT = ROOT / "benchmarks" / "diagnosis" / "runs" / "power.json"


@dataclass(frozen=True)
class Cell:
    """One effect of one robot: what was stated, and how many of the sets were found, and named."""

    robot: str
    code: str
    sets: int
    found: int
    named: int
    stated_found: Chance
    stated_named: Chance

    def holds(self, which: str) -> bool:
        """Whether the share lies in the interval stated."""
        stated: Chance = getattr(self, f"stated_{which}")
        return stated.low <= getattr(self, which) / max(self.sets, 1) <= stated.high


def request(plan: Plan, robot: str) -> RehearseRequest:
    """The sheet of a robot."""
    poses, reads = plan.sheets[robot]
    return RehearseRequest(draws=DRAWS, seed=plan.seed, poses=poses, reads=reads, effects=plan.effects, one_more=False)


def make(folder: Path, plan: Plan, seed: int, each: int) -> None:
    """Sheets, what is stated of them, and the sets."""
    stated: dict[str, Any] = {}
    for robot in plan.sheets:
        given = read_model(robot, "rigid", None)
        world = prepared(given)
        sheet = set_ups_of(given, world, request(plan, robot))
        found = power(given, request(plan, robot))
        by_code = {p.code: p for p in found.prospects}
        stated[robot] = {
            code: {
                "found": asdict(by_code[code].found),
                "named": asdict(by_code[code].named),
                "chi2": by_code[code].chi2,
                "why_not": by_code[code].why_not,
            }
            for code in plan.effects
        }
        for code in plan.effects:
            for k in range(each):
                one_set(folder / robot / f"{code.replace(':', '-')}-{k:03d}", given, world, sheet, code, [seed, k])
    (folder / "stated.json").write_text(json.dumps(stated, indent=2) + "\n", encoding="utf-8")


def one_set(folder: Path, given: Any, world: Any, sheet: SetUps, code: str, seed: list[int]) -> None:
    """A set as `benchmarks.diagnosis.study` reads it."""
    size = arm_class(given.description, given.robot)
    own = int(np.random.default_rng([*seed, *f"{given.robot.name} {code}".encode()]).integers(2**31))
    one = hide(
        world, code, sheet.readings, sheet.noise, seed=own, links="rigid", read=sheet.read, ranges=(size.low, size.high)
    )
    folder.mkdir(parents=True)
    write_measurements(sheet.filled(one.measured()), folder / "readings.csv", given.robot)
    excess = one.excess()
    key = {
        "schema": "stiffarm-study-key/1",
        "world": "rehearsal",
        "excess_chi2": excess,
        "effects": [{"code": code, "place": code.partition(":")[2], "excess_chi2": excess}],
    }
    (folder / "key.json").write_text(json.dumps(key), encoding="utf-8")
    about = {"schema": "stiffarm-study-set/1", "model": given.robot.name, "links": "rigid"}
    (folder / "set.json").write_text(json.dumps(about), encoding="utf-8")


def run(folder: Path) -> None:
    """Diagnose what was not yet diagnosed: all effects and robots in turn, so that a part of it says something."""
    done = {row.name for row in rows(folder)}
    sets = sorted(study_sets(folder), key=lambda s: (s.name[-3:], s.name))
    with (folder / "rows.jsonl").open("a", encoding="utf-8") as file:
        for k, one in enumerate(sets, start=1):
            if one.name in done:
                continue
            row = run_set(one)
            file.write(ROWS.dump_json(row).decode() + "\n")
            file.flush()
            said = f"{row.verdict} {', '.join(row.named)}"
            print(f"{k} of {len(sets)}: {one.name}: {said} ({row.seconds:.0f} s)", flush=True)


def rows(folder: Path) -> list[Row]:
    """What came of the sets so far."""
    path = folder / "rows.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    # NaN is null in JSON.
    plain = [{k: float("nan") if v is None else v for k, v in json.loads(line).items()} for line in lines]
    return [ROWS.validate_python(one) for one in plain]


def cells(folder: Path) -> list[Cell]:
    """Shares beside what was stated."""
    stated = json.loads((folder / "stated.json").read_text(encoding="utf-8"))
    out = []
    known = rows(folder)
    for robot, of in stated.items():
        for code, s in of.items():
            mine = [r for r in known if r.name.startswith(f"{robot}/") and r.hidden == (code,)]
            found = sum(r.verdict not in ("none", "uninformative", "refused", "failed") for r in mine)
            right = family(code)
            named = sum(right in {family(c) for c in r.named} for r in mine)
            out.append(Cell(robot, code, len(mine), found, named, Chance(**s["found"]), Chance(**s["named"])))
    return out


def show(folder: Path) -> None:
    """The cells on the screen."""
    for c in cells(folder):
        text = " ".join(
            f"{w} {getattr(c, w)}/{c.sets} stated {getattr(c, f'stated_{w}').value:.2f} "
            f"({getattr(c, f'stated_{w}').low:.2f} to {getattr(c, f'stated_{w}').high:.2f}) "
            f"{'holds' if c.holds(w) else 'OUT'};"
            for w in ("found", "named")
        )
        print(f"{c.robot:8s} {c.code:30s} {text}")


def page(folder: Path, tuned: Path | None) -> None:
    """Keep what came of the sets, and write the page from it."""
    some, before = cells(folder), [] if tuned is None else cells(tuned)
    kept = {
        "constants": {"FREEDOM": FREEDOM, "LEFT": LEFT, "CEILING": CEILING, "SPREAD": SPREAD},
        "check": {**about(folder), "cells": [asdict(c) for c in some]},
        "tune": None if tuned is None else {**about(tuned), "cells": [asdict(c) for c in before]},
    }
    KEPT.write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")
    old = PAGE.read_text(encoding="utf-8") if PAGE.is_file() else ""
    PAGE.write_text(words(some, before, about(folder)["seed"], old), encoding="utf-8")


def about(folder: Path) -> dict[str, Any]:
    """Plan and seed of a folder of sets."""
    return dict(json.loads((folder / "study.json").read_text(encoding="utf-8")))


NOTES = "<!-- notes -->"


def words(some: list[Cell], tuned: list[Cell], seed: int, before: str) -> str:
    """The page; what stands below its line of notes stays."""
    both = [(c, w) for c in some for w in ("found", "named")]
    held, total = sum(c.holds(w) for c, w in both), sum(c.sets for c in some)
    plan = PLANS["check"]
    sheets = "; ".join(
        f"{robot}: {poses} poses, {', '.join(reads)} read" for robot, (poses, reads) in plan.sheets.items()
    )
    lines = [
        "# Does a power analysis come true?",
        "",
        f"Of {len(both)} shares (five effects, two robots, found and named; {total} sets in all) {held} lie in the "
        "interval that `stiffarm rehearse MODEL SHEET` had stated before any set was diagnosed.",
        "",
        f"Sheets: {sheets}; three loads up and down, three repeats, noise 3 % and 3 um. Sets: the world of "
        f"rehearsals, seed {seed}, {total // len(some)} for each effect and robot, each with other springs, sizes, "
        "laws and errors; diagnosed as `benchmarks.diagnosis.study` does it, blind. No constant of the analysis was set"
        " on these effects, sheets or seed.",
        "",
        *table(some),
        "",
    ]
    if tuned:
        lines += [
            "## What the constants were set on",
            "",
            f"{sum(c.sets for c in tuned)} sets of seed 11, other effects and sheets. Three constants were set on "
            "these shares (doe/power/chances.py), which therefore prove nothing. The intervals are those of 20 "
            "campaigns.",
            "",
            *table(tuned),
            "",
        ]
    how = "`python benchmarks/diagnosis/power_study.py make DIR`, then `run DIR`, then `page DIR`."
    return "\n".join([*lines, how, "", NOTES]) + (before.partition(NOTES)[2] or "\n")


def table(some: list[Cell]) -> list[str]:
    """Shares beside what was stated."""
    lines = [
        "| robot | effect | found | stated | holds | named | stated | holds |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for c in some:
        row = [c.robot, f"`{c.code}`"]
        for w in ("found", "named"):
            s: Chance = getattr(c, f"stated_{w}")
            row += [
                f"{getattr(c, w)} of {c.sets}",
                f"{100 * s.value:.0f} % ({100 * s.low:.0f} to {100 * s.high:.0f})",
                "yes" if c.holds(w) else "no",
            ]
        lines.append(f"| {' | '.join(row)} |")
    return lines


def main() -> None:
    """Do what the command line asks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("make", "run", "show", "page"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--plan", choices=tuple(PLANS), default="check")
    parser.add_argument("--tuned", type=Path)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--each", type=int, default=20)
    asked = parser.parse_args()
    if asked.what == "make":
        asked.folder.mkdir(parents=True)
        (asked.folder / "study.json").write_text(json.dumps({"plan": asked.plan, "seed": asked.seed}), encoding="utf-8")
        make(asked.folder, PLANS[asked.plan], asked.seed, asked.each)
    elif asked.what == "run":
        run(asked.folder)
    elif asked.what == "show":
        show(asked.folder)
    else:
        page(asked.folder, asked.tuned)


if __name__ == "__main__":
    main()
