"""The order of loads in a table of readings, for effects with a memory."""

from __future__ import annotations

import numpy as np

from doe.measurements import Measurements
from fem.effects.history import History


def history_of(data: Measurements) -> History:
    """Load cycles and clock of readings: a cycle is one repeat in one pose, and starts unloaded.

    Within a cycle the order is that of ``step``; without steps, loading by rising load, then unloading by falling
    load. The clock runs over ``step`` where no step is used twice, else it is not known.
    """
    keys = [(pose, repeat) for pose, repeat in zip(data.pose, data.repeat, strict=True)]
    number = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    cycle = np.array([number[key] for key in keys], dtype=np.intp)
    size = np.linalg.norm(data.wrench[:, :3], axis=1) + np.linalg.norm(data.wrench[:, 3:], axis=1)
    down = np.array([phase == "unloading" for phase in data.phase])
    told = any(phase is not None for phase in data.phase)
    stepped = bool(np.isfinite(data.step).all()) and len(data.step) > 0
    place = data.step if stepped else np.where(down, 1e12 - size, size)
    order = np.zeros(len(keys), dtype=np.intp)
    for k in range(len(number)):
        mine = np.flatnonzero(cycle == k)
        order[mine] = np.unique(place[mine], return_inverse=True)[1]
    clock = np.full(len(keys), np.nan)
    if stepped and len(np.unique(data.step)) == len(data.step) and np.ptp(data.step) > 0.0:
        clock = (data.step - data.step.min()) / np.ptp(data.step)
    known = told or (stepped and bool((order > 0).any()))
    return History(cycle, order, clock, is_known=known)
