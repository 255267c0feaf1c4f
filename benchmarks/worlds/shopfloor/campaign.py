"""A technician's campaign, event by event: drive, zero the gauge, hang weights, read, take them off, drink tea.

Time is counted in seconds since the campaign's start. Work starts at eight; a tea pause about every two hours, lunch at
noon, and after eight hours the next morning. The joints warm up with a time constant of about 50 minutes while the arm
works, and cool with 90 minutes while it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Ints

ZERO, HANG, READ = 0, 1, 2
DAY = 86400.0


@dataclass(frozen=True)
class Cycle:
    """Weights put on one after another along one direction: forces (n, 3) N, phases (+1 on, -1 off), which are read."""

    force: Floats
    phase: Ints
    read: tuple[bool, ...]
    repeat: int


@dataclass(frozen=True)
class Habits:
    """How the technician works; times in s."""

    drive: float = 90.0
    settle: float = 25.0
    tea: float = 900.0
    lunch: float = 2700.0
    exercise: bool = False
    zero_each_cycle: bool = True
    warm_up: bool = False
    hours: float = 8.0


@dataclass(frozen=True)
class Timeline:
    """Events as columns (n,). ``zero`` is the event at which the gauge was zeroed; ``count`` counts load cycles."""

    kind: Ints
    pose: Ints
    force: Floats
    phase: Ints
    repeat: Ints
    visit: Ints
    zero: Ints
    time: Floats
    warm: Floats
    session: Ints
    count: Ints
    morning: Floats

    @property
    def reads(self) -> Ints:
        """Which events are readings."""
        return np.flatnonzero(self.kind == READ)


@dataclass
class _Notebook:
    """What is noted down while the campaign runs."""

    habits: Habits
    rng: np.random.Generator
    now: float = 0.0
    warm: float = 0.0
    session: int = 0
    count: int = 0
    morning: float = 0.0
    since_tea: float = 0.0
    had_lunch: bool = False
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def work(self, seconds: float) -> None:
        took = seconds * float(self.rng.lognormal(0.0, 0.2))
        self.now += took
        self.since_tea += took
        self.warm += (1.0 - self.warm) * (1.0 - np.exp(-took / 3000.0))

    def rest(self, seconds: float) -> None:
        self.now += seconds
        self.since_tea = 0.0
        self.warm *= float(np.exp(-seconds / 5400.0))

    def pause(self) -> None:
        """Tea, lunch or home, where it is time for it; never while a weight hangs."""
        day = self.now - self.morning
        if day > self.habits.hours * 3600.0:
            self.rest(DAY - day)
            self.morning, self.session, self.had_lunch = self.now, self.session + 1, False
            if self.habits.warm_up:
                self.work(1800.0)
        elif day > 4 * 3600.0 and not self.had_lunch:
            self.had_lunch = True
            self.rest(self.habits.lunch)
        elif self.since_tea > 7200.0:
            self.rest(self.habits.tea)

    def note(self, kind: int, pose: int, force: Floats, phase: int, repeat: int, visit: int, zero: int) -> None:
        self.rows.append(
            (
                kind,
                pose,
                *force,
                phase,
                repeat,
                visit,
                zero,
                self.now,
                self.warm,
                self.session,
                self.count,
                self.morning,
            )
        )


def run(
    setups: Sequence[tuple[int, Sequence[Cycle]]],
    habits: Habits,
    rng: np.random.Generator,
    start: float = 0.0,
    session: int = 0,
    count: int = 0,
) -> Timeline:
    """Work through ``setups`` (pose and its load cycles) in their order."""
    book = _Notebook(habits, rng, start, session=session, count=count, morning=start)
    nothing = np.zeros(3)
    if habits.warm_up:
        book.work(1800.0)
    for visit, (pose, cycles) in enumerate(setups):
        book.pause()
        book.work(habits.drive)
        zero = -1
        for cycle in cycles:
            if habits.exercise and zero < 0:
                book.note(HANG, pose, cycle.force[np.argmax(np.linalg.norm(cycle.force, axis=1))], 1, 0, visit, -1)
                book.work(habits.settle)
            if zero < 0 or habits.zero_each_cycle:
                zero = len(book.rows)
            book.note(ZERO, pose, nothing, 0, cycle.repeat, visit, zero)
            for force, phase, read in zip(cycle.force, cycle.phase, cycle.read, strict=True):
                book.work(habits.settle)
                book.note(READ if read else HANG, pose, force, int(phase), cycle.repeat, visit, zero)
            book.work(habits.settle)
            book.count += 1
        book.note(HANG, pose, nothing, 0, 0, visit, zero)
    table = np.array(book.rows)
    whole = table.astype(np.int64)
    return Timeline(
        whole[:, 0],
        whole[:, 1],
        table[:, 2:5],
        whole[:, 5],
        whole[:, 6],
        whole[:, 7],
        whole[:, 8],
        table[:, 9],
        table[:, 10],
        whole[:, 11],
        whole[:, 12],
        table[:, 13],
    )


def cycle(way: Floats, sizes: Sequence[float], down: bool, hold: bool, repeat: int) -> Cycle:
    """Loads of these sizes (N, ascending) along ``way``; ``down`` reads them coming off too, ``hold`` the top twice."""
    up = list(sizes)
    back = (up[::-1] if hold else up[-2::-1]) if down else []
    phase = np.array([1] * len(up) + [-1] * len(back), dtype=np.int64)
    return Cycle(np.outer([*up, *back], way), phase, (True,) * len(phase), repeat)


def air(time: Floats, mood: tuple[float, float, float]) -> Floats:
    """Temperature of the hall in C: a daily wave and a gate that is opened now and then."""
    mean, wave, gate = mood
    return np.asarray(
        mean
        + wave * np.sin(2 * np.pi * (time / DAY - 0.1))
        + gate * np.abs(np.sin(time / 5300.0)) * np.sin(time / 1700)
    )
