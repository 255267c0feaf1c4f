"""Effects of surroundings, all effects by family, and the clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np

from .arm import Moment, Vector
from .effects import ELASTIC, NONLINEAR, Effect, Parameters, Row, Site, family_table, scaled, signed, uniform
from .frames import FRAMES, OUTSIDE

# Expansion per K: steel, and the aluminium of a gauge's stand.
STEEL, ALUMINIUM = 11.7e-6, 23.1e-6


class People(Effect):
    """From day two on somebody else reads: another lever of the gauge (3 to 9 %), another zero (15 to 60 um)."""

    family = "other:people"
    axis: ClassVar[tuple[str, ...]] = ("session",)
    fading = True
    timed = True

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The gauge."""
        return ["gauge"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw both."""
        return {"scale": 1 + signed(rng, 0.03, 0.09), "offset_m": [signed(rng, 15e-6, 60e-6) for _ in range(3)]}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """All days but the first."""
        if row.moment.session == 0:
            return displacement
        return displacement * self.number("scale") + self.vector("offset_m")


class BumpedGauge(People):
    """Someone touched the gauge: 30 to 90 um from then on."""

    family = "other:bumped-gauge"
    axis: ClassVar[tuple[str, ...]] = ("clock",)

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw when and by how much."""
        return {"step_m": [signed(rng, 30e-6, 90e-6) for _ in range(3)], "when": uniform(rng, 0.25, 0.75)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Step."""
        return displacement + self.vector("step_m") * (row.moment.progress >= self.number("when"))


class WarmStand(People):
    """The gauge's aluminium stand, 0.6 to 1.6 m high, grows with the hall's air."""

    family = "other:warm-stand"
    axis: ClassVar[tuple[str, ...]] = ("temperature", "clock")

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw its height, and how far it leans out."""
        return {"stand_m": [signed(rng, 0.1, 0.5), signed(rng, 0.1, 0.5), uniform(rng, 0.6, 1.6)]}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """The gauge moves, so the arm seems to move the other way."""
        return displacement - self.vector("stand_m") * ALUMINIUM * row.moment.air


class WarmFrame(People):
    """The arm's iron grows with the hall, hours behind the air: the further out, the more."""

    family = "other:warm-frame"
    axis: ClassVar[tuple[str, ...]] = ("temperature", "pose", "clock")

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """Links."""
        return ["link"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much of the expansion shows (the gauge's stand does its part)."""
        return {"shown": uniform(rng, 0.6, 1.2)}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """All of the position grows."""
        return displacement + position * self.number("shown") * STEEL * row.moment.iron


class FloorCreep(People):
    """The floor goes on sagging under the load's moment, by the square of the reach: 20 to 80 um at 1.5 m."""

    family = "other:floor-creep"
    axis: ClassVar[tuple[str, ...]] = ("clock", "pose", "load")
    fading = False

    @classmethod
    def places(cls, site: Site) -> list[str]:
        """The base."""
        return ["base"]

    @classmethod
    def draw(cls, rng: np.random.Generator, site: Site, place: str) -> Parameters:
        """Draw how much, how fast."""
        return {"sag_m": scaled(rng, 20e-6, 80e-6), "share": uniform(rng, 0.15, 1.0), "full_N": site.force}

    def reading(self, displacement: Vector, row: Row, position: Vector) -> Vector:
        """Return more of it as time goes on."""
        course = 1 - np.exp(-max(row.moment.progress, 0) / self.number("share"))
        part = row.force[2] / self.number("full_N")
        sag = self.number("sag_m") * course * part * (position[0] ** 2 + position[1] ** 2) / 1.5**2
        return np.asarray(displacement + np.array([0, 0, sag]))


SURROUNDINGS: list[type[Effect]] = [People, BumpedGauge, WarmStand, WarmFrame, FloorCreep]


CATALOGUE = family_table([*ELASTIC, *NONLINEAR, *FRAMES])
OUTSIDE = family_table([*OUTSIDE, *SURROUNDINGS])
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
