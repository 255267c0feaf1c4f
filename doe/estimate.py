"""Parameters from readings: bounded, weighted, with priors and outliers; noise and parameters in turn.

For given noise the parameters minimise ``|L^-1 (y - f(u))|^2`` plus the priors within their bounds. Where f is
linear in all of them and no prior is given, that is one convex problem, solved exactly (bounded least squares):
the optimum is global. Else its linear part is solved first, and a trust-region method with exact derivatives goes
on from there. Outliers lose weight as in bounded-influence regression (a reading beyond three of its standard
deviations counts as one that is just there) and are named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from doe.noise import Blocks, Noise, fit_noise, shrink_common
from doe.problem import Problem
from robots import InputError

Array = NDArray[np.float64]

ROUNDS = 12
# Rounds in which terms of the noise are chosen; later ones only refine them, so that the rounds settle.
CHOOSING = (0, 1)
# Parameters and noise have settled when no prediction moves by more than this share of its standard deviation.
SETTLED = 1e-3
# Standardised residual beyond which a reading loses weight; 0.3 % of good ones do.
OUTLIER = 3.0
# Columns below this share of the largest move no reading.
BLIND = 1e-9


@dataclass(frozen=True)
class Estimate:
    """The parameters found.

    ``u`` (p,): estimator's variables; ``prediction``, ``residual`` (m,): read minus predicted; ``noise``: as used;
    ``weight`` (m,): 1, less for outliers; ``own`` (m,): residual without what its set-up has in common, over the
    reading's own standard deviation; ``whitened`` (m, p): derivatives with unit covariance; ``settled``: whether
    noise and parameters came to rest; ``square``: sum of squares that was minimised.
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

    @property
    def values(self) -> Array:
        """The parameters' values (p,) in their units."""
        return np.array([p.outer(float(v)) for p, v in zip(self.problem.parameters, self.u, strict=True)])

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which parameters (p,) move any reading."""
        norm = np.linalg.norm(self.whitened * step_sizes(self.problem), axis=0)
        return np.asarray(norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300))


def step_sizes(p: Problem) -> Array:
    """How much each variable (p,) is worth: the span of its range, by which columns are compared."""
    low, high = p.bounds
    return np.asarray(high - low)


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
    _check(p)
    blocks, weight = Blocks.of(p), np.ones(len(p))
    noise = fixed_noise or Noise(white=gauge)
    u = p.free.start
    f, J = p.evaluate(u)
    settled = False
    for turn in range(ROUNDS):
        u = solve(p, blocks, noise, f, weight, u)
        before, (f, J) = f, p.evaluate(u)
        error = p.value - f
        sd = np.sqrt(noise.variance(p, f))
        own = (error - shrink_common(p, blocks, noise, f, weight, error)) / sd
        moved = float(np.max(np.abs(f - before) / sd, initial=0.0))
        if turn > 1 and moved < SETTLED:
            settled = True
            break
        if fixed_noise is None:
            noise = fit_noise(p, f, J, error, noise, gauge, weight, choose=turn in CHOOSING)
            own = (error - shrink_common(p, blocks, noise, f, weight, error)) / np.sqrt(noise.variance(p, f))
        if robust and len(p) > len(u) + 3:
            weight = np.minimum(1.0, (OUTLIER / np.maximum(np.abs(own), 1e-12)) ** 2)
    return estimate_at(p, u, noise, weight, settled=settled)


def estimate_at(p: Problem, u: Array, noise: Noise, weight: Array, *, settled: bool) -> Estimate:
    """The estimate whose variables, noise and weights are known already."""
    blocks = Blocks.of(p)
    f, J = p.evaluate(u)
    error, variance = p.value - f, noise.variance(p, f)
    own = (error - shrink_common(p, blocks, noise, f, weight, error)) / np.sqrt(variance)
    white, _ = blocks.whiten(variance / weight, noise.common(p, f), np.column_stack([error, J]))
    square = float(white[:, 0] @ white[:, 0]) + float(np.sum(prior_residual(p, u)[0] ** 2))
    return Estimate(p, u, f, error, noise, weight, own, J, white[:, 1:], settled, square)


def _check(p: Problem) -> None:
    if len(p) == 0:
        raise InputError("no reading to calibrate on", remedy="select poses or loads that were measured")
    _, J = p.evaluate(p.free.start)
    norm = np.linalg.norm(J * step_sizes(p), axis=0)
    seen = norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300)
    free = [q.name for q, visible in zip(p.parameters, seen, strict=True) if visible and q.prior is None]
    if len(free) > len(p):
        raise InputError(
            f"{len(p)} reading(s) cannot determine {len(free)} parameters ({', '.join(free)})",
            remedy="measure more poses, set fewer free, or give some of them a prior",
        )


def prior_residual(p: Problem, u: Array) -> tuple[Array, Array]:
    """Standardised distances (k,) from the priors' means, and their derivatives (k, p)."""
    rows, slopes = [], []
    for k, (q, v) in enumerate(zip(p.parameters, u, strict=True)):
        if q.prior is None:
            continue
        mean, sd = q.prior
        slope = np.zeros(len(u))
        if q.scale == "compliance":
            rows.append((-np.log(max(v, 1e-300)) - mean) / sd)
            slope[k] = -1.0 / (max(v, 1e-300) * sd)
        else:
            rows.append((v - mean) / sd)
            slope[k] = 1.0 / sd
        slopes.append(slope)
    return np.array(rows), np.array(slopes).reshape(len(rows), len(u))


