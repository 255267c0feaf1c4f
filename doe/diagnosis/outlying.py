"""Readings that may be wrong, judged before any effect is named: by their own repeats, and by all other readings.

A slipped digit must neither hide an effect nor make one. What is missing is not known yet, so readings are held against
something that can follow any effect that is smooth over poses and loads: springs, and the discrepancy that stands for
the unknown (:func:`doe.diagnosis.unknowns.discrepancies`). A reading that its own repeats confirm is no outlier,
however far off; one that they contradict is one only by the scatter that these readings have, not by an assumed share.
Weights are those of a contaminated normal distribution, or of Student's t: :meth:`doe.estimation.noise.Noise.weigh`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.known import base_of, free_columns
from doe.diagnosis.scatter import NoisePrior, covariance, first_noise, fitted_noise, typical_size
from doe.diagnosis.setting import FLOOR, Setting
from doe.diagnosis.unknowns import discrepancies
from doe.estimation.noise import OUTLIERS, WIDER, Noise
from doe.estimation.problem import Problem
from doe.estimation.repeats import repeated
from doe.estimation.robust import robust_sd
from robots.arrays import Array

# A reading that counts for less than this share is odd.
ODD = 0.5
ROUNDS = 6
# Weights have settled when none changes by more.
SETTLED = 0.02
# A reading without repeats is held against what may follow it or not: it must stand out farther.
ALONE = 1.5
# Rounds, and bend in robust standard deviations, of the fit that draws outliers out.
DRAWING, BEND = 15, 1.5
# What all readings under one load may have in common, as a share of the deflection, and how seldom that is (log).
LEVEL, SELDOM = 0.2, -2.0
MOST_LEVELS, FEWEST_AT_A_LEVEL = 8, 4
# Noises tried where nothing tells it, as shares of the deflection.
USUAL = (0.005, 0.01, 0.02, 0.03, 0.045, 0.07, 0.1)
# How many readings may be wrong, and at most which share of them; more readings than these are judged one by one.
SEARCHED = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24)
MOST_WRONG, MOST_SEARCHED = 0.1, 300
# The middle half of readings never counts for less than this share of their noise: many may repeat one another exactly.
LEAST = 0.3


def reading_weights(s: Setting, explanations: Sequence[Array] = ()) -> Array:
    """Weights (m,) of readings: 1, next to nothing for sure outliers.

    ``explanations``: columns (m, k) of standard normal numbers, each set of which may be what is missing, beside those
    that are always asked: a smooth discrepancy, and loads and poses that are off. A reading is wrong as far as it
    stands out under every credible one: weights are means over all, by their evidence.
    """
    views = _views(s, explanations)
    worth = np.array([view.worth for view in views])
    chance = np.exp(worth - logsumexp(worth))
    return np.asarray(chance @ np.array([view.weight for view in views]))


@dataclass(frozen=True)
class _View:
    """Weights (m,) of the readings as one explanation has them, and its log evidence with these."""

    weight: Array
    worth: float


def _views(s: Setting, explanations: Sequence[Array]) -> list[_View]:
    base, p = base_of(s), s.data
    free = free_columns(s, base)
    none = np.zeros((len(p), 0))
    smooth = next(iter(discrepancies(s)))
    single = np.bincount(p.replicate)[p.replicate] == 1
    # Repeats contradict an outlier, whatever is missing; without them it must be told from what is.
    levels = _load_levels(s) if single.any() else none
    asked: list[tuple[Array, Array | None, float]] = [(smooth, free, 0.0)]
    asked += [(some, np.hstack([free, some]), 0.0) for some in explanations]
    if levels.size:
        asked.append((levels, None, SELDOM))
    out = []
    for columns, beside, chance in asked:
        flexible = base.beside(columns)
        if beside is not None:
            out.append(_judged(s, flexible, beside, chance))
        if single.any() and len(p) <= MOST_SEARCHED:
            out.append(_searched(s, flexible, chance))
    return out


def _judged(s: Setting, flexible: Base, beside: Array, chance: float) -> _View:
    """Weights under one explanation, each reading judged by all others; noise estimated beside ``beside`` (m, k)."""
    weight, noise = np.ones(len(s.data)), None
    for _ in range(ROUNDS):
        noise = fitted_noise(s, beside, weight, noise)
        before, weight = weight, noise.weigh(_standing_out(s, flexible, noise, weight))
        if np.abs(weight - before).max() < SETTLED:
            break
    assert noise is not None  # noqa: S101 - there is a round
    return _View(weight, _worth(s, flexible, noise, weight) + chance)


def _searched(s: Setting, flexible: Base, chance: float) -> _View:
    """Weights under one explanation by its evidence: as many of the readings that stand out most as raise it most.

    Two wrong readings beside one another pull a fit their way, and neither stands out; without both it would.
    """
    one = np.ones(len(s.data))
    order = np.argsort(_drawn_out(s, flexible, _likeliest(s, flexible, one)))
    best = _View(one, -np.inf)
    for count in SEARCHED:
        if count > MOST_WRONG * len(one):
            break
        weight = one.copy()
        weight[order[:count]] = WIDER**-2
        worth = _worth(s, flexible, _likeliest(s, flexible, weight), weight) + chance
        if worth > best.worth:
            best = _View(weight, worth)
    return best


def _worth(s: Setting, flexible: Base, noise: Noise, weight: Array) -> float:
    """Log evidence of an explanation with weights (m,); each reading taken for an outlier is one that seldom is."""
    odd = 0.0 if noise.tail else float(np.sum(1.0 - weight)) * float(np.log(OUTLIERS / (1.0 - OUTLIERS)))
    evidence = Whitened(flexible, covariance(s, noise, weight)).log_evidence
    return evidence + odd + NoisePrior().log_density(noise, typical_size(s))


def _drawn_out(s: Setting, flexible: Base, noise: Noise) -> Array:
    """Weights (m,) of a fit that outliers hardly pull: several beside one another pull a common fit their way."""
    sd, weight = np.sqrt(noise.variance(s.data, s.prediction)), np.ones(len(s.data))
    for _ in range(DRAWING):
        rest = (flexible.residual - flexible.columns @ Whitened(flexible, covariance(s, noise, weight)).u) / sd
        weight = 1.0 / (1.0 + (rest / (BEND * max(robust_sd(rest), 1e-3))) ** 2)
    return np.asarray(weight)


def _likeliest(s: Setting, flexible: Base, weight: Array) -> Noise:
    """The most probable one of usual noises: more columns than there are readings leave nothing else to tell it by."""
    told, size, known = repeated(s.data), typical_size(s), NoisePrior()
    if told is not None:
        return first_noise(s)
    usual = [Noise((max(0.01 * size[0], FLOOR[0]), max(0.01 * size[1], FLOOR[1])), share=x) for x in USUAL]
    usual += [Noise((max(x * size[0], FLOOR[0]), max(x * size[1], FLOOR[1]))) for x in USUAL]
    worth = [Whitened(flexible, covariance(s, n, weight)).log_evidence + known.log_density(n, size) for n in usual]
    return usual[int(np.argmax(worth))]


def _load_levels(s: Setting) -> Array:
    """Columns (m, k) of what readings under loads of one size have in common, and those of one pose: a two-way table.

    Both are shares of the deflection. Whatever one pose and whatever one load is off by, this follows.
    """
    size = np.round(s.data.load, 1)
    values, count = np.unique(size, return_counts=True)
    if not 1 < len(values) <= MOST_LEVELS or count.min() < FEWEST_AT_A_LEVEL:
        return np.zeros((len(size), 0))
    load = [np.where(size == v, LEVEL * s.prediction, 0.0) for v in values]
    pose = [np.where(s.data.pose == g, LEVEL * s.prediction, 0.0) for g in range(len(s.data.poses))]
    return np.stack([*load, *pose], axis=1)


def _standing_out(s: Setting, flexible: Base, noise: Noise, weight: Array) -> Array:
    """How far readings (m,) stand out, in standard deviations of one: of their repeats and of all others."""
    p = s.data
    variance = noise.variance(p, s.prediction)
    away = np.abs(_away(s, flexible, noise, weight, variance))
    repeats = np.bincount(p.replicate)[p.replicate]
    apart = np.abs(_apart(p)) / np.sqrt(variance)
    # Of good readings the middle half is as wide as a normal distribution's: outliers widen the noise and hide in it.
    # Without repeats it is what the model misses that widens it, and what follows that may be one pose's own.
    alone = away / (ALONE * max(1.0, robust_sd(away)))
    # Where repeats tell the noise nothing of that hides in it.
    least = LEAST if repeated(p) is None else 1.0
    away, apart = (x / max(least, robust_sd(x[repeats > 1])) for x in (away, apart))
    return np.asarray(np.where(repeats > 1, np.minimum(away, apart), alone))


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
