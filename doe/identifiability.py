"""What the readings can tell apart: combinations of parameters that trade off, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe.estimate import Estimate, prior_residual, step_sizes
from doe.uncertainty import Certainty
from fem.parameters import Parameter

Array = NDArray[np.float64]

# A correlation beyond this, either way, means that two parameters are read as one.
TRADED = 0.9
# Weights of a combination within this of one another are called a sum or a difference.
EQUAL = 1.25
# Parameters whose weight in a combination is below this share of the largest are not named in it.
SMALL = 0.1
# A combination whose value is known this well (relative standard deviation) is called determined.
KNOWN = 0.5


@dataclass(frozen=True)
class TradeOff:
    """Parameters that the readings see only together.

    ``parameters``: their names; ``weights`` (k,) of the estimator's variables in the best determined combination,
    the largest 1; ``value`` and ``sd`` of that combination, in ``unit``; ``words``: one sentence.
    """

    parameters: tuple[str, ...]
    weights: Array
    value: float
    sd: float
    unit: str
    words: str


def trade_offs(e: Estimate, c: Certainty) -> tuple[TradeOff, ...]:
    """Groups of parameters that trade off, each with its best determined combination.

    Two parameters belong together if their estimates correlate beyond 0.9, with bounds ignored. Parameters that no
    reading moves with form no group; :func:`unseen` names them.
    """
    correlation, covariance, index = correlations(e)
    out = []
    for group in _groups(np.abs(correlation) > TRADED):
        out.append(_trade_off(e, covariance[np.ix_(group, group)], index[group]))
    return tuple(out)


def unseen(e: Estimate) -> tuple[str, ...]:
    """Names of the parameters that no reading moves with."""
    return tuple(q.name for q, visible in zip(e.problem.parameters, e.seen, strict=True) if not visible)


def correlations(e: Estimate) -> tuple[Array, Array, NDArray[np.intp]]:
    """Correlations and covariance of the variables seen, bounds ignored, and their positions.

    Directions without information get the variance of their whole range, so that they show as trade-offs.
    """
    index = np.flatnonzero(e.seen)
    A = np.vstack([e.whitened, prior_residual(e.problem, e.u)[1]])[:, index]
    span = step_sizes(e.problem)[index]
    information = (A * span).T @ (A * span) + np.eye(index.size)
    covariance = np.linalg.inv(information) * np.outer(span, span)
    sd = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sd, sd), covariance, index


def _groups(joined: NDArray[np.bool_]) -> list[list[int]]:
    """Connected groups of two or more."""
    left, groups = set(range(len(joined))), []
    while left:
        group, edge = [], [left.pop()]
        while edge:
            k = edge.pop()
            group.append(k)
            near = {j for j in left if joined[k, j]}
            left -= near
            edge += sorted(near)
        if len(group) > 1:
            groups.append(sorted(group))
    return sorted(groups)


def _trade_off(e: Estimate, covariance: Array, index: NDArray[np.intp]) -> TradeOff:
    """The combination of a group's variables with the smallest relative variance."""
    parameters = [e.problem.parameters[k] for k in index]
    u = e.u[index]
    sd = np.sqrt(np.diag(covariance))
    _, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    weights = vectors[:, 0] / sd
    weights = weights / weights[np.argmax(np.abs(weights * sd))]
    alike = len({_unit(q) for q in parameters}) == 1
    if alike:
        weights = weights / weights[np.argmax(np.abs(weights))]
    kept = np.abs(weights * sd) > SMALL * np.abs(weights * sd).max()
    value, spread = float(weights @ u), math.sqrt(max(float(weights @ covariance @ weights), 0.0))
    names = tuple(q.name for q, use in zip(parameters, kept, strict=True) if use)
    unit = _unit(parameters[0]) if alike else "mixed units"
    words = _words(
        [q for q, use in zip(parameters, kept, strict=True) if use], weights[kept], value, spread, unit, alike
    )
    return TradeOff(names, weights[kept], value, spread, unit, words)


def _unit(q: Parameter) -> str:
    """Unit of the estimator's variable."""
    if q.scale == "compliance":
        return {"N m/rad": "rad/(N m)", "N/m": "m/N", "Pa": "1/Pa"}.get(q.unit, f"1/({q.unit})")
    return f"ln({q.unit})" if q.scale == "log" else q.unit


def _words(q: list[Parameter], weights: Array, value: float, sd: float, unit: str, alike: bool) -> str:
    compliances = all(p.scale == "compliance" for p in q)
    what = "compliances" if compliances else "values"
    names = _listed([p.name for p in q])
    if not alike:
        return f"{names} trade off: these readings see them only together, in a mix of different units"
    size = f"{value:.2g} +- {sd:.1g} {unit}"
    known = sd < KNOWN * abs(value) or (abs(value) < 1e-300 and sd > 0.0)
    verb = "is determined" if known else "would be determined, and that poorly"
    ratio = np.abs(weights).max() / np.abs(weights).min()
    if ratio < EQUAL and (weights > 0).all():
        return f"{names} trade off: only the sum of their {what}, {size}, {verb} by these poses"
    if ratio < EQUAL and len(q) == 2:
        return f"{names} trade off: only the difference of their {what}, {size}, {verb} by these poses"
    sign = "c" if compliances else "x"
    terms = " ".join(f"{w:+.2g} {sign}({p.name})" for p, w in zip(q, weights, strict=True)).lstrip("+")
    return f"{names} trade off: only {terms} = {size} {verb} by these poses"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + " and " + names[-1]
