"""How sure: covariance, intervals by profile likelihood, bootstrap over poses; nothing doubtful as a plain number."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtri, stdtrit

from doe.certainty.profile_likelihood import profile_end, rise_of
from doe.estimation.estimate import Estimate, estimate, seen_columns, step_sizes
from doe.estimation.least_squares import is_convex
from doe.estimation.noise import likelihood
from doe.estimation.problem import Problem
from fem.free.parameters import FreeLaw, Parameter
from robots import InputError, require_at_least
from robots.arrays import Array, Bools, Indices, Integers
from robots.progress import Progress, report_progress

Status = Literal["determined", "one-sided", "at bound", "not identified"]

# Directions whose singular value is below 1/this of the largest are not determined (columns of norm one).
MAX_CONDITION = 1e6
# A parameter with more than this part in an undetermined direction is not determined by itself.
MIXED = 1e-6
# A law's part in what is not determined that counts as rounding.
NO_PART = 1e-6
# A variable this close to an end of its range (share of the value there) stands at it.
AT_END = 1e-6


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter with what the data say about it.

    ``value`` and ``interval`` (95 %) in the parameter's unit: infinite ends where the data do not exclude a rigid
    part, NaN where nothing can be said. ``sd``: standard deviation of the estimator's variable (1/value, ln value
    or the value), NaN at a bound. ``status``: "determined"; "one-sided" (only a limit on one side); "at bound"
    (the estimate stands at an end of its range); "not identified" (no reading moves with it, or only combinations
    with others are determined: then the value is one of many). ``degrees_of_freedom``: of its interval.
    """

    parameter: Parameter
    value: float
    interval: tuple[float, float]
    sd: float
    status: Status
    degrees_of_freedom: float


@dataclass(frozen=True)
class Certainty:
    """``estimates``; ``covariance`` (p, p) of the estimator's variables, zero for those at bounds or unseen.

    ``singular`` (r,): singular values of the derivatives with unit covariance and columns of norm one;
    ``null`` (d, p): directions of the variables that no reading determines, length one.
    """

    estimates: tuple[ParameterEstimate, ...]
    covariance: Array
    singular: Array
    null: Array

    @property
    def condition(self) -> float:
        """Condition number of the scaled derivatives."""
        s = self.singular
        return float(s[0] / s[-1]) if s.size and s[-1] > 0.0 else math.inf


@dataclass(frozen=True)
class LawBand:
    """``stiffness``, ``low``, ``high`` (n,) N m/rad at n poses; NaN where the readings do not determine it."""

    stiffness: Array
    low: Array
    high: Array


def certainty(e: Estimate, level: float = 0.95, *, profiles: bool = True) -> Certainty:
    """Intervals of all parameters of an estimate.

    Profile likelihood: a value belongs to the interval if, with the best values of all others within their bounds,
    the sum of squares rises by less than Student's t squared, with Satterthwaite's degrees of freedom
    (:func:`degrees_of_freedom`). ``profiles=False`` takes the parabola.
    """
    p, A = e.problem, e.rows
    low, high = p.bounds
    at_low, at_high = _at_end(e.u, low, high), _at_end(e.u, high, low)
    seen = seen_columns(p, A)
    inner = seen & ~at_low & ~at_high
    whole, (singular, null) = determined_covariance(A, seen)
    covariance = whole if inner[seen].all() else determined_covariance(A, inner)[0]
    # One at its bound counts as fitted, so that intervals are wider rather than narrower.
    dof = degrees_of_freedom(e, whole, seen)
    mixed = ~seen | np.any(np.abs(null * step_sizes(p)) > MIXED * np.abs(null * step_sizes(p)).max(initial=1.0), axis=0)
    out = []
    for k, q in enumerate(p.parameters):
        if mixed[k]:
            value = q.outer(float(e.u[k])) if seen[k] else math.nan
            out.append(ParameterEstimate(q, value, (math.nan, math.nan), math.nan, "not identified", float(dof[k])))
            continue
        sd = math.sqrt(covariance[k, k]) if inner[k] else math.nan
        ends = _limits(e, k, covariance, sd, _quantile(level, float(dof[k])), profiles)
        out.append(_judged(q, float(e.u[k]), ends, (bool(at_low[k]), bool(at_high[k])), sd, float(dof[k])))
    return Certainty(tuple(out), covariance, singular, null)


