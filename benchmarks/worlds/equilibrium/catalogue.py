"""All effects by family, and the names that they go by."""

from __future__ import annotations

from . import elastic, frames, nonlinear, outside, surroundings
from .effect import Effect, family_table

CATALOGUE = family_table([*elastic.KINDS, *nonlinear.KINDS, *frames.KINDS])
OUTSIDE = family_table([*outside.KINDS, *surroundings.KINDS])
EVERY = CATALOGUE | OUTSIDE
# Of these there is one in an arm, so that the code does not say where.
ONE = {
    "payload",
    "base-tilt",
    "base-vertical",
    "parallelogram-bar",
    "load-path",
    "tool-compliance",
    "load-point-offset",
    "load-misalignment",
    "gauge-zero",
    "gauge-scale",
    "drift",
    "wrist-coupling",
    "turned-frame",
    "tool-point-offset",
    "partial-load-path",
    "loose-base",
    "cable-package",
}


def code(effect: Effect) -> str:
    """Return the code under which the study counts it."""
    return effect.family if effect.family in ONE else f"{effect.family}:{effect.place}"


def effect_of(data: dict[str, object]) -> Effect:
    """Read an effect from plain data."""
    family = str(data["code"])
    if family not in ONE:
        family = family.rsplit(":", 1)[0]
    return EVERY[family](str(data["place"]), dict(data["parameters"]))  # type: ignore[call-overload]
