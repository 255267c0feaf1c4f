"""Readings kept out of every calibration of the whole chain: which variant predicts them best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from doe.calibration.prediction import Holdout
from robots.quantities import rounded
from stiffarm.commands.calibrate.step import Calibrated


def of_variants(variants: Sequence[Calibrated]) -> dict[str, Holdout]:
    """What each variant, by its name, makes of the readings held out; empty where none were."""
    return {v.name: v.holdout for v in variants if v.holdout is not None}


def payload(found: dict[str, Holdout]) -> dict[str, Any]:
    """As JSON; there is at least one variant."""
    data = next(iter(found.values())).data
    return {
        "data": data.source,
        "data_sha256": data.sha256,
        "readings": int(data.used.sum()),
        "rms_mm": {name: rounded(h.rms_mm) for name, h in found.items()},
        "beyond_the_laws": {name: list(h.beyond) for name, h in found.items() if h.beyond},
    }


def sentences(found: dict[str, Holdout], others_mm: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """What the report and the screen say about it; ``others_mm``: errors (RMS) of models that are no variants."""
    if not found:
        return ()
    data = next(iter(found.values())).data
    errors_mm = {name: h.rms_mm for name, h in found.items()} | dict(others_mm or {})
    best = min(errors_mm, key=lambda name: errors_mm[name] if np.isfinite(errors_mm[name]) else np.inf)
    out = [
        f"Held out: {int(data.used.sum())} readings of {data.source}, at poses that no calibration has seen. "
        f"{best} predicts them best, to {errors_mm[best]:.3f} mm RMS."
    ]
    out += [
        f"{name}: poses {', '.join(h.beyond)} lie outside the angles of its laws; polynomials are unreliable there."
        for name, h in found.items()
        if h.beyond
    ]
    return tuple(out)
