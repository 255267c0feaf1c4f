"""What came of the studies whose rows are kept in benchmarks/diagnosis/runs: shares, and what further set-ups brought.

    python benchmarks/diagnosis/run_summaries.py [--write]

``--write`` writes benchmarks/diagnosis/results/runs.json, which docs/validation/diagnosis_study.md (its notes) and
docs/validation/diagnosis_next.md have their figures from. Nothing is diagnosed; it takes a second.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from diagnosis_loop import summary
from protocol import kept

from benchmarks.asked import asked
from benchmarks.diagnosis.study.scores import scores
from stiffarm.session.json_text import share

RUNS = Path(__file__).parent / "runs"
RESULTS = Path(__file__).parent / "results" / "runs.json"


def study(commit: str) -> dict[str, Any]:
    """Counts of a study, share by share."""
    found = [s for s in scores(list(kept(RUNS / commit / "rows.jsonl"))) if s.share.of]
    return {s.name: {**share(s.share), "percent": round(100.0 * s.share.count / s.share.of, 2)} for s in found}


def open_at_last(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Of the sets without a name after the last proposed set-up: what keeps them open. One set may count twice."""
    last = [r["proposed"][-1] for r in rows if r.get("proposed") and r["proposed"][-1]["end"] == "unsettled"]
    return {
        "sets": len(last),
        "the_right_effect_leads": sum(d["leads_right"] for d in last),
        "unknown": sum(d["verdict"] == "unknown" for d in last),
        "no_set_up_would_tell": sum(bool(d["why_none"]) for d in last),
    }


def loop(commit: str) -> dict[str, Any]:
    """What proposed and random set-ups brought."""
    text = (RUNS / commit / "loop_rows.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text.splitlines()]
    return {**summary(rows), "open_at_last": open_at_last(rows)}


def text() -> str:
    """The results file."""
    content = {
        "studies": {commit: study(commit) for commit in ("8288c762", "a3d97a58")},
        "loops": {"a3d97a58": loop("a3d97a58")},
    }
    return json.dumps(content, indent=1) + "\n"


def main() -> None:
    """Print or write."""
    if asked(__doc__, write=False).write:
        RESULTS.write_text(text(), encoding="utf-8")
    else:
        sys.stdout.write(text())


if __name__ == "__main__":
    main()
