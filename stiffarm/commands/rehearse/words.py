"""What a rehearsal says, each outcome as it is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rehearsal.possible import NOTHING
from rehearsal.scoring import DETECTABLE, OUTCOMES, Share
from stiffarm.commands.rehearse.step import Number, Rehearsed

# What an outcome is called where nothing was hidden.
OF_NOTHING = {"named": "rightly nothing found", "wrong": "a false alarm", "unnamed": "something suspected"}


def outcome(r: Rehearsed) -> str:
    """The outcome of one draw."""
    if r.world.code == NOTHING:
        return OF_NOTHING[r.outcome]
    if r.outcome == "named" and r.world.code not in r.verdict.found:
        return "rightly called unknown"
    if r.outcome == "wrong" and r.world.code in r.verdict.not_testable:
        return "wrong, for an effect that it called not testable"
    too_many = r.outcome in ("named", "family") and r.verdict.sure > 1
    return OUTCOMES[r.outcome] + (", plus one too many" if too_many else "")


def headline(r: Rehearsed) -> str:
    """What was hidden and what came of it, in one sentence."""
    hidden = "nothing" if r.world.code == NOTHING else r.world.code
    return f"Hidden was {hidden}; the diagnosis {said(r)}: {outcome(r)}."


def said(r: Rehearsed) -> str:
    """What the diagnosis said."""
    v = r.verdict
    sure, open_ = ", ".join(v.found[: v.sure]), ", ".join(v.found[v.sure :])
    if v.kind == "named":
        return f"named {sure}" + (f" (and, not sure, {open_})" if open_ else "")
    if v.kind == "none":
        return "found nothing missing"
    if v.kind == "uninformative":
        return "said that the readings say nothing about the arm"
    if v.kind == "unknown":
        return "found something that it does not know" + (f" ({', '.join(v.found)} in part)" if v.found else "")
    left = [code for code in r.diagnosed.credible if code not in (NOTHING, "unknown")]
    return f"left several candidates, {', '.join(dict.fromkeys([*v.found, *left]))}"


def visible(r: Rehearsed) -> str:
    """Whether the readings could show it at all."""
    if r.world.code == NOTHING:
        return "There was nothing to find."
    if r.is_visible:
        return (
            f"These readings can show it: springs leave a chi-square of {r.excess:.3g} ({DETECTABLE:g} or more "
            "counts as visible)."
        )
    return (
        "These readings can hardly show it: even without other errors, springs leave only a chi-square of "
        f"{r.excess:.3g} ({DETECTABLE:g} or more would count as visible)."
    )


def gap(r: Rehearsed) -> str:
    """The gap before and after, on poses held out."""
    if r.gap_mm is None:
        return "No poses were held out: within the measured angles the arm can take no others."
    before, after = r.gap_mm
    text = (
        f"At held-out poses, against the true values without noise, the error is {before:.4f} mm RMS with springs alone"
    )
    return f"{text} and {after:.4f} mm with the effects found." if r.verdict.found else f"{text}; nothing was added."


def numbers(r: Rehearsed) -> list[tuple[str, ...]]:
    """Rows of a table: name, true, found, interval, whether the true one lies inside."""
    return [_row(n) for n in r.numbers]


def _row(n: Number) -> tuple[str, ...]:
    ends = "-" if n.interval95 is None else f"{n.interval95[0]:.4g} to {n.interval95[1]:.4g}"
    inside = "-" if n.is_inside is None else "yes" if n.is_inside else "no"
    found = "-" if n.found is None else f"{n.found:.4g}"
    unit = "" if n.unit == "1" else f" {n.unit}"
    return n.name, f"{n.true:.4g}{unit}", found, ends, inside


def tally(draws: Sequence[Rehearsed]) -> list[tuple[str, str, str, str]]:
    """Rows: outcome, how many of all, of those that the readings could show."""
    every, seen = Counter(map(outcome, draws)), Counter(outcome(r) for r in draws if r.is_visible)
    return [
        (name, str(count), f"{100 * count / len(draws):.0f} %", str(seen[name])) for name, count in every.most_common()
    ]


def right(draws: Sequence[Rehearsed]) -> tuple[Share, Share]:
    """How many were right by the blind study's measure: of all draws, and of those that the readings could show."""
    seen = [r for r in draws if r.is_visible]
    return Share(sum(r.is_right for r in draws), len(draws)), Share(sum(r.is_right for r in seen), len(seen))


def share(s: Share) -> str:
    """``17 of 20 (85 %; 95 % interval 62 to 97 %)``."""
    if s.of == 0:
        return "none of none"
    low, high = s.interval95
    rate = 100 * s.count / s.of
    return f"{s.count} of {s.of} ({rate:.0f} %; 95 % interval {100 * low:.0f} to {100 * high:.0f} %)"


def summary(draws: Sequence[Rehearsed]) -> list[str]:
    """The answer in a few sentences."""
    if len(draws) == 1:
        r = draws[0]
        return [headline(r), visible(r), gap(r)]
    every, seen = right(draws)
    return [
        f"{len(draws)} draws; the right family came first in {share(every)}.",
        f"Of those that the readings could show, in {share(seen)}.",
    ]
