"""Effects that some readings could not tell from one another: what one does, the other does too, springs following.

An effect's change of the readings is imitated by another one, whatever its sizes and shapes, as well as it can be
beside springs and noise; what is left of the change is the chi-square between the two.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve
from scipy.optimize import lsq_linear, nnls

from doe.diagnosis.candidates import MANY, impossible, possible
from doe.diagnosis.evidence import Whitened
from doe.diagnosis.hypotheses import SLACK, Decision, Hypothesis, Ranking, is_learned
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count, signatures
from doe.diagnosis.weighing import as_if
from doe.estimation.noise import Noise
from fem.effects.base import Effect
from robots.arrays import Array

# Chi-square by which two effects must differ to be told apart by these readings.
APART = 9.0
# Below this chi-square the readings would be the same, however small their noise were told to be.
EXACT = 1.0
# A twin whose numbers are this much less plausible than the best one's is none that a verdict must wait for.
PLAUSIBLE = 0.03
# Set-ups scatter at least this much where twins are looked for, unless they are known to scatter less.
USUAL_SETUP = 0.01


class Likeness:
    """What readings of one setting leave between effects, at a noise."""

    def __init__(self, s: Setting, noise: Noise, weight: Array) -> None:
        self.s, self.base = s, base_of(s)
        common = with_setup(noise, min(noise.pose_share, USUAL_SETUP))
        self.w = Whitened(self.base, covariance(s, common, weight))
        self._signatures: dict[str, list[Signature]] = {}

    def signatures(self, effect: Effect) -> list[Signature]:
        """The signatures of an effect in all its shapes, worked out once."""
        if effect.code not in self._signatures:
            self._signatures[effect.code] = possible(self.s, effect) if effect.gross else signatures(self.s, effect)
        return self._signatures[effect.code]

    def change(self, c: Signature, amplitude: Array) -> Array:
        """What an effect changes of the readings (m,)."""
        return as_if(self.s, self.base, c, self.w.V) if c.shift is not None else np.asarray(c.columns @ amplitude)

    def strength(self, change: Array) -> float:
        """Chi-square by which a change of the readings (m,) shows."""
        cleared = self._cleared(change[:, None])
        return float(np.sum(cleared**2))

    def left(self, change: Array, imitations: Sequence[Signature], *, plausible: bool = False) -> float:
        """Least chi-square that any of the imitations leaves of a change of the readings (m,).

        Their amplitudes have the signs that they can have; ``plausible``: and plausible sizes, give or take ``SLACK``,
        where any sizes would leave less than ``APART``.
        """
        wanted = self._cleared(change[:, None])[:, 0]
        return min((self._left(wanted, c, plausible) for c in imitations), default=np.inf)

    def _left(self, wanted: Array, c: Signature, plausible: bool) -> float:
        if c.shift is not None:
            return float(np.sum((wanted - self._cleared(self.change(c, np.zeros(0))[:, None])[:, 0]) ** 2))
        A = self._cleared(c.columns)
        left = self._left_by_any_size(wanted, A, c)
        return _left_by_plausible_sizes(wanted, A, c) if plausible and left < APART else left

    def _left_by_any_size(self, wanted: Array, A: Array, c: Signature) -> float:
        if c.positive.any():
            # A compliance below nothing imitates nothing; what may have either sign stands there with both.
            both = np.hstack([A, -A[:, ~c.positive]])
            return float(nnls(both / np.maximum(np.linalg.norm(both, axis=0), 1e-300), wanted)[1] ** 2)
        G = A.T @ A
        size = np.sqrt(np.maximum(np.diag(G), 1e-300))
        b = (A.T @ wanted) / size
        gain = float(b @ np.linalg.lstsq(G / np.outer(size, size), b, rcond=1e-9)[0])
        return float(wanted @ wanted) - gain

    def _cleared(self, X: Array) -> Array:
        """Whitened columns (m, k) without what springs and the model's other numbers can follow, softly."""
        w, WX = self.w, self.w.V.whiten(X)
        follow = cho_solve((w.L, True), w.W.T @ WX)
        # What the priors still charge for following stands in rows of its own.
        return np.vstack([WX - w.W @ follow, np.sqrt(self.base.precision)[:, None] * follow])


