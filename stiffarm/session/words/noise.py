"""What a standard deviation is called: noise only where repeats or given sigmas tell it from what the model misses."""

from __future__ import annotations

from doe.estimation.noise import origin
from doe.estimation.problem import Problem

RESIDUAL = "the model's residual"


def is_residual(p: Problem) -> bool:
    """Whether readings bring neither repeats nor sigmas, so that what is left of them may be noise or not."""
    return origin(p) == "residual"


def scatter_name(p: Problem) -> str:
    """``noise``, or that it is the model's residual."""
    return RESIDUAL if is_residual(p) else "noise"


def floor_name(p: Problem) -> str:
    """What an RMS that noise alone would give is called."""
    return RESIDUAL if is_residual(p) else "noise alone"
