"""A study in words: the answer in a few sentences, the scores as rows of tables."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.diagnosis.study.scores import (
    KINDS,
    SHRINK,
    Row,
    Score,
    by_family,
    by_tag,
    reliability,
    scores,
    shrinkage,
)
from rehearsal.scoring import DETECTABLE, Share

HEADS = ("of", "share", "sets", "95 % interval", "target", "met")
FAMILY_HEADS = ("effect", "sets", "detectable", "right family", "exact", "named and right")
TAG_HEADS = ("tag", "value", "right family leads, detectable singles", "a wrong name, all sets")
# Shares of fewer sets than this are counts.
FEW = 10
# Rates of fewer sets than this tell little.
TELLING = 50
RELIABILITY_HEADS = ("stated", "mean stated", "right", "95 % interval", "holds")


def rate(s: Share) -> str:
    """``85.0 % of 20``; of a few ``2 of 3``, for percents say too much of them; a dash where there is none."""
    if not s.of:
        return "-"
    return f"{100 * s.count / s.of:.1f} % of {s.of}" if s.of >= FEW else f"{s.count} of {s.of}"


def _counted(s: Share) -> str:
    if not s.count or s.of < FEW:
        return str(s.count or "none")
    return f"{s.count} ({100 * s.count / s.of:.1f} %)"


def _sets(count: int) -> str:
    return f"{count} set" if count == 1 else f"{count} sets"


def interval(s: Share) -> str:
    """The exact interval, in percent."""
    low, high = s.interval95
    return f"{100 * low:.0f} to {100 * high:.0f} %" if s.of else "-"


def lines(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """The table of scores; scores of no set are left out."""
    found = [_line(s) for s in scores(rows) if s.share.of]
    for kind, (median, count) in shrinkage(rows).items():
        aim = SHRINK.get(kind)
        goal, met = ("", "") if aim is None else (f"at most {aim:.2f}", "yes" if median <= aim else "no")
        name = f"held-out error after / before, median; {KINDS[kind]}"
        found.append((name, f"{median:.2f}", str(count), "", goal, met))
    return found


def _line(s: Score) -> tuple[str, ...]:
    aim = "" if s.aim is None else f"{'at most' if s.at_most else 'at least'} {100 * s.aim:.0f} %"
    met = {None: "", True: "yes", False: "no"}[s.is_met]
    share = f"{100 * s.share.count / s.share.of:.1f} %" if s.share.of >= FEW else rate(s.share)
    return (s.name, share, str(s.share.of), interval(s.share), aim, met)


def families(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Single effects by family."""
    return [
        (name, str(count), str(right.of), *(str(s.count) if s.of else "-" for s in (right, exact, named)))
        for name, count, right, exact, named in by_family(rows)
    ]


def tags(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """By each tag's value."""
    return [(tag, value, rate(right), rate(wrong)) for tag, value, right, wrong in by_tag(rows)]


def reliabilities(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Stated probabilities beside shares right."""
    return [
        (
            f"{100 * b.low:.0f} to {100 * b.high:.0f} %",
            f"{100 * b.stated:.1f} %",
            rate(b.right),
            interval(b.right),
            "yes" if b.holds else "no",
        )
        for b in reliability(rows)
    ]


def summary(rows: Sequence[Row]) -> list[str]:
    """The answer in a few sentences."""
    by = {s.name: s.share for s in scores(rows)}
    out = []
    led, named = by["right family leads, detectable"], by["named and right, detectable"]
    if named.of:
        out.append(
            f"{_sets(named.of)} with one effect that the readings can show (chi-square {DETECTABLE:.0f} and more): the "
            f"right family leads in {_counted(led)}, and {_counted(named)} {'was' if named.count == 1 else 'were'} "
            "named correctly."
        )
    wrong, calm = by["a wrong name, all sets"], by["nothing hidden: a name"]
    out.append(f"A wrong name was given in {_counted(wrong)} of {_sets(wrong.of)}.")
    if calm.of:
        out.append(f"With nothing hidden, {_counted(calm)} of {_sets(calm.of)} got a name.")
    refused = by["refused, all sets"]
    if refused.count:
        out.append(f"{refused.count} of {refused.of} sets were refused, which counts as wrong; rows.csv says why.")
    failed = by["failed, all sets"]
    if failed.count:
        out.append(f"The program failed on {failed.count} sets: please report what rows.csv says about them.")
    return out


def todo(rows: Sequence[Row]) -> str:
    """What to do with such a result."""
    missed = [s.name for s in scores(rows) if s.is_met is False]
    if missed:
        return (
            f"Targets missed: {'; '.join(missed)}. rows.csv lists every set: start with those that have a wrong name."
        )
    if len(rows) < TELLING:
        return (
            f"{_sets(len(rows))} are too few to trust a rate: look at the intervals, and use {TELLING} sets or more. "
            "rows.csv lists every set."
        )
    return "All targets are met. rows.csv lists every set."
