"""What is read when effects act: stage by stage, in the order of :mod:`fem.effects.base`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem.compiled.compliance import deflection
from fem.effects.acting import act
from fem.effects.base import PlacedEffect
from fem.effects.history import History, plain_history
from fem.effects.situation import Situation
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses
from robots.arrays import Array


def observed(
    model: ArmModel,
    at: LoadedPoses,
    effects: Sequence[PlacedEffect],
    history: History | None = None,
    start: Situation | None = None,
) -> Array:
    """Readings (n, 6), m and rad, of an arm at loaded poses with effects; without effects its deflection.

    ``start``: a situation asked before at the same loaded poses (the same object) and history, whose statics serve
    again.
    """
    before = start or Situation(model, at, history or plain_history(len(at)))
    changed, loads = model, at
    for e in _of_stage(effects, "model"):
        changed = act(e, changed, None)
    for e in _of_stage(effects, "load"):
        loads = act(e, loads, before.of(changed, at))
    d = deflection(changed, loads.q, loads.wrench, loads.point)
    situation = before.of(changed, loads)
    for e in _of_stage(effects, "arm"):
        d = d + act(e, None, situation)
    for e in _of_stage(effects, "gauge"):
        d = act(e, d, situation)
    return np.asarray(d)


def _of_stage(effects: Sequence[PlacedEffect], stage: str) -> list[PlacedEffect]:
    return [e for e in effects if e.effect.stage == stage]
