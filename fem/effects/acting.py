"""What an effect's law gives; a law of the user's own is checked whenever it is asked.

A law written elsewhere is not trusted to give what its stage asks for: shapes and finite numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fem.effects.base import Effect, PlacedEffect
from fem.effects.situation import Situation
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses
from robots import InputError


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
            f"law of effect {effect.code} fails ({type(error).__name__}: {error})", remedy="mend it in its file"
        ) from error
    return _checked(effect, subject, situation, given)


def _checked(effect: Effect, subject: Any, situation: Situation | None, given: Any) -> Any:
    what = f"law of effect {effect.code} (stage {effect.stage})"
    if effect.stage == "model":
        if not isinstance(given, ArmModel):
            raise InputError(what, value=type(given).__name__, allowed="an ArmModel", remedy="return the changed model")
        return given
    if effect.stage == "load":
        if not isinstance(given, LoadedPoses):
            raise InputError(what, value=type(given).__name__, allowed="LoadedPoses", remedy="return the changed loads")
        pairs = [(getattr(given, name), getattr(subject, name), name) for name in ("q", "wrench", "point")]
    else:
        assert situation is not None  # noqa: S101 - these stages have one
        pairs = [(given, np.zeros((len(situation.at), 6)), "displacement")]
    for value, like, name in pairs:
        if not isinstance(value, np.ndarray) or value.shape != like.shape:
            shape = value.shape if isinstance(value, np.ndarray) else type(value).__name__
            raise InputError(f"{what}: {name}", value=f"shape {shape}", allowed=f"an array {like.shape}")
        if not np.issubdtype(value.dtype, np.floating) or not np.isfinite(value).all():
            raise InputError(f"{what}: {name}", value="NaN, inf or no real numbers", allowed="finite numbers")
    return given
