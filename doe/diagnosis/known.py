"""What is taken as given beside a candidate: springs, small errors that every model has, accepted effects."""

from __future__ import annotations

import numpy as np

from doe.diagnosis.evidence import Base
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import prior
from fem.effects.base import EffectParameter, PlacedEffect
from robots.arrays import Array

# Standard deviation of a spring's compliance beforehand, in shares of its typical value.
SPRING = 1.5


def base_of(s: Setting) -> Base:
    """Columns and priors of everything but the candidates."""
    parts = [_springs(s), _errors(s), _accepted(s)]
    columns = np.hstack([p[0] for p in parts])
    mean, sd, floor = (np.concatenate([p[k] for p in parts]) for k in (1, 2, 3))
    return Base(columns, s.residual - columns @ mean, sd**-2.0, floor - mean)


def base_mean(s: Setting) -> Array:
    """Prior means (b,) of the base's numbers, from where they stand."""
    return np.concatenate([s.typical - s.springs, np.zeros(error_count(s)), _accepted_priors(s)[0]])


def _springs(s: Setting) -> tuple[Array, Array, Array, Array]:
    return s.spring_columns, s.typical - s.springs, SPRING * s.typical, -s.springs


def _errors(s: Setting) -> tuple[Array, Array, Array, Array]:
    columns = np.hstack([s.errors, s.doubts])
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
    """Parameters of an accepted effect that stay free: its amplitudes, and torques that shape its law."""
    return [
        (k, p)
        for k, p in enumerate(placed.effect.parameters)
        if p.role == "amplitude" or (p.dimension == "torque" and len(p.grid) > 1 and min(p.grid) > 0.0)
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

    return s.slope(stepped, step)


def errors_of(s: Setting) -> Array:
    """Change of the readings (m, e) by one standard deviation of each error that every model has."""
    columns = [np.zeros((len(s.data), 0))]
    for effect in s.known.values():
        if effect.usual > 0.0:
            ends = [s.read(s.arm, (PlacedEffect(effect, np.array([x])),)) for x in (effect.usual, -effect.usual)]
            columns.append(0.5 * (ends[0] - ends[1])[:, None])
    return np.hstack(columns)
