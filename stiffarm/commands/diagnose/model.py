"""The model file that a diagnosis writes: springs as fitted, effects found, and where each number came from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from doe.diagnosis.diagnose import State
from doe.diagnosis.known import error_count, free_numbers
from doe.model_file.carried_on import carried_on
from doe.model_file.uncertainty_table import FoundNumber, calibration_table, uncertainty_table
from fem.effects import LOAD_PATH, PlacedEffect, with_effects, without_effect
from fem.free.parameters import TURN, parameter
from robots import ModelDescription
from robots.constants import NORMAL_95
from robots.schema.description import Calibration as Origin
from robots.schema.description import CalibrationUncertainty
from robots.schema.quantities import RotationalStiffness
from stiffarm.commands.calibrate.words import bound_of
from stiffarm.commands.diagnose.effect_numbers import Number, numbers_of
from stiffarm.commands.diagnose.step import Diagnosed

SPRING_SOURCE, EFFECT_SOURCE = "calibrated", "diagnosed"


@dataclass(frozen=True)
class FittedSpring:
    """A joint's spring as fitted with everything else: N m/rad, 95 % interval (inf: no upper limit).

    ``status``: ``determined``, ``one-sided`` (rigid is possible) or ``rigid`` (rigid fits best; the interval says how
    soft it may be).
    """

    joint: str
    stiffness: float
    low: float
    high: float
    status: str


def fitted_springs(state: State) -> tuple[FittedSpring, ...]:
    """Springs of a state with their intervals, from the compliances', which are normal."""
    s, out = state.setting, []
    sd = np.sqrt(np.diag(state.refit.inverse))
    for k, joint in enumerate(s.free):
        c, spread = float(s.springs[k]), float(sd[k])
        low, high = (
            1.0 / (c + NORMAL_95 * spread),
            1.0 / (c - NORMAL_95 * spread) if c > NORMAL_95 * spread else math.inf,
        )
        rigid = c * TURN[1] <= 1.0
        status = "rigid" if rigid else "one-sided" if math.isinf(high) else "determined"
        out.append(FittedSpring(joint, math.inf if rigid else 1.0 / c, low, high, status))
    return tuple(out)


def springs_of(d: Diagnosed) -> tuple[FittedSpring, ...]:
    """Springs of the new model: as `calibrate` finds them where nothing is added to the model, else as fitted with it.

    The same springs of the same model and readings have one value and one interval.
    """
    found = _calibrated_springs(d)
    return fitted_springs(d.found.after) if found is None else found


def _calibrated_springs(d: Diagnosed) -> tuple[FittedSpring, ...] | None:
    """Those of `calibrate`; None where the model has effects, or a spring has no value that a file can hold."""
    if d.calibrated is None or d.found.after.setting.accepted:
        return None
    out = []
    for s in d.calibrated.springs:
        rigid = bound_of(s) == "rigid"
        if s.status == "not identified" or (s.status == "at bound" and not rigid):
            return None
        stiffness, status = (math.inf, "rigid") if rigid else (s.value, s.status)
        out.append(FittedSpring(s.parameter.place, stiffness, *s.interval, status))
    return tuple(out)


def described(d: Diagnosed) -> ModelDescription:
    """The new model: what was given, with springs fitted and effects found.

    Where the verdict is not certain, the effects in it are marked as provisional.
    """
    after = d.found.after
    description = _with_springs(d, after)
    placed = list(after.setting.accepted)
    if any(t.code == LOAD_PATH for t in description.effect) and any(e.effect.code == LOAD_PATH for e in placed):
        # The other path than the one of the effect is the file's own.
        description = without_effect(description, LOAD_PATH)
        placed = [e for e in placed if e.effect.code != LOAD_PATH]
    if placed:
        text = f"diagnosis on {d.used.source}, SHA-256 {d.used.sha256}"
        description = with_effects(description, placed, EFFECT_SOURCE, _notes(d, placed), text)
    data = description.model_dump(by_alias=True)
    data["sources"] = {**data["sources"], SPRING_SOURCE: f"fitted with the diagnosis on {d.used.source}, SHA-256 "
                       f"{d.used.sha256}"}  # fmt: skip
    data["calibration"] = Origin(
        scheme="diagnosis",
        load_path=d.given.model.load_path,
        links=d.given.model.link_kind,
        data=d.used.source,
        data_sha256=d.used.sha256,
        rms_mm=after.fit_rms_mm,
        loads_N=d.request.loads,
        notes=_origin_notes(d),
        uncertainty=_uncertainty(d),
    ).model_dump()
    return ModelDescription.model_validate(data)


