"""A parametric study: the best of all combinations of levels, then of finer levels around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.estimation.problem import Problem
from doe.planning.designs import level_grid
from doe.planning.screening import inner
from robots.arrays import Array

# Refinement ends when levels are this close together (ratio of positive numbers, share of the range of others).
SAME = 1e-3
MOST_ROUNDS = 40


@dataclass(frozen=True)
class LevelStudy:
    """The best combination of levels.

    ``u`` (p,): its estimator's variables; ``first`` (p,): the first round's best; ``rms``, ``first_rms``: of the
    residuals (m or rad) with either; ``runs``: model evaluations; ``at_bound``: parameters whose best level is an end
    of their range.
    """

    u: Array
    first: Array
    rms: float
    first_rms: float
    runs: int
    rounds: int
    at_bound: tuple[str, ...]


def level_study(p: Problem, levels: int, *, refine: bool = True) -> LevelStudy:
    """All combinations of ``levels`` of each parameter over its range (in the logarithm where positive).

    With ``refine`` the range narrows to one level on either side of the best one until levels are 0.1 % apart. The
    best is that with the smallest root mean square of residuals, all weighted alike, as in published studies.
    """
    k = len(p.parameters)
    low, high = np.zeros(k), np.ones(k)
    first: tuple[Array, float] | None = None
    runs = rounds = 0
    while True:
        grid = level_grid([np.linspace(a, b, levels) for a, b in zip(low, high, strict=True)])
        u = inner(p.parameters, grid)
        error = np.array([_rms(p, one) for one in u])
        best = int(np.argmin(error))
        runs, rounds = runs + len(grid), rounds + 1
        first = first or (u[best], float(error[best]))
        step = (high - low) / (levels - 1)
        if not refine or rounds == MOST_ROUNDS or np.all(_ratio(p, step) < SAME):
            break
        low, high = np.maximum(grid[best] - step, 0.0), np.minimum(grid[best] + step, 1.0)
    ends = tuple(q.name for q, x in zip(p.parameters, grid[best], strict=True) if x in (0.0, 1.0))
    return LevelStudy(u[best], first[0], float(error[best]), first[1], runs, rounds, ends)


def _rms(p: Problem, u: Array) -> float:
    return float(np.sqrt(np.mean((p.value - p.evaluate(u)[0]) ** 2)))


def _ratio(p: Problem, step: Array) -> Array:
    """How far two neighbouring levels are apart."""
    span = [1.0 if q.scale == "linear" else float(np.log(q.upper / q.lower)) for q in p.parameters]
    return np.asarray(step * np.array(span))
