"""Variances by marginal likelihood: of the readings, and of what is not there unless the readings ask for it.

Variables with a law (joint error curves, the rail's bow) are draws from normal distributions about zero, ``u ~ N(0, s^2
g)``, with sizes s and shapes g (by order) that the readings tell: what maximises the likelihood with all variables
integrated out (restricted likelihood; MacKay 1992, doi:10.1162/neco.1992.4.3.415; Wood 2011,
doi:10.1111/j.1467-9868.2010.00749.x). It needs the reduced triangle alone: it costs the same for any number of poses.
A curve's variance by order N is ``a^2 / (1 + (N / b)^2)^2``: smooth on scales below a turn over b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from doe.absolute.reduced import Reduced, upper
from doe.absolute.unknowns import Unknown
from robots.arrays import Array, Indices

# A curve's size (rad) and the order beyond which it falls off, at first; bows and turns of rails.
START = {"periodic": (2e-4, 10.0), "rail.bow": (2e-4, 3.0), "rail.turn": (1e-4, 3.0)}
# Within which they are looked for.
MOST_STEPS = 20
SIZES, ORDERS = (1e-9, 0.1), (0.3, 300.0)


@dataclass(frozen=True)
class Variances:
    """``sigma`` m: of a reading in each direction; ``laws``: size a and order b of each law."""

    sigma: float
    laws: dict[str, tuple[float, float]] = field(default_factory=dict)

    def sds(self, unknowns: Sequence[Unknown]) -> Array:
        """Standard deviations (p,) of the variables before they were read; inf for those of which nothing is known."""
        return np.array([self._sd(one) for one in unknowns])

    def _sd(self, one: Unknown) -> float:
        if not one.law:
            return one.sd
        a, b = self.laws[one.law]
        return a / (1.0 + (one.index[1] / b) ** 2)


def starting(unknowns: Sequence[Unknown], sigma: float) -> Variances:
    """Variances before any reading was looked at."""
    return Variances(sigma, {law: START[law] for law in dict.fromkeys(one.law for one in unknowns if one.law)})


@dataclass(frozen=True)
class Posterior:
    """The variables' distribution given variances.

    ``root`` (p, p): a triangle whose inverse times that's transpose is the covariance; ``step`` (p,) to the mean.
    """

    root: Array
    step: Array

    @property
    def half(self) -> Array:
        """H (p, p) with covariance H H^T."""
        return np.asarray(solve_triangular(self.root, np.eye(len(self.root))))


def step_with(free: Posterior, places: Indices, step: Array) -> Array:
    """The likeliest step (p,) of all variables where some, at ``places``, take a step that is given."""
    p = len(free.step)
    other, out = np.setdiff1d(np.arange(p), places), np.zeros(p)
    R = upper(np.column_stack([free.root[:, other], free.root[:, places], free.root @ free.step]))
    k = len(other)
    out[places] = step
    out[other] = solve_triangular(R[:k, :k], R[:k, p] - R[:k, k:p] @ step)
    return out


def posterior(of: Reduced, u: Array, start: Array, sd: Array, sigma: float) -> tuple[Posterior, float]:
    """Distribution at variables u (p,) with priors ``sd`` about ``start`` (p,), and the least sum of squares.

    The sum is of readings over sigma and of distances from priors.
    """
    known = np.flatnonzero(np.isfinite(sd))
    width = len(u)
    prior = np.zeros((len(known), width + 1))
    prior[np.arange(len(known)), known] = 1.0 / sd[known]
    prior[:, -1] = (start - u)[known] / sd[known]
    rows = np.vstack([np.column_stack([of.R, of.z]) / sigma, prior])
    R = upper(rows)
    square = of.rest / sigma**2 + (float(R[width, -1] ** 2) if len(R) > width else 0.0)
    root = R[:width, :width] * np.where(np.diag(R[:width]) < 0.0, -1.0, 1.0)[:, None]
    z = R[:width, -1] * np.where(np.diag(R[:width]) < 0.0, -1.0, 1.0)
    d = np.diag(root)
    floor = 1e-13 * max(float(d.max(initial=0.0)), 1e-300)
    root = root + np.diag(np.where(d < floor, floor, 0.0))
    return Posterior(root, solve_triangular(root, z)), square


def likeliest(of: Reduced, u: Array, unknowns: Sequence[Unknown], start: Variances, readings: int) -> Variances:
    """Variances of the largest marginal likelihood, by quasi-Newton steps with exact slopes in their logarithms.

    ``readings``: rows that were reduced, less six for each frame.
    """
    names = list(start.laws)

    def loss(x: Array) -> tuple[float, Array]:
        return minus_log(of, u, unknowns, _variances(x, names), readings)

    bounds = [(np.log(1e-7), np.log(1.0))] + [tuple(np.log(b)) for _ in names for b in (SIZES, ORDERS)]
    found = minimize(
        loss,
        _logarithms(start, names),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": MOST_STEPS, "ftol": 1e-9},
    )
    return _variances(np.asarray(found.x), names)


def minus_log(of: Reduced, u: Array, unknowns: Sequence[Unknown], v: Variances, readings: int) -> tuple[float, Array]:
    """Minus the logarithm of the marginal likelihood, but for a constant, and its slopes (1 + 2 laws,).

    Slopes are by the logarithms of the scatter, and of each law's size and order.
    """
    start, sd = np.array([one.start for one in unknowns]), v.sds(unknowns)
    found, square = posterior(of, u, start, sd, v.sigma)
    known = np.isfinite(sd)
    value = readings * np.log(v.sigma) + float(np.log(np.diag(found.root)).sum())
    value += float(np.log(sd[known]).sum()) + 0.5 * square
    # By the logarithm of a prior's standard deviation: 1 - (variance + distance^2) / sd^2.
    spread = np.sum(found.half**2, axis=1) + (u + found.step - start) ** 2
    by_sd = np.where(known, 1.0 - spread / np.where(known, sd, 1.0) ** 2, 0.0)
    residual = of.z - of.R @ found.step
    used = float(np.sum((of.R @ found.half) ** 2)) + float(residual @ residual) + of.rest
    slopes = [readings - used / v.sigma**2]
    for law, (_, b) in v.laws.items():
        mine = np.array([one.law == law for one in unknowns])
        ratio = np.array([one.index[1] / b if one.law == law else 0.0 for one in unknowns]) ** 2
        slopes += [float(by_sd[mine].sum()), float((by_sd * 2.0 * ratio / (1.0 + ratio)).sum())]
    return value, np.array(slopes)


def _logarithms(v: Variances, names: Sequence[str]) -> Array:
    return np.log([v.sigma, *(number for name in names for number in v.laws[name])])


def _variances(x: Array, names: Sequence[str]) -> Variances:
    a = np.exp(x)
    return Variances(float(a[0]), {name: (float(a[1 + 2 * k]), float(a[2 + 2 * k])) for k, name in enumerate(names)})
