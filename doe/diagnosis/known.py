"""What is taken as given beside a candidate: springs, small errors, accepted effects; these numbers at their best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.hypotheses import Hypothesis
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import prior
from doe.estimation.noise import Noise
from fem.effects.base import EffectParameter, PlacedEffect
from robots.arrays import Array

# Standard deviation of a spring's compliance beforehand, in shares of its typical value.
SPRING = 1.5
ROUNDS, HALVINGS = 12, 5
# Steps stop when the sum of squares with priors falls by less.
LAST = 1e-3
# Shapes that are found between the points of their grid.
REFINED = ("torque", "force", "time")


def base_of(s: Setting, doubts: Array | None = None) -> Base:
    """Columns and priors of everything but the candidates; ``doubts`` (m, d) in place of the setting's own."""
    springs = s.spring_columns, s.typical - s.springs, SPRING * s.typical, -s.springs
    parts = [springs, _errors(s, s.doubts if doubts is None else doubts), _accepted(s)]
    columns = np.hstack([p[0] for p in parts])
    mean, sd, floor = (np.concatenate([p[k] for p in parts]) for k in (1, 2, 3))
    return Base(columns, s.residual - columns @ mean, sd**-2.0, floor - mean)


def base_mean(s: Setting) -> Array:
    """Prior means (b,) of the base's numbers, from where they stand."""
    return np.concatenate([s.typical - s.springs, np.zeros(error_count(s)), _accepted_priors(s)[0]])


def _errors(s: Setting, doubts: Array) -> tuple[Array, Array, Array, Array]:
    columns = np.hstack([s.errors, doubts])
    n = columns.shape[1]
    return columns, np.zeros(n), np.ones(n), np.full(n, -np.inf)


def free_columns(s: Setting, base: Base) -> Array:
    """The base's columns (m, k) without those of small errors: what the noise is estimated beside."""
    n, e = len(s.free), error_count(s)
    return np.delete(base.columns, np.s_[n : n + e], axis=1)


def error_count(s: Setting) -> int:
    """How many of the base's columns, after the springs', are errors of the model and doubts about laws."""
    return int(s.errors.shape[1] + s.doubts.shape[1])


def _accepted(s: Setting) -> tuple[Array, Array, Array, Array]:
    columns = [np.zeros((len(s.data), 0))]
    for number, placed in enumerate(s.accepted):
        for k, p in free_numbers(placed):
            step = 0.05 * _prior_of(p, placed)[1]
            if p.role == "shape":
                step = min(step, 0.2 * abs(float(placed.values[k])))
            columns.append(_slope(s, number, k, step)[:, None])
    return (np.hstack(columns), *_accepted_priors(s))


def _accepted_priors(s: Setting) -> tuple[Array, Array, Array]:
    """Prior means, standard deviations and floors (a,) of accepted effects' numbers, from where they stand."""
    mean, sd, floor = [], [], []
    for placed in s.accepted:
        for k, p in free_numbers(placed):
            m, spread = _prior_of(p, placed)
            mean.append(m - placed.values[k])
            sd.append(spread)
            floor.append(-np.inf if p.signed or p.role == "shape" else -placed.values[k])
    return np.array(mean), np.array(sd), np.array(floor)


def free_numbers(placed: PlacedEffect) -> list[tuple[int, EffectParameter]]:
    """Parameters of an accepted effect that stay free: amplitudes, and torques, forces and times that shape its law."""
    return [
        (k, p)
        for k, p in enumerate(placed.effect.parameters)
        if p.role == "amplitude" or (p.dimension in REFINED and len(p.grid) > 1 and min(p.grid) > 0.0)
    ]


def _prior_of(p: EffectParameter, placed: PlacedEffect) -> tuple[float, float]:
    if p.role == "amplitude":
        return prior(p)
    # Half the way to the next point of the grid, around the best one.
    index = placed.effect.parameters.index(p)
    value, grid = float(placed.values[index]), np.array(p.grid)
    nearest = float(grid[np.argmin(np.abs(np.log(grid / max(value, 1e-9))))])
    ratio = float(np.exp(np.mean(np.diff(np.log(grid)))))
    return nearest, 0.5 * nearest * (ratio - 1.0)


def _slope(s: Setting, number: int, k: int, step: float) -> Array:
    placed = s.accepted[number]

    def stepped(by: float) -> tuple[PlacedEffect, ...]:
        values = placed.values.copy()
        values[k] += by
        return (*s.accepted[:number], PlacedEffect(placed.effect, values), *s.accepted[number + 1 :])

    effect = s.accepted[number].effect
    if effect.parameters[k].role == "amplitude" and effect.stage in ("arm", "gauge") and not effect.own:
        # Linear: one step tells the slope.
        return (s.read(s.arm, stepped(step)) - s.prediction) / step
    return s.slope(stepped, step)


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
    """Springs and accepted effects with the least sum of squares, priors included, at a given noise.

    What effects' laws may be off by grows with the effects, so a sum of squares that is judged by each point's own
    doubt would rather leave a part of an effect to it than fit the effect. The doubt is held while the numbers are
    fitted, then taken anew, until they rest.
    """
    square, w = _at(s, noise, weight)
    for _ in range(ROUNDS):
        doubts, before = s.doubts, square
        for _ in range(ROUNDS):
            step = w.u + base_mean(s)
            for half in range(HALVINGS):
                there = s.moved(*_moved(s, 0.5**half * step))
                found, ahead = _at(there, noise, weight, doubts)
                if found < square:
                    break
            else:
                break
            gain, s, square, w = square - found, there, found, ahead
            if gain < LAST:
                break
        if before - square < LAST:
            break
        square, w = _at(s, noise, weight)
    return Refit(s, noise, w.inverse, square)


def _at(s: Setting, noise: Noise, weight: Array, doubts: Array | None = None) -> tuple[float, Whitened]:
    """Sum of squares with priors at the setting's own numbers (its model errors at their best), ready for a step.

    ``doubts`` as in :func:`base_of`.
    """
    base = base_of(s, doubts)
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
