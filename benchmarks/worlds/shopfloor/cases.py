"""Noise, what of an effect springs cannot take up, the true answer, and cases drawn from a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import nnls

from ..shared import log_uniform
from .arms import BUNDLED, OWN, Floats, Ints, Robot, beams, postures, robot, springs_only
from .joint_laws import GEARS, GEARS_OUTSIDE, LAGS, LAGS_OUTSIDE
from .law import (
    Hidden,
    Law,
    Rig,
    Scene,
    Timeline,
    air,
    balanced,
    cycles_of,
    habits,
    over_days,
    poses,
    ranges,
    schedule,
    ways,
    weights,
)
from .other_laws import GAUGES, GAUGES_OUTSIDE, STRUCTURE, STRUCTURE_OUTSIDE, TABLE, TABLE_OUTSIDE

NOISES = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")
UM = 1e-6


@dataclass(frozen=True)
class Noise:
    """One structure of noise, SI.

    share is of the component or the vector, per_newton of the load (m/N), axes are standard deviations (3,) m;
    days is the standard deviation of a session's own offset (m), floor that of the gauge's last digits.
    """

    kind: str
    share: float
    per_newton: float
    axes: tuple[float, float, float]
    days: float
    scatter: float
    resolution: float
    outliers: bool

    def sigma(self, d: Floats, force: Floats) -> Floats:
        """Standard deviation of each component (n, 3), resolution apart."""
        floor = 2.0 * UM
        if self.kind == "share-of-component":
            return self.share * np.abs(d) + floor
        if self.kind == "share-of-vector":
            return np.tile(self.share * np.linalg.norm(d, axis=1)[:, None] + floor, (1, 3))
        if self.kind == "load":
            return np.tile(self.per_newton * np.linalg.norm(force, axis=1)[:, None] + floor, (1, 3))
        return np.tile(np.array(self.axes), (len(d), 1))

    def variance(self, d: Floats, force: Floats) -> Floats:
        """Of each component (n, 3), m^2, the rounding with it."""
        return np.asarray(self.sigma(d, force) ** 2 + self.resolution**2 / 12.0)

    def jitter(self, shape: tuple[int, ...], rng: np.random.Generator) -> Floats:
        """Unit variance; heavy tails as a scale mixture: a Student t with three degrees of freedom over its sqrt(3)."""
        normal = rng.normal(size=shape)
        if self.kind != "heavy-tailed":
            return normal
        return np.asarray(normal / np.sqrt(rng.chisquare(3, shape) / 3.0) / np.sqrt(3.0))

    def rounded(self, d: Floats) -> Floats:
        """To the gauge's steps."""
        return np.asarray(np.rint(d / self.resolution) * self.resolution)


def draw_noise(rng: np.random.Generator, kind: str, scatter: float, outliers: bool) -> Noise:
    white = log_uniform(rng, 5 * UM, 30 * UM)
    axes = (white, white, white)
    if kind == "by-axis":
        x, y, z = (log_uniform(rng, 5 * UM, 30 * UM) for _ in range(3))
        axes = (x, y, z)
    days = log_uniform(rng, 8 * UM, 30 * UM) if kind == "session" else 0.0
    return Noise(
        kind,
        log_uniform(rng, 0.005, 0.03),
        log_uniform(rng, 0.02 * UM, 0.08 * UM),
        axes,
        days,
        scatter,
        float(rng.choice([1.0, 1.0, 1.0, 10.0])) * UM,
        outliers,
    )


