"""Loads, directions and what a plan will tell, in words."""

from __future__ import annotations

import math
from typing import Final

from doe.certainty.uncertainty import ParameterEstimate
from doe.planning.forecast import KEPT, Forecast
from doe.planning.outset import Outset
from doe.planning.plan import Foresight, MeasurementPlan
from fem.free.parameters import Parameter
from robots.constants import NORMAL_95
from robots.quantities import Quantity, angle, length, percent, relative, significant

# Beyond this factor to either side a parameter is not called known.
POORLY = 3.0
# Beyond this one nothing worth saying is.
HARDLY = 30.0


SHOWN: Final = {
    "N m/rad": Quantity("", "10⁶ N m/rad", 1e-6),
    "N/m": Quantity("", "N/µm", 1e-6),
    "Pa": Quantity("", "GPa", 1e-9),
    "rad": angle(""),
    "m": length(""),
}


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit; stiffnesses in 10⁶ N m/rad and N/µm, angles in deg, lengths in mm."""
    shown = SHOWN.get(unit, Quantity("", unit))
    return f"{_number(value, unit, digits)}{'·' if shown.unit.startswith('10') else ' '}{shown.unit}"


def _number(value: float, unit: str, digits: int) -> str:
    """The same without the unit."""
    return significant(SHOWN.get(unit, Quantity("", unit)).factor * value, digits)


def known_so_far(found: ParameterEstimate | None, p: Parameter) -> str:
    """What the readings so far say: ``0.82 to 4.9·10⁶ N m/rad``, ``only ≥ 0.034·10⁶ N m/rad``, ``nothing``."""
    if found is None or found.status == "not identified":
        return "nothing"
    if all(map(math.isnan, found.interval)):
        return "only a fit with as many parameters as readings"
    low, high = found.interval
    nowhere = (0.0, -math.inf) if p.scale != "linear" else (-math.inf,)
    if math.isinf(high) and low in nowhere:
        return "nothing"
    if math.isinf(high):
        return f"only ≥ {quantity(low, p.unit, 2)}"
    if low in nowhere:
        return f"only ≤ {quantity(high, p.unit, 2)}"
    return f"{_number(low, p.unit, 2)} to {quantity(high, p.unit, 2)}"


def is_open(found: ParameterEstimate | None) -> bool:
    """Whether the readings so far leave a parameter open to at least one side."""
    return found is None or found.status != "determined"


def factor95(sd: float) -> float:
    """Factor to either side within which a positive value lies with 95 %."""
    return math.exp(min(NORMAL_95 * sd, 700.0))


def rigid_from(f: Foresight) -> float:
    """Stiffness from which on the plan could only give a lower limit: its compliance is then below its 95 % interval.

    Deflections are linear in compliances, so their standard deviation is that at the planned value.
    """
    return f.planned_for / (NORMAL_95 * f.promised)


def told(f: Foresight, found: ParameterEstimate | None) -> str:
    """One sentence on one parameter."""
    p = f.parameter
    was = known_so_far(found, p)
    if not f.seen:
        return f"{p.name}: no reading of this plan moves with it (known: {was}); load or read in other directions"
    if p.scale == "linear":
        now, then = (quantity(NORMAL_95 * sd, p.unit) for sd in (f.promised, f.before))
        return f"{p.name}: known to ± {now} (was: ± {then}); {_times(f.promised_shrink)}"
    factor = factor95(f.promised)
    if factor > HARDLY:
        return f"{p.name}: may stay open, these readings hardly identify it alone (was: {was})"
    rest = f"(was: {was}); {_times(f.promised_shrink)}"
    if not is_open(found) or p.scale != "compliance":
        return f"{p.name}: known {_within(factor)} {rest}"
    at = quantity(f.planned_for, p.unit, 2)
    softest = found is not None and found.interval[0] > p.lower
    assumed = f"if it is as soft as the readings allow, {at}" if softest else f"if it is {at}"
    limit = rigid_from(f)
    if limit <= 1.5 * f.planned_for:
        return f"{p.name}: known {_within(factor)} {assumed} {rest}"
    return (
        f"{p.name}: known {_within(factor)} {assumed} {rest}. A stiffer one can be distinguished from rigid up "
        f"to {quantity(limit, p.unit, 2)}"
    )


def rests_on(start: Outset, found: Forecast) -> str:
    """What the predicted intervals rest on, and how often such ones came true."""
    low, middle, high = map(relative, found.lack)
    source = f"as the {start.readings} readings so far suggest" if found.seen else "as it usually is"
    least, most = map(percent, KEPT)
    return (
        f"predicted intervals include the model's lack of fit, {source}: about {middle} of the deflection in every "
        f"set-up ({low} to {high}), which repeats do not average away. In simulated campaigns with a hidden effect "
        f"{least} to {most} of the intervals came out no wider than predicted"
    )


def _within(factor: float) -> str:
    if factor < 1.1:
        return f"to ± {significant(100.0 * (factor - 1.0), 1)} %"
    if factor < POORLY:
        return f"within a factor {significant(factor)}"
    return f"only within a factor {significant(factor, 2)}"


def _times(shrink: float) -> str:
    if shrink < 1.05:
        return "perhaps no narrower"
    return f"{significant(shrink, 2)} times narrower"


def against_chance(made: MeasurementPlan) -> str:
    """One sentence on the plan beside plans chosen at random."""
    n, most = len(made.q), len(made.random)
    if made.random_needed is None:
        needed = f"more than {most}" if most > n else "more"
    else:
        needed = f"about {made.random_needed}"
    ratio = float(made.per_parameter(made.random_median) / made.per_parameter(made.value))
    what = {
        "D": "standard deviations (geometric mean over the parameters seen)",
        "A": "standard deviations (root mean square over the parameters)",
        "I": "standard deviations of predicted deflections (root mean square)",
    }[made.criterion]
    return (
        f"a random choice of {n} leaves {what} {significant(ratio)} times as large; it takes {needed} set-ups chosen "
        "at random for the same (medians of many random choices)"
    )
