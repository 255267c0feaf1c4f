"""What came of the sets of a study, counted strictly.

- A verdict of ``unknown`` or ``none`` is an answer of its own, never that of an effect it tried on the way.
- An effect is *named* where the verdict takes it for sure; the most probable one of an ambiguous verdict only leads.
- A wrong name is one that is not of the family of anything hidden, whatever else was named beside it.
- A set whose readings were refused, or that the program failed at, counts and is never right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from rehearsal.scoring import DETECTABLE, Share, family

Kind = Literal["none", "single", "outside", "pair"]
KINDS: dict[Kind, str] = {
    "single": "one effect of the catalogue",
    "none": "nothing hidden",
    "outside": "outside of the catalogue",
    "pair": "two or more effects of the catalogue",
}
# What the held-out error should shrink to, of its size before, in the median.
SHRINK: dict[Kind, float] = {"single": 0.2, "outside": 0.5}
# Stated probabilities are compared with shares right between these.
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)


@dataclass(frozen=True)
class Row:
    """What came of one set.

    ``hidden``: codes; ``axes``, ``places``: along and at which they act; ``excess``: chi-square of all of them that no
    springs take up, ``each`` of one by one (NaN: not known). ``verdict``: named, ambiguous, unknown, none,
    uninformative, learned, refused (the readings) or failed (a fault of the program); ``named``: codes taken for sure;
    ``found``: all taken up, the sure ones first; ``probability``: of what leads; ``learned``: what it acts along, and
    where, as the diagnosis says of an effect that it cannot name. ``before_mm``, ``after_mm``: RMS errors against the
    truth without noise in other set-ups.
    """

    name: str
    kind: Kind
    hidden: tuple[str, ...]
    axes: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    excess: float = float("nan")
    each: tuple[float, ...] = ()
    tags: Mapping[str, Any] = field(default_factory=dict)
    world: str = ""
    first_joint: str = "j1"
    verdict: str = "refused"
    reason: str = ""
    named: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    probability: float = float("nan")
    set95: tuple[str, ...] = ()
    not_testable: tuple[str, ...] = ()
    learned: tuple[tuple[str, str], ...] = ()
    before_mm: float = float("nan")
    after_mm: float = float("nan")
    seconds: float = float("nan")

    def family(self, code: str) -> str:
        """Family of a code, for counting."""
        return family(code, self.first_joint)

    @property
    def families(self) -> set[str]:
        """Families of what is hidden."""
        return {self.family(code) for code in self.hidden}

    @property
    def leading(self) -> str:
        """The code that leads a named or ambiguous verdict; else the verdict."""
        return self.found[0] if self.verdict in ("named", "ambiguous") and self.found else self.verdict

    @property
    def is_detectable(self) -> bool:
        """Whether the readings can show what is hidden: all of it, where there are several."""
        if not self.hidden:
            return False
        least = min(self.each) if len(self.each) > 1 else self.excess
        return bool(least >= DETECTABLE)

    @property
    def is_right(self) -> bool:
        """Whether what leads is of a hidden family; of nothing hidden: whether it says so."""
        if not self.hidden:
            return self.verdict == "none"
        return self.family(self.leading) in self.families

    @property
    def is_exact(self) -> bool:
        """Whether the code that leads is hidden."""
        return self.leading in self.hidden

    @property
    def wrong_names(self) -> tuple[str, ...]:
        """Names of effects that are not hidden."""
        return tuple(code for code in self.named if self.family(code) not in self.families)

    @property
    def is_named_right(self) -> bool:
        """Whether everything hidden was named, and nothing else."""
        return bool(self.named) and not self.wrong_names and {self.family(c) for c in self.named} == self.families

    @property
    def is_placed(self) -> bool:
        """Whether an effect that nobody catalogued was called unknown or learned, and its axis and place told."""
        if self.verdict not in ("unknown", "learned"):
            return False
        return any(axis in self.axes and place in self.places for axis, place in self.learned)


@dataclass(frozen=True)
class Score:
    """One line of the table: a share with its aim ("at least", "at most" or none), and of which sets."""

    name: str
    share: Share
    aim: float | None = None
    at_most: bool = False

    @property
    def is_met(self) -> bool | None:
        """Whether the aim is met; None without an aim or a set."""
        if self.aim is None or not self.share.of:
            return None
        rate = self.share.count / self.share.of
        return rate <= self.aim if self.at_most else rate >= self.aim


def share(rows: Iterable[Row], holds: Callable[[Row], bool]) -> Share:
    """In how many of the rows something holds."""
    some = [bool(holds(r)) for r in rows]
    return Share(sum(some), len(some))


def scores(rows: Sequence[Row]) -> list[Score]:
    """The table of a study, line by line."""
    of = {kind: [r for r in rows if r.kind == kind] for kind in KINDS}
    seen = [r for r in of["single"] if r.is_detectable]
    dim = [r for r in of["single"] if np.isfinite(r.excess) and not r.is_detectable]
    strange = [r for r in of["outside"] if r.is_detectable]
    pairs = [r for r in of["pair"] if r.is_detectable]
    xyz = [r for r in seen if r.tags.get("reads") == "xyz"]
    lines = [
        Score("right family leads, detectable", share(seen, lambda r: r.is_right), 0.95),
        Score("the same, X, Y and Z read", share(xyz, lambda r: r.is_right), 0.98),
        Score("exact code leads, detectable", share(seen, lambda r: r.is_exact), 0.88),
        Score("truth in the 95 % set, detectable", share(seen, lambda r: bool({*r.hidden} & {*r.set95})), 0.96),
        Score("named and right, detectable", share(seen, lambda r: r.is_named_right), 0.80),
        Score("a wrong name, all sets", share(rows, lambda r: bool(r.wrong_names)), 0.02, at_most=True),
        Score('nothing hidden: anything but "none"', share(of["none"], lambda r: not r.is_right), 0.02, at_most=True),
        Score("nothing hidden: a name", share(of["none"], lambda r: bool(r.named))),
        Score(
            "more effects named than there are, all sets",
            share(rows, lambda r: len(r.named) > len(r.hidden)),
            0.02,
            at_most=True,
        ),
        Score("not detectable: none, ambiguous or rightly named", share(dim, _modest), 0.98),
        Score("outside: unknown or learned", share(strange, lambda r: r.verdict in ("unknown", "learned"))),
        Score("outside: the same with the right axis and place", share(strange, lambda r: r.is_placed), 0.90),
        Score("outside: a name", share(strange, lambda r: bool(r.named))),
        Score("pairs: one right", share(pairs, lambda r: bool(_taken(r) & r.families)), 0.98),
        Score("pairs: both right", share(pairs, lambda r: _taken(r) >= r.families), 0.80),
        Score(
            "held-out error grew, detectable",
            share(_judged(rows), lambda r: r.after_mm > r.before_mm),
            0.02,
            at_most=True,
        ),
        Score("refused, all sets", share(rows, lambda r: r.verdict == "refused")),
        Score("failed, all sets", share(rows, lambda r: r.verdict == "failed"), 0.0, at_most=True),
    ]
    return lines


def _modest(r: Row) -> bool:
    return r.verdict in ("none", "ambiguous") or r.is_named_right


def _taken(r: Row) -> set[str]:
    """Families that a verdict stands for: all named; of an ambiguous one all that it took up."""
    return {r.family(code) for code in (r.found if r.verdict in ("named", "ambiguous") else ())}


def _judged(rows: Iterable[Row]) -> list[Row]:
    return [r for r in rows if r.is_detectable and r.before_mm > 0.0 and np.isfinite(r.after_mm)]


def shrinkage(rows: Iterable[Row]) -> dict[Kind, tuple[float, int]]:
    """Median of the held-out error after over before, by kind, and of how many detectable sets."""
    out = {}
    judged = _judged(rows)
    for kind in KINDS:
        ratio = [r.after_mm / r.before_mm for r in judged if r.kind == kind]
        if ratio:
            out[kind] = float(np.median(ratio)), len(ratio)
    return out


def by_family(rows: Iterable[Row]) -> list[tuple[str, int, Share, Share, Share]]:
    """Single effects by family: sets, and of the detectable ones right family, exact code, named and right."""
    groups: dict[str, list[Row]] = {}
    for r in rows:
        if r.kind == "single":
            groups.setdefault(r.hidden[0].partition(":")[0], []).append(r)
    out = []
    for name, some in sorted(groups.items()):
        seen = [r for r in some if r.is_detectable]
        out.append(
            (
                name,
                len(some),
                share(seen, lambda r: r.is_right),
                share(seen, lambda r: r.is_exact),
                share(seen, lambda r: r.is_named_right),
            )
        )
    return out


def by_tag(rows: Iterable[Row]) -> list[tuple[str, str, Share, Share]]:
    """By each tag's value: right family of the detectable singles, and wrong names among all sets.

    Tags that are lists or tables, and those of many values, are left out.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for r in rows:
        for tag, value in {**r.tags, "world": r.world}.items():
            if not isinstance(value, str | float | int | bool):
                continue
            groups.setdefault((tag, str(value)), []).append(r)
    tags = {tag for tag, _ in groups}
    some = [tag for tag in sorted(tags) if 1 < sum(one == tag for one, _ in groups) <= 12]
    return [
        (
            tag,
            value,
            share([r for r in rows if r.kind == "single" and r.is_detectable], lambda r: r.is_right),
            share(rows, lambda r: bool(r.wrong_names)),
        )
        for (tag, value), rows in sorted(groups.items())
        if tag in some
    ]


@dataclass(frozen=True)
class Reliability:
    """Sets whose leading effect was stated with a probability between ``low`` and ``high``: how many were right."""

    low: float
    high: float
    stated: float
    right: Share

    @property
    def holds(self) -> bool:
        """Whether the stated mean lies in the exact 95 % interval of the share right."""
        low, high = self.right.interval95
        return low <= self.stated <= high


def reliability(rows: Iterable[Row]) -> list[Reliability]:
    """Stated probabilities beside shares right, of all sets where an effect leads."""
    led = [r for r in rows if r.verdict in ("named", "ambiguous") and np.isfinite(r.probability)]
    out = []
    for low, high in pairwise(BINS):
        mine = [r for r in led if low <= r.probability < high or (high == BINS[-1] and r.probability == high)]
        if mine:
            out.append(
                Reliability(low, high, float(np.mean([r.probability for r in mine])), share(mine, lambda r: r.is_right))
            )
    return out
