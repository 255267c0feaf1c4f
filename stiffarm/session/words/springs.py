"""Stiffnesses in words: in millions, at the ends of the widest range, outside the range in which they were expected."""

from __future__ import annotations

import math

from doe.certainty.uncertainty import ParameterEstimate
from fem.free.parameters import TURN

# A compliance this close (relative) to an end of the widest range stands at it.
_AT_END = 1e-6


def at_widest_bound(value: float) -> bool:
    """Whether a stiffness (N m/rad) stands at an end of the widest range: then it is no measured number."""
    soft, rigid = TURN
    return not 1.01 * soft < value < 0.99 * rigid


def mega(value: float) -> str:
    """A stiffness in 10⁶ N m/rad; at the widest bound it means rigid, not a number."""
    if math.isnan(value):
        return "–"
    return "rigid" if value >= 0.99 * TURN[1] else f"{value / 1e6:.3g}"


def bound_remark(spring: ParameterEstimate, bounds: tuple[float, float], widest: tuple[float, float]) -> list[str]:
    """What to say of a joint's spring outside the range in which it was expected."""
    k, at_bound, joint = spring.value, spring.status == "at bound", spring.parameter.place
    if bounds[0] <= k <= bounds[1] and not at_bound:
        return []
    side = int(k > math.sqrt(bounds[0] * bounds[1]))
    if math.isclose(bounds[side], widest[side]):
        return [f"{joint}: bound {bounds[side]:.0e} N m/rad hit, as wide as it goes"]
    decades = max(math.ceil(abs(math.log10(k / bounds[side])) - _AT_END), 1)
    wider = bounds[side] * 10.0 ** (decades if side else -decades)
    wider = min(wider, widest[1]) if side else max(wider, widest[0])
    end = " and is hit there too" if at_bound else ""
    return [f"{joint}: bound {bounds[side]:.0e} N m/rad hit, widened to {wider:.0e}{end}"]
