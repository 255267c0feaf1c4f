"""What set-ups chosen at random would tell: the yardstick of a plan."""

from __future__ import annotations

import numpy as np

from doe.planning.optimal_choice import Criterion
from robots.arrays import Array

# Their median is then uncertain by some 6 % of one plan's standard deviation.
PLANS = 400


def random_values(
    known: Array,
    experiments: Array,
    most: int,
    criterion: Criterion,
    weight: Array | None,
    rng: np.random.Generator,
    plans: int = PLANS,
) -> Array:
    """The criterion (plans, most) after the first 1, 2 ... ``most`` of experiments drawn without replacement.

    Arguments as of :func:`doe.planning.optimal_choice.choose`.
    """
    W = np.eye(len(known)) if weight is None else weight
    out = np.empty((plans, most))
    for k in range(plans):
        B = experiments[rng.choice(len(experiments), most, replace=False)]
        M = known + np.cumsum(np.swapaxes(B, 1, 2) @ B, axis=0)
        out[k] = -np.linalg.slogdet(M)[1] if criterion == "D" else np.sum(W * np.linalg.inv(M), axis=(1, 2))
    return out
