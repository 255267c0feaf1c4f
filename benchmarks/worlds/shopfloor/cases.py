"""One measurement set drawn whole: arm, springs, hidden effects, nuisances, campaign and noise, from its seed alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from benchmarks.worlds.shopfloor import design, gauges, gears, lags, noise, structure, table
from benchmarks.worlds.shopfloor.arms import BUNDLED, OWN, Floats, Robot, robot
from benchmarks.worlds.shopfloor.beams import beams
from benchmarks.worlds.shopfloor.campaign import Timeline
from benchmarks.worlds.shopfloor.law import Hidden, Law
from benchmarks.worlds.shopfloor.score import bending, excess_chi2, spring_columns
from benchmarks.worlds.shopfloor.truth import Nuisance, Truth, displacement

T = TypeVar("T")
CATALOGUE: tuple[Law, ...] = (*gears.LAWS, *lags.LAWS, *structure.LAWS, *table.LAWS, *gauges.LAWS)
OUTSIDE: tuple[Law, ...] = (*lags.OUTSIDE, *structure.OUTSIDE, *table.OUTSIDE, *gauges.OUTSIDE, *gears.OUTSIDE)
KINDS = ("none", "single", "outside", "pair")
# Nothing that springs cannot do, or no arm but one: not drawn for pairs.
NO_PAIR = ("gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "load-path")
DETECTABLE = 30.0
TRIES = {"none": 1, "single": 8, "outside": 8, "pair": 20}


@dataclass(frozen=True)
class Case:
    """A drawn set. ``axes`` are the read ones; ``springs`` the joints with one in the model."""

    kind: str
    index: int
    attempt: int
    seed: int
    truth: Truth
    q_deg: Floats
    box: Floats
    line: Timeline
    noise: noise.Noise
    axes: slice
    springs: tuple[int, ...]
    by_urdf: bool
    thermometer: str
    sizes: tuple[float, ...]
    down: bool
    hold: bool
    ways: tuple[tuple[float, ...], ...]
    tags: dict[str, object]

    @property
    def model_loop(self) -> bool:
        """Whether the model has the parallelogram as its load path."""
        return self.truth.drawing.parallelogram and not self.truth.hides("load-path")


def families(laws: Sequence[Law]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(law.family for law in laws))


def _wanted(seed: int, kind: str, index: int) -> list[tuple[Law, ...]]:
    """Families to hide, each as the laws of its name."""
    if kind == "none":
        return []
    laws = OUTSIDE if kind == "outside" else CATALOGUE
    names = families(laws)

    def named(*chosen: str) -> list[tuple[Law, ...]]:
        return [tuple(law for law in laws if law.family == name) for name in chosen]

    if kind == "pair":
        names = tuple(n for n in names if n not in NO_PAIR)
        first = design.balanced(seed, "pair-first", names, index)
        others = tuple(n for n in names if n != first and _able(named(first, n)))
        return named(first, others[int(np.random.default_rng([seed, 77, index]).integers(len(others)))])
    return named(design.balanced(seed, kind, names, index))


def _able(wanted: Sequence[tuple[Law, ...]]) -> list[str]:
    """Arms on which every effect has a place."""
    return [n for n in (*BUNDLED, *OWN) if all(any(law.places(robot(n)) for law in laws) for laws in wanted)]


def _arm(seed: int, kind: str, index: int, wanted: Sequence[tuple[Law, ...]]) -> Robot:
    """The arm whose turn it is, or, where an effect has no place on it, the first that has one."""
    first, able = design.balanced(seed, f"{kind}-robot", (*BUNDLED, *OWN), index), _able(wanted)
    return robot(first if first in able else able[int(index) % len(able)])


def _number(arm: Robot, place: str) -> int:
    """Which joint or link a place is; 0 for others."""
    for names in (arm.names, tuple(b.name for b in beams(arm.name))):
        if place in names:
            return names.index(place)
    return 0


def _hidden(rng: np.random.Generator, arm: Robot, wanted: Sequence[tuple[Law, ...]]) -> tuple[Hidden, ...]:
    """An effect of each family; those with few places choose first, as one joint has one further law."""
    found: list[Hidden] = []
    for laws in sorted(wanted, key=lambda laws: sum(len(law.places(arm)) for law in laws)):
        free = [(law, p) for law in laws for p in law.places(arm) if p not in {h.place for h in found if h.law.theta}]
        law, place = free[int(rng.integers(len(free)))]
        k = _number(arm, place)
        found.append(Hidden(law, place, k, {n: float(v) for n, v in law.draw(rng, arm, k).items()}))
    return tuple(found)


def _truth(rng: np.random.Generator, arm: Robot, hidden: tuple[Hidden, ...]) -> tuple[Truth, tuple[int, ...]]:
    held = {h.joint for h in hidden if h.law.family == "joint-compliance"}
    c = 1.0 / (arm.nominal() * np.exp(rng.uniform(np.log(0.5), np.log(2.0), arm.dof)))
    c[sorted(held)] = 0.0
    nuisance = Nuisance(
        np.radians(rng.normal(0.0, 0.03, arm.dof)),
        float(rng.uniform(0.002, 0.010) * c[1:3].max()),
        float(rng.normal(0.0, 0.005)),
        0.001,
        int(rng.integers(2**31)),
    )
    mood = (float(rng.uniform(18, 25)), float(rng.uniform(1, 3)), float(rng.uniform(0.2, 1.2)))
    carried = float(rng.integers(2))
    truth = Truth(arm, arm.off_drawing(rng), c, hidden, nuisance, carried, mood)
    return truth, tuple(k for k in range(arm.dof) if k not in held)


def _repeats(rng: np.random.Generator, n: int, a_cycle: int) -> int:
    """One to four, but not more than about two thousand readings."""
    return min(int(rng.integers(1, 5)), max(1, 2000 // (n * a_cycle)))


def draw(seed: int, kind: str, index: int, attempt: int) -> Case:
    """The set of this number; another attempt has other places, sizes and poses in the same kind of campaign."""

    def turn(factor: str, levels: Sequence[T]) -> T:
        return design.balanced(seed, f"{kind}-{factor}", levels, index)

    rng = np.random.default_rng([seed, KINDS.index(kind), index, attempt])
    wanted = _wanted(seed, kind, index)
    arm = _arm(seed, kind, index, wanted)
    hidden = _hidden(rng, arm, wanted)
    truth, springs = _truth(rng, arm, hidden)
    n, reads, structure_ = turn("poses", (9, 27, 81)), turn("reads", ("z", "xyz")), turn("noise", noise.KINDS)
    lagging = any(not h.law.steady for h in hidden if h.law.family != "backlash")
    down = turn("down", (True, True, False)) or lagging
    hold = bool(rng.random() < 0.5)
    way = design.ways(rng, reads == "xyz" and bool(rng.random() < 0.4))
    sizes = design.weights(rng, arm)
    repeats = _repeats(rng, n, len(way) * len(sizes) * (2 if down else 1))
    box, factorial = design.ranges(rng, arm), bool(rng.random() < 0.5)
    q_deg = design.poses(rng, arm, box, n, factorial)
    rounds, shuffled = bool(rng.random() < 0.33), bool(rng.random() < 0.7)
    cycles = design.cycles_of(sizes, way, down, hold, repeats)
    setups, usual = design.schedule(rng, n, cycles, rounds, shuffled), design.habits(rng)
    days = int(rng.integers(2, 5)) if structure_ == "session" or rng.random() < 0.25 else 1
    line = design.over_days(setups, usual, rng, days)
    truth = replace(truth, span=float(line.time[-1]), warmth=float(line.warm[line.reads].mean()))
    scatter, spoilt = turn("scatter", (0.0, 0.015)), turn("outliers", (True, False))
    thermometer = turn("thermometer", ("air", "housing", "none"))
    by_urdf = arm.name in OWN and len(springs) == arm.dof and turn("urdf", (True, False, False))
    bends = turn("links", (False, False, False, True)) and not arm.parallelogram and not by_urdf
    if bends or truth.hides("link-flexibility"):
        by_urdf = False
        links = tuple(float(x) for x in np.exp(rng.normal(0.0, 0.03, len(beams(arm.name)))))
        truth = replace(truth, links=links, nuisance=replace(truth.nuisance, links=0.0))
    tags: dict[str, object] = {
        "robot": arm.name,
        "reads": reads,
        "poses": n,
        "loads": len(sizes),
        "directions": len(way),
        "up_and_down": down,
        "repeats": repeats,
        "order": "random" if shuffled else "by pose",
        "rounds": rounds,
        "plan": "factorial" if factorial else "random",
        "sessions": int(line.session.max()) + 1,
        "exercised": usual.exercise,
        "zero": "each cycle" if usual.zero_each_cycle else "each set-up",
        "warmed_up": usual.warm_up,
        "thermometer": thermometer,
        "weight": "carried" if truth.carried else "balanced",
        "model": "urdf" if by_urdf else "toml",
        "links": "beam" if truth.links else "rigid",
    }
    return Case(
        kind,
        index,
        attempt,
        seed,
        truth,
        q_deg,
        box,
        line,
        noise.draw(rng, structure_, scatter, spoilt),
        slice(2, 3) if reads == "z" else slice(0, 3),
        springs,
        by_urdf,
        thermometer,
        tuple(sizes),
        down,
        hold,
        tuple(tuple(float(x) for x in w) for w in way),
        tags,
    )


def loudness(case: Case, hidden: Sequence[Hidden] | None = None, nuisance: bool = False) -> float:
    """Excess chi-square of the noise-free readings with these effects (default: all), springs fitted again."""
    truth = case.truth.plain(hidden)
    if nuisance:
        truth = replace(case.truth, hidden=tuple(hidden or ()))
    q = np.radians(case.q_deg)
    clean = displacement(truth, q, case.line)
    columns = spring_columns(truth.drawing, q, case.line, np.array(case.springs), case.model_loop)
    known = bending(truth.drawing, q, case.line) if truth.links else np.zeros_like(clean)
    return excess_chi2(clean, known, columns, case.noise, case.line, case.axes)


def heard(case: Case) -> list[float]:
    """Loudness of each hidden effect alone."""
    return [loudness(case, [h]) for h in case.truth.hidden]


def drawn(seed: int, kind: str, index: int) -> tuple[Case, list[float]]:
    """The first attempt whose effects are all detectable, else the one whose faintest effect is loudest."""
    best: tuple[Case, list[float]] | None = None
    for attempt in range(TRIES[kind]):
        case = draw(seed, kind, index, attempt)
        loud = heard(case)
        if best is None or min(loud, default=0.0) > min(best[1], default=0.0):
            best = (case, loud)
        if min(loud, default=DETECTABLE) >= DETECTABLE:
            break
    assert best is not None
    return best
