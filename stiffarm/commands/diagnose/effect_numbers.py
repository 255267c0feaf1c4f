"""The numbers of effects as they are shown: value, standard deviation and interval in the unit of files and screens."""

from __future__ import annotations

import math
from dataclasses import dataclass

from doe.diagnosis.diagnose import State
from fem.effects import EffectParameter, PlacedEffect
from robots.constants import NORMAL_95
from robots.schema.units import factor


@dataclass(frozen=True)
class Number:
    """One number of an effect.

    ``value``: inf where nothing of a stiffness acts; ``sd``: None where the number was chosen from a grid; ``low``,
    ``high``: 95 % interval, of which an end is infinite where the readings set none. All in ``unit``.
    ``plausible``: range expected beforehand, of the size where the number is ``signed``; ``meaning``: in words.
    """

    code: str
    name: str
    value: float
    sd: float | None
    low: float | None
    high: float | None
    unit: str
    plausible: tuple[float, float]
    signed: bool
    role: str
    meaning: str

    @property
    def code_and_name(self) -> str:
        """``backlash:j2.gap``."""
        return f"{self.code}.{self.name}"


def short(value: float, digits: int = 3) -> str:
    """A number of so many digits with a true minus, its exponent without zeros before it."""
    return f"{value:.{digits}g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-").replace("-", "−")


def numbers_of(state: State) -> list[Number]:
    """Numbers of all effects of a state, in their order."""
    out = []
    for k, placed in enumerate(state.setting.accepted):
        spread = state.refit.spread(k)
        out += [_number(placed, i, p, spread.get(p.name)) for i, p in enumerate(placed.effect.parameters)]
    return out


def _number(placed: PlacedEffect, index: int, p: EffectParameter, sd: float | None) -> Number:
    scale = factor(p.dimension, p.unit)
    acts = float(placed.values[index])
    value = p.value(acts) / scale
    ends: tuple[float | None, float | None] = (None, None)
    shown = None
    if sd is not None:
        low, high = acts - NORMAL_95 * sd, acts + NORMAL_95 * sd
        if not p.signed:
            low = max(low, 0.0)
        if p.scale == "compliance":
            ends = p.value(high) / scale, p.value(low) / scale
            # To first order; the interval says it better where it is wide.
            shown = sd / acts**2 / scale if acts > 0.0 else math.inf
        else:
            ends, shown = (low / scale, high / scale), sd / scale
    plausible = (p.lower / scale, p.upper / scale)
    return Number(placed.effect.code, p.name, value, shown, *ends, p.unit, plausible, p.signed, p.role, p.meaning)