def measured(
    noise: Noise,
    clean: Floats,
    force: Floats,
    pose: Ints,
    session: Ints,
    rng: np.random.Generator,
    axes: slice,
) -> tuple[Floats, list[int]]:
    """Readings (n, 3) m with all noise, and the rows that were spoilt in one of the read ``axes``."""
    read = np.arange(3)[axes]
    d = clean * (1.0 + noise.scatter * rng.normal(size=int(pose.max()) + 1)[pose][:, None])
    sigma = noise.sigma(clean, force)
    d = d + sigma * noise.jitter(clean.shape, rng)
    d = d + noise.days * rng.normal(size=(int(session.max()) + 1, 3))[session]
    spoilt = np.flatnonzero(rng.random(len(d)) < 0.02).tolist() if noise.outliers else []
    for row in spoilt:
        axis = int(rng.choice(read))
        way = rng.random()
        if way < 0.7:
            d[row, axis] += rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 15.0) * sigma[row, axis]
        else:
            d[row, axis] *= -1.0 if way < 0.85 else float(rng.choice([10.0, 0.1]))
    return noise.rounded(d), spoilt


def common(noise: Noise, d: Floats, pose: Ints, session: Ints) -> Floats:
    """What readings have in common, as columns of a root of the covariance, (n, 3, m) m."""
    columns = []
    if noise.scatter:
        columns += [noise.scatter * d * (pose == p)[:, None] for p in np.unique(pose)]
    if noise.days:
        for day in np.unique(session):
            columns += [noise.days * np.outer(session == day, axis) for axis in np.eye(3)]
    return np.stack(columns, axis=-1) if columns else np.zeros((*d.shape, 0))


def tags(noise: Noise, spoilt: int) -> Mapping[str, object]:
    return {"noise": noise.kind, "scatter": noise.scatter, "outliers": spoilt, "resolution_um": noise.resolution / UM}


def spring_columns(arm: Robot, q: Floats, line: Timeline, springs: Ints, loop: bool) -> Floats:
    """Displacement (n_reads, 3, m) by a compliance of one in each spring, as the model computes it from the table."""
    rows = line.reads
    turns = postures(arm, q, loop=loop).turns[line.pose[rows]][:, springs]
    torque = np.einsum("nki,ni->nk", turns[..., :3], line.force[rows])
    return np.asarray(np.einsum("nki,nk->nik", turns[..., :3], torque))


def bending(arm: Robot, q: Floats, line: Timeline) -> Floats:
    """Displacement (n_reads, 3) by the links alone, as a model with beams computes it from the table."""
    rows, d = line.reads, np.zeros((len(line.reads), 3))
    parts = postures(arm, q).parts[line.pose[rows]]
    for beam in beams(arm.name):
        x = parts[:, beam.body, :3]
        d += np.einsum("nij,jk,nlk,nl->ni", x, beam.flexibility, x, line.force[rows])
    return d


def excess_chi2(clean: Floats, known: Floats, columns: Floats, noise: Noise, line: Timeline, axes: slice) -> float:
    """Weighted sum of squares that is left after fitting compliances of zero or more.

    clean : (n_reads, 3) m without noise; known : what the model has beside its springs, columns : by its springs
    """
    rows = line.reads
    weight = 1.0 / noise.variance(clean, line.force[rows])[:, axes].ravel()
    y = (clean - known)[:, axes].ravel()
    a = columns[:, axes].reshape(len(y), -1)
    u = common(noise, clean, line.pose[rows], line.session[rows])[:, axes].reshape(len(y), -1)
    core = cho_factor(np.eye(u.shape[1]) + u.T @ (weight[:, None] * u)) if u.shape[1] else None

    def by_covariance(x: Floats) -> Floats:
        """Inverse covariance times x, by Woodbury."""
        wx = weight[:, None] * x
        return wx if core is None else wx - weight[:, None] * (u @ cho_solve(core, u.T @ wx))

    scale = np.sqrt(np.maximum(np.einsum("ni,ni->i", a, weight[:, None] * a), 1e-300))
    seen = scale > 1e-9 * scale.max()
    a = a[:, seen] / scale[seen]
    gram, right = a.T @ by_covariance(a), a.T @ by_covariance(y[:, None])
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-13 * values[-1]
    root = vectors[:, keep] * np.sqrt(values[keep])
    target = (vectors[:, keep] / np.sqrt(values[keep])).T @ right[:, 0]
    c, _ = nnls(root.T, target, maxiter=1000)
    rest = (y - a @ c)[:, None]
    return float((rest.T @ by_covariance(rest))[0, 0])