def degrees_of_freedom(e: Estimate, covariance: Array, seen: Bools) -> Array:
    """Degrees of freedom (p,) of the variances on the diagonal of ``covariance`` (p, p); infinite for given noise.

    The variance of an estimate is itself estimated, from variances t of the noise with covariance W (twice the inverse
    of ``tr(P V_i P V_j)``, :mod:`doe.estimation.restricted_likelihood`). Matching the first two moments of a chi-square
    distribution gives ``2 v^2 / (g^T W g)`` degrees of freedom for a variance v with slopes g = dv/dt (Satterthwaite;
    Giesbrecht and Burns 1985, doi:10.2307/2530872; Fai and Cornelius 1996, doi:10.1080/00949659608811740). With white
    noise alone that is readings less parameters; where set-ups scatter, it is near the number of set-ups less
    parameters.

    A variance that was found to be zero is as uncertain as one that was not, and counts: with nine set-ups readings can
    hardly tell which kind of scatter there is, and intervals that take the choice for certain hold the truth 80 to 90 %
    of the time where it was wrong (docs/validation/calibration_coverage.md).

    ``seen`` (p,): which parameters took part in the fit. NaN where there are fewer readings than those.
    """
    return satterthwaite(e, covariance, seen, np.eye(len(e.u)), np.diag(covariance))


def satterthwaite(e: Estimate, covariance: Array, seen: Bools, D: Array, v: Array, own: Array | None = None) -> Array:
    """Degrees of freedom (n,) of variances ``v`` (n,) along directions D (p, n) of the variables.

    ``own`` (k, n): slopes of what v has beside ``D^T covariance D`` by the variances of the noise that were estimated.
    The rest as of :func:`degrees_of_freedom`.
    """
    p, names = e.problem, e.estimated
    if not names:
        return np.full(len(v), math.inf)
    of = likelihood(p, names, e.noise, e.prediction, e.jacobian[:, seen], e.residual, e.weight)
    if of.basis.shape[1] >= len(p):
        return np.full(len(v), math.nan)
    at = of.at(e.noise.variances(names))
    information = at.information()
    Y = at.V.solve(e.jacobian) @ covariance
    slopes = []
    for term in of.terms:
        # The slope of the covariance itself, a matrix as small as there are parameters.
        way = of.blocks.add(term.pattern[:, None] * Y) if term.common else np.sqrt(term.pattern)[:, None] * Y
        slopes.append(np.sum(((way.T @ way) @ D) * D, axis=0))
    g = np.array(slopes) if own is None else np.array(slopes) + own
    scale = 1.0 / np.sqrt(np.diag(information))
    W = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-10, hermitian=True)
    spread = np.einsum("ip,ij,jp->p", g * scale[:, None], W, g * scale[:, None])
    return np.asarray(np.where(spread > 0.0, 2.0 * v**2 / np.where(spread > 0.0, spread, 1.0), math.inf))


def law_band(e: Estimate, c: Certainty, law: FreeLaw, q: Array) -> LawBand:
    """The spring of a law with its pointwise 95 % band at poses q (n, dof) rad.

    By the covariance of ln k, linear in the coefficients, with Student's t of the coefficient with the fewest degrees
    of freedom. NaN where a coefficient counts that no reading moves with or that stands at an end of its range, or a
    combination that no reading determines. Priors that keep a law flat are part of the covariance: where nothing was
    read the band is as wide as these say.
    """
    B = law.basis(q)
    mine = slice(law.first, law.first + law.basis.size)
    log_k = B @ e.u[mine]
    sd = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", B, c.covariance[mine, mine], B), 0.0))
    coefficients = c.estimates[mine]
    lost = np.array([k.status == "at bound" for k in coefficients]) | ~e.seen[mine]
    told = np.abs(B[:, lost]).max(axis=1, initial=0.0) < NO_PART
    told &= np.abs(B @ c.null[:, mine].T).max(axis=1, initial=0.0) < NO_PART
    dof = min((k.degrees_of_freedom for k in coefficients), default=math.nan)
    t = _quantile(0.95, dof)
    k = np.where(told, np.exp(log_k), np.nan)
    return LawBand(k, k * np.exp(-t * sd), k * np.exp(t * sd))


def null_directions(A: Array, seen: Bools) -> Array:
    """Directions (d, p), length one, that rows A (m, p) do not determine, of the columns ``seen`` (p,)."""
    return determined_covariance(A, seen)[1][1]


def bootstrap(e: Estimate, rng: np.random.Generator, times: int = 200, progress: Progress | None = None) -> Array:
    """Values (times, p) re-estimated from poses drawn with replacement, noise as estimated.

    Poses, not readings: what a set-up's readings have in common stays together. A row whose poses cannot
    determine the parameters is NaN.

    Raises
    ------
    InputError
        Fewer than three poses.
    """
    p = e.problem
    require_at_least("poses for a bootstrap", len(p.poses), 3, code="C001")
    groups = [np.flatnonzero(p.pose == k) for k in range(len(p.poses))]
    out = np.full((times, len(e.u)), np.nan)
    for i in range(times):
        drawn = rng.integers(0, len(groups), len(groups))
        try:
            one = estimate(_drawn(p, groups, drawn), (0.0, 0.0), fixed_noise=e.noise, robust=False)
        except InputError:
            continue
        out[i] = one.values
        report_progress(progress, i + 1, times)
    return out


