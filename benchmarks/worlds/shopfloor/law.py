"""The work of a campaign, what a law is, and how a campaign is designed."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from .arms import Floats, Ints, Postures, Robot, postures

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


Sizes = Mapping[str, float]


@dataclass(frozen=True)
class Scene:
    """All that laws may look at: (n,) or (n, ...) over the events of a timeline.

    wrench is at the tool in base axes (N, N m); torque and weight are those of the springs (N m); clock and warm are
    what slow laws see, which in a rested state differ from the timeline's.
    """

    arm: Robot
    at: Postures
    line: Timeline
    q: Floats
    wrench: Floats
    torque: Floats
    weight: Floats
    compliance: Floats
    clock: Floats
    warm: Floats
    air: Floats
    span: float
    fresh: bool = False

    @property
    def pose(self) -> Ints:
        """Pose of each event."""
        return self.line.pose

    def turned(self, joint: int, angle: Floats) -> Floats:
        """Displacement of the tool (n, 6) where a spring gives way by ``angle`` (n,) rad."""
        return np.asarray(self.at.turns[self.pose, joint] * angle[:, None])

    def part(self, index: int, flexibility: Floats) -> Floats:
        """Displacement (n, 6) by a 6x6 flexibility of a part in its frame; -2 is the base and -1 the tool."""
        x = self.at.parts[self.pose, index]
        carried = np.einsum("nji,nj->ni", x, self.wrench)
        return np.asarray(np.einsum("nij,nj->ni", x, carried @ flexibility.T))

    def carried(self, index: int) -> Floats:
        """Wrench (n, 6) that a part carries, in its frame."""
        return np.asarray(np.einsum("nji,nj->ni", self.at.parts[self.pose, index], self.wrench))

    def by_visit(self, law: Callable[[Floats, Floats], Floats], torque: Floats) -> Floats:
        """A law with memory, set-up by set-up: given torques and times (m,) since the drive, it gives (m,)."""
        out = np.zeros(len(torque))
        edges = np.flatnonzero(np.diff(self.line.visit)) + 1
        for rows in np.split(np.arange(len(torque)), edges):
            out[rows] = law(torque[rows], self.line.time[rows] - self.line.time[rows[0]])
        return out


@dataclass(frozen=True)
class Rig:
    """What stands and pulls in truth, before statics: laws of the table and of the load change it.

    q : (n_pose, dof) rad; force : (n, 3) N over events; moment_arm in flange axes (m); ``loop`` is the load path
    """

    q: Floats
    force: Floats
    shift: Floats
    arm_of_force: Floats
    frame: Floats
    loop: bool


@dataclass(frozen=True)
class Law:
    """One family of effects.

    draw gives the sizes (SI) of one at a place of an arm; exactly one of rig, gives, theta and reads is set:
    rig changes a :class:`Rig`, gives returns a displacement (n, 6), theta a further turn of the joint (n,) rad,
    reads turns displacements (n, 3) into what the gauge shows.
    """

    family: str
    axis: tuple[str, ...]
    places: Callable[[Robot], tuple[str, ...]]
    draw: Callable[[np.random.Generator, Robot, int], dict[str, float]]
    rig: Callable[[Rig, Timeline, int, Sizes], Rig] | None = None
    gives: Callable[[Scene, int, Sizes], Floats] | None = None
    theta: Callable[[Scene, int, Sizes], Floats] | None = None
    reads: Callable[[Scene, Floats, Sizes], Floats] | None = None
    slow: bool = False
    steady: bool = True


@dataclass(frozen=True)
class Hidden:
    """An effect of one set: its law, where it sits, and its sizes."""

    law: Law
    place: str
    joint: int
    sizes: dict[str, float] = field(default_factory=dict)

    @property
    def code(self) -> str:
        """As the catalogue names it."""
        return self.law.family if self.law.family in PLAIN else f"{self.law.family}:{self.place}"


# Codes that name no place.
PLAIN = frozenset(
    {
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
)


def at_joints(*which: int) -> Callable[[Robot], tuple[str, ...]]:
    """Places: these joints, or all."""
    return lambda arm: tuple(arm.names[k] for k in (which or range(arm.dof)) if k < arm.dof)


def at(place: str) -> Callable[[Robot], tuple[str, ...]]:
    return lambda arm: (place,)


def rating(arm: Robot, joint: int) -> float:
    """Torque (N m) of 60 % of the payload at the stretched rest of the arm: what a gear is bought for, weight apart."""
    lengths = [float(np.linalg.norm(a.xyz)) for a in arm.axes[joint + 1 :]] + [float(np.linalg.norm(arm.flange))]
    return 0.6 * arm.payload * 9.81 * sum(lengths)


T = TypeVar("T")
DOWN = np.array([0.0, 0.0, -1.0])


def balanced(seed: int, factor: str, levels: Sequence[T], index: int) -> T:
    """Level of a factor for set ``index``: every block of sets has each level once, in an order of its own."""
    block, place = divmod(index, len(levels))
    order = np.random.default_rng([seed, zlib.crc32(factor.encode()), block]).permutation(len(levels))
    return levels[int(order[place])]


def stands(arm: Robot, q_deg: Floats) -> Floats:
    """Which poses are within coupled limits, above the floor and away from the column, (n,) bool."""
    at = postures(arm, np.radians(q_deg))
    good = (at.tool[:, 2] > 0.15) & (np.hypot(at.tool[:, 0], at.tool[:, 1]) > 0.4)
    if arm.parallelogram:
        forearm = 180.0 + q_deg[:, 1] - q_deg[:, 2]
        good &= (forearm > 66.0) & (forearm < 189.0)
    return np.asarray(good)


def ranges(rng: np.random.Generator, arm: Robot) -> Floats:
    """Angles that this campaign uses, degrees, (dof, 2): most of the limits, turned to one side of the base."""
    low, high = arm.limits().T
    middle, half = (low + high) / 2, (high - low) / 2 * rng.uniform(0.6, 0.9, arm.dof)
    box = np.stack([middle - half, middle + half], axis=1)
    centre = rng.uniform(-90, 90)
    box[0] = np.clip([centre - 40, centre + 40], low[0], high[0])
    return np.asarray(np.clip(box, -175.0, 175.0))


def random_poses(rng: np.random.Generator, arm: Robot, box: Floats, n: int) -> Floats:
    """As many poses as asked that the arm can take, degrees to a hundredth."""
    found = np.empty((0, arm.dof))
    while len(found) < n:
        q = np.round(rng.uniform(box[:, 0], box[:, 1], (3 * n, arm.dof)), 2)
        found = np.vstack([found, q[stands(arm, q).astype(bool)]])
    return found[:n]


def poses(rng: np.random.Generator, arm: Robot, box: Floats, n: int, factorial: bool) -> Floats:
    """Three levels of two, three or four joints, impossible ones replaced; or all joints at random."""
    if not factorial:
        return random_poses(rng, arm, box, n)
    moving = np.sort(rng.permutation(np.arange(1, 5))[: {9: 2, 27: 3, 81: 4}[n]])
    q = np.tile(random_poses(rng, arm, box, 1), (n, 1))
    levels = np.stack(np.meshgrid(*([np.arange(3)] * len(moving)), indexing="ij"), axis=-1).reshape(n, -1)
    q[:, moving] = np.round(box[moving, 0] + levels / 2.0 * (box[moving, 1] - box[moving, 0]), 1)
    bad = ~stands(arm, q).astype(bool)
    q[bad] = random_poses(rng, arm, box, int(bad.sum()))
    return q


def weights(rng: np.random.Generator, arm: Robot) -> list[float]:
    """Two to four loads from about 15 to 60 % of the payload, N."""
    low, high = rng.uniform(0.15, 0.3), rng.uniform(0.45, 0.6)
    sizes = np.linspace(low, high, int(rng.integers(2, 5))) * arm.payload * 9.81
    return [float(5 * round(s / 5)) for s in sizes]


def ways(rng: np.random.Generator, several: bool) -> list[Floats]:
    """Directions of the loads: down, and sideways by a rope in some campaigns."""
    if not several:
        return [DOWN]
    angle = rng.uniform(0, 2 * np.pi)
    aside = np.array([np.cos(angle), np.sin(angle), 0.0])
    return [DOWN, np.round(aside, 3) / np.linalg.norm(np.round(aside, 3))]


def habits(rng: np.random.Generator) -> Habits:
    return Habits(
        drive=float(rng.uniform(60, 180)),
        settle=float(rng.uniform(10, 40)),
        exercise=bool(rng.random() < 0.25),
        zero_each_cycle=bool(rng.random() < 0.7),
        warm_up=bool(rng.random() < 0.4),
    )


def schedule(
    rng: np.random.Generator,
    n: int,
    cycles: Sequence[Cycle],
    rounds: bool,
    shuffled: bool,
) -> list[tuple[int, list[Cycle]]]:
    """Set-ups in their order; ``rounds`` comes back for each repeat, else all repeats are made at once."""
    order = rng.permutation(n) if shuffled else np.arange(n)
    if not rounds:
        return [(int(p), list(cycles)) for p in order]
    repeats = sorted({c.repeat for c in cycles})
    return [(int(p), [c for c in cycles if c.repeat == r]) for r in repeats for p in order]


def cycles_of(sizes: Sequence[float], way: Sequence[Floats], down: bool, hold: bool, repeats: int) -> list[Cycle]:
    return [cycle(w, sizes, down, hold, r + 1) for r in range(repeats) for w in way]


def over_days(
    setups: Sequence[tuple[int, Sequence[Cycle]]], usual: Habits, rng: np.random.Generator, days: int
) -> Timeline:
    """The campaign, with working days short enough for ``days`` sessions."""
    first = run(setups, usual, np.random.default_rng(rng.integers(2**31)))
    hours = float(first.time[-1]) / 3600.0 / days if days > 1 else 8.0
    return run(setups, replace(usual, hours=min(hours, 8.0)), rng)
