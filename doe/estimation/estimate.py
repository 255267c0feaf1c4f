"""Parameters from readings: bounded, weighted, with priors and outliers; noise and parameters in turn.

For given noise the parameters minimise ``|L^-1 (y - f(u))|^2`` plus the priors within their bounds. Where f is
linear in all of them and no prior is given, that is one convex problem, solved exactly (bounded least squares):
the optimum is global. Else its linear part is solved first, and damped steps with exact derivatives go on from there
(:mod:`doe.estimation.least_squares`). Outliers lose weight as readings that may come from a wider distribution (Tukey's
contaminated normal), and are named.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from doe.estimation.blocks import Covariance
from doe.estimation.least_squares import BLIND, minimise, prior_residual
from doe.estimation.noise import (
    OUTLIER,
    Noise,
    Structure,
    at_least,
    fit_noise,
    own_residual,
    rms_by_kind,
    terms_of,
    within_readings,
)
from doe.estimation.problem import Problem
from doe.estimation.repeats import repeated
from doe.estimation.restricted_likelihood import Known
from doe.estimation.robust import robust_sd
from robots import InputError
from robots.arrays import Array, Bools

__all__ = ["BLIND", "OUTLIER", "Estimate", "estimate", "estimate_at", "prior_residual", "solve", "step_sizes"]

ROUNDS = 100
# Rounds in which it is decided which variances the readings can tell; later ones keep to that, so that they settle.
CHOOSING = (0, 1)
# Parameters and noise have settled when all predictions together (and the distances from priors) are nearer than this
# to where they are going, in standard deviations: no parameter, nor any combination of them, is farther by its own.
SETTLED = 1e-6
# The noise has when no reading's standard deviation changed by a larger share than this: what is left is a tenth of it.
STILL_NOISE = 1e-5
# Rounds are not counted on to shrink by more than this, though the last ones did.
LEAST_RATE = 0.05
# The middle half of good readings' residuals is at most so many times as wide as the noise says.
MOST_WIDE = 2.0


@dataclass(frozen=True)
class Estimate:
    """The parameters found.

    ``u`` (p,): estimator's variables; ``prediction``, ``residual`` (m,): read minus predicted; ``noise``: as used;
    ``weight`` (m,): 1, less for outliers; ``own`` (m,): residual without what its set-up has in common, over the
    reading's own standard deviation; ``whitened`` (m, p): derivatives with unit covariance; ``settled``: whether
    noise and parameters came to rest; ``square``: sum of squares that was minimised; ``estimated``: names of the
    variances that were estimated from these readings, also those found to be zero; none where the noise was given;
    ``covariance``: of the readings, by the noise and the weights.
    """

    problem: Problem
    u: Array
    prediction: Array
    residual: Array
    noise: Noise
    weight: Array
    own: Array
    jacobian: Array
    whitened: Array
    settled: bool
    square: float
    estimated: tuple[str, ...]
    covariance: Covariance = field(repr=False, compare=False)

    @property
    def values(self) -> Array:
        """The parameters' values (p,) in their units."""
        return np.array([p.outer(float(v)) for p, v in zip(self.problem.parameters, self.u, strict=True)])

    @property
    def rows(self) -> Array:
        """Derivatives with unit covariance, and those of the distances from priors below them (m + k, p)."""
        return np.vstack([self.whitened, prior_residual(self.problem, self.u)[1]])

    @property
    def seen(self) -> Bools:
        """Which parameters (p,) move any reading."""
        return seen_columns(self.problem, self.whitened)


def step_sizes(p: Problem) -> Array:
    """How much each variable (p,) is worth: the span of its range, by which columns are compared."""
    low, high = p.bounds
    return np.asarray(high - low)


def seen_columns(p: Problem, J: Array) -> Bools:
    """Which parameters (p,) move any reading; J (m, p): derivatives, whitened or not. Others' columns are rounding."""
    reach = np.linalg.norm(J * step_sizes(p), axis=0)
    return np.asarray(reach > BLIND * max(float(reach.max(initial=0.0)), 1e-300))