def _drawn(p: Problem, groups: list[Indices], drawn: Integers) -> Problem:
    rows = np.concatenate([groups[k] for k in drawn])
    pose = np.repeat(np.arange(len(drawn)), [len(groups[k]) for k in drawn])
    labels = tuple(f"{p.poses[k]} ({i})" for i, k in enumerate(drawn))
    return replace(
        p,
        value=p.value[rows],
        row=p.row[rows],
        component=p.component[rows],
        pose=pose,
        poses=labels,
        replicate=p.replicate[rows],
        sigma=p.sigma[rows],
    )


def _at_end(u: Array, end: Array, other: Array) -> Bools:
    near = AT_END * np.where(end != 0.0, np.abs(end), np.abs(other))
    return np.asarray(np.abs(u - end) <= near)


def determined_covariance(A: Array, use: Bools) -> tuple[Array, tuple[Array, Array]]:
    """Covariance (p, p) of the columns used (zero elsewhere), their singular values, and the null directions."""
    p = A.shape[1]
    out, columns = np.zeros((p, p)), np.flatnonzero(use)
    if columns.size == 0:
        return out, (np.zeros(0), np.zeros((0, p)))
    norm = np.linalg.norm(A[:, columns], axis=0)
    _, s, V = np.linalg.svd(np.linalg.qr(A[:, columns] / norm, mode="r"), full_matrices=True)
    s = np.concatenate([s, np.zeros(len(V) - len(s))])
    good = s * MAX_CONDITION >= s[0]
    inverse = (V[good].T / s[good] ** 2) @ V[good]
    out[np.ix_(columns, columns)] = inverse / np.outer(norm, norm)
    null = np.zeros((int((~good).sum()), p))
    null[:, columns] = V[~good] / norm
    length = np.linalg.norm(null, axis=1, keepdims=True)
    return out, (s, null / np.where(length > 0.0, length, 1.0))


def _quantile(level: float, dof: float) -> float:
    if math.isnan(dof) or dof <= 0.0:
        return math.nan
    tail = 0.5 + level / 2.0
    return float(ndtri(tail)) if math.isinf(dof) else float(stdtrit(max(dof, 1.0), tail))


def _limits(e: Estimate, k: int, covariance: Array, sd: float, quantile: float, profiles: bool) -> tuple[float, float]:
    """Ends of the interval of variable k; an end of its range where the data do not exclude that."""
    low, high = (float(b[k]) for b in e.problem.bounds)
    u = float(e.u[k])
    if math.isnan(quantile):
        return math.nan, math.nan
    parabola = max(u - quantile * sd, low), min(u + quantile * sd, high)
    if not math.isnan(sd) and (not profiles or _is_parabola(e, k, covariance, quantile * sd)):
        return parabola
    rise, guess = rise_of(e, k, covariance), quantile * sd if sd > 0.0 else 0.1 * (high - low)
    return profile_end(rise, u, low, quantile, guess), profile_end(rise, u, high, quantile, guess)


def _is_parabola(e: Estimate, k: int, covariance: Array, way: float) -> bool:
    """Whether the profile is exactly a parabola: a convex problem in which no variable meets a bound on the way."""
    low, high = e.problem.bounds
    if not is_convex(e.problem) or ((e.u <= low) | (e.u >= high))[np.diag(covariance) == 0.0].any():
        return False
    drift = np.abs(covariance[:, k]) / covariance[k, k] * way
    return bool(((e.u - drift >= low) & (e.u + drift <= high))[np.arange(len(e.u)) != k].all())


def _judged(
    q: Parameter, u: float, ends: tuple[float, float], at: tuple[bool, bool], sd: float, dof: float
) -> ParameterEstimate:
    """Status and interval in the parameter's unit from those of the estimator's variable."""
    low, high = q.inner_bounds
    span = high - low
    open_low = not math.isnan(ends[0]) and ends[0] <= low + AT_END * (abs(low) if low else span)
    open_high = not math.isnan(ends[1]) and ends[1] >= high - AT_END * (abs(high) if high else span)
    outer = sorted(
        [_outer_end(q, ends[0], low if open_low else None), _outer_end(q, ends[1], high if open_high else None)]
    )
    interval = (outer[0], outer[1]) if not math.isnan(ends[0]) else (math.nan, math.nan)
    status: Status = "determined"
    if open_low and open_high:
        status, interval = "not identified", (math.nan, math.nan)
    elif any(at):
        status = "at bound"
    elif open_low or open_high:
        status = "one-sided"
    return ParameterEstimate(q, q.outer(u), interval, sd, status, dof)


def _outer_end(q: Parameter, u: float, bound: float | None) -> float:
    """An end in the parameter's unit; ``bound``: the end of the range that the data do not exclude, if they do not.

    Then there is no limit on that side: a stiffness may be rigid, an amplitude that has no sign may be none.
    """
    if bound is None:
        return q.outer(u)
    if q.outer(bound) >= q.upper * (1.0 - 1e-3):
        return math.inf
    return 0.0 if q.lower >= 0.0 else -math.inf