# Joints behind which links bend a little: upper arm and forearm.
BENDING = (1, 2, 3)


@dataclass(frozen=True)
class Nuisance:
    """What is a little off in every hall: joint zeros (rad), links (rad/(N m) at three joints), loads (shares)."""

    zeros: Floats
    links: float
    all_loads: float
    each_load: float
    seed: int

    def weights(self, force: Floats) -> Floats:
        """Factor of each force, the same wherever the same weights hang, (n, 1)."""
        newtons = np.rint(np.linalg.norm(force, axis=1)).astype(int)
        one = {
            n: 1.0 + self.all_loads + self.each_load * float(np.random.default_rng([self.seed, n]).normal())
            for n in set(newtons.tolist())
        }
        return np.array([one[n] for n in newtons.tolist()])[:, None]


@dataclass(frozen=True)
class Truth:
    """All that decides what a gauge would show without noise.

    drawing is the arm of the model, built the one that stands; ``carried`` the share of the links' weight in the gears
    (0: balanced), ``mood`` the hall's temperature, ``links`` factors on the beams' flexibility (none: links are
    rigid), ``span`` how long the campaign took (s), ``warmth`` its mean.
    """

    drawing: Robot
    built: Robot
    compliance: Floats
    hidden: tuple[Hidden, ...]
    nuisance: Nuisance
    carried: float
    mood: tuple[float, float, float]
    links: tuple[float, ...] = ()
    span: float = 0.0
    warmth: float = 0.0

    def hides(self, family: str) -> bool:
        """Whether an effect of this family is hidden."""
        return any(h.law.family == family for h in self.hidden)

    def plain(self, hidden: Sequence[Hidden] | None = None) -> Truth:
        """The same without nuisances; ``hidden`` instead of all that is hidden."""
        n = self.nuisance
        kept = self.hidden if hidden is None else tuple(hidden)
        nothing = Nuisance(np.zeros_like(n.zeros), 0.0, 0.0, 0.0, n.seed)
        even = (1.0,) * len(self.links)
        return replace(self, built=self.drawing, nuisance=nothing, hidden=kept, links=even)


def _rig(truth: Truth, q: Floats, line: Timeline) -> Rig:
    force = line.force * truth.nuisance.weights(line.force)
    # An arm with a parallelogram has it, whatever the model says.
    rig = Rig(q + truth.nuisance.zeros, force, np.zeros(3), np.zeros(3), np.eye(3), truth.built.parallelogram)
    for h in truth.hidden:
        if h.law.rig is not None:
            rig = h.law.rig(rig, line, h.joint, h.sizes)
    return rig


def _scene(truth: Truth, rig: Rig, line: Timeline, fresh: bool) -> Scene:
    at = postures(truth.built, rig.q, rig.shift, rig.loop)
    beside = np.einsum("nij,j->ni", at.flange_axes, rig.arm_of_force)[line.pose]
    wrench = np.hstack([rig.force, np.cross(beside, rig.force)])
    n = len(line.kind)
    clock = np.full(n, truth.span / 2) if fresh else line.time
    warm = np.full(n, truth.warmth) if fresh else line.warm
    return Scene(
        truth.built,
        at,
        line,
        rig.q,
        wrench,
        np.einsum("nki,ni->nk", at.turns[line.pose], wrench),
        truth.carried * at.weight[line.pose],
        truth.compliance,
        clock,
        warm,
        air(clock, truth.mood),
        truth.span,
        fresh,
    )


