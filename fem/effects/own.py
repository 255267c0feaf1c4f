"""A user's own effects, checked before they are used: nothing at zero amplitude, plausible numbers give something."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from fem.compiled.compliance import deflection
from fem.effects.base import Effect, PlacedEffect
from fem.effects.observed import observed
from fem.effects.situation import plain_history
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses
from robots import InputError

# A user's own effects: for a model, the effects that it can have.
Maker = Callable[[ArmModel], Iterable[Effect]]

# Poses and loads that a law is tried on. Two: a law that mixes up poses and parameters shows in its shapes.
TRIED = 3
LOADS = (-150.0, -650.0, 375.0)
# Displacements at zero amplitude must equal those without the effect, m and rad.
NOTHING = 1e-12


def checked_maker(make: Callable[[ArmModel], Any], where: str) -> Maker:
    """The maker of a user's effects whose results are checked; ``where`` names its file in messages."""
    last: list[tuple[ArmModel, list[Effect]]] = []

    def maker(model: ArmModel) -> list[Effect]:
        # One arm is asked for its effects many times; trying a law takes a few milliseconds.
        if not last or last[0][0] is not model:
            last[:] = [(model, _made(make, where, model))]
        return last[0][1]

    return maker


def _made(make: Callable[[ArmModel], Any], where: str, model: ArmModel) -> list[Effect]:
    try:
        given = make(model)
        effects = list(given) if isinstance(given, Iterable) else given
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    except Exception as error:  # what it does is the user's affair
        raise InputError(
            f"{where}: effects(model) fails ({type(error).__name__}: {error})", remedy="mend the file"
        ) from error
    if not isinstance(effects, list) or not all(isinstance(e, Effect) for e in effects):
        raise InputError(
            f"{where}: effects(model)",
            value=type(given).__name__,
            allowed="a list of fem.effects.Effect",
            remedy="return the effects in a list",
        )
    out = [replace(effect, own=True) for effect in effects]
    for effect in out:
        try:
            _try(effect, model)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
    return out


def _try(effect: Effect, model: ArmModel) -> None:
    """Ask the law at plausible numbers and at zero amplitude, on a few poses."""
    if not effect.code or effect.code != effect.code.strip():
        raise InputError("effect: code", value=effect.code, allowed="a word such as my-effect:j2")
    middle = model.robot.limits.mean(axis=1)
    q = middle + np.linspace(0.0, 0.2, TRIED)[:, None] * np.diff(model.robot.limits, axis=1)[:, 0] / 2.0
    wrench = np.zeros((TRIED, 6))
    wrench[:, 2] = LOADS
    point = np.broadcast_to(model.robot.T_flange_tool[:3, 3], (TRIED, 3))
    at, history = LoadedPoses(q, wrench, point), plain_history(TRIED)
    history = replace(history, clock=np.linspace(0.0, 1.0, TRIED))
    plausible = np.array([p.grid[0] if p.role == "shape" else float(np.mean(p.size)) for p in effect.parameters])
    observed(model, at, [PlacedEffect(effect, plausible)], history)
    if effect.amplitudes:
        nothing = plausible.copy()
        nothing[effect.amplitudes] = 0.0
        left = observed(model, at, [PlacedEffect(effect, nothing)], history)
        if np.abs(left - deflection(model, q, wrench, point)).max() > NOTHING:
            raise InputError(
                f"law of effect {effect.code}: it acts although its amplitudes are zero",
                remedy="make it proportional to its amplitudes, or make the number a shape",
            )
