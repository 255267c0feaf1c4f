"""The page of the protocol's study: scores with intervals, stated probabilities, by effect and by condition."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from benchmarks.diagnosis.study import words
from benchmarks.diagnosis.study.figures import TELLING, reliability_figure
from benchmarks.diagnosis.study.scores import Row, reliability, share
from stiffarm.pages.style import save_png

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
            " ".join(words.summary(rows)),
            _how(planned, len(rows)),
            "## Scores",
            _table(words.HEADS, words.lines(rows)),
            "## Stated probability",
            _stated(rows),
            f"![Stated probability beside the share right]({DIAGRAM})",
            _table(words.RELIABILITY_HEADS, words.reliabilities(rows)),
            "## By effect",
            _table(words.FAMILY_HEADS, words.families(rows)),
            "## Outside of the catalogue",
            _table(("kind", "detectable", "unknown or learned", "axis and place", "a name"), _outside(rows)),
            "## By condition",
            _table(words.TAG_HEADS, [line for line in words.tags(rows) if line[0] in CONDITIONS]),
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
