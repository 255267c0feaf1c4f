"""Readings that may be wrong, judged before any effect is named: by their own repeats, and by all other readings.

A slipped digit must neither hide an effect nor make one. What is missing is not known yet, so readings are held against
something that can follow any effect that is smooth over poses and loads: springs, and the discrepancy that stands for
the unknown (:func:`doe.diagnosis.weighing.discrepancies`). A reading that its own repeats confirm is no outlier,
however far off; one that they contradict is one only by the scatter that these readings have, not by an assumed share.
Weights are those of a contaminated normal distribution (:func:`doe.estimation.estimate.outlier_weight`).
"""

from __future__ import annotations

import numpy as np

from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.known import base_of, free_columns
from doe.diagnosis.scatter import covariance, fitted_noise
from doe.diagnosis.setting import Setting
from doe.diagnosis.weighing import discrepancies
from doe.estimation.estimate import outlier_weight
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from robots.arrays import Array

ROUNDS = 6
# Weights have settled when none changes by more.
SETTLED = 0.02
# A reading without repeats is held against what may follow it or not: it must stand out farther.
ALONE = 1.5
# The middle half of readings never counts for less than this share of their noise: many may repeat one another exactly.
LEAST = 0.3
# Median of the absolute value of a standard normal number.
MEDIAN = 0.6745


def reading_weights(s: Setting) -> Array:
    """Weights (m,) of readings: 1, next to nothing for sure outliers."""
    base, p = base_of(s), s.data
    flexible = base.beside(next(iter(discrepancies(s))))
    free = free_columns(s, base)
    weight = np.ones(len(p))
    for _ in range(ROUNDS):
        noise = fitted_noise(s, free, weight)
        before, weight = weight, outlier_weight(_standing_out(s, flexible, noise, weight))
        if np.abs(weight - before).max() < SETTLED:
            break
    return weight


def _standing_out(s: Setting, flexible: Base, noise: Noise, weight: Array) -> Array:
    """How far readings (m,) stand out, in standard deviations of one: of their repeats and of all others."""
    p = s.data
    variance = noise.variance(p, s.prediction)
    away = np.abs(_away(s, flexible, noise, weight, variance))
    repeats = np.bincount(p.replicate)[p.replicate]
    apart = np.abs(_apart(p)) / np.sqrt(variance)
    # Of good readings the middle half is as wide as a normal distribution's: outliers widen the noise and hide in it.
    # Without repeats it is what the model misses that widens it, and what follows that may be one pose's own.
    alone = away / (ALONE * max(1.0, _middle(away)))
    away, apart = (x / max(LEAST, _middle(x[repeats > 1])) for x in (away, apart))
    return np.asarray(np.where(repeats > 1, np.minimum(away, apart), alone))


def _middle(x: Array) -> float:
    return float(np.median(x)) / MEDIAN if len(x) else 0.0


def _away(s: Setting, flexible: Base, noise: Noise, weight: Array, variance: Array) -> Array:
    """Reading less what all others make of it (m,), over what that difference scatters by.

    ``variance`` (m,): of a reading that is judged, whatever weight it has so far.
    """
    V = covariance(s, noise, weight)
    w = Whitened(flexible, V)
    rest = flexible.residual - flexible.columns @ w.u
    # (V^-1 e)_i / P_ii is the error at reading i predicted from all others, and 1 / P_ii its variance.
    solved = V.solve(np.column_stack([rest, flexible.columns]))
    half = np.linalg.solve(w.L, solved[:, 1:].T)
    P = np.maximum(V.inverse_diagonal - np.sum(half**2, axis=0), 1e-300)
    return np.asarray(solved[:, 0] / P / np.sqrt(np.maximum(1.0 / P + variance * (1.0 - 1.0 / weight), variance)))


def _apart(p: Problem) -> Array:
    """Reading less the median of its other repeats (m,), over what that scatters by beside its own; 0 without any."""
    out = np.zeros(len(p))
    order = np.argsort(p.replicate, kind="stable")
    starts = np.flatnonzero(np.diff(p.replicate[order], prepend=-1))
    for rows in np.split(order, starts[1:]):
        n = len(rows)
        if n < 2:
            continue
        value = p.value[rows]
        for k, row in enumerate(rows):
            others = np.delete(value, k)
            out[row] = (value[k] - np.median(others)) / np.sqrt(1.0 + 1.3 / (n - 1))
    return out