def _with_springs(d: Diagnosed, after: State) -> ModelDescription:
    springs = {s.joint: s for s in springs_of(d)}
    joints = []
    for joint in d.given.description.joint:
        s = springs.get(joint.name)
        if s is None:
            joints.append(joint)
            continue
        high = "no upper limit" if math.isinf(s.high) else f"{s.high:.3g}"
        note = f"{s.status}; 95 % interval {s.low:.3g} to {high} N m/rad"
        spring = None if s.status == "rigid" else RotationalStiffness(
            value=float(f"{s.stiffness:.9g}"), unit="N m/rad", source=SPRING_SOURCE, note=note
        )  # fmt: skip
        joints.append(joint.model_copy(update={"stiffness": spring}))
    has_path = any(table.code == LOAD_PATH for table in d.given.description.effect)
    path = d.given.description.load_path if has_path else d.given.model.load_path
    sources = {**d.given.description.sources, SPRING_SOURCE: "diagnosis"}
    update = {"joint": tuple(joints), "load_path": path, "sources": sources}
    return d.given.description.model_copy(update=update)


def _notes(d: Diagnosed, placed: list[PlacedEffect]) -> Mapping[str, str]:
    """By CODE.NAME: how sure, and whether the effect is provisional."""
    provisional = {f.code for f in d.found.provisional}
    numbers = {n.code_and_name: n for n in numbers_of(d.found.after)}
    out = {}
    for e in placed:
        for p in e.effect.parameters:
            name = f"{e.effect.code}.{p.name}"
            head = "provisional; " if e.effect.code in provisional else ""
            out[name] = head + _sure(numbers[name])
    return out


def _sure(n: Number) -> str:
    if n.sd is None:
        return "the best of the values tried"
    return f"standard deviation {n.sd:.2g} {n.unit}".removesuffix(" 1")


def _origin_notes(d: Diagnosed) -> tuple[str, ...]:
    out = [f"verdict of the diagnosis: {d.found.verdict} ({d.found.reason})"]
    codes = ", ".join(f.code for f in d.found.provisional)
    if codes:
        out.append(f"provisional, these readings do not settle it: {codes}")
    out += [
        f"spring {s.joint}: rigid fits best, at least {s.low:.3g} N m/rad" for s in springs_of(d) if s.status == "rigid"
    ]
    return tuple(out)


def _uncertainty(d: Diagnosed) -> CalibrationUncertainty | None:
    """The covariance that belongs to the springs of the new model."""
    if d.calibrated is not None and _calibrated_springs(d) is not None:
        return calibration_table(d.calibrated.found)
    return uncertainty_of(d.found.after)


def uncertainty_of(state: State) -> CalibrationUncertainty | None:
    """Covariance of springs and effects' numbers as the file has them; errors that every model has are averaged over.

    A spring that is rigid in the file keeps its variance around a compliance of zero. Shapes of effects that were
    chosen from a grid have none.
    """
    s = state.setting
    model = s.arm
    numbers, columns, slopes = [], [], []
    for k, spring in enumerate(fitted_springs(state)):
        at = 0.0 if spring.status == "rigid" else 1.0 / float(f"{spring.stiffness:.9g}")
        status: Literal["determined", "one-sided"] = "determined" if spring.status == "determined" else "one-sided"
        name = f"{spring.joint}.stiffness"
        ends = (spring.low, spring.high)
        numbers.append(FoundNumber(name, "N m/rad", "compliance", at, ends, status, math.inf, has_variance=True))
        columns.append(k)
        slopes.append(1.0)
    at_column = len(s.free) + error_count(s)
    for placed in s.accepted:
        for index, _ in free_numbers(placed):
            code = f"{placed.effect.code}.{placed.effect.parameters[index].name}"
            p = parameter(model, code, (placed,))
            value = float(placed.values[index])
            log = p.scale == "log"
            here = math.log(value) if log else value
            numbers.append(FoundNumber(code, p.unit, p.scale, here, (math.nan, math.nan), "determined", math.inf,
                                       has_variance=True))  # fmt: skip
            columns.append(at_column)
            slopes.append(1.0 / value if log else 1.0)
            at_column += 1
    V = state.refit.inverse[np.ix_(columns, columns)] * np.outer(slopes, slopes)
    note = "diagnosis: posterior covariance at the noise found, with its broad priors on springs and effects"
    before = carried_on(s.description, model, [n.name for n in numbers], s.accepted)
    return uncertainty_table(numbers, V, np.zeros((0, len(numbers))), note, before)
