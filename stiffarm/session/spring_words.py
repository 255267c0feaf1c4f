"""A constant spring in words: its value, its interval, and which bound it stands at."""

from __future__ import annotations

import math
from typing import Literal

from doe import SpringEstimate
from doe.published.parametric import WIDEST_Nm_per_rad

UNIT = "10⁶ N m/rad"


def bound_of(spring: SpringEstimate) -> Literal["rigid", "soft"] | None:
    """Which end of the widest range the fit stands at, or None if at neither."""
    if spring.status != "at bound":
        return None
    # No interval of a spring at the soft end is open upward, and none at the rigid end is closed.
    return "rigid" if math.isinf(spring.interval[1]) else "soft"


def spring_text(spring: SpringEstimate) -> str:
    """The spring with its 95 % interval in 10⁶ N m/rad; no plain number where the data give none."""
    value, low, high = (f"{k / 1e6:#.3g}" for k in (spring.stiffness, *spring.interval))
    if spring.status == "not identified":
        return "not identified"
    bound = bound_of(spring)
    spare = not any(map(math.isnan, spring.interval))
    if bound == "rigid":
        return f"at least {low}, rigid fits best" if spare else "rigid fits best (no spare reading)"
    if bound == "soft":
        softest = f"the soft bound ({WIDEST_Nm_per_rad[0] / 1e6:g}) fits best"
        return f"at most {high}, {softest}" if spare else f"{softest} (no spare reading)"
    if not spare:
        return f"{value} (no spare reading)"
    return f"{value} (at least {low})" if math.isinf(spring.interval[1]) else f"{value} ({low} to {high})"


def at_widest_bound(value: float) -> bool:
    """Whether a stiffness (N m/rad) stands at an end of the widest range: then it is no measured number."""
    soft, rigid = WIDEST_Nm_per_rad
    return not 1.01 * soft < value < 0.99 * rigid


def mega(value: float) -> str:
    """A stiffness in 10⁶ N m/rad; at the widest bound it means rigid, not a number."""
    if math.isnan(value):
        return "–"
    return "rigid" if value >= 0.99 * WIDEST_Nm_per_rad[1] else f"{value / 1e6:.3g}"
