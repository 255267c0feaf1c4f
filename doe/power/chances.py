"""How likely a diagnosis is to find an effect in planned readings, and to name it.

*Found*: "nothing missing" is less probable than :data:`doe.diagnosis.hypotheses.ALARM`. The chi-square that an effect
shows follows the noncentral chi-square distribution, with as many degrees of freedom as it has amplitudes; it must pass
what the diagnosis charges for the effect's numbers, shapes and prior probability. *Named*: the right family at its
place has the share :data:`doe.diagnosis.hypotheses.NAME` of all probability; the log odds between two candidates are
normal, with a variance of twice their mean. An effect that is found but has a twin is not named.

What linear theory leaves out are constants, set by made-up sets that check nothing (docs/validation/power.md): the
diagnosis does not know the noise, so evidence grows with the logarithm of chi-square; laws may bend
(:mod:`doe.diagnosis.doubts`); and names fail checks for reasons that are none of the plan's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit, logit, logsumexp, ndtr
from scipy.stats import binom, ncx2

from doe.certainty.verdicts import ALARM, NAME
from doe.diagnosis.hypotheses import NONE, UNKNOWN, is_learned
from doe.power.planned import Explained, Planned
from robots.arrays import Array

# The noise is told as if by so many times the set-ups and axes that are read: what set-ups usually scatter by is known.
FREEDOM: Final = 5.0
# What a law leaves beyond its doubt passes for a further effect from about this chi-square on: then nothing is named.
LEFT: Final = 120.0
# Of the effects that could be named so many pass all checks.
CEILING: Final = 0.95
# The false alarms: nothing is missing, something is found.
ALARMS: Final = 0.03
# Standard deviations of the logit of a chance, from effect to effect: found, and named.
SPREAD: Final = (0.8, 0.8)
POWER: Final = 0.8
# Shares in practice are those of so many campaigns; what lies beyond each end of the interval.
CAMPAIGNS: Final = 20
TAIL: Final = 0.025
# Beyond so many times the largest usual size nobody asks whether an effect would be found.
BEYOND: Final = 10.0


@dataclass(frozen=True)
class Chance:
    """A probability with the 95 % interval in which the share of :data:`CAMPAIGNS` campaigns should lie."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, spread: float) -> Chance:
        """The chance with its interval; ``spread``: standard deviation of its logit, beside which shares scatter."""
        node, weight = np.polynomial.hermite_e.hermegauss(21)
        p = expit(logit(np.clip(value, 0.005, 0.995)) + spread * node)
        count = np.arange(CAMPAIGNS + 1)
        sure = np.cumsum(binom.pmf(count, CAMPAIGNS, p[:, None]).T @ (weight / weight.sum()))
        low, high = (float(count[np.searchsorted(sure, at)]) / CAMPAIGNS for at in (TAIL, 1.0 - TAIL))
        return cls(value, min(low, value), max(high, value))


@dataclass(frozen=True, eq=False)
class Chances:
    """Of d changes by one effect: chances (d,) to be found and named, and the strongest rival's code of each."""

    found: Array
    named: Array
    rival: tuple[str, ...]


def told(p: Planned, chi2: Array) -> Array:
    """Chi-square (...) as it counts where the noise has to be told from the same readings."""
    nu = FREEDOM * p.freedom
    return np.asarray(nu * np.log1p(chi2 / nu))


def found_alone(p: Planned, code: str, chi2: Array, charge: float) -> Array:
    """Chance (...) that an effect of a chi-square (...) is found; ``charge``: what its evidence pays, as chi-square."""
    need = charge + 2.0 * (p.log_prior[NONE] - p.log_prior[code] + math.log((1.0 - ALARM) / ALARM))
    return _beyond(told(p, chi2), need, max(len(p.effects[code].amplitudes), 1))


