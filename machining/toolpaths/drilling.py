"""Drill cycles put into a recorder: the way to the hole, the strokes, and the way back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from machining.toolpaths.cycles import Cycle
from machining.toolpaths.recorder import Recorder, Vector


def drill(
    recorder: Recorder,
    line: int,
    here: ArrayLike | None,
    point: ArrayLike,
    axis: ArrayLike,
    cycle: Cycle,
    state: Callable[[bool, bool], None],
) -> Vector:
    """Moves of ``cycle`` at ``point`` (3,) m, tool along ``axis`` (3,); the point where the tool ends.

    From ``here`` (m, None: not known) the tool rises along the axis if it stands below the height where feed begins,
    moves across at that height (rapid), then down. ``state(at_cycle_feed, reversed)`` is called before the moves
    that it holds for.
    """
    p, a = np.asarray(point, dtype=np.float64), np.asarray(axis, dtype=np.float64)
    unit = a / max(float(np.linalg.norm(a)), 1e-300)

    def to(height: float, rapid: bool, base: ArrayLike = p) -> Vector:
        x, y, z = (np.asarray(base) + height * unit).tolist()
        recorder.move(line, (x, y, z), (float(a[0]), float(a[1]), float(a[2])), rapid)
        return x, y, z

    state(True, False)
    travel = cycle.start
    last: Vector = (float(p[0]), float(p[1]), float(p[2]))
    h = p if here is None else np.asarray(here, dtype=np.float64)
    if here is not None:
        above = float((h - p) @ unit)
        travel = max(above, cycle.start)
        if above < cycle.start - 1e-9:
            h = np.array(to(cycle.start - above, True, h))
    if here is None or float(np.linalg.norm(p + travel * unit - h)) > 1e-9:
        last = to(travel, True)
    if travel > cycle.start + 1e-9:
        last = to(cycle.start, True)
    for stroke in cycle.strokes():
        if stroke.reverse:
            state(True, True)
        last = to(stroke.height, stroke.rapid)
        if stroke.dwell:
            recorder.dwell(line, stroke.dwell)
    state(False, False)
    return last
