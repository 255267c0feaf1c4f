"""From a ranking to what to do next: nothing is missing, take up an effect, and whether its name is sure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from doe.diagnosis.hypotheses import NONE, UNKNOWN, Hypothesis, Ranking

# Readings that tell nothing about the arm ("uninformative") cannot say either that nothing is missing from its model.
Kind = Literal["none", "named", "ambiguous", "unknown", "uninformative"]

# Below this probability of "nothing missing" there is something to explain.
ALARM = 0.12
# A name is sure from this share of the probability of all effects on.
NAME = 0.8
# A further effect needs this probability, of all but the unknown, and this log evidence: no law is quite right, and
# what is left of one looks like another.
FURTHER, GAIN = 0.9, 5.5


@dataclass(frozen=True)
class Decision:
    """What a ranking says: its kind, the effect to take up (if any), and why in a few words."""

    kind: Kind
    hypothesis: Hypothesis | None
    reason: str


def decide(r: Ranking, *, further: bool = False) -> Decision:
    """Judge one ranking; ``further``: something has been found already.

    A name must also predict left-out poses better than nothing missing does. Where the unknown leads, the best effect
    is taken up all the same: two of them together may explain what none does alone.
    """
    none, unknown = r.of(NONE), r.of(UNKNOWN)
    named = [h for h in r.hypotheses if h.code not in (NONE, UNKNOWN)]
    if none.probability >= ALARM or not named:
        return Decision("none", None, "the readings do not ask for more than the model has")
    top, mass = named[0], sum(h.probability for h in named)
    if further and (mass < FURTHER * (1.0 - unknown.probability) or top.log_evidence - none.log_evidence < GAIN):
        return Decision("ambiguous", None, "what is left may be several things, or an effect's law not quite right")
    if unknown.probability > 0.5:
        return Decision("unknown", top, "no single effect of the catalogue explains the pattern over poses and loads")
    gain = float(top.left_out.log_density.sum() - none.left_out.log_density.sum())
    if top.probability < NAME * mass:
        return Decision("ambiguous", top, "several effects explain the readings about equally well")
    if gain <= 0.0 and top.lopo_rms_mm > none.lopo_rms_mm:
        return Decision("ambiguous", top, "it fits, but does not predict poses left out")
    return Decision("named", top, "it explains the readings and predicts poses left out")
