"""Physical effects that a plain arm model leaves out, as parts with a law, parameters and a plausible range."""

from fem.effects.base import Effect, EffectParameter, PlacedEffect, Stage
from fem.effects.catalogue import catalogue, effect_of
from fem.effects.described import (
    LOAD_PATH,
    build_arm,
    build_plain,
    described_effects,
    effect_tables,
    path_of,
    reading_effects,
    with_effects,
    with_load_path,
    with_model_effects,
    without_effect,
)
from fem.effects.observed import observed
from fem.effects.own import Maker, checked_maker
from fem.effects.situation import History, Situation, plain_history

__all__ = [
    "LOAD_PATH",
    "Effect",
    "EffectParameter",
    "History",
    "Maker",
    "PlacedEffect",
    "Situation",
    "Stage",
    "build_arm",
    "build_plain",
    "catalogue",
    "checked_maker",
    "described_effects",
    "effect_of",
    "effect_tables",
    "observed",
    "path_of",
    "plain_history",
    "reading_effects",
    "with_effects",
    "with_load_path",
    "with_model_effects",
    "without_effect",
]
