"""When readings are taken, and how warm it is then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from .laws import Moment

DAY = 86400.0


@dataclass(frozen=True)
class Clock:
    """Hours of work, and the hall's air as a sum of waves (so that later visits find the same weather going on).

    ``thermometer``: what the table's column is of: ``air``, ``housing`` (of a joint, which warms as the arm works) or
    ``none``. ``end_s`` and ``cycles`` are filled in when the campaign is planned.
    """

    start_hour: float
    work_s: float
    setup_s: float
    reading_s: float
    mean_celsius: float
    waves: tuple[tuple[float, float, float], ...]
    iron_lag_s: float
    thermometer: str
    housing_rise: float
    housing_time_s: float
    days: int
    end_s: float = 0.0
    cycles: int = 0

    def waves_at(self, time_s: float, lag_s: float) -> float:
        """Deviation of the air from its mean, or of something that follows it with a lag of first order, K."""
        total = 0.0
        for amplitude, period, phase in self.waves:
            turn = 2 * np.pi / period
            delay = np.arctan(turn * lag_s)
            total += amplitude * np.cos(delay) * np.cos(turn * time_s + phase - delay)
        return float(total)

    def moment(self, time_s: float, day_s: float, session: int, cycle: int) -> Moment:
        """Say all that effects may ask about a time."""
        air = self.waves_at(time_s, 0.0) - self.waves_at(0.0, 0.0)
        iron = self.waves_at(time_s, self.iron_lag_s) - self.waves_at(0.0, self.iron_lag_s)
        progress, used = time_s / max(self.end_s, 1.0), cycle / max(self.cycles, 1)
        return Moment(time_s, progress, day_s, air, iron, session, cycle, used)

    def temperature(self, moment: Moment) -> float:
        """Return what the thermometer says, C, before its own noise."""
        if self.thermometer == "air":
            return self.mean_celsius + self.waves_at(moment.time_s, 120.0)
        rise = self.housing_rise * (1 - np.exp(-moment.day_s / self.housing_time_s))
        return float(self.mean_celsius + self.waves_at(moment.time_s, 2400.0) + rise)

    def data(self) -> dict[str, object]:
        """As plain data."""
        return asdict(self)


def draw_clock(rng: np.random.Generator, thermometer: str, days: int) -> Clock:
    """Draw hours and weather: a daily wave of 1 to 4 K and its half, doors, and a front that takes four days."""
    peak = rng.uniform(14, 17)
    start = rng.uniform(6.5, 9.5)
    daily = rng.uniform(1.0, 4.0)
    phase = 2 * np.pi * (start - peak) / 24
    waves = (
        (daily, DAY, phase),
        (0.25 * daily, DAY / 2, 2 * phase),
        (rng.uniform(0.1, 0.5), rng.uniform(1800, 6000), rng.uniform(0, 6.28)),
        (rng.uniform(0.3, 2.0), 4 * DAY, rng.uniform(0, 6.28)),
    )
    return Clock(
        start,
        rng.uniform(7, 9) * 3600,
        rng.uniform(180, 420),
        rng.uniform(25, 60),
        rng.uniform(18, 24),
        waves,
        rng.uniform(1.5, 4.0) * 3600,
        thermometer,
        rng.uniform(5, 14),
        rng.uniform(1800, 7200),
        days,
    )


def moments(
    clock: Clock, poses: Sequence[str], repeats: Sequence[int], rng: np.random.Generator, visit: int = 0
) -> tuple[Clock, list[Moment]]:
    """Go through a campaign reading by reading; a day ends when its hours are over, or its share of the set-ups is.

    Returns the clock with its end, where ``visit`` is 0; later visits begin on the morning of as many days later.
    """
    first_day = 0 if visit == 0 else int(clock.end_s // DAY) + visit
    changes = [i for i in range(len(poses)) if i == 0 or poses[i] != poses[i - 1]]
    most = -(-len(changes) // clock.days) if visit == 0 else len(changes)
    time, begun, session, on_this_day = first_day * DAY, first_day * DAY, 0, 0
    cycle = -1 if visit == 0 else clock.cycles
    stamps: list[tuple[float, float, int, int]] = []
    for i, pose in enumerate(poses):
        fresh = i == 0 or pose != poses[i - 1]
        if fresh:
            over = time - begun > clock.work_s or on_this_day >= most
            if i and over:
                begun = (int(begun // DAY) + 1) * DAY
                time, session, on_this_day = begun, session + 1, 0
            on_this_day += 1
        if fresh or repeats[i] != repeats[i - 1]:
            cycle += 1
        time += (clock.setup_s if fresh else 0.0) * rng.uniform(0.7, 1.4) + clock.reading_s * rng.uniform(0.8, 1.3)
        time = float(np.round(time))
        stamps.append((time, time - begun, session if visit == 0 else clock.days + visit - 1 + session, cycle))
    if visit == 0:
        clock = replace(clock, end_s=stamps[-1][0], cycles=cycle + 1, days=stamps[-1][2] + 1)
    return clock, [clock.moment(*stamp) for stamp in stamps]


def clock_of(data: dict[str, object]) -> Clock:
    """Read a clock from plain data."""
    plain = dict(data)
    plain["waves"] = tuple(tuple(wave) for wave in plain["waves"])  # type: ignore[attr-defined]
    return Clock(**plain)  # type: ignore[arg-type]
