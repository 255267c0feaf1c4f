"""A constant spring in words: its value, its interval, and which bound it stands at."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from doe.certainty.uncertainty import ParameterEstimate, Status
from fem.free.parameters import TURN

UNIT = "10⁶ N m/rad"


# A compliance this close (relative) to an end of the widest range stands at it.
_AT_END = 1e-6


@dataclass(frozen=True)
class SpringEstimate:
    """A joint's constant spring with its 95 % ``interval``, N m/rad (:class:`ParameterEstimate` of its stiffness)."""

    joint: str
    stiffness: float
    interval: tuple[float, float]
    status: Status

    @staticmethod
    def of(e: ParameterEstimate) -> SpringEstimate:
        """The spring of an estimate of a joint's stiffness."""
        return SpringEstimate(e.parameter.place, e.value, e.interval, e.status)


def bound_of(spring: SpringEstimate) -> Literal["rigid", "soft"] | None:
    """Which end of the widest range the fit stands at, or None if at neither."""
    if spring.status != "at bound":
        return None
    return "rigid" if spring.stiffness**2 > TURN[0] * TURN[1] else "soft"


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
        softest = f"the soft bound ({TURN[0] / 1e6:g}) fits best"
        return f"at most {high}, {softest}" if spare else f"{softest} (no spare reading)"
    if not spare:
        return f"{value} (no spare reading)"
    return f"{value} (at least {low})" if math.isinf(spring.interval[1]) else f"{value} ({low} to {high})"


def at_widest_bound(value: float) -> bool:
    """Whether a stiffness (N m/rad) stands at an end of the widest range: then it is no measured number."""
    soft, rigid = TURN
    return not 1.01 * soft < value < 0.99 * rigid


def mega(value: float) -> str:
    """A stiffness in 10⁶ N m/rad; at the widest bound it means rigid, not a number."""
    if math.isnan(value):
        return "–"
    return "rigid" if value >= 0.99 * TURN[1] else f"{value / 1e6:.3g}"


def bound_remark(spring: SpringEstimate, bounds: tuple[float, float], widest: tuple[float, float]) -> list[str]:
    """What to say of a spring outside the range in which it was expected."""
    k, at_bound = spring.stiffness, spring.status == "at bound"
    if bounds[0] <= k <= bounds[1] and not at_bound:
        return []
    side = int(k > math.sqrt(bounds[0] * bounds[1]))
    if math.isclose(bounds[side], widest[side]):
        return [f"{spring.joint}: bound {bounds[side]:.0e} N m/rad hit, as wide as it goes"]
    decades = max(math.ceil(abs(math.log10(k / bounds[side])) - _AT_END), 1)
    wider = bounds[side] * 10.0 ** (decades if side else -decades)
    wider = min(wider, widest[1]) if side else max(wider, widest[0])
    end = " and is hit there too" if at_bound else ""
    return [f"{spring.joint}: bound {bounds[side]:.0e} N m/rad hit, widened to {wider:.0e}{end}"]
