"""What a diagnosis made of what was hidden, told as it is: one measure for rehearsals and for the blind study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from scipy.stats import binomtest

from rehearsal.possible import NOTHING

# Chi-square that no springs take up: from here on readings can show an effect at all.
DETECTABLE = 30.0
# Effects that act alike and are cured alike: a compensator is a stiffness that varies with the angle.
FAMILY = {
    "gravity-compensator": "angle-dependent-stiffness",
    "tool-point-offset": "load-point-offset",
    "angle-sign": "angle-convention",
    "angle-offset": "angle-convention",
    "angle-coupling": "angle-convention",
}

Outcome = Literal["named", "family", "candidate", "unnamed", "not testable", "nothing", "wrong"]
OUTCOMES: dict[Outcome, str] = {
    "named": "named right",
    "family": "the right family named",
    "candidate": "one of the candidates left",
    "unnamed": "something found, but unknown",
    "not testable": "said to be not testable",
    "nothing": "nothing found",
    "wrong": "wrong",
}


def family(code: str, first_joint: str = "j1") -> str:
    """Family of a code, for counting; behind a vertical first axis the joint's tilt is the base's."""
    if code == f"joint-tilt:{first_joint}":
        return "base-tilt"
    kind = code.partition(":")[0]
    return FAMILY.get(kind, kind)


@dataclass(frozen=True)
class Verdict:
    """What a diagnosis said.

    ``kind``: named, ambiguous, unknown, none, uninformative; ``found``: codes taken up, the sure ones first, ``sure``
    of them; ``left``: codes that it would not rule out, twins of what it found among them; ``not_testable``: codes that
    it says the readings cannot show; ``first_joint``: the arm's.
    """

    kind: str
    found: tuple[str, ...]
    sure: int
    left: tuple[str, ...]
    not_testable: tuple[str, ...]
    first_joint: str = "j1"

    def is_right(self, hidden: Sequence[str]) -> bool:
        """Whether what it took up first, sure or most probable, is of the right family; nothing where that is so.

        Where it says "unknown" or "none" that is its answer, whatever it tried on the way.
        """
        answers = self.found if self.kind in ("named", "ambiguous") else ()
        first = family(answers[0] if answers else self.kind, self.first_joint)
        return first == (family(hidden[0], self.first_joint) if hidden else NOTHING)


def outcome(hidden: str, verdict: Verdict, known: bool = True) -> Outcome:
    """What came of one hidden code (``none``: nothing was hidden).

    ``known``: whether the diagnosis knows such an effect at all; else "unknown" is what it should say.
    """
    v = verdict
    if hidden == NOTHING:
        return "named" if v.kind == "none" else "wrong" if v.sure else "unnamed"
    if not known and v.kind == "unknown":
        return "named"
    named = v.kind == "named"
    if named and hidden in v.found[: v.sure]:
        return "named"
    if named and family(hidden, v.first_joint) in {family(code, v.first_joint) for code in v.found[: v.sure]}:
        return "family"
    if v.kind in ("none", "uninformative"):
        return "not testable" if hidden in v.not_testable else "nothing"
    if hidden in (*v.found, *v.left):
        return "candidate"
    return "unnamed" if v.kind == "unknown" else "wrong"


@dataclass(frozen=True)
class Share:
    """``count`` of ``of``, with the exact 95 % interval of its probability (Clopper and Pearson)."""

    count: int
    of: int

    @property
    def interval95(self) -> tuple[float, float]:
        """Lower and upper end; 0 to 1 where there is none."""
        if self.of == 0:
            return 0.0, 1.0
        ci = binomtest(self.count, self.of).proportion_ci(0.95, "exact")
        return float(ci.low), float(ci.high)
