"""What these readings cannot tell: effects they cannot see, and effects they cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_solve

from doe.diagnosis.candidates import MANY, impossible
from doe.diagnosis.evidence import Whitened
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.scatter import covariance, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import shape_count, signatures
from robots.arrays import Array

# An effect of usual size must raise chi-square by this to be told by name.
TESTABLE = 30.0
# Chi-square by which two effects must differ to be told apart by these readings.
APART = 9.0
# Set-ups scatter at least this much where twins are looked for, unless they are known to scatter less.
USUAL_SETUP = 0.01


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
