"""Numbers of springs and accepted effects by the exact laws, from where the ranking's straight lines left them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.hypotheses import Hypothesis
from doe.diagnosis.known import base_mean, base_of, error_count, free_numbers
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.estimation.noise import Noise
from fem.effects.base import PlacedEffect
from robots.arrays import Array

ROUNDS, HALVINGS = 12, 5
# Steps stop when the sum of squares with priors falls by less.
LAST = 1e-3


@dataclass(frozen=True)
class Refit:
    """A setting whose numbers fit best at a noise; ``inverse`` (b, b): covariance of springs, errors, effects."""

    setting: Setting
    noise: Noise
    inverse: Array
    square: float

    def columns(self, number: int) -> list[int]:
        """Which of the numbers that ``inverse`` is about are the free ones of an accepted effect."""
        s = self.setting
        first = len(s.free) + error_count(s) + sum(len(free_numbers(e)) for e in s.accepted[:number])
        return [first + k for k in range(len(free_numbers(s.accepted[number])))]

    def spread(self, number: int) -> dict[str, float]:
        """Standard deviations of an accepted effect's free numbers, by name, as amplitudes and shapes in SI."""
        sd = np.sqrt(np.diag(self.inverse))[self.columns(number)].tolist()
        return {p.name: v for (_, p), v in zip(free_numbers(self.setting.accepted[number]), sd, strict=True)}


def accept(s: Setting, h: Hypothesis) -> Setting:
    """The setting with a hypothesis's effect in it, its numbers as the ranking has them."""
    assert h.signature is not None  # noqa: S101 - of an effect, not of nothing or the unknown
    values = h.signature.values.copy()
    springs, accepted = s.springs, list(s.accepted)
    if h.fit is not None:
        amplitudes = h.fit.mean.copy()
        positive = h.signature.positive
        amplitudes[positive] = np.maximum(amplitudes[positive], 0.05 * h.signature.mean[positive])
        values[h.signature.effect.amplitudes] = amplitudes
        springs, accepted = _moved(s, h.fit.base - (-base_mean(s)))
    return s.moved(springs, (*accepted, PlacedEffect(h.signature.effect, values)))


def _moved(s: Setting, step: Array) -> tuple[Array, list[PlacedEffect]]:
    """Springs and accepted effects after a step (b,) of the base's numbers from where they stand."""
    springs = np.maximum(s.springs + step[: len(s.free)], 0.0)
    at, accepted = len(s.free) + error_count(s), []
    for placed in s.accepted:
        values = placed.values.copy()
        for k, p in free_numbers(placed):
            values[k] += step[at]
            if not p.signed:
                values[k] = max(values[k], 1e-3 * placed.values[k], 1e-3 * p.size[0] if p.role == "shape" else 0.0)
            at += 1
        accepted.append(PlacedEffect(placed.effect, values))
    return springs, accepted


def refit(s: Setting, noise: Noise, weight: Array) -> Refit:
    """Springs and accepted effects with the least sum of squares, priors included, at a given noise."""
    square, w = _at(s, noise, weight)
    for _ in range(ROUNDS):
        step = w.u + base_mean(s)
        for half in range(HALVINGS):
            there = s.moved(*_moved(s, 0.5**half * step))
            found, ahead = _at(there, noise, weight)
            if found < square:
                break
        else:
            break
        gain, s, square, w = square - found, there, found, ahead
        if gain < LAST:
            break
    return Refit(s, noise, w.inverse, square)


def _at(s: Setting, noise: Noise, weight: Array) -> tuple[float, Whitened]:
    """Sum of squares with priors at the setting's own numbers (its model errors at their best), ready for a step."""
    base = base_of(s)
    w = Whitened(base, covariance(s, noise, weight))
    here = -base_mean(s)
    n, e = len(s.free), error_count(s)
    # Errors of the model are no numbers of the setting: whatever they can take up is theirs.
    mine = slice(n, n + e)
    own = Base(base.columns[:, mine], base.residual, base.precision[mine], base.floor[mine])
    inner = Whitened(own, w.V) if e else None
    rest = base.residual - base.columns @ here
    r = w.V.whiten(rest[:, None])[:, 0]
    square = float(r @ r)
    if inner is not None:
        b = inner.W.T @ r
        square -= float(b @ inner.inverse @ b)
    return square + float(np.sum(base.precision * here**2)), w
