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
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from pydantic import TypeAdapter

sys.path.insert(0, str(Path(__file__).parents[2]))

from protocol_page import page

from benchmarks.diagnosis.study import payload, words
from benchmarks.diagnosis.study.report import write_report
from benchmarks.diagnosis.study.scores import Row
from benchmarks.diagnosis.study.sets import study_sets
from benchmarks.diagnosis.study.step import rows_of
from stiffarm.session.outputs import OutputFolder

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
        results.write_json("study.json", payload.study(done))
        results.write_text("rows.csv", payload.as_csv(done))
        write_report(done, folder.name, results)
    for line in words.lines(done):
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