def estimate(
    p: Problem, gauge: tuple[float, float], *, fixed_noise: Noise | None = None, robust: bool = True
) -> Estimate:
    """Estimate all parameters of a problem, and its noise unless ``fixed_noise`` gives it.

    ``gauge``: smallest standard deviation of a reading, m and rad (its resolution). Readings' own sigma are kept.

    Raises
    ------
    InputError
        No readings, or fewer of them than parameters without a prior.
    """
    check_enough(p)
    weight = np.ones(len(p))
    names: tuple[str, ...] = ()
    tail = repeated(p) if robust and fixed_noise is None else None
    noise = fixed_noise or Noise(white=gauge, tail=tail.noise.tail if tail else 0.0)
    u = p.free.start
    f, J = p.evaluate(u)
    known: dict[tuple[str, ...], Known | None] = {}
    prior, moved, settled, spread = prior_residual(p, u)[0], np.inf, False, noise.spread(p, f)
    # Noise that is given and hangs on no prediction leaves nothing to go back for.
    once = fixed_noise is not None and not robust and not (fixed_noise.share or fixed_noise.pose_share)
    for turn in range(ROUNDS):
        u = solve(p, noise, f, weight, u)
        before, (f, J) = (f, prior), p.evaluate(u)
        error, prior = p.value - f, prior_residual(p, u)[0]
        sd, last = np.sqrt(noise.variance(p, f)), moved
        earlier, spread = spread, noise.spread(p, f)
        still = np.abs(spread / earlier - 1.0).max() < STILL_NOISE
        moved = float(np.hypot(np.linalg.norm((f - before[0]) / sd), np.linalg.norm(prior - before[1])))
        if once or (turn > (fixed_noise is None) and still and _to_go(moved, last) < SETTLED):
            settled = True
            break
        if fixed_noise is None:
            names = terms_of(p, f, structure_of(p, noise)) if turn in CHOOSING else names
            told = J[:, seen_columns(p, J)]
            noise = noise if turn else replace(noise, white=at_least(rms_by_kind(p, error), gauge))
            noise = fit_noise(p, f, told, error, noise, gauge, weight, names=names, known=known)
        if robust and len(p) > len(u) + 3:
            own = own_residual(p, noise, f, weight, error)
            # Before outliers have lost their weight they widen the noise and hide in it; the median does not see them.
            # Residuals are smaller than the noise by what the parameters follow: without that, a few good readings
            # beside almost as many parameters would lose weight, and intervals come out too narrow.
            middle = robust_sd(own) / np.sqrt(1.0 - len(u) / len(p)) if turn == 0 else 1.0
            own = own / min(max(middle, 1e-3), 1.0)
            if fixed_noise is None and turn > 0:
                # Other weights make for another noise, and that for other weights: what it will be, all but a little.
                factor = float(np.sqrt(noise.weigh(own) @ own**2 / max(float(weight @ own**2), 1e-300)))
                noise, own = noise.times(factor, names, gauge), own / max(factor, 1e-3)
            weight = _weights(noise, own)
    if fixed_noise is None:
        noise = within_readings(p, f, noise, gauge)
    return estimate_at(p, u, noise, weight, settled=settled, given=fixed_noise is not None)


def _weights(noise: Noise, own: Array) -> Array:
    """Weights (m,) of residuals over the readings' own standard deviations; most readings are no outliers.

    Where half of all stand out the noise is too small, not the readings wrong: without that a fit may end at the few
    readings that it follows exactly, all others taken for outliers.
    """
    return noise.weigh(own / max(robust_sd(own) / MOST_WIDE, 1.0))


def structure_of(p: Problem, noise: Noise) -> Structure:
    """What the readings' own scatter depends on: as their repeats tell, a share of the component if none do.

    What the model misses has a structure too: without repeats the residual would be asked the wrong thing.
    """
    told = repeated(p)
    return told.structure if told is not None else noise.structure


