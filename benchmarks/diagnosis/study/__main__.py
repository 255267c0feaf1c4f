"""Score the diagnosis on readings whose true cause is known.

    python -m benchmarks.diagnosis.study FOLDER [--jobs N] [--out DIR] [--json]

Any simulator can make the sets (docs/reference/study_sets.md). Every set is diagnosed blind, with unchanged defaults,
and counted strictly: "unknown" and "none" are never right for an effect of the catalogue, and candidates that were only
tried do not count. Writes study.json, rows.csv and a report into --out.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from benchmarks.diagnosis.study import report
from benchmarks.diagnosis.study import step as studying
from benchmarks.diagnosis.study.report import write_report
from benchmarks.diagnosis.study.sets import study_sets
from robots import InputError
from stiffarm.session.console import emit_json, progress, say, show_table
from stiffarm.session.outputs import OutputFolder


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, help="sets: folders with set.json, readings.csv, key.json")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="sets diagnosed at the same time")
    parser.add_argument("--out", type=Path, help="where to write study.json, rows.csv and report.html")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args(arguments)
    try:
        sets = study_sets(asked.folder)
    except InputError as error:
        say(f"study: {error}")
        return 2
    with progress("sets") as bar:
        rows = studying.study(sets, asked.jobs, bar)
    content = report.study(rows)
    if asked.out is not None:
        with OutputFolder(asked.out, sys.argv, {}, None) as results:
            results.write_json("study.json", content)
            results.write_text("rows.csv", report.as_csv(rows))
            write_report(rows, asked.folder.name, results)
    if asked.json:
        emit_json(content)
        return 0
    for text in report.summary(rows):
        say(text)
    show_table("Scores", list(report.HEADS), [list(line) for line in report.score_lines(rows)])
    if families := report.family_lines(rows):
        show_table("By effect, detectable singles", list(report.FAMILY_HEADS), [list(f) for f in families])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
