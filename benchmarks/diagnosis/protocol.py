"""The protocol of the diagnosis: sets of worlds that nothing was tuned on, drawn after the code is fixed, run once.

    python benchmarks/diagnosis/protocol.py make DIR [--commit TAG] [--worlds frame,motors] [--share 1.0]
    python benchmarks/diagnosis/protocol.py run DIR [--jobs 2]
    python benchmarks/diagnosis/protocol.py page DIR

``make`` takes the seed of each world from the commit's hash, so that nobody can choose them, and writes them with the
numbers of sets into ``protocol.json``. ``run`` diagnoses every set as `benchmarks.diagnosis.study` does; stopped, it
goes on where it was (``rows.jsonl``), and refuses sets made for another state of the program. DIR/study gets
``study.json``, ``rows.csv`` and ``report.html`` at the end. Every run is a line of ``runs.jsonl``. ``page``
writes what came of it so far into docs/validation/diagnosis_study.md, above that page's line of
notes, and draws the diagram beside it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from pydantic import TypeAdapter

from benchmarks.diagnosis.study import report
from benchmarks.diagnosis.study.report import TELLING, reliability_figure, write_report
from benchmarks.diagnosis.study.scores import Row, reliability, share
from benchmarks.diagnosis.study.sets import study_sets
from benchmarks.diagnosis.study.step import rows_of
from stiffarm.pages.style import save_png
from stiffarm.session.outputs import OutputFolder

# What was written by hand begins here, and stays.
NOTES = "<!-- notes -->"
DIAGRAM = "diagnosis_reliability.png"
# From here on what is stated has to be what holds, within so many points.
SURE, NEAR = 0.8, 3.0
CONDITIONS = ("world", "reads", "poses", "noise", "scatter")


def page(folder: Path, rows: Sequence[Row], path: Path) -> None:
    """Write everything above the notes of the page at ``path``, and the diagram beside it."""
    planned = json.loads((folder / "protocol.json").read_text(encoding="utf-8"))
    runs = [json.loads(line) for line in (folder / "runs.jsonl").read_text(encoding="utf-8").splitlines()]
    _, mark, notes = path.read_text(encoding="utf-8").partition(NOTES)
    if not mark:
        raise SystemExit(f"{path} has no line {NOTES}: what stands there would be lost")
    bins = reliability(rows)
    save_png(reliability_figure(bins), path.parent / DIAGRAM)
    text = "\n\n".join(
        _wrapped(part)
        for part in [
            "# How often a diagnosis is right",
            " ".join(report.summary(rows)),
            _how(planned, len(rows)),
            "## Scores",
            _table(report.HEADS, report.score_lines(rows)),
            "## Stated probability",
            _stated(rows),
            f"![Stated probability beside the share right]({DIAGRAM})",
            _table(report.RELIABILITY_HEADS, report.reliabilities(rows)),
            "## By effect",
            _table(report.FAMILY_HEADS, report.family_lines(rows)),
            "## Outside of the catalogue",
            _table(("kind", "detectable", "unknown or learned", "axis and place", "a name"), _outside(rows)),
            "## By condition",
            _table(report.TAG_HEADS, [line for line in report.tag_lines(rows) if line[0] in CONDITIONS]),
            "## Every run",
            _runs(runs),
        ]
    )
    path.write_text(f"{text}\n\n{NOTES}{notes}", encoding="utf-8")


def _wrapped(part: str) -> str:
    """Paragraphs in lines as the other pages have them; tables and pictures as they are."""
    return part if part.startswith(("|", "!")) else "\n\n".join(textwrap.fill(p, 120) for p in part.split("\n\n"))


def _how(planned: dict[str, object], done: int) -> str:
    worlds = planned["worlds"]
    assert isinstance(worlds, dict)
    sets = sum(n for numbers in worlds.values() for key, n in numbers.items() if key != "seed")
    seeds = ", ".join(f"`{name}` (seed {numbers['seed']})" for name, numbers in worlds.items())
    state = f"All {sets} sets" if done == sets else f"**{done} of {sets} sets so far**"
    return (
        f"{state}, drawn after the program was fixed, from worlds that nothing was tuned on: {seeds}; the seeds come "
        f"from the hash of commit `{str(planned['commit'])[:12]}`. Each was diagnosed once, blind. The "
        "[worlds](../reference/study_sets.md#worlds-of-this-project) share no code with the program or one another.\n\n"
        "`python benchmarks/diagnosis/protocol.py make DIR --commit COMMIT`, then `run DIR`, then `page DIR`."
    )


def _stated(rows: Sequence[Row]) -> str:
    """How far what is stated is from what holds, above 80 %."""
    led = [r for r in rows if r.verdict in ("named", "ambiguous") and r.probability >= SURE]
    if not led:
        return "No effect was stated with 80 % or more."
    right = share(led, lambda r: r.is_right)
    gap = 100.0 * (sum(r.probability for r in led) / len(led) - right.count / right.of)
    off = [b for b in reliability(rows) if b.right.of >= TELLING and not b.holds]
    return (
        f"Where {100 * SURE:.0f} % or more was stated ({len(led)} sets), the mean stated is {abs(gap):.1f} points "
        f"{'above' if gap > 0 else 'below'} the share right (aim: within {NEAR:.0f}). Bins of {TELLING} sets and more "
        f"that lie outside of their interval: {len(off) or 'none'}."
    )


def _outside(rows: Iterable[Row]) -> list[tuple[str, ...]]:
    groups: dict[str, list[Row]] = {}
    for r in rows:
        if r.kind == "outside" and r.is_detectable:
            groups.setdefault(r.hidden[0].removeprefix("other:").partition(":")[0], []).append(r)
    return [
        (
            kind,
            str(len(some)),
            str(sum(r.verdict in ("unknown", "learned") for r in some)),
            str(sum(r.is_placed for r in some)),
            str(sum(bool(r.named) for r in some)),
        )
        for kind, some in sorted(groups.items())
    ]


def _runs(runs: Sequence[dict[str, str]]) -> str:
    lines = [(r["at"], r["commit"][:12], r["head"][:12]) for r in runs]
    return _table(("begun, or gone on with", "sets drawn for", "program"), lines)


def _table(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    rows = [heads, ["---"] * len(heads), *lines]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


sys.path.insert(0, str(Path(__file__).parents[2]))


ROOT = Path(__file__).parents[2]
# Sets of each kind over all worlds, by the words of a world's command. Some that a world takes for outside of the
# catalogue are in it by now: more are drawn than the 150 that count.
KINDS = {"single": 300, "none": 150, "outside": 200, "pairs": 100}
# Worlds that no constant of the diagnosis was set on.
UNTUNED = "frame,motors"
ROWS: TypeAdapter[Row] = TypeAdapter(Row)


def git(*words: str) -> str:
    """What git says."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)  # noqa: S603, S607
    return done.stdout.strip()


