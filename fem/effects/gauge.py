"""What is read is not what happened: zero, scale, drift."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.effects.base import ASSUMED_LAW, Effect, EffectParameter
from fem.effects.situation import Situation
from fem.effects.structure import ASSUMED
from robots.arrays import Array

AXES = ("x", "y", "z")


def gauge_effects() -> Iterator[Effect]:
    """Effects of this kind."""
    zeros = tuple(
        EffectParameter(a, "length", "um", 5e-6, 60e-6, ASSUMED, signed=True, meaning=f"reading along {a} without load")
        for a in AXES
    )
    yield Effect("gauge-zero", "the gauge does not read zero without load", "gauge", zeros, _zero, "gauge-zero")
    scale = EffectParameter(
        "share", "ratio", "%", 0.005, 0.1, ASSUMED, signed=True, meaning="share by which it reads too much"
    )
    yield Effect("gauge-scale", "the gauge's scale is off", "gauge", (scale,), _scale, "gauge-scale")
    drifts = tuple(
        EffectParameter(
            a, "length", "um", 10e-6, 120e-6, ASSUMED, signed=True, meaning=f"drift along {a} over the whole campaign"
        )
        for a in AXES
    )
    settling = EffectParameter("settling", "ratio", "1", 0.05, 10.0, ASSUMED, role="shape", grid=(0.1, 0.3, 10.0),
                               meaning="time to settle over the campaign's; large: nearly straight")  # fmt: skip
    yield Effect("drift", "readings drift with time", "gauge", (*drifts, settling), _drift, "drift",
                 depends_on="clock", doubt=ASSUMED_LAW)  # fmt: skip


def _zero(d: Array, s: Situation, v: Array) -> Array:
    out = d.copy()
    out[:, :3] += v
    return out


def _scale(d: Array, s: Situation, v: Array) -> Array:
    return np.asarray(d * (1.0 + v[0]))


def _drift(d: Array, s: Situation, v: Array) -> Array:
    """``d (1 - exp(-t/T)) / (1 - exp(-1/T))``, t from 0 to 1 over the campaign: nearly straight for large T."""
    t = np.nan_to_num(s.history.clock)
    out = d.copy()
    out[:, :3] += ((1.0 - np.exp(-t / v[3])) / (1.0 - np.exp(-1.0 / v[3])))[:, None] * v[:3]
    return out
