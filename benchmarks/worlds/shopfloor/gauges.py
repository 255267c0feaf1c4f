"""Laws of the gauge: what is read instead of the displacement: zero, scale, clock, temperature, stiction, a touch."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.law import Law, Scene, Sizes, at, either


def _vector(v: Sizes) -> Floats:
    return np.array([v["x_m"], v["y_m"], v["z_m"]])


def zero(scene: Scene, d: Floats, v: Sizes) -> Floats:
    return d + _vector(v)


def scale(scene: Scene, d: Floats, v: Sizes) -> Floats:
    return d * (1.0 + v["share"])


def drift(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The tracker's stand moves after switching on, fast and then slowly; it is set up anew every morning."""
    hours = (scene.clock - scene.line.morning) / 3600.0
    grown = 0.6 * (1.0 - np.exp(-hours / v["time_h"])) + 0.4 * np.minimum(hours, 8.0) / 8.0
    return np.asarray(d + grown[:, None] * _vector(v))


def touched(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """Someone leaned on the stand: from then on all readings are off, until the stand is set up again days later."""
    after = (scene.clock > v["when"] * scene.span) & (scene.clock < scene.span + 1.0)
    return np.asarray(d + after[:, None] * _vector(v))


def warm_frame(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The measuring frame grows with the hall's temperature since the morning's zero."""
    _, first, day = np.unique(scene.line.session, return_index=True, return_inverse=True)
    return np.asarray(d + (scene.air - scene.air[first][day])[:, None] * _vector(v))


def sticky(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The plunger lags by up to a length: a play operator on each axis."""
    out = np.empty_like(d)
    for axis in range(3):

        def lag(x: Floats, _: Floats) -> Floats:
            at, held = 0.0, np.empty(len(x))
            for i, value in enumerate(x):
                at = min(max(at, value - v["play_m"]), value + v["play_m"])
                held[i] = at
            return held

        out[:, axis] = scene.by_visit(lag, d[:, axis])
    return out


def _offsets(rng: np.random.Generator, low: float, high: float) -> dict[str, float]:
    return {name: either(rng) * rng.uniform(low, high) for name in ("x_m", "y_m", "z_m")}


def _drifts(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    return {**_offsets(rng, 2e-5, 8e-5), "time_h": rng.uniform(0.5, 3.0)}


LAWS = (
    Law("gauge-zero", ("load",), at("gauge"), lambda rng, arm, k: _offsets(rng, 15e-6, 45e-6), reads=zero),
    Law(
        "gauge-scale",
        ("load",),
        at("gauge"),
        lambda rng, arm, k: {"share": either(rng) * rng.uniform(0.02, 0.08)},
        reads=scale,
    ),
    Law("drift", ("clock",), at("gauge"), _drifts, reads=drift, slow=True),
)
OUTSIDE = (
    Law(
        "other:gauge-touched",
        ("clock",),
        at("gauge"),
        lambda rng, arm, k: {**_offsets(rng, 2e-5, 8e-5), "when": rng.uniform(0.3, 0.7)},
        reads=touched,
        slow=True,
    ),
    Law(
        "other:frame-temperature",
        ("temperature", "clock"),
        at("gauge"),
        lambda rng, arm, k: _offsets(rng, 3e-6, 1.2e-5),
        reads=warm_frame,
        slow=True,
    ),
    Law(
        "other:gauge-stick",
        ("load history",),
        at("gauge"),
        lambda rng, arm, k: {"play_m": rng.uniform(8e-6, 3e-5)},
        reads=sticky,
        steady=False,
    ),
)
