"""Which effects of the catalogue are worth weighing on these readings, and in which shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from doe.diagnosis.evidence import Base, Whitened, fit_all
from doe.diagnosis.scatter import covariance, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, signatures
from doe.diagnosis.weighing import as_if
from doe.estimation.noise import Noise
from fem.effects.base import Effect, PlacedEffect
from robots.arrays import Array

# Without priors amplitudes and springs have standard deviations larger by this.
VAGUE = 30.0
# An effect of usual size must raise chi-square by this to be seen at all.
SEEN = 2.0
# Laws with more shapes than this keep only the best few of them at each of a few noises.
MANY, KEPT = 40, 8


def candidates_of(s: Setting, *, priors: bool = True) -> dict[str, list[Signature]]:
    """Signatures of every effect that these readings might show, by code."""
    taken = {e.effect.code for e in s.accepted}
    out = {
        code: signatures(s, effect)
        for code, effect in s.known.items()
        if code not in taken and impossible(s, effect) is None and not _same_law(effect, s.accepted)
    }
    return out if priors else {code: [_vague(c) for c in some] for code, some in out.items()}


def _vague(c: Signature) -> Signature:
    """A signature of which nothing is known beforehand, not even its sign (an ablation)."""
    return replace(c, mean=0.0 * c.mean, sd=VAGUE * c.sd, positive=np.zeros_like(c.positive))


def pruned(
    s: Setting, base: Base, weight: Array, noises: Sequence[Noise], candidates: dict[str, list[Signature]]
) -> dict[str, list[Signature]]:
    """Candidates of many shapes with those only that count for something, by a few of the noises.

    The evidence stays an average over all shapes: what is left out adds next to nothing to it.
    """
    many = [code for code, some in candidates.items() if len(some) > MANY]
    kept: dict[str, set[int]] = {code: set() for code in many}
    flat = [c for code in many for c in candidates[code]]
    for noise in (noises[0], noises[len(noises) // 2], noises[-1]) if many else ():
        fits = iter(fit_all(Whitened(base, covariance(s, noise, weight)), flat))
        for code in many:
            z = np.array([next(fits).log_evidence for _ in candidates[code]])
            kept[code] |= set(np.argsort(-z)[:KEPT].tolist())
    return {
        code: [c for i, c in enumerate(some) if code not in kept or i in kept[code]]
        for code, some in candidates.items()
    }


def _same_law(effect: Effect, accepted: Sequence[PlacedEffect]) -> bool:
    taken = {(e.effect.slot, e.effect.place) for e in accepted if e.effect.slot}
    return (effect.slot, effect.place) in taken


def impossible(s: Setting, effect: Effect) -> str | None:
    """Why these readings can say nothing about an effect, whatever its size; None if they might."""
    if effect.needs_history and not s.history.is_known:
        return "the readings do not tell loading from unloading: give them a phase or a step"
    if effect.needs_clock and not np.isfinite(s.history.clock).all():
        return "the readings do not say in which order they were taken: number them in the column step"
    if effect.spring in s.free:
        return "the joint's spring is fitted already"
    return None


def hidden_among(
    s: Setting, base: Base, weight: Array, noise: Noise, candidates: dict[str, list[Signature]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Codes whose effect of usual size would not be seen, with its excess; and the excess of all codes.

    Judged without scatter between set-ups beyond what is usual: the base's own may be the effect itself.
    """
    common = min(noise.pose_share, 0.01)
    w = Whitened(base, covariance(s, with_setup(noise, common), weight))
    hidden, usual = {}, {}
    for code, some in candidates.items():
        found = []
        for c in some:
            if c.shift is not None:
                WX = w.V.whiten(as_if(s, base, c, w.V)[:, None])
                found.append(float(w.schur(WX, WX)[0, 0]))
                continue
            WX = w.V.whiten(c.columns)
            size = np.sqrt(c.mean**2 + c.sd**2)
            found.append(float(np.mean(np.diag(w.schur(WX, WX)) * size**2) * (len(size) if c.positive.all() else 1.0)))
        usual[code] = float(np.median(found))
        if max(found) < SEEN:
            hidden[code] = max(found)
    return hidden, usual
