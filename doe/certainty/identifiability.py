"""What the readings can tell apart: combinations of parameters that trade off."""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from doe.certainty.combinations import (
    KNOWN,
    Combination,
    alike,
    combination_words,
    complement,
    components,
    group_words,
    groups,
    near_words,
    sparsest,
    unit_of,
)
from doe.certainty.uncertainty import Certainty, determined_covariance
from doe.estimation.estimate import Estimate, step_sizes
from fem.free.parameters import Parameter
from robots.arrays import Array, Indices

# A correlation beyond this, either way, means that two parameters are read as one.
TRADED = 0.9
# Two parameters that are both known this well by themselves (relative standard deviation) have little left to trade.
WELL_KNOWN = 0.1
# Parameters whose weight in a combination is below this share of the largest are not named in it.
SMALL = 0.1


@dataclass(frozen=True)
class TradeOff:
    """Parameters that the readings see only together.

    ``parameters``: their names; ``combinations``: independent ones that the readings determine, best known first;
    ``words``: what an engineer wants to know; ``missing``: how many numbers must come from elsewhere before all are
    determined (0: all are, but poorly).
    """

    parameters: tuple[str, ...]
    combinations: tuple[Combination, ...]
    words: str
    missing: int = 0

    @property
    def best(self) -> Combination:
        """The best determined combination."""
        return self.combinations[0]

    @property
    def weights(self) -> Array:
        """Weights (k,) of the parameters' estimator's variables in the best determined combination, the largest 1."""
        own = dict(zip(self.best.names, self.best.weights, strict=True))
        return np.array([own.get(name, 0.0) for name in self.parameters])


def trade_offs(e: Estimate, c: Certainty) -> tuple[TradeOff, ...]:
    """Groups of parameters that trade off, each with its best determined combinations.

    First those that no reading separates, whatever the noise (``c.null``); among the others, two belong together if
    their estimates correlate beyond 0.9, with bounds ignored, and not both are known within 10 %. Parameters that no
    reading moves with form no group; :func:`unseen` names them.
    """
    out = []
    correlation, covariance, index = correlations(e)
    exact = _inseparable(e, c)
    for group, null in exact:
        out.append(_exact(e, group, null))
    taken = {int(k) for group, _ in exact for k in group}
    free = np.array([k for k, j in enumerate(index) if int(j) not in taken], dtype=np.intp)
    poor = np.sqrt(np.diag(covariance)) > WELL_KNOWN * np.abs(e.u[index])
    joined = (np.abs(correlation) > TRADED) & (poor[:, None] | poor)
    for group_of_free in groups(joined[np.ix_(free, free)]):
        group = free[group_of_free]
        out.append(_near(e, covariance[np.ix_(group, group)], index[group]))
    return tuple(out)


def unseen(e: Estimate) -> tuple[str, ...]:
    """Names of the parameters that no reading moves with."""
    return tuple(q.name for q, visible in zip(e.problem.parameters, e.seen, strict=True) if not visible)


def correlations(e: Estimate) -> tuple[Array, Array, Indices]:
    """Correlations and covariance of the variables seen, bounds ignored, and their positions.

    Directions without information get the variance of their whole range, so that they show as trade-offs.
    """
    index = np.flatnonzero(e.seen)
    A = e.rows[:, index]
    span = step_sizes(e.problem)[index]
    information = (A * span).T @ (A * span) + np.eye(index.size)
    covariance = np.linalg.inv(information) * np.outer(span, span)
    sd = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sd, sd), covariance, index


def _inseparable(e: Estimate, c: Certainty) -> list[tuple[Indices, Array]]:
    """Groups of variables joined by directions without information, and those directions (columns of norm one)."""
    if not len(c.null):
        return []
    norm = np.where(e.seen, np.linalg.norm(e.rows, axis=0), 0.0)
    null = c.null * norm
    null = null / np.linalg.norm(null, axis=1, keepdims=True)
    return [(g, _rank_basis(null[:, g])) for g in components(null)]


def _rank_basis(rows: Array) -> Array:
    """Orthonormal rows with the same span."""
    _, s, V = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(V[s > 1e-6 * s.max(initial=1e-300)])


def _exact(e: Estimate, group: Indices, null: Array) -> TradeOff:
    """A group of which only some combinations are determined: those with the fewest terms, best known first."""
    A = e.rows
    norm = np.linalg.norm(A[:, group], axis=0)
    parameters = [e.problem.parameters[k] for k in group]
    covariance = determined_covariance(A, e.seen)[0][np.ix_(group, group)]
    rows, _ = sparsest(complement(null))
    found = sorted(
        (_combination(parameters, row * norm, e.u[group], covariance) for row in rows), key=attrgetter("relative")
    )
    twins = [tuple(parameters[j].name for j in same) for same in alike(null)]
    given = tuple(parameters[j].name for j in sparsest(null)[1])
    names = tuple(q.name for q in parameters)
    single = len(found) == 1 and len(names) == 2
    words = found[0].words if single else group_words(parameters, found, twins, given)
    return TradeOff(names, tuple(found), words, len(null))


def _near(e: Estimate, covariance: Array, index: Indices) -> TradeOff:
    """A group that correlates: the combinations with the smallest and the largest relative variance."""
    parameters = [e.problem.parameters[k] for k in index]
    sd = np.sqrt(np.diag(covariance))
    _, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    best, worst = (_combination(parameters, vectors[:, k] / sd, e.u[index], covariance, SMALL) for k in (0, -1))
    names = tuple(q.name for q in parameters)
    if len(names) == 2:
        return TradeOff(best.names, (best,), best.words)
    return TradeOff(names, (best,), near_words(parameters, best, worst))


def _combination(
    parameters: list[Parameter], weights: Array, u: Array, covariance: Array, small: float = 0.0
) -> Combination:
    """A combination with its value; terms that hardly count (their standard deviation's share) are left out."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.abs(weights) * (sd if small else 1.0)
    kept = size > small * size.max()
    units = {unit_of(q) for q, use in zip(parameters, kept, strict=True) if use}
    # Where units differ, the first term has weight one; else the first of the largest that are left.
    largest = np.abs(weights) > 0.999 * np.abs(weights[kept]).max()
    lead = int(np.flatnonzero(kept & ((len(units) > 1) | largest))[0])
    weights = np.where(kept, weights / weights[lead], 0.0)
    value = float(weights @ u)
    spread = math.sqrt(max(float(weights @ covariance @ weights), 0.0))
    relative = spread / max(float(np.abs(weights * u).sum()), 1e-300)
    unit = units.pop() if len(units) == 1 else "mixed units"
    chosen = [q for q, use in zip(parameters, kept, strict=True) if use]
    words = combination_words(chosen, weights[kept], value, spread, unit, relative < KNOWN)
    return Combination(tuple(q.name for q in chosen), weights[kept], value, spread, unit, relative, words)
