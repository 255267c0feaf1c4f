"""What is read when effects act: stage by stage, in the order of :mod:`fem.effects.base`.

A law written elsewhere is not trusted to give what its stage asks for: shapes and finite numbers are checked whenever
it is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fem.effects.base import Effect, PlacedEffect
from fem.effects.situation import History, Situation, plain_history
from fem.model import ArmModel
from fem.springs import SumSpring
from fem.statics.flexibility import spring_influence
from fem.statics.loads import LoadedPoses, turned
from robots import InputError
from robots.arrays import Array

# A compliance, rad/(N m), by which springs are made softer to see what laws make of it; straight lines: any will do.
SOFTER = 1e-7


def act(placed: PlacedEffect, subject: Any, situation: Situation | None) -> Any:
    """What an effect's law gives; a user's law is checked.

    Raises
    ------
    InputError
        A user's law fails, or gives another shape or kind than its stage asks for, or numbers that are not finite.
    """
    effect = placed.effect
    if not effect.own:
        return effect.law(subject, situation, placed.values)
    try:
        with np.errstate(all="ignore"):
            given = effect.law(subject, situation, placed.values.copy())
    except InputError:
        raise
    except Exception as error:  # a law may fail in any way
        raise InputError(
            f"law of effect {effect.code} fails ({type(error).__name__}: {error})",
            code="M012",
            remedy="mend it in its file",
        ) from error
    return _checked(effect, subject, situation, given)


def _checked(effect: Effect, subject: Any, situation: Situation | None, given: Any) -> Any:
    what = f"law of effect {effect.code} (stage {effect.stage})"
    if effect.stage == "model":
        if not isinstance(given, ArmModel):
            raise InputError(
                what, code="M012", value=type(given).__name__, allowed="an ArmModel", remedy="return the changed model"
            )
        return given
    if effect.stage == "frame":
        pairs = [(given, np.eye(3), "rotation")]
    elif effect.stage == "load":
        if not isinstance(given, LoadedPoses):
            raise InputError(
                what, code="M012", value=type(given).__name__, allowed="LoadedPoses", remedy="return the changed loads"
            )
        pairs = [(getattr(given, name), getattr(subject, name), name) for name in ("q", "wrench", "point")]
    else:
        assert situation is not None  # noqa: S101 - these stages have one
        pairs = [(given, np.zeros((len(situation.at), 6)), "displacement")]
    for value, like, name in pairs:
        if not isinstance(value, np.ndarray) or value.shape != like.shape:
            shape = value.shape if isinstance(value, np.ndarray) else type(value).__name__
            raise InputError(f"{what}: {name}", code="M012", value=f"shape {shape}", allowed=f"an array {like.shape}")
        if not np.issubdtype(value.dtype, np.floating) or not np.isfinite(value).all():
            raise InputError(
                f"{what}: {name}", code="M012", value="NaN, inf or no real numbers", allowed="finite numbers"
            )
    return given


def observed(
    model: ArmModel,
    at: LoadedPoses,
    effects: Sequence[PlacedEffect],
    history: History | None = None,
) -> Array:
    """Readings (n, 6), m and rad, of an arm at loaded poses with effects; without effects its deflection."""
    return seen(model, at, effects, history)[0]


def seen(
    model: ArmModel, at: LoadedPoses, effects: Sequence[PlacedEffect], history: History | None = None
) -> tuple[Array, Situation]:
    """Readings as :func:`observed`, and the situation that a gauge's law is asked in."""
    before = Situation(model, at, history or plain_history(len(at)))
    # What has no memory is the same for repeats, and on the way up and down.
    where = at.distinct[1]
    few = before if any(e.effect.own for e in effects if e.effect.stage in ("frame", "load")) else before.few
    changed, loads, R = _loaded(model, few.at, effects, few)
    there = few.of(changed, loads)
    d = there.deflection
    for e in _of_stage(effects, "arm"):
        if not e.effect.has_memory:
            d = d + act(e, None, there)
    situation = there
    if few is not before:
        d = d[where]
        situation = before.of(changed, at if loads is few.at else loads.repeated(where))
    for e in _of_stage(effects, "arm"):
        if e.effect.has_memory:
            d = d + act(e, None, situation)
    if R is not None:
        d = np.hstack([d[:, :3] @ R, d[:, 3:] @ R])
    for e in _of_stage(effects, "gauge"):
        d = act(e, d, situation)
    return np.asarray(d), situation


def added(placed: PlacedEffect, situation: Situation) -> Array:
    """What an effect of stage "arm" adds (n, 6), m and rad, to the displacements of an arm as it stands."""
    if placed.effect.has_memory or situation.few is situation:
        return np.asarray(act(placed, None, situation))
    return np.asarray(act(placed, None, situation.few))[situation.at.distinct[1]]


def spring_influences(
    model: ArmModel,
    at: LoadedPoses,
    effects: Sequence[PlacedEffect],
    joints: Sequence[str],
    history: History | None = None,
) -> Array | None:
    """Derivatives (n, 6, k) of the readings by the compliances of joints' springs, exact; None with a user's effect.

    Every effect of the catalogue is linear in them: readings go by each spring's own part, and by what laws make of it.
    """
    if any(e.effect.own for e in effects):
        return None
    whole, where = Situation(model, at, history or plain_history(len(at))), at.distinct[1]
    few = whole.few
    changed, loads, R = _loaded(model, few.at, effects, few)
    influence = spring_influence(changed, loads.q, loads.wrench, loads.point)[0]
    full = at if loads is few.at else loads.repeated(where)
    before = whole.of(changed, full)
    laws, gauges = _of_stage(effects, "arm"), _of_stage(effects, "gauge")
    own = [added(e, before) for e in laws]
    nothing = np.zeros((len(at), 6))
    zero = nothing
    for e in gauges:
        zero = act(e, zero, before)
    columns = []
    for name in joints:
        k = model.robot.joint_names.index(name)
        softer = model.with_joint(name, axial=SumSpring(model.joints[k].axial, SOFTER))
        for e in _of_stage(effects, "model"):
            softer = act(e, softer, None)
        more = (softer.joints[k].axial.compliance(loads.q) - changed.joints[k].axial.compliance(loads.q)) / SOFTER
        column = (more[:, None] * influence[:, k])[where]
        after = whole.of(softer, full)
        for e, was in zip(laws, own, strict=True):
            column = column + (added(e, after) - was) / SOFTER
        if R is not None:
            column = np.hstack([column[:, :3] @ R, column[:, 3:] @ R])
        for e in gauges:
            column = act(e, column, before)
        columns.append(column - zero)
    return np.stack(columns, axis=2) if columns else np.zeros((len(at), 6, 0))


def _loaded(
    model: ArmModel, at: LoadedPoses, effects: Sequence[PlacedEffect], before: Situation
) -> tuple[ArmModel, LoadedPoses, Array | None]:
    """The arm with what is missing of it, its loads as they act, and the rotation from the table's axes to its own."""
    R = None
    for e in _of_stage(effects, "frame"):
        R = act(e, None, before) if R is None else R @ act(e, None, before)
    changed, loads = model, at if R is None else turned(model, at, R)
    for e in _of_stage(effects, "model"):
        changed = act(e, changed, None)
    for e in _of_stage(effects, "load"):
        loads = act(e, loads, before.of(changed, loads))
    return changed, loads if loads is at else at.recalled(loads), R


def _of_stage(effects: Sequence[PlacedEffect], stage: str) -> list[PlacedEffect]:
    return [e for e in effects if e.effect.stage == stage]
