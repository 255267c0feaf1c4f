"""Estimation problems without a robot, small enough for closed forms: readings of one component, any function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from doe.estimation.problem import Problem
from fem.free.kinds import KINDS
from fem.free.model import FreeModel
from fem.free.parameters import Parameter
from robots.arrays import Array, Indices, Integers

Evaluate = Callable[[Array], tuple[Array, Array]]

DZ = 2


class PlainModel:
    """Stands in for a model with numbers set free: ``work(u)`` gives readings (m,) and derivatives (m, p)."""

    def __init__(self, parameters: Sequence[Parameter], start: Array, work: Evaluate) -> None:
        self.parameters, self.start, self._work = tuple(parameters), start, work
        self.is_linear = all(p.is_linear for p in parameters)

    def evaluate(self, u: Array) -> tuple[Array, Array]:
        f, J = self._work(u)
        value, slopes = np.zeros((len(f), 6)), np.zeros((len(f), 6, len(u)))
        value[:, DZ], slopes[:, DZ] = f, J
        return value, slopes

    def displacement(self, u: Array) -> Array:
        return self.evaluate(u)[0]

    def take(self, rows: Indices) -> tuple[PlainModel, Indices]:
        def work(u: Array) -> tuple[Array, Array]:
            f, J = self._work(u)
            return f[rows], J[rows]

        part = PlainModel(self.parameters, self.start, work)
        part.is_linear = self.is_linear
        return part, np.arange(len(rows))


def problem_of(model: PlainModel, value: Array, pose: Integers | None = None) -> Problem:
    """One reading of dz a row; ``pose`` (m,), by default a pose each."""
    rows = np.arange(len(value))
    where = rows if pose is None else pose
    free = cast(FreeModel, cast(Any, model))
    labels = tuple(f"P{k}" for k in range(int(where.max()) + 1))
    return Problem(free, value, rows, np.full(len(value), DZ), where, labels, rows, np.full(len(value), np.nan))


def linear(
    A: Array, value: Array, pose: Integers | None = None, ranges: Sequence[tuple[float, float]] | None = None
) -> Problem:
    """Readings A u with linear variables in ``ranges``, by default -1000 to 1000."""
    ends = ranges or [(-1e3, 1e3)] * A.shape[1]
    parameters = [
        Parameter(f"x{k}", KINDS[1], "base", (k,), "", 0.0, low, high, "linear") for k, (low, high) in enumerate(ends)
    ]
    return problem_of(PlainModel(parameters, np.zeros(A.shape[1]), lambda u: (A @ u, A)), value, pose)
