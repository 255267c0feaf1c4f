"""What was set up and when: rows of a campaign in the order of time, and histories of load along them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .screws import Array, Flags, Whole

HANDLING_S = 15.0  # so long a load hangs before it is read
ZERO, NOTHING = -1, -2


@dataclass(frozen=True)
class Campaign:
    """Readings in the order of time: angles (n, joints) in deg, forces (n, 3) in N, points (n, 3) in flange axes in m.

    ``setup`` is the pose's number, ``visit`` the stretch over which a load history goes on, ``cycle`` the loading cycle
    at whose start the gauge was zeroed, ``stay`` the stretch at one pose without leaving it (it shares one scatter).
    """

    q_deg: Array
    force: Array
    point: Array
    setup: Whole
    repeat: Whole
    visit: Whole
    cycle: Whole
    stay: Whole
    unloading: Flags
    time_s: Array
    session: Whole
    air_celsius: Array
    rested: bool = False

    def __len__(self) -> int:
        return len(self.setup)

    def joined(self, later: Campaign) -> Campaign:
        """Both campaigns as one; the later one's groups are its own, its poses' numbers too."""
        shifted = replace(
            later,
            visit=later.visit + self.visit.max() + 1,
            cycle=later.cycle + self.cycle.max() + 1,
            stay=later.stay + self.stay.max() + 1,
            setup=later.setup + self.setup.max() + 1,
        )
        names = [f for f in self.__dataclass_fields__ if f != "rested"]
        both: dict[str, Any] = {f: np.concatenate([getattr(self, f), getattr(shifted, f)]) for f in names}
        return replace(self, **both)


def histories(c: Campaign) -> Whole:
    """Events (visits, longest): row numbers, ``ZERO`` where a cycle starts unloaded, ``NOTHING`` after."""
    lines: list[list[int]] = []
    for rows in np.split(np.arange(len(c)), np.flatnonzero(np.diff(c.visit)) + 1):
        line: list[int] = []
        for i in rows.tolist():
            if not line or c.cycle[i] != c.cycle[i - 1]:
                line.append(ZERO)
            line.append(i)
        lines.append(line)
    longest = max(len(line) for line in lines)
    return np.array([line + [NOTHING] * (longest - len(line)) for line in lines], np.int64)


def along_history(c: Campaign, signal: Array, law: Callable[[Array], Array]) -> Array:
    """What ``law``, which keeps its own state a visit, answers to ``signal`` (n,), less its value at the cycle's zero.

    The law is called event by event with the inputs of all visits at once; each visit starts from the law's own rest.
    """
    events = histories(c)
    answer, held, zero = np.zeros(len(c)), np.zeros(len(events)), np.zeros(len(events))
    for column in events.T:
        held = np.where(column >= 0, signal[np.maximum(column, 0)], np.where(column == ZERO, 0.0, held))
        out = law(held)
        zero = np.where(column == ZERO, out, zero)
        real = column >= 0
        answer[column[real]] = (out - zero)[real]
    return answer


def lagging(c: Campaign, drive: Array, lag_s: float) -> Array:
    """Solution of ``lag dx/dt = drive - x`` at the readings less at the cycle's zero; no drive between cycles."""
    if c.rested:
        return np.zeros(len(c))
    x, now, zero, held, answer = 0.0, -1e9, 0.0, 0.0, np.zeros(len(c))
    decay = float(np.exp(-HANDLING_S / lag_s))
    for i, (t, aim) in enumerate(zip(c.time_s.tolist(), drive.tolist(), strict=True)):
        starts = i == 0 or c.cycle[i] != c.cycle[i - 1]
        held = 0.0 if starts else held
        x = held + (x - held) * float(np.exp(-max(t - HANDLING_S - now, 0.0) / lag_s))
        zero = x if starts else zero
        x = aim + (x - aim) * decay
        now, held = t, aim
        answer[i] = x - zero
    return answer


def heated(c: Campaign, power: Array, lag_s: float) -> Array:
    """Solution of ``lag dy/dt = power - y`` from cold at the start; motors are off between sessions."""
    if c.rested:
        return np.zeros(len(c))
    y, now, answer = 0.0, 0.0, np.zeros(len(c))
    for i, (t, heat) in enumerate(zip(c.time_s.tolist(), power.tolist(), strict=True)):
        off = i > 0 and c.session[i] != c.session[i - 1]
        aim = 0.0 if off else heat
        y = aim + (y - aim) * float(np.exp(-max(t - now, 0.0) / lag_s))
        now, answer[i] = t, y
    return answer