def displacement(truth: Truth, q: Floats, line: Timeline, fresh: bool = False) -> Floats:
    """What a perfect gauge shows at the readings of a timeline, (n_reads, 3) m, in the table's axes.

    q : (n_pose, dof) rad, as the table has them. ``fresh``: slow things in their middle state, the gauge itself steady.
    """
    rig = _rig(truth, q, line)
    scene = _scene(truth, rig, line, fresh)
    d = springs_only(scene.at, line.pose, scene.wrench, truth.compliance)
    for k in BENDING if truth.nuisance.links else ():
        d = d + scene.part(k, np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) * truth.nuisance.links)
    if truth.links:
        for beam, factor in zip(beams(truth.drawing.name), truth.links, strict=True):
            d = d + scene.part(beam.body, factor * beam.flexibility)
    for h in truth.hidden:
        if h.law.gives is not None:
            d = d + h.law.gives(scene, h.joint, h.sizes)
        if h.law.theta is not None:
            d = d + scene.turned(h.joint, h.law.theta(scene, h.joint, h.sizes))
    moved = (d - d[line.zero])[:, :3] @ rig.frame
    for h in truth.hidden:
        if h.law.reads is not None and not (fresh and (h.law.slow or not h.law.steady)):
            moved = h.law.reads(scene, moved, h.sizes)
    return np.asarray(moved[line.reads])


T = TypeVar("T")
CATALOGUE: tuple[Law, ...] = (*GEARS, *LAGS, *STRUCTURE, *TABLE, *GAUGES)
OUTSIDE: tuple[Law, ...] = (*LAGS_OUTSIDE, *STRUCTURE_OUTSIDE, *TABLE_OUTSIDE, *GAUGES_OUTSIDE, *GEARS_OUTSIDE)
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
    noise: Noise
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
        first = balanced(seed, "pair-first", names, index)
        others = tuple(n for n in names if n != first and _able(named(first, n)))
        return named(first, others[int(np.random.default_rng([seed, 77, index]).integers(len(others)))])
    return named(balanced(seed, kind, names, index))


def _able(wanted: Sequence[tuple[Law, ...]]) -> list[str]:
    """Arms on which every effect has a place."""
    return [n for n in (*BUNDLED, *OWN) if all(any(law.places(robot(n)) for law in laws) for laws in wanted)]


def _arm(seed: int, kind: str, index: int, wanted: Sequence[tuple[Law, ...]]) -> Robot:
    """The arm whose turn it is, or, where an effect has no place on it, the first that has one."""
    first, able = balanced(seed, f"{kind}-robot", (*BUNDLED, *OWN), index), _able(wanted)
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
        return balanced(seed, f"{kind}-{factor}", levels, index)

    rng = np.random.default_rng([seed, KINDS.index(kind), index, attempt])
    wanted = _wanted(seed, kind, index)
    arm = _arm(seed, kind, index, wanted)
    hidden = _hidden(rng, arm, wanted)
    truth, springs = _truth(rng, arm, hidden)
    n, reads, structure_ = turn("poses", (9, 27, 81)), turn("reads", ("z", "xyz")), turn("noise", NOISES)
    lagging = any(not h.law.steady for h in hidden if h.law.family != "backlash")
    down = turn("down", (True, True, False)) or lagging
    hold = bool(rng.random() < 0.5)
    way = ways(rng, reads == "xyz" and bool(rng.random() < 0.4))
    sizes = weights(rng, arm)
    repeats = _repeats(rng, n, len(way) * len(sizes) * (2 if down else 1))
    box, factorial = ranges(rng, arm), bool(rng.random() < 0.5)
    q_deg = poses(rng, arm, box, n, factorial)
    rounds, shuffled = bool(rng.random() < 0.33), bool(rng.random() < 0.7)
    cycles = cycles_of(sizes, way, down, hold, repeats)
    setups, usual = schedule(rng, n, cycles, rounds, shuffled), habits(rng)
    days = int(rng.integers(2, 5)) if structure_ == "session" or rng.random() < 0.25 else 1
    line = over_days(setups, usual, rng, days)
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
        draw_noise(rng, structure_, scatter, spoilt),
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
