"""Intervals of stiffness along a path: the index worked out again for arms drawn from what is uncertain about theirs.

An index is no linear function of the compliance, and the worst point of a path is none of its points, so intervals come
from drawn arms (JCGM 101:2008): ``C_tt = rest + sum_j v_j D_j`` with variables v drawn. All courses of a path share the
draws: what is uncertain about the arm is common to them, and largely cancels in their ratio.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import fem
from machining.cutting.spread import Estimated, interval
from machining.cutting.stiffness_uncertainty import StiffnessUncertainty
from machining.stiffness.cartesian import translational
from machining.stiffness.objective import Objective
from machining.task import Task
from robots.arrays import Array, Integers

# An end of a 95 % interval from so many draws is good to some 6 % of its half-width.
DRAWS = 1000
# Compliances worked on at once: some 40 MB.
AT_ONCE = 500_000
# Step along a change that a calibration left open, share of it: first order, as everywhere.
STEP = 1e-3
# Shares of the mean below which what a calibration left open does not matter.
SHARE = 0.01


@dataclass(frozen=True, eq=False)
class Drawn:
    """A quantity along a course: ``value`` (n,), that of drawn arms ``draws`` (c, n).

    ``open_share``: by which share of the mean each parameter that the calibration left open may change it.
    """

    value: Array
    draws: Array
    open_share: Mapping[str, float]

    @property
    def matters(self) -> dict[str, float]:
        """What of :attr:`open_share` is more than 1 %: no interval holds it."""
        return {name: share for name, share in self.open_share.items() if share > SHARE}

    def estimated(self, statistic: Callable[[Array], Array]) -> Estimated:
        """A statistic of the values along the path, (..., n) to (...), with its interval."""
        return Estimated(float(statistic(self.value)), *interval(np.asarray(statistic(self.draws))))

    def ratio(self, other: Drawn, statistic: Callable[[Array], Array]) -> Estimated:
        """A statistic here over that of another course, from common draws."""
        drawn = np.asarray(statistic(self.draws)) / np.asarray(statistic(other.draws))
        return Estimated(float(statistic(self.value) / statistic(other.value)), *interval(drawn))


def drawn_stiffness(
    model: fem.ArmModel,
    task: Task,
    q: Array,
    stiffness: StiffnessUncertainty,
    of: Callable[[Array, Integers], Array],
    generator: np.random.Generator,
    draws: int = DRAWS,
) -> Drawn:
    """A quantity of C_tt along postures q (n, dof) rad, for arms drawn from ``stiffness``.

    ``of``: compliances (k, 3, 3) m/N at the path points (k,) to values (k,). The same generator state gives the same
    arms, so draw for each course of a path from a copy of it.
    """
    C = translational(model, q, task.tip)
    found = stiffness.influence(model, q, task.tip)
    n, points = len(q), np.arange(len(q))
    value = of(C, points)
    rest = C - np.einsum("j,njab->nab", stiffness.value, found.D)
    v = stiffness.draws(draws, generator)
    out = np.empty((draws, n))
    step = max(1, AT_ONCE // draws)
    for first in range(0, n, step):
        rows = slice(first, first + step)
        D = found.D[rows].transpose(1, 0, 2, 3).reshape(v.shape[1], -1)
        drawn = rest[rows] + (v @ D).reshape(draws, -1, 3, 3)
        out[:, rows] = of(drawn.reshape(-1, 3, 3), np.tile(points[rows], draws)).reshape(draws, -1)
    # To first order a law may be drawn beyond rigid.
    out = np.where(out < 0.0, np.inf, out)
    share = {}
    for k, name in enumerate(found.open_names):
        moved = of(C + STEP * found.open_change[:, k], points)
        share[name] = abs(float(moved.mean() / value.mean()) - 1.0) / STEP
    return Drawn(value, out, share)


def drawn_objective(
    model: fem.ArmModel,
    task: Task,
    courses: Mapping[str, Array],
    objective: Objective,
    stiffness: StiffnessUncertainty,
    seed: int = 0,
) -> dict[str, Drawn]:
    """What courses of postures (n, dof) rad along one path are judged by, for the same drawn arms."""
    force = objective.forces(task.path.n)

    def of(C: Array, point: Integers) -> Array:
        return objective.of_compliance(C, task.normals[point], None if force is None else force[point])

    return {
        name: drawn_stiffness(model, task, q, stiffness, of, np.random.default_rng(seed)) for name, q in courses.items()
    }
