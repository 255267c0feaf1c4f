"""Hypotheses about what a model is missing: none, each effect of the catalogue, something unknown; what to do next."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from doe.certainty.verdicts import ALARM, FURTHER, GAIN, NAME, PRIOR_NONE, PRIOR_UNKNOWN
from doe.diagnosis.evidence import Base, LeftOut
from doe.diagnosis.fits import Fitted
from doe.diagnosis.scatter import NoisePrior
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature
from doe.estimation.noise import Noise
from fem.effects.base import Effect, EffectParameter
from fem.effects.learned import axes_of, learned_place
from fem.effects.learned_parts import FAMILY as LEARNED

NONE, UNKNOWN = "none", "unknown"
# Prior probability of something that the catalogue does not know and that acts at one place along one variable.
PRIOR_LEARNED = 0.03
# What a ranking may go by.
Worth = Literal["evidence", "bic", "left-out"]

# Readings that tell nothing about the arm ("uninformative") cannot say either that nothing is missing from its model.
Kind = Literal["none", "named", "learned", "ambiguous", "unknown", "uninformative"]

# An amplitude is beyond its plausible range where it is so by this factor, and by so many standard deviations.
SLACK, SURELY = 1.25, 2.0
# Then it is a name only where nothing else comes near it in log evidence.
CLEAR = 20.0
# Beside something unknown a further effect must have at least this probability to be taken up.
CREDIBLE = 0.05


@dataclass(frozen=True)
class Options:
    """How to weigh hypotheses; the parts that an ablation may leave out.

    ``for_record``: whether to look once more after the last effect that can be taken up.
    """

    pose_term: bool = True
    priors: bool = True
    by: Worth = "evidence"
    prior_none: float = PRIOR_NONE
    noise: NoisePrior = NoisePrior()  # noqa: RUF009 - frozen
    for_record: bool = True


@dataclass(frozen=True)
class Hypothesis:
    """One line of the ranking.

    ``code``: of an effect, "none" or "unknown"; ``log_evidence``; ``bic``; ``probability``; ``judged``: each pose
    predicted from the others, and the RMS error (mm), worked out when asked for; ``signature`` and ``fit``: the
    effect's best shape and its amplitudes; ``noise``: the noise that goes best with it; ``usual_excess``: rise of chi-
    square by an effect of usual size; ``axis``: of the unknown, what it varies with most probably.
    """

    code: str
    log_evidence: float
    bic: float
    probability: float
    noise: Noise
    judged: Callable[[], tuple[LeftOut, float]] = field(repr=False)
    signature: Signature | None = None
    fit: Fitted | None = None
    usual_excess: float = math.nan
    axis: str = ""

    @cached_property
    def _judged(self) -> tuple[LeftOut, float]:
        return self.judged()

    @property
    def left_out(self) -> LeftOut:
        """Each pose predicted from the others."""
        return self._judged[0]

    @property
    def lopo_rms_mm(self) -> float:
        """RMS error of that, mm."""
        return self._judged[1]

    def worth(self, by: Worth) -> float:
        """What it weighs by, in logarithms."""
        if by == "bic":
            return -0.5 * self.bic
        return float(self.left_out.log_density.sum()) if by == "left-out" else self.log_evidence


@dataclass(frozen=True)
class Ranking:
    """All hypotheses, most probable first; ``hidden``: codes that these readings cannot see, with their excess.

    ``sets``: the most probable sets of what is missing, with their probabilities; "unknown" may be one of several.
    """

    hypotheses: tuple[Hypothesis, ...]
    hidden: dict[str, float]
    base: Base
    sets: tuple[tuple[frozenset[str], float], ...] = ()

    def of(self, code: str) -> Hypothesis:
        """One hypothesis by its code."""
        return next(h for h in self.hypotheses if h.code == code)

    @property
    def best(self) -> Hypothesis:
        """The most probable one."""
        return self.hypotheses[0]

    def partner(self, code: str) -> tuple[str, float]:
        """The effect that most probably acts beside one, and with what probability if that one does; "" if none."""
        with_it = [(key - {code, UNKNOWN}, p) for key, p in self.sets if code in key]
        beside: dict[str, float] = {}
        for key, p in with_it:
            for other in key:
                beside[other] = beside.get(other, 0.0) + p
        best = max(beside, key=lambda other: beside[other], default="")
        return best, beside.get(best, 0.0) / max(sum(p for _, p in with_it), 1e-300)

    def credible(self, share: float = 0.95) -> tuple[str, ...]:
        """The fewest codes that together hold a share of the probability."""
        total, out = 0.0, []
        for h in self.hypotheses:
            out.append(h.code)
            total += h.probability
            if total >= share:
                break
        return tuple(out)


def log_priors(s: Setting, codes: Sequence[str], options: Options) -> dict[str, float]:
    """Log prior probability of each hypothesis."""
    families: dict[str, list[str]] = {}
    for code in codes:
        if code not in (NONE, UNKNOWN):
            families.setdefault(s.known[code].family, []).append(code)
    named = [family for family in families if family != LEARNED]
    rest = 1.0 - options.prior_none - PRIOR_UNKNOWN - PRIOR_LEARNED
    out = {NONE: math.log(options.prior_none), UNKNOWN: math.log(PRIOR_UNKNOWN)}
    for family, members in families.items():
        share = PRIOR_LEARNED if family == LEARNED else rest / len(named)
        for code in members:
            out[code] = math.log(s.known[code].chance * share / len(members))
    return out


@dataclass(frozen=True)
class Decision:
    """What a ranking says: its kind, the effect to take up (if any), and why in a few words.

    ``same``: codes of effects that would give the very same readings.
    """

    kind: Kind
    hypothesis: Hypothesis | None
    reason: str
    same: tuple[str, ...] = ()


def decide(r: Ranking, *, further: bool = False) -> Decision:
    """Judge one ranking; ``further``: something has been found already.

    A name must also predict left-out poses better than nothing missing does. Where the unknown leads, the best effect
    is taken up all the same: two of them together may explain what none does alone.
    """
    none, unknown = r.of(NONE), r.of(UNKNOWN)
    effects = [h for h in r.hypotheses if h.code not in (NONE, UNKNOWN)]
    if none.probability >= ALARM or not effects:
        return Decision("none", None, "the readings do not ask for more than the model has")
    top, mass = effects[0], sum(h.probability for h in effects)
    if further and (mass < FURTHER * (1.0 - unknown.probability) or top.log_evidence - none.log_evidence < GAIN):
        return Decision("ambiguous", None, "what is left may be several things, or an effect's law not quite right")
    same_axis = is_learned(top.code) and unknown.axis in axes_of(top.code)
    if unknown.probability > 0.5 and not same_axis:
        if top.probability >= CREDIBLE:
            return Decision(
                "unknown", top, "no single effect of the catalogue explains the pattern over poses and loads"
            )
        if further:
            return Decision("ambiguous", None, "what is left is nothing that the catalogue knows")
        some = top if top.log_evidence > none.log_evidence + GAIN else None
        reason = "no effect of the catalogue explains the pattern over poses and loads"
        return Decision("unknown", best_law(r) or some, reason)
    if is_learned(top.code):
        return _learned(top, effects, none, unknown.probability if same_axis else 0.0)
    gain = float(top.left_out.log_density.sum() - none.left_out.log_density.sum())
    if sum(h.probability for h in effects if _is_kin(h, top)) < NAME:
        return Decision("ambiguous", top, "several effects explain the readings about equally well")
    outside, others = beyond(top), [h for h in r.hypotheses if not _is_kin(h, top)]
    if outside and top.log_evidence - max(h.log_evidence for h in others) < CLEAR:
        return Decision("ambiguous", top, f"its number {outside} lies beyond what is plausible")
    if gain <= 0.0 and top.lopo_rms_mm > none.lopo_rms_mm:
        return Decision("ambiguous", top, "it fits, but does not predict poses left out")
    return Decision("named", top, "it explains the readings and predicts poses left out")


def best_law(r: Ranking) -> Hypothesis | None:
    """Of laws learned at one place the one that goes best with the readings; None where none explains anything."""
    laws = [h for h in r.hypotheses if is_learned(h.code)]
    best = max(laws, key=lambda h: h.log_evidence, default=None)
    return best if best is not None and best.log_evidence > r.of(NONE).log_evidence + GAIN else None


def _is_kin(h: Hypothesis, top: Hypothesis) -> bool:
    """Whether a hypothesis is of the same family at the same place: cured alike, it need not be told apart."""
    if h.signature is None or top.signature is None:
        return h is top
    a, b = h.signature.effect, top.signature.effect
    return a.family == b.family and a.place == b.place


def beyond(h: Hypothesis) -> str:
    """Name of the first amplitude that is surely larger than is plausible; empty where none is."""
    if h.fit is None or h.signature is None:
        return ""
    effect = h.signature.effect
    sd = np.sqrt(np.diag(h.fit.covariance))
    for k, v, s in zip(effect.amplitudes, h.fit.mean, sd, strict=True):
        p = effect.parameters[k]
        if too_large(p, float(v), float(s)):
            return p.name
    return ""


def too_large(p: EffectParameter, acts: float, sd: float) -> bool:
    """Whether an amplitude, as it acts, or a shape is surely larger than is plausible."""
    return abs(acts) - SURELY * sd > SLACK * p.size[1]


def too_small(p: EffectParameter, acts: float, sd: float) -> bool:
    """Whether it is surely smaller."""
    return abs(acts) + SURELY * sd < p.size[0] / SLACK


def is_learned(code: str) -> bool:
    """Whether a code is of a law that was learned, not of an effect of the catalogue."""
    return code.startswith(LEARNED)


def clash(one: Effect, other: Effect) -> bool:
    """Whether two effects would only correct one another: of one slot, or one learned beside another at one place."""
    if one.place != other.place:
        return False
    return bool(one.slot and one.slot == other.slot) or is_learned(one.code) or is_learned(other.code)


def _learned(top: Hypothesis, effects: Sequence[Hypothesis], none: Hypothesis, unknown: float) -> Decision:
    """A law learned at one place: sure where laws along other axes there are its only rivals.

    ``unknown``: probability of something unknown along the same axis, which the law stands for.
    """
    place = learned_place(top.code)
    learned = [h for h in effects if is_learned(h.code)]
    own = sum(h.probability for h in learned if learned_place(h.code) == place)
    there = own + unknown * own / sum(h.probability for h in learned)
    gain = float(top.left_out.log_density.sum() - none.left_out.log_density.sum())
    if there < NAME:
        return Decision("ambiguous", top, "laws at several places explain the readings about equally well")
    if gain <= 0.0 and top.lopo_rms_mm > none.lopo_rms_mm:
        return Decision("unknown", top, "no effect of the catalogue explains the pattern over poses and loads")
    return Decision("learned", top, "no effect of the catalogue does so, but a law learned at this place does")