def _left_by_plausible_sizes(wanted: Array, A: Array, c: Signature) -> float:
    """Chi-square that amplitudes of plausible sign and size leave; several of one effect may be small, a single not."""
    size = np.array([c.effect.parameters[k].size for k in c.effect.amplitudes])
    least, most = size[:, 0] / SLACK, size[:, 1] * SLACK
    low = np.where(c.positive, 0.0, -most)
    high = most
    if len(most) == 1:
        either = not c.positive[0] and float(A[:, 0] @ wanted) < 0.0
        low, high = (-most, -least) if either else (least, most)
    # In shares of the largest: sizes of several kinds differ by many decades.
    return 2.0 * float(lsq_linear(A * most, wanted, (low / most, high / most), method="bvls").cost)


def likely_amplitude(h: Hypothesis) -> Array:
    """Amplitudes of a hypothesis as fitted, or of usual size where the effect is hardly there."""
    assert h.signature is not None  # noqa: S101 - of an effect
    if h.fit is not None and h.fit.excess > APART:
        return h.fit.mean
    return np.where(h.signature.mean > 0.0, h.signature.mean, h.signature.sd)


def twins_of(
    like: Likeness, change: Array, code: str, best: Mapping[str, Signature], *, among: Collection[str] | None = None
) -> tuple[str, ...]:
    """Codes of effects that would give the same ``change`` (m,) of the readings as ``code`` does.

    ``best``: shapes that stand for laws of very many, which would imitate anything somehow; ``among``: codes of which
    those are asked for that do so with plausible sizes, None for all effects with any sizes.
    """
    s, out = like.s, []
    taken = {code, *(e.effect.code for e in s.accepted)}
    for other, effect in s.known.items():
        if (
            other in taken
            or (among is not None and other not in among)
            or is_learned(other)
            or (effect.gross and not s.known[code].gross)
            or impossible(s, effect) is not None
        ):
            continue
        if not effect.gross and shape_count(effect) > MANY:
            some = [best[k] for k in (other,) if k in best]
        else:
            some = like.signatures(effect)
        if like.left(change, some, plausible=among is not None) < APART:
            out.append(other)
    return tuple(out)


def _same(like: Likeness, a: Hypothesis, b: Hypothesis) -> bool:
    """Whether all that one of two effects does the other does too, and what is left of that one's is noise."""
    assert a.signature is not None  # noqa: S101 - both are effects
    assert b.signature is not None  # noqa: S101
    there = like.left(like.change(a.signature, likely_amplitude(a)), [b.signature])
    back = like.left(like.change(b.signature, likely_amplitude(b)), [a.signature])
    return max(there, back) < APART and min(there, back) < EXACT


def beside_twins(s: Setting, r: Ranking, weight: Array, d: Decision) -> Decision:
    """The decision, ambiguous where an effect of another kind would give the very same readings.

    Prior plausibility alone tells exact twins apart: no name can be sure of it unless one of them is absurd.
    """
    h = d.hypothesis
    if d.kind not in ("named", "ambiguous") or h is None or h.signature is None:
        return d
    like = Likeness(s, r.best.noise, weight)
    same = [
        x.code
        for x in r.hypotheses
        if x.signature is not None
        and not is_learned(x.code)
        and x.signature.effect.family != h.signature.effect.family
        and x.probability > PLAUSIBLE * h.probability
        and _same(like, h, x)
    ]
    if d.kind == "ambiguous" or not same:
        return replace(d, same=tuple(same))
    return Decision("ambiguous", h, f"{' and '.join(same)} would give the very same readings", tuple(same))
