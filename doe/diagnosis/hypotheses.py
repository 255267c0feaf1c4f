"""Hypotheses about what a model is missing: none, each effect of the catalogue, something unknown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from doe.diagnosis.evidence import Base, Fitted, LeftOut
from doe.diagnosis.scatter import NoisePrior
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature
from doe.estimation.noise import Noise

NONE, UNKNOWN = "none", "unknown"
# Prior probabilities of nothing missing and of something that the catalogue does not know; the rest is shared by
# the families of effects that the readings can see, and within a family by its members.
PRIOR_NONE, PRIOR_UNKNOWN = 0.5, 0.1


@dataclass(frozen=True)
class Options:
    """How to weigh hypotheses; the parts that an ablation may leave out."""

    pose_term: bool = True
    priors: bool = True
    by: str = "evidence"
    prior_none: float = PRIOR_NONE
    noise: NoisePrior = NoisePrior()  # noqa: RUF009 - frozen


@dataclass(frozen=True)
class Hypothesis:
    """One line of the ranking.

    ``code``: of an effect, "none" or "unknown"; ``log_evidence``; ``bic``; ``probability``; ``left_out``: each pose
    predicted from the others; ``signature`` and ``fit``: the effect's best shape and its amplitudes; ``noise``: the
    noise that goes best with it; ``usual_excess``: rise of chi-square by an effect of usual size.
    """

    code: str
    log_evidence: float
    bic: float
    probability: float
    noise: Noise
    left_out: LeftOut
    lopo_rms_mm: float
    signature: Signature | None = None
    fit: Fitted | None = None
    usual_excess: float = math.nan


@dataclass(frozen=True)
class Ranking:
    """All hypotheses, most probable first; ``hidden``: codes that these readings cannot see, with their excess."""

    hypotheses: tuple[Hypothesis, ...]
    hidden: dict[str, float]
    base: Base

    def of(self, code: str) -> Hypothesis:
        """One hypothesis by its code."""
        return next(h for h in self.hypotheses if h.code == code)

    @property
    def best(self) -> Hypothesis:
        """The most probable one."""
        return self.hypotheses[0]

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
    rest = 1.0 - options.prior_none - PRIOR_UNKNOWN
    out = {NONE: math.log(options.prior_none), UNKNOWN: math.log(PRIOR_UNKNOWN)}
    for members in families.values():
        for code in members:
            out[code] = math.log(s.known[code].chance * rest / len(families) / len(members))
    return out
