"""Drill cycles as single strokes along the tool axis, and put into a recorder: the way to the hole, and back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import Recorder, StatementError, Vector

# Distance kept from the bottom of the last peck when the drill returns to it, and the lift that breaks the chip:
# 0.254 mm (0.010 inch), as LinuxCNC does for G83 and G73. Controls have it as a parameter, files do not say it.
PECK_GAP = 0.254e-3
MAX_PECKS = 10_000


@dataclass(frozen=True)
class Stroke:
    """Move to ``height`` m above the cycle point along the tool axis; ``dwell`` s after it; spindle reversed or not.

    ``out``: it leaves the hole.
    """

    height: float
    rapid: bool
    dwell: float = 0.0
    reverse: bool = False
    out: bool = False


@dataclass(frozen=True)
class Cycle:
    """Drill cycle about a point and the tool axis there.

    ``start`` m above the point where feed begins, ``depth`` m below it, ``back`` m above it where the tool returns to
    (NaN: ``start``), ``pecks`` m of each step (the last one repeats; none: one stroke), ``chip_break``: pecks lift by
    ``lift`` m only (``breaks`` of them, then one withdraws; 0: all), ``gap`` m kept from the last bottom on the way
    back to it, ``dwell`` s at the bottom, ``feed_out``: leave at feed, ``reverse``: spindle turns back on the way out
    (tapping), ``feed``, None: the one in force, ``leaving``: the feed on the way out, None: that of the cycle.
    """

    start: float
    depth: float
    back: float = math.nan
    pecks: tuple[float, ...] = ()
    chip_break: bool = False
    dwell: float = 0.0
    feed_out: bool = False
    reverse: bool = False
    feed: Feed | None = None
    breaks: int = 0
    lift: float = PECK_GAP
    gap: float = PECK_GAP
    leaving: Feed | None = None

    def strokes(self) -> list[Stroke]:
        """Strokes from ``start`` to the bottom and back out."""
        out: list[Stroke] = []
        bottoms = self._bottoms()
        for i, bottom in enumerate(bottoms):
            last = i == len(bottoms) - 1
            out.append(Stroke(-bottom, rapid=False, dwell=self.dwell if last else 0.0))
            if last:
                continue
            if self.chip_break and not (self.breaks and (i + 1) % (self.breaks + 1) == 0):
                out.append(Stroke(min(-bottom + self.lift, self.start), rapid=True))
            else:
                out.append(Stroke(self.start, rapid=not self.feed_out, out=True))
                out.append(Stroke(min(-bottom + self.gap, self.start), rapid=True))
        out.append(Stroke(self.start, rapid=not self.feed_out, reverse=self.reverse, out=True))
        if self.height_back > self.start:
            out.append(Stroke(self.height_back, rapid=True))
        return out

    @property
    def height_back(self) -> float:
        """Height m where the tool ends; never below ``start``."""
        return self.start if math.isnan(self.back) else max(self.back, self.start)

    def _bottoms(self) -> list[float]:
        if not self.pecks:
            return [self.depth]
        bottoms: list[float] = []
        bottom, i = -self.start, 0
        # A rest below a nanometre is rounding, no peck.
        while bottom < self.depth - 1e-9:
            bottom = min(bottom + self.pecks[min(i, len(self.pecks) - 1)], self.depth)
            bottoms.append(bottom)
            i += 1
        return bottoms

    def checked(self, allowed: str) -> Cycle:
        """The cycle itself. Raises StatementError for numbers that make no hole; ``allowed``: those that would."""
        feed = 1.0 if self.feed is None else self.feed.value
        leaving = 1.0 if self.leaving is None else self.leaving.value
        numbers = (self.start, self.depth, self.dwell, feed, leaving, self.lift, self.gap, *self.pecks)
        if not all(map(math.isfinite, numbers)) or math.isinf(self.back):
            fault = "numbers that are not finite"
        elif self.depth < -self.start - 1e-9:
            fault = "the bottom lies above the height where feed begins"
        elif min(self.dwell, self.lift, self.gap) < 0.0 or min(feed, leaving, *self.pecks) <= 0.0:
            fault = "feeds and pecks must be more than 0, dwell and lifts 0 or more"
        elif self.pecks and (self.depth + self.start) / self.pecks[-1] > MAX_PECKS:
            fault = f"more than {MAX_PECKS} pecks"
        else:
            return self
        raise StatementError(f"cycle with {fault}", allowed, code="P012")


def drill(
    recorder: Recorder,
    line: int,
    here: ArrayLike | None,
    point: ArrayLike,
    axis: ArrayLike,
    cycle: Cycle,
    state: Callable[[Feed | None, bool], None],
) -> Vector:
    """Moves of ``cycle`` at ``point`` (3,) m, tool along ``axis`` (3,); the point where the tool ends.

    From ``here`` (m, None: not known) the tool rises along the axis if it stands below the height where feed begins,
    moves across at that height (rapid), then down. ``state(feed, reversed)`` is called before the moves that it
    holds for; None: the feed in force.
    """
    p, a = np.asarray(point, dtype=np.float64), np.asarray(axis, dtype=np.float64)
    unit = a / max(float(np.linalg.norm(a)), 1e-300)

    def to(height: float, rapid: bool, base: ArrayLike = p) -> Vector:
        x, y, z = (np.asarray(base) + height * unit).tolist()
        recorder.move(line, (x, y, z), (float(a[0]), float(a[1]), float(a[2])), rapid)
        return x, y, z

    state(cycle.feed, False)
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
    leaving = False
    for stroke in cycle.strokes():
        if stroke.reverse or (cycle.leaving is not None and stroke.out != leaving):
            state((cycle.leaving if stroke.out else None) or cycle.feed, stroke.reverse)
        leaving = stroke.out
        last = to(stroke.height, stroke.rapid)
        if stroke.dwell:
            recorder.dwell(line, stroke.dwell)
    state(None, False)
    return last
