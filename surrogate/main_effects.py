"""Main effects of joint angles on stiffness: smallest, mean and largest value at each level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robots import InputError
from robots.arrays import Array

# Levels that differ by less are the same level: angles went through deg -> rad -> deg.
_SAME_LEVEL_DEG = 1e-6


class MainEffect(NamedTuple):
    """Stiffness over its overall maximum at each level of one angle; all (levels,).

    ``levels_deg`` ascending; ``low``, ``mean``, ``high``: over all runs at that level, no unit.
    """

    levels_deg: Array
    low: Array
    mean: Array
    high: Array


def main_effects(q_deg: Array, stiffness: Array, names: Sequence[str]) -> dict[str, MainEffect]:
    """Main effect of each angle of a factorial design on the stiffness.

    In a design that is not orthogonal (levels of one angle adjusted to another) the levels of an angle do
    not meet the same runs of the others, so a difference between levels is not that angle's alone.

    Parameters
    ----------
    q_deg : (n, k) deg, one row a run
    stiffness : (n,) any unit, greater than zero
    names : (k,) names of the angles, in the order of the columns

    Returns
    -------
    name -> levels, and smallest, mean and largest stiffness there, normalised by the largest of all

    Raises
    ------
    InputError
        Shapes that do not fit, a name twice, values that are not finite, or a stiffness that is not positive.
    """
    q = np.asarray(q_deg, dtype=np.float64)
    k = np.asarray(stiffness, dtype=np.float64)
    if q.ndim != 2 or len(q) == 0 or q.shape != (len(k), len(names)) or k.ndim != 1:
        raise InputError(
            "main effects: shapes",
            code="B002",
            value=f"angles {q.shape}, stiffness {k.shape}, {len(names)} names",
            allowed="(n, k), (n,) and k names, n >= 1",
        )
    if len(set(names)) < len(names):
        raise InputError("main effects: names", code="B002", value=", ".join(names), allowed="each one once")
    if not np.isfinite(q).all():
        raise InputError("main effects: angles", code="B002", value="NaN or infinity", allowed="finite (deg)")
    bad = np.flatnonzero(~(np.isfinite(k) & (k > 0.0)))
    if bad.size:
        raise InputError(
            f"main effects: stiffness of run {int(bad[0]) + 1}",
            code="B002",
            value=float(k[bad[0]]),
            allowed="finite, greater than 0",
            remedy="leave out runs that have no result",
        )
    return {name: _effect(q[:, i], k / k.max()) for i, name in enumerate(names)}


def _effect(angle: Array, stiffness: Array) -> MainEffect:
    levels = np.unique(angle)
    levels = levels[np.concatenate([[True], np.diff(levels) > _SAME_LEVEL_DEG])]
    runs = [stiffness[np.searchsorted(levels, angle, side="right") - 1 == i] for i in range(len(levels))]
    low, mean, high = (np.array([f(r) for r in runs]) for f in (np.min, np.mean, np.max))
    return MainEffect(levels, low, mean, high)
