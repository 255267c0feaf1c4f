"""Which effects these readings might show, in which shapes; which they cannot tell, by name or from one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve

from doe.diagnosis.evidence import Base, Whitened, fit_all
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.scatter import covariance, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count, signatures
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
# An effect of usual size must raise chi-square by this to be told by name.
TESTABLE = 30.0
# Chi-square by which two effects must differ to be told apart by these readings.
APART = 9.0
# Set-ups scatter at least this much where twins are looked for, unless they are known to scatter less.
USUAL_SETUP = 0.01


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


def not_testable(s: Setting, r: Ranking, found: Sequence[str] = ()) -> dict[str, str]:
    """Codes that these readings cannot judge, with the reason; ``found``: codes that were seen all the same."""
    out: dict[str, str] = {}
    taken = {e.effect.code for e in s.accepted}
    for code, effect in s.known.items():
        if code in found or code in taken:
            continue
        reason = impossible(s, effect)
        if reason is not None:
            out[code] = reason
        elif code in r.hidden:
            out[code] = _hidden(r.hidden[code])
    for h in r.hypotheses:
        if h.code in (NONE, UNKNOWN, *found, *r.credible()) or not h.usual_excess < TESTABLE:
            continue
        out[h.code] = (
            f"an effect of usual size would raise chi-square by {h.usual_excess:.2g} only, beyond what springs and "
            f"noise take up: {TESTABLE:.0f} would be needed to name it"
        )
    return out


def _hidden(excess: float) -> str:
    if excess < 1e-6:
        return "no reading moves with it, or the springs take up all that it does"
    return f"springs and noise take up what it does: chi-square would rise by {excess:.1g}"


def twins(s: Setting, r: Ranking, weight: Array, codes: Sequence[str] | None = None) -> dict[str, tuple[str, ...]]:
    """For each code, other codes that these readings could not tell from it.

    An effect as large as fitted (or of usual size where it is not there) is imitated by another one, whatever its
    sizes and shapes, as well as it can be beside springs and noise; what is left is the chi-square between them.
    """
    noise = r.best.noise
    w = Whitened(r.base, covariance(s, with_setup(noise, min(noise.pose_share, USUAL_SETUP)), weight))
    wanted = [h for h in r.hypotheses if h.signature is not None and h.signature.shift is None]
    if codes is not None:
        wanted = [h for h in wanted if h.code in codes]
    # A law of very many shapes would imitate anything somehow: its best one stands for it.
    columns = {
        h.code: [
            _cleared(w, c.columns)
            for c in (signatures(s, h.signature.effect) if shape_count(h.signature.effect) <= MANY else [h.signature])
        ]
        for h in r.hypotheses
        if h.signature is not None and h.signature.shift is None
    }
    out: dict[str, tuple[str, ...]] = {}
    for h in wanted:
        assert h.signature is not None  # noqa: S101 - chosen so
        size = np.where(h.signature.mean > 0.0, h.signature.mean, h.signature.sd)
        amplitude = h.fit.mean if h.fit is not None and h.fit.excess > APART else size
        shape = _cleared(w, h.signature.columns) @ amplitude
        strength = float(shape @ shape)
        if strength < APART:
            continue
        out[h.code] = tuple(
            code for code, some in columns.items() if code != h.code and _left(shape, some, strength) < APART
        )
    return out


def _cleared(w: Whitened, X: Array) -> Array:
    """Whitened columns (m, k) without what springs and the model's other numbers can follow, softly."""
    WX = w.V.whiten(X)
    follow = cho_solve((w.L, True), w.W.T @ WX)
    # What the priors still charge for following stands in rows of its own.
    return np.vstack([WX - w.W @ follow, np.sqrt(w.base.precision)[:, None] * follow])


def _left(shape: Array, imitations: Sequence[Array], most: float) -> float:
    """Least sum of squares that any of the imitations leaves of a shape."""
    left = most
    for A in imitations:
        G = A.T @ A
        size = np.sqrt(np.maximum(np.diag(G), 1e-300))
        b = (A.T @ shape) / size
        gain = float(b @ np.linalg.lstsq(G / np.outer(size, size), b, rcond=1e-9)[0])
        left = min(left, most - gain)
    return left