def _beyond(chi2: Array, need: Array | float, freedom: int) -> Array:
    """Chance that a noncentral chi-square passes what is needed; false alarms are always there."""
    sure = ncx2.sf(np.maximum(need, 1e-9), freedom, np.maximum(chi2, 1e-9))
    return np.asarray(np.maximum(np.where(np.asarray(need) <= 0.0, 1.0, np.nan_to_num(sure)), ALARMS))


def chances(p: Planned, code: str, e: Explained, which: slice) -> Chances:
    """Chances of an effect whose changes of the readings are those numbered ``which``."""
    worth = _worth(p, e, which)
    total = e.total[which]
    effects = [c for c in worth if c != NONE]
    none = worth[NONE]
    need = told(p, total) - 2.0 * (
        logsumexp([worth[c] for c in effects], axis=0) - none - math.log((1.0 - ALARM) / ALARM)
    )
    found = _beyond(told(p, total), need, max(len(p.effects[code].amplitudes), 1))
    named, rival = _named(p, code, worth)
    nothing_left = ncx2.cdf(LEFT, 1, np.maximum(_beyond_doubt(p, e, which, code), 1e-9))
    return Chances(found, CEILING * found * named * nothing_left, rival)


def _worth(p: Planned, e: Explained, which: slice) -> dict[str, Array]:
    """Log posterior (d,) of each candidate and of nothing missing, up to a constant."""
    total, nu = e.total[which], FREEDOM * p.freedom
    out = {NONE: np.full(len(total), p.log_prior[NONE])}
    for code in p.candidates:
        left = _beyond_doubt(p, e, which, code)
        gain = 0.5 * nu * np.log((nu + total) / (nu + left)) - 0.5 * e.charge(code)[which]
        out[code] = gain + p.log_prior[code]
    return out


def _beyond_doubt(p: Planned, e: Explained, which: slice, code: str) -> Array:
    """Chi-square (d,) that a candidate leaves beyond what its law may be off by."""
    doubt = p.s.known[code].law_doubt
    return np.asarray(np.maximum(e.left[code][which] - doubt**2 * e.total[which], 0.0))


def _named(p: Planned, code: str, worth: Mapping[str, Array]) -> tuple[Array, tuple[str, ...]]:
    """Chance (d,) that the right family has its share of the probability, and the strongest rival of each."""
    known, family = p.s.known, p.effects[code].family
    codes = [c for c in worth if c not in (NONE, UNKNOWN)]
    right = [c for c in codes if known[c].family == family and not is_learned(c)]
    if not right:
        return np.zeros(len(worth[NONE])), tuple(NONE for _ in worth[NONE])
    best = np.array(right)[np.argmax([worth[c] for c in right], axis=0)]
    chance, rivals = np.zeros(len(best)), []
    for k, top in enumerate(best):
        kin = {c for c in right if known[c].place == known[top].place}
        other = {c: float(worth[c][k]) for c in worth if c not in kin}
        rival = max(other, key=lambda c: other[c])
        mine = logsumexp([worth[c][k] for c in kin])
        margin = mine - logsumexp(list(other.values())) - math.log(NAME / (1.0 - NAME))
        chance[k] = ndtr(margin / math.sqrt(max(2.0 * abs(mine - other[rival]), 1.0)))
        rivals.append(rival)
    return chance, tuple(rivals)


def smallest(p: Planned, code: str, e: Explained, which: slice) -> float | None:
    """The size of an effect that is found with :data:`POWER`: its first amplitude, in the middle of its changes.

    Each change of the readings is taken as so many times larger or smaller. None where nothing of up to :data:`BEYOND`
    times the largest usual size is found.
    """
    effect = p.effects[code]
    if not effect.amplitudes:
        return None
    chi2 = np.geomspace(1e-2, 1e8, 2000)
    power = found_alone(p, code, chi2, float(np.median(e.charge(code)[which])))
    need = float(np.interp(POWER, np.maximum.accumulate(power), chi2, right=np.inf))
    size = float(np.median(e.size[code][which] * np.sqrt(need / np.maximum(e.total[which], 1e-300))))
    return size * effect.parameters[effect.amplitudes[0]].size[1] if 0.0 < size < BEYOND else None