def solve(
    p: Problem, blocks: Blocks, noise: Noise, f: Array, weight: Array, start: Array, held: int | None = None
) -> Array:
    """Variables (p,) that minimise the weighted squares for given noise; ``held``: one that stays where it is."""
    variance, common = noise.variance(p, f) / weight, noise.common(p, f)
    moving = np.array([k for k in range(len(start)) if k != held], dtype=np.int64)
    if moving.size == 0:
        return start
    low, high = (b[moving] for b in p.bounds)
    linear = np.array([p.parameters[k].is_linear for k in moving])
    no_prior = all(p.parameters[k].prior is None for k in moving)
    value, J = p.evaluate(start)
    white, _ = blocks.whiten(variance, common, np.column_stack([p.value - value, J[:, moving]]))
    u = start.copy()
    if linear.any():
        columns = moving[linear]
        u[columns] = _bounded(white[:, 0], white[:, 1:][:, linear], start[columns], low[linear], high[linear])
        if linear.all() and no_prior:
            return u
    scale = _scales(white[:, 1:], low, high)

    def residual(z: Array) -> Array:
        at = u.copy()
        at[moving] = z * scale
        r, _ = blocks.whiten(variance, common, (p.value - p.evaluate(at)[0])[:, None])
        return np.concatenate([r[:, 0], prior_residual(p, at)[0]])

    def slope(z: Array) -> Array:
        at = u.copy()
        at[moving] = z * scale
        r, _ = blocks.whiten(variance, common, -p.evaluate(at)[1][:, moving])
        return np.vstack([r, prior_residual(p, at)[1][:, moving]]) * scale

    first = np.clip(u[moving], low, high)
    inside = low + 1e-9 * (high - low), high - 1e-9 * (high - low)
    found = least_squares(
        residual,
        np.clip(first, *inside) / scale,
        slope,
        (low / scale, high / scale),
        method="trf",
        xtol=1e-10,
        ftol=1e-12,
    )
    u[moving] = found.x * scale
    return u


def _bounded(error: Array, A: Array, start: Array, low: Array, high: Array) -> Array:
    """Bounded linear least squares for the step from ``start`` (k,) that removes ``error`` (m,)."""
    norm = np.linalg.norm(A, axis=0)
    seen = norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300)
    out = start.copy()
    if seen.any():
        s = norm[seen]
        box = (low[seen] * s, high[seen] * s)
        target = error + A[:, seen] @ start[seen]
        found = lsq_linear(A[:, seen] / s, target, bounds=box, method="bvls", tol=1e-14, max_iter=1000)
        out[seen] = np.clip(found.x / s, low[seen], high[seen])
    return out


def _scales(A: Array, low: Array, high: Array) -> Array:
    """Lengths (k,) in which the variables are counted: what moves the readings by one standard deviation."""
    norm = np.linalg.norm(A, axis=0)
    span = high - low
    return np.asarray(np.where(norm * span > 1e-9, 1.0 / np.maximum(norm, 1e-300), span))
