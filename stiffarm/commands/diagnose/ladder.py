"""A diagnosis as one ladder: what each look took up, how the error fell, how probable it was and is, what is open.

Every figure that a page gives of these comes from here, so that no two of them differ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from doe.diagnosis.checks import Check, stated
from doe.diagnosis.diagnose import Diagnosis, Found, state_of
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from robots.quantities import percent, significant
from stiffarm.commands.diagnose.check_words import AGAINST
from stiffarm.pages.report import Table


@dataclass(frozen=True)
class Rung:
    """What one look took up.

    ``error_mm``: at poses left out one at a time, before and after; ``then``, ``now``: probability among all candidates
    when it was taken up, and after its checks; ``against``: the checks that failed.
    """

    code: str
    error_mm: tuple[float, float]
    then: float
    now: float
    against: tuple[Check, ...]
    provisional: bool


@dataclass(frozen=True)
class Ladder:
    """All rungs; ``start_mm``: error with springs alone.

    ``last``: the look after everything that was taken up, None where there was none; ``against_all``: checks of all
    that was taken up together that failed.
    """

    rungs: tuple[Rung, ...]
    start_mm: float
    last: Ranking | None
    against_all: tuple[Check, ...] = ()

    @cached_property
    def more(self) -> float:
        """Probability that something more is missing, by the last look; NaN where nobody looked."""
        return math.nan if self.last is None else 1.0 - self.last.of(NONE).probability

    @property
    def suspects(self) -> tuple[tuple[str, float], ...]:
        """What it would most probably be, most probable first."""
        if self.last is None:
            return ()
        return tuple((h.code, h.probability) for h in self.last.hypotheses if h.code != NONE)


def ladder_of(d: Diagnosis) -> Ladder:
    """The ladder of a diagnosis, in the order in which the new model takes the effects up."""
    codes = [e.effect.code for e in d.after.setting.accepted]
    order = sorted(d.found, key=lambda f: codes.index(f.code))
    error = errors_mm(d)
    provisional = {f.code for f in d.provisional}
    rungs = tuple(
        Rung(
            f.code, (error[k], error[k + 1]), f.probability, stated(f, d.checks), _against(d, f), f.code in provisional
        )
        for k, f in enumerate(order)
    )
    last = d.rankings[len(rungs)] if len(rungs) < len(d.rankings) else None
    return Ladder(rungs, error[0], last, tuple(c for c in d.checks if c.passed is False and not c.effect))


def errors_mm(d: Diagnosis) -> list[float]:
    """RMS error at poses left out one at a time (mm): with springs alone, and with each effect added in turn.

    All at the noise that the whole leaves: at its own noise a poorer model fits its springs loosely, and errors of
    several looks could not be compared.
    """
    out, count = [d.before.left_out_rms_mm], len(d.found)
    s, noise = d.after.setting, d.after.refit.noise
    given = len(s.accepted) - count
    out += [
        state_of(s.moved(s.springs, s.accepted[: given + k]), noise, d.weight).left_out_rms_mm for k in range(1, count)
    ]
    return [*out, d.after.left_out_rms_mm] if count else out


def _against(d: Diagnosis, f: Found) -> tuple[Check, ...]:
    return tuple(c for c in d.checks if c.passed is False and c.effect == f.code)


# Of what may be missing beside it so many are named.
NAMED: Final = 3
# Less probable ones are not.
LEAST: Final = 0.01
NAMES: Final = {NONE: "nothing missing", UNKNOWN: "something unknown"}


def ladder_table(of: Ladder) -> Table:
    """A row for each step: springs alone, each effect that was taken up, and the look after the last."""
    rows = [("springs alone", f"{significant(of.start_mm)}", "", "", "")]
    rows += [
        (
            f"+ {r.code}" + (" (provisional)" if r.provisional else ""),
            f"{significant(r.error_mm[0])} → {significant(r.error_mm[1])}",
            percent(r.then),
            percent(r.now),
            "; ".join(AGAINST[c.code] for c in r.against) or "no check speaks against it",
        )
        for r in of.rungs
    ]
    rows.append(("nothing more", "", "", "", last_words(of)))
    heads = ("accepted", "error (mm)", "then", "now", "still in doubt")
    return Table("RMS error at poses left out, and probability then and now", heads, tuple(rows), (0, 4))


def last_words(of: Ladder) -> str:
    """What the look after the last effect leaves open."""
    if of.last is None:
        return "nobody looked further: three effects are as many as are looked for"
    doubts = [AGAINST[c.code] for c in of.against_all if c.code != "nothing-left"]
    named = [f"{NAMES.get(code, code)} {percent(p)}" for code, p in of.suspects[:NAMED] if p >= LEAST]
    open_ = f"{percent(of.more)} that {'something more' if of.rungs else 'anything'} is missing"
    # A number keeps its unit on its line.
    return "; ".join([open_ + (f" ({', '.join(named)})" if named else ""), *doubts]).replace(" %", "\u00a0%")


def ladder_sentence(of: Ladder) -> str:
    """How the error fell, step by step."""
    if not of.rungs:
        return f"Springs alone leave {significant(of.start_mm)} mm (RMS) at poses left out; no effect was accepted."
    steps = [f"{r.code} to {significant(r.error_mm[1])} mm" for r in of.rungs]
    return (
        f"Springs alone leave {significant(of.start_mm)} mm (RMS) at poses left out one at a time; "
        f"{', then '.join(steps)}. “Then” is the probability among all candidates when it was accepted, “now” that "
        "after its checks."
    )