def _to_go(moved: float, last: float) -> float:
    """What is left to go after a round that moved so far, and the ``last`` before: rounds shrink by one factor."""
    if moved < 0.1 * SETTLED or last == 0.0:
        return moved
    rate = moved / last
    return moved * max(rate / (1.0 - rate), LEAST_RATE) if rate < 1.0 else np.inf


def unrest(
    p: Problem, gauge: tuple[float, float], u: Array, noise: Noise, weight: Array, *, robust: bool
) -> tuple[float, float, float]:
    """How far one more round of :func:`estimate` would go from variables, noise and weights that it ended with.

    Returns
    -------
    The largest move of a prediction (or from a prior) in standard deviations, the largest change of a reading's
    standard deviation as a share of it, and the largest change of a weight. Infinite where the numbers cannot be an
    end at all.
    """
    low, high = p.bounds
    given = noise.numbers
    if (u < low).any() or (u > high).any() or (given < 0.0).any() or (weight <= 0.0).any() or (weight > 1.0).any():
        return np.inf, np.inf, np.inf
    f, J = p.evaluate(u)
    unmoved = ~J.any(axis=0) & np.array([q.prior is None for q in p.parameters], dtype=bool)
    if not (noise.variance(p, f) > 0.0).all() or (u != p.free.start)[unmoved].any():
        return np.inf, np.inf, np.inf
    error, there = p.value - f, solve(p, noise, f, weight, u)
    moved, off = p.predict(there) - f, prior_residual(p, there)[0] - prior_residual(p, u)[0]
    names = terms_of(p, f, structure_of(p, noise))
    found = fit_noise(p, f, J[:, seen_columns(p, J)], error, noise, gauge, weight, names=names)
    before, after = (np.sqrt(n.variance(p, f) + np.sum(n.common(p, f) ** 2, axis=1)) for n in (noise, found))
    own = own_residual(p, found, f, weight, error)
    judged = _weights(found, own) if robust and len(p) > len(u) + 3 else weight
    return (
        float(np.max(np.abs(np.concatenate([moved / before, off])), initial=0.0)),
        float(np.max(np.abs(after / before - 1.0), initial=0.0)),
        float(np.max(np.abs(judged - weight), initial=0.0)),
    )


def estimate_at(
    p: Problem,
    u: Array,
    noise: Noise,
    weight: Array,
    *,
    settled: bool,
    given: bool = False,
) -> Estimate:
    """The estimate whose variables, noise and weights are known already; ``given``: noise not from these readings."""
    f, J = p.evaluate(u)
    error = p.value - f
    own = own_residual(p, noise, f, weight, error)
    V = noise.covariance(p, f, weight)
    white = V.whiten(np.column_stack([error, J]))
    square = float(white[:, 0] @ white[:, 0]) + float(np.sum(prior_residual(p, u)[0] ** 2))
    names = () if given else terms_of(p, f, structure_of(p, noise))
    return Estimate(p, u, f, error, noise, weight, own, J, white[:, 1:], settled, square, names, V)


def solve(p: Problem, noise: Noise, f: Array, weight: Array, start: Array, held: int | None = None) -> Array:
    """Variables (p,) that minimise the weighted squares for given noise; ``held``: one that stays where it is."""
    return minimise(p, noise.covariance(p, f, weight), start, held)[0]


def unaided(p: Problem) -> list[str]:
    """Names of the parameters that readings move with and that have no prior: it takes as many readings."""
    seen = seen_columns(p, p.evaluate(p.free.start)[1])
    return [q.name for q, visible in zip(p.parameters, seen, strict=True) if visible and q.prior is None]


def check_enough(p: Problem) -> None:
    """Raise InputError where there are no readings, or fewer of them than parameters without a prior."""
    if len(p) == 0:
        raise InputError("no reading to calibrate on", code="C001", remedy="select poses or loads that were measured")
    free = unaided(p)
    if len(free) > len(p):
        raise InputError(
            f"{len(p)} reading(s) cannot determine {len(free)} parameters ({', '.join(free)})",
            code="C001",
            remedy="measure more poses, set fewer free, or give some of them a prior",
        )
