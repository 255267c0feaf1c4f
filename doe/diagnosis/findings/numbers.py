"""Numbers of what was found: those of effects in the unit of files and screens, springs, and their covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from doe.certainty.uncertainty import ParameterEstimate, Status
from doe.diagnosis.diagnose import Diagnosis, Found, State, state_of
from doe.diagnosis.known import free_numbers
from doe.model_file.uncertainty_table import FoundNumber, carried_on, uncertainty_table
from fem.effects import EffectParameter, PlacedEffect
from fem.free.parameters import TURN, parameter
from robots.constants import NORMAL_95
from robots.schema.description import CalibrationUncertainty
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


def in_order(d: Diagnosis) -> tuple[Found, ...]:
    """What was found, in the order in which the model has it."""
    codes = [e.effect.code for e in d.after.setting.accepted]
    return tuple(sorted(d.found, key=lambda f: codes.index(f.code)))


def errors_mm(d: Diagnosis) -> list[float]:
    """RMS error at poses left out one at a time (mm): with springs alone, and with each effect added in turn.

    All at the noise that the whole leaves: at its own noise a poorer model fits its springs loosely, and errors of
    several looks could not be compared.
    """
    out, count = [d.before.left_out_rms_mm], len(d.found)
    s, noise = d.after.setting, d.after.refit.noise
    given = len(s.accepted) - count
    out += [
        state_of(s.moved(s.springs, s.accepted[: given + k]), noise, d.weight).left_out_rms_mm for k in range(1, count)
    ]
    return [*out, d.after.left_out_rms_mm] if count else out


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


def fitted_springs(state: State) -> tuple[ParameterEstimate, ...]:
    """Springs of a state with their intervals, from the compliances', which are normal; rigid ones at their bound."""
    s, out = state.setting, []
    sd = np.sqrt(np.diag(state.refit.inverse))
    for joint, c, spread in zip(s.free, s.springs.tolist(), sd.tolist(), strict=False):
        half = NORMAL_95 * spread
        interval = 1.0 / (c + half), 1.0 / (c - half) if c > half else math.inf
        rigid = c * TURN[1] <= 1.0
        status: Status = "at bound" if rigid else "one-sided" if math.isinf(interval[1]) else "determined"
        value = TURN[1] if rigid else 1.0 / c
        out.append(ParameterEstimate(parameter(s.arm, f"{joint}.stiffness"), value, interval, spread, status, math.inf))
    return tuple(out)


def uncertainty_of(state: State) -> CalibrationUncertainty | None:
    """Covariance of springs and effects' numbers as the file has them; errors that every model has are averaged over.

    A spring that is rigid in the file keeps its variance around a compliance of zero. Shapes of effects that were
    chosen from a grid have none.
    """
    s = state.setting
    model = s.arm
    free = [(placed, *number) for placed in s.accepted for number in free_numbers(placed)]
    columns = [*range(len(s.free)), *(k for number in range(len(s.accepted)) for k in state.refit.columns(number))]
    numbers, slopes = [], [1.0] * len(s.free)
    for spring in fitted_springs(state):
        at = 0.0 if spring.status == "at bound" else 1.0 / float(f"{spring.value:.9g}")
        known: Status = "determined" if spring.status == "determined" else "one-sided"
        numbers.append(
            FoundNumber(
                spring.parameter.name, "N m/rad", "compliance", at, spring.interval, known, math.inf, has_variance=True
            )
        )
    for placed, index, own in free:
        code = f"{placed.effect.code}.{own.name}"
        p, value = parameter(model, code, (placed,)), float(placed.values[index])
        log = p.scale == "log"
        here = math.log(value) if log else value
        numbers.append(
            FoundNumber(code, p.unit, p.scale, here, (math.nan, math.nan), "determined", math.inf, has_variance=True)
        )
        slopes.append(1.0 / value if log else 1.0)
    V = state.refit.inverse[np.ix_(columns, columns)] * np.outer(slopes, slopes)
    note = "diagnosis: posterior covariance at the noise found, with its broad priors on springs and effects"
    before = carried_on(s.description, model, [n.name for n in numbers], s.accepted)
    return uncertainty_table(numbers, V, np.zeros((0, len(numbers))), note, before)