def plan(commit: str, worlds: list[str], share: float) -> dict[str, dict[str, int]]:
    """For each world its seed, eight digits of the hash each, and its numbers of sets."""
    out: dict[str, dict[str, int]] = {}
    for k, world in enumerate(worlds):
        # What does not divide goes to the first worlds.
        counts = {kind: round(share * n) for kind, n in KINDS.items()}
        mine = {kind: n // len(worlds) + (k < n % len(worlds)) for kind, n in counts.items()}
        out[world] = {"seed": int(commit[8 * k : 8 * k + 8], 16) % 2**31, **mine}
    return out


def make(folder: Path, commit: str, worlds: list[str], share: float) -> None:
    """Draw the sets."""
    folder.mkdir(parents=True)
    planned = plan(commit, worlds, share)
    for world, numbers in planned.items():
        options = [x for kind, n in numbers.items() for x in (f"--{kind}", str(n))]
        command = [sys.executable, "-m", f"benchmarks.worlds.{world}", "make", str(folder / "sets" / world), *options]
        subprocess.run(command, cwd=ROOT, check=True)  # noqa: S603 - ours
    content = {"commit": commit, "worlds": planned}
    (folder / "protocol.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def kept(path: Path) -> Iterator[Row]:
    """Rows of a run that was stopped."""
    if path.exists():
        yield from (ROWS.validate_python(json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines())


def run(folder: Path, jobs: int) -> None:
    """Diagnose every set that was not yet, and score all."""
    commit = json.loads((folder / "protocol.json").read_text(encoding="utf-8"))["commit"]
    if git("diff", "--stat", commit, "--", "doe", "fem", "robots", "meshes", "stiffarm"):
        raise SystemExit(f"these sets were drawn for {commit[:12]}, and the program has changed since: draw others")
    started = {
        "commit": commit,
        "head": git("rev-parse", "HEAD"),
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    with (folder / "runs.jsonl").open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(started) + "\n")
    rows = {r.name: r for r in kept(folder / "rows.jsonl")}
    sets = study_sets(folder / "sets")
    # In any order, but always the same one: what is done when a run is stopped is like the whole.
    mixed = sorted(sets, key=lambda one: hashlib.sha256(f"{commit} {one.name}".encode()).digest())
    todo = [one for one in mixed if one.name not in rows]
    with (folder / "rows.jsonl").open("a", encoding="utf-8") as stream:
        for r in rows_of(todo, jobs):
            rows[r.name] = r
            stream.write(json.dumps(asdict(r)) + "\n")
            stream.flush()
            print(f"{len(rows)} of {len(sets)}: {r.name} {r.seconds:.1f} s", file=sys.stderr)
    done = [rows[one.name] for one in sets]
    with OutputFolder(folder / "study", sys.argv, {"protocol": folder / "protocol.json"}, None) as results:
        results.write_json("study.json", report.study(done))
        results.write_text("rows.csv", report.as_csv(done))
        write_report(done, folder.name, results)
    for line in report.score_lines(done):
        print(" | ".join(str(cell) for cell in line))


def main() -> int:
    """Draw or run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    drawing = commands.add_parser("make")
    drawing.add_argument("folder", type=Path)
    drawing.add_argument("--commit", default="HEAD", help="tag or commit whose hash gives the seeds")
    drawing.add_argument("--worlds", default=UNTUNED)
    drawing.add_argument("--share", type=float, default=1.0, help="share of the full number of sets")
    running = commands.add_parser("run")
    running.add_argument("folder", type=Path)
    running.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    telling = commands.add_parser("page")
    telling.add_argument("folder", type=Path)
    a = parser.parse_args()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if a.command == "make":
        make(a.folder, git("rev-parse", f"{a.commit}^{{commit}}"), a.worlds.split(","), a.share)
    elif a.command == "run":
        run(a.folder, a.jobs)
    else:
        page(a.folder, list(kept(a.folder / "rows.jsonl")), ROOT / "docs" / "validation" / "diagnosis_study.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
