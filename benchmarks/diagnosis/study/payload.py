"""A study as JSON and as a table of sets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from benchmarks.diagnosis.study.scores import Row, by_family, by_tag, reliability, scores, shrinkage
from rehearsal.scoring import DETECTABLE
from robots.files.csv_text import rows_text
from robots.quantities import rounded
from stiffarm.session.json_text import share

SCHEMA = "stiffarm-study/1"
COLUMNS = (
    "set",
    "world",
    "kind",
    "hidden",
    "excess_chi2",
    "detectable",
    "verdict",
    "named",
    "found",
    "probability",
    "set95",
    "right",
    "named_right",
    "wrong_names",
    "before_mm",
    "after_mm",
    "seconds",
    "reason",
)


def study(rows: Sequence[Row]) -> dict[str, Any]:
    """Scores, and every set."""
    return {
        "schema": SCHEMA,
        "detectable_chi2": DETECTABLE,
        "sets": len(rows),
        "kinds": dict(Counter(r.kind for r in rows)),
        "scores": [
            {"name": s.name, **share(s.share), "aim": s.aim, "at_most": s.at_most, "met": s.is_met}
            for s in scores(rows)
        ],
        "held_out_after_over_before": {
            kind: {"median": rounded(median), "sets": count} for kind, (median, count) in shrinkage(rows).items()
        },
        "by_effect": {
            name: {"sets": count, "right_family": share(right), "exact": share(exact), "named_right": share(named)}
            for name, count, right, exact, named in by_family(rows)
        },
        "by_tag": [
            {"tag": tag, "value": value, "right_family": share(right), "wrong_name": share(wrong)}
            for tag, value, right, wrong in by_tag(rows)
        ],
        "reliability": [
            {"from": b.low, "to": b.high, "stated": rounded(b.stated), "right": share(b.right), "holds": b.holds}
            for b in reliability(rows)
        ],
        "rows": [one(r) for r in rows],
    }


def one(r: Row) -> dict[str, Any]:
    """One set, unveiled."""
    return {
        "set": r.name,
        "world": r.world,
        "kind": r.kind,
        "hidden": list(r.hidden),
        "axes": list(r.axes),
        "places": list(r.places),
        "excess_chi2": rounded(r.excess, 5),
        "detectable": r.is_detectable,
        "tags": dict(r.tags),
        "verdict": r.verdict,
        "reason": r.reason,
        "named": list(r.named),
        "found": list(r.found),
        "probability": rounded(r.probability, 5),
        "set95": list(r.set95),
        "learned": [list(one) for one in r.learned],
        "right": r.is_right,
        "named_right": r.is_named_right,
        "wrong_names": list(r.wrong_names),
        "before_mm": rounded(r.before_mm),
        "after_mm": rounded(r.after_mm),
        "seconds": rounded(r.seconds, 3),
    }


def as_csv(rows: Sequence[Row]) -> str:
    """One line a set."""
    table: list[Sequence[object]] = [COLUMNS]
    for r in rows:
        found = one(r)
        found |= {key: " ".join(value) for key, value in found.items() if isinstance(value, list) and key != "learned"}
        table.append([found[key] for key in COLUMNS])
    return rows_text(table)
