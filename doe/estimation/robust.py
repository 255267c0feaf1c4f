"""How wide numbers scatter where some of them are no part of it."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array

# Median of the absolute value of a standard normal number.
MEDIAN = 0.6745


def robust_sd(values: Array) -> float:
    """Standard deviation about zero of normal numbers (m,) whose middle half is as wide as that of these; 0 of none."""
    return float(np.median(np.abs(values))) / MEDIAN if len(values) else 0.0
