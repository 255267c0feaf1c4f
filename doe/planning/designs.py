"""Experiment designs over springs and over poses."""

from __future__ import annotations

import itertools

import numpy as np

from doe.estimation.study_plan import Factorial
from robots import InputError, Robot
from robots.arrays import Array


def two_level_factorial(factors: int) -> Array:
    """Full two-level factorial (2^k, k) of -1 and +1, first factor fastest (standard order)."""
    rows = itertools.product((-1.0, 1.0), repeat=factors)
    return np.array([row[::-1] for row in rows])


def level_grid(levels: list[Array]) -> Array:
    """All combinations of the given levels, (prod(len), factors), last factor fastest."""
    return np.stack([g.ravel() for g in np.meshgrid(*levels, indexing="ij")], axis=1)


def factorial_poses(robot: Robot, plan: Factorial, *, whole: bool = True) -> Array:
    """Poses (n, dof) rad of the (adjusted) full factorial; coordinates that it does not name stand at zero.

    Not ``whole``: poses that the robot cannot take are left out.

    Raises
    ------
    InputError
        A pose of the design that the robot cannot take.
    """
    columns = [robot.coordinate_index(name) for name in plan.inputs]
    rows = _combinations(plan)
    q = np.zeros((len(rows), robot.dof))
    q[:, columns] = np.radians(np.array(rows))
    reachable = robot.reachable(q)
    if not whole:
        return np.asarray(q[reachable])
    bad = np.flatnonzero(~reachable)
    if bad.size:
        raise InputError(
            f"factorial run {int(bad[0]) + 1} cannot be taken: {'; '.join(robot.violations(q[bad[0]]))}",
            code="A005",
            remedy="adjust the levels of the design there",
        )
    return q


def _combinations(plan: Factorial) -> list[tuple[float, ...]]:
    out: list[tuple[float, ...]] = [()]
    for name, usual in zip(plan.inputs, plan.levels_deg, strict=True):
        grown: list[tuple[float, ...]] = []
        for row in out:
            levels = usual
            for rule in plan.adjust:
                known = dict(zip(plan.inputs, row, strict=False))
                if rule.coordinate == name and known.get(rule.when.coordinate) == rule.when.equals_deg:
                    levels = rule.levels_deg
            grown.extend((*row, level) for level in levels)
        out = grown
    return out
