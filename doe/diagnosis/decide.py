"""From a ranking to a verdict: whether anything is missing, what, and whether its name holds on unseen poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from doe.diagnosis.ranking import NONE, UNKNOWN, Hypothesis, Ranking

Kind = Literal["none", "named", "ambiguous", "unknown"]

# Below this probability of "nothing missing" there is something to explain.
ALARM, FURTHER_ALARM = 0.05, 0.02
# A name is given from this share of the probability of all effects on.
NAME = 0.8
# The unknown outweighs a name from here on.
OUTSIDE = 0.5


@dataclass(frozen=True)
class Decision:
    """What a ranking says: its kind, the hypothesis that stands for it, and why in a few words."""

    kind: Kind
    hypothesis: Hypothesis | None
    reason: str


def decide(r: Ranking, *, further: bool = False) -> Decision:
    """Judge one ranking; a name must also predict left-out poses better than nothing missing does.

    ``further``: something has been found already, so that more of it needs more evidence: no law is quite right.
    """
    alarm = FURTHER_ALARM if further else ALARM
    none, unknown = r.of(NONE), r.of(UNKNOWN)
    named = [h for h in r.hypotheses if h.code not in (NONE, UNKNOWN)]
    if none.probability >= alarm or not named:
        if unknown.probability > max(none.probability, 1.0 - alarm):
            return Decision("unknown", None, "set-ups differ more than noise explains")
        return Decision("none", None, "the readings do not ask for more than the model has")
    if unknown.probability > OUTSIDE:
        return Decision("unknown", None, "no effect of the catalogue explains the pattern over poses and loads")
    top, mass = named[0], sum(h.probability for h in named)
    gain = float(top.left_out.log_density.sum() - none.left_out.log_density.sum())
    if top.probability < NAME * mass:
        return Decision("ambiguous", top, "several effects explain the readings about equally well")
    if gain <= 0.0 and top.lopo_rms_mm > none.lopo_rms_mm:
        return Decision("ambiguous", top, "it fits, but does not predict poses left out")
    return Decision("named", top, "it explains the readings and predicts poses left out")
