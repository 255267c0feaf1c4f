"""Which set-ups a campaign takes, what the gauge would say, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from .arm import DIRECTIONS, GRAVITY, Arm, Chain, Extra, Law, Moment, Vector, beam
from .effects import Effect, Row, Site

# No point of a set-up is to be lower than this over the floor, or nearer to the column, m.
LOW, NEAR = 0.25, 0.45


@dataclass(frozen=True)
class Plan:
    """Wishes: how many poses, what is read, what is repeated."""

    poses: int
    xyz: bool
    back: bool
    repeats: int
    levels: int
    directions: int
    random_order: bool
    grid: bool


def draw_plan(rng: np.random.Generator, poses: int, xyz: bool, back: bool) -> Plan:
    """Draw what the study leaves open; pulls in several directions only where all are read."""
    several = int(rng.integers(1, 4)) if xyz else 1
    return Plan(
        poses,
        xyz,
        back,
        int(rng.integers(1, 5 if poses < 81 else 4)),
        int(rng.integers(2, 5)),
        several,
        bool(rng.random() < 0.75),
        bool(rng.random() < 0.5),
    )


def draw_rows(rng: np.random.Generator, arm: Arm, plan: Plan, point: Vector) -> list[Row]:
    """Rows in the order in which they are taken (their moments are not yet known)."""
    poses = draw_poses(rng, arm, plan.poses, plan.grid)
    shares = np.sort(rng.uniform(0.15, 0.6, plan.levels))
    shares = np.linspace(shares[0], max(shares[-1], shares[0] + 0.25), plan.levels)
    sizes = np.round(shares * arm.payload * GRAVITY / 5) * 5
    ways = _directions(rng, plan.directions)
    rows = []
    order = rng.permutation(plan.poses) if plan.random_order else np.arange(plan.poses)
    for number in order:
        way = ways[int(number) % len(ways)]
        for repeat in range(1, plan.repeats + 1):
            run = [("loading", i) for i in range(plan.levels)]
            if plan.back:
                run += [("unloading", i) for i in reversed(range(plan.levels))]
            for phase, level in run:
                force = np.round(sizes[level] * way, 3)
                rows.append(Row(f"P{number + 1}", repeat, phase, poses[number], force, point, level))
    return rows


def draw_unseen(rng: np.random.Generator, arm: Arm, rows: Sequence[Row], count: int = 40) -> list[Row]:
    """Other set-ups within the same angles, each with one of the same loads, taken from rest."""
    seen = np.array([row.angles for row in rows])
    low, high = seen.min(axis=0), seen.max(axis=0)
    chain = Chain(arm)
    out: list[Row] = []
    while len(out) < count:
        angles = np.round(np.degrees(rng.uniform(low, high)), 2)
        if _stands(chain, arm, np.radians(angles)):
            like = rows[int(rng.integers(len(rows)))]
            name = f"U{len(out) + 1}"
            out.append(replace(like, pose=name, repeat=1, phase="loading", angles=np.radians(angles)))
    return out


def draw_poses(rng: np.random.Generator, arm: Arm, count: int, grid: bool) -> Vector:
    """Poses (count, joints) in rad: levels of each joint in a random design, or a Latin hypercube."""
    chain = Chain(arm)
    bounds = np.degrees([joint.limits for joint in arm.joints])
    middle = bounds.mean(axis=1)
    half = np.minimum(bounds[:, 1] - middle, [60.0] + [110.0] * (len(middle) - 1)) * rng.uniform(0.55, 0.9, len(middle))
    low, high = middle - half, middle + half
    found: list[Vector] = []
    while len(found) < count:
        if grid:
            levels = np.array([rng.permutation(np.arange(count) % 3) for _ in middle]).T / 2
        else:
            levels = np.array([(rng.permutation(count) + rng.random(count)) / count for _ in middle]).T
        for angles in np.round(low + levels * (high - low), 2):
            if len(found) < count and _stands(chain, arm, np.radians(angles)):
                found.append(np.radians(angles))
    return np.array(found)


def site_of(arm: Arm, springs: dict[str, float], rows: Sequence[Row], xyz: bool) -> Site:
    """Say how large the campaign's torques are."""
    chain = Chain(arm)
    no = np.zeros(3)
    torques, held = np.zeros(len(arm.joints)), []
    seen: set[bytes] = set()
    for row in rows:
        key = np.concatenate([row.angles, row.force]).tobytes()
        if key in seen:
            continue
        seen.add(key)
        chain.pose(arm.real(row.angles), np.zeros(chain.size))
        weight = chain.torque(no, row.point)
        held.append(np.abs(weight))
        torques = np.maximum(torques, np.abs(chain.torque(row.force, row.point) - weight))
    force = max(float(np.linalg.norm(row.force)) for row in rows)
    names = arm.names
    usual = np.median(held, axis=0)
    return Site(arm, springs, dict(zip(names, torques, strict=True)), dict(zip(names, usual, strict=True)), xyz, force)


def _directions(rng: np.random.Generator, count: int) -> list[Vector]:
    """Down, and pulls by a rope over a pulley, to the side or aslant."""
    ways = [np.array([0.0, 0.0, -1.0])]
    for _ in range(count - 1):
        turn, dip = rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 0.9)
        ways.append(np.array([np.cos(dip) * np.cos(turn), np.cos(dip) * np.sin(turn), -np.sin(dip)]))
    return ways


def _stands(chain: Chain, arm: Arm, angles: Vector) -> bool:
    """Say whether the flange is over the floor and off the column, and coupled limits are kept."""
    degrees = [row @ angles for row, _, _ in arm.coupled]
    if any(not low <= angle <= high for angle, (_, low, high) in zip(degrees, arm.coupled, strict=True)):
        return False
    chain.pose(arm.real(angles), np.zeros(chain.size))
    x, y, z = chain.point(np.zeros(3))
    return bool(z > LOW and np.hypot(x, y) > NEAR)


KINDS = ("share-of-component", "share-of-vector", "load", "white", "by-axis", "heavy-tailed", "session")
# Standard deviation of Student's t with three degrees of freedom.
HEAVY = np.sqrt(3.0)
# What a good gauge adds to any reading, m.
FLOOR = 5e-6


@dataclass(frozen=True)
class Noise:
    """Kind and sizes: a share of what is read, m by axis, m that a session has in common, N that count as full load."""

    kind: str
    share: float
    axes: tuple[float, float, float]
    session: float
    scatter: float
    outliers: bool
    resolution: float
    full: float


def draw_noise(rng: np.random.Generator, kind: str, scatter: float, outliers: bool, full: float) -> Noise:
    """Shares of 1 to 4 %, white noise of 5 to 30 um, 10 to 40 um in common within a session."""
    white = np.exp(rng.uniform(np.log(5e-6), np.log(30e-6), 3))
    x, y, z = (white if kind == "by-axis" else white[[0, 0, 0]]).tolist()
    session = float(rng.uniform(10e-6, 40e-6)) if kind == "session" else 0.0
    resolution = 1e-5 if rng.random() < 0.25 else 1e-6
    return Noise(kind, float(rng.uniform(0.01, 0.04)), (x, y, z), session, scatter, outliers, resolution, full)


def deviations(noise: Noise, rows: Sequence[Row], true: Vector) -> Vector:
    """Standard deviation (n, 3) of each component by itself, m."""
    out = np.tile(np.array(noise.axes), (len(rows), 1))
    if noise.kind == "share-of-component":
        out = np.hypot(noise.share * np.abs(true), FLOOR)
    elif noise.kind == "share-of-vector":
        out = np.repeat(np.hypot(noise.share * np.linalg.norm(true, axis=1), FLOOR)[:, None], 3, axis=1)
    elif noise.kind == "load":
        size = np.array([np.linalg.norm(row.force) for row in rows])
        out = np.hypot(out * (size / noise.full)[:, None], FLOOR)
    return out


def blur(noise: Noise, rows: Sequence[Row], true: Vector, rng: np.random.Generator) -> tuple[Vector, list[int]]:
    """Readings (n, 3) with noise, and which of them are outliers (row times three plus component)."""
    sigma = deviations(noise, rows, true)
    scatter = {pose: noise.scatter * rng.normal() for pose in dict.fromkeys(row.pose for row in rows)}
    common = {s: noise.session * rng.normal(size=3) for s in sorted({row.moment.session for row in rows})}
    draws = rng.standard_t(3, true.shape) / HEAVY if noise.kind == "heavy-tailed" else rng.normal(size=true.shape)
    out = true + sigma * draws
    for i, row in enumerate(rows):
        out[i] += scatter[row.pose] * true[i] + common[row.moment.session]
    out = np.round(out / noise.resolution) * noise.resolution
    wrong: list[int] = []
    if noise.outliers:
        for spoilt in np.flatnonzero(rng.random(len(rows)) < 1 / 50).tolist():
            for axis in range(3):
                wrong.append(3 * spoilt + axis)
                out[spoilt, axis] = _spoilt(out[spoilt, axis], sigma[spoilt, axis], rng)
    return out, wrong


def _spoilt(value: float, sigma: float, rng: np.random.Generator) -> float:
    """Return 5 to 15 standard deviations more or less, a slipped digit or a slipped sign."""
    kind = rng.random()
    if kind < 0.7:
        return float(value + rng.choice([-1, 1]) * rng.uniform(5, 15) * sigma)
    return float(-value if kind < 0.85 else value * rng.choice([0.1, 10.0]))


def excess(
    arm: Arm, rows: Sequence[Row], true: Vector, noise: Noise, axes: Sequence[int], free: Sequence[str], share: float
) -> float:
    """Chi-square of noise-free readings after refitting all springs of the model, which are never negative.

    What set-ups scatter and sessions have in common are unknowns with a prior of their own size, which is the same as
    their covariance. Least squares in compliances on rigid links, at the table's angles.
    """
    columns = _columns(arm, rows, free, share)[:, :, axes]
    sigma, y = deviations(noise, rows, true)[:, axes], true[:, axes]
    common = _common(noise, rows, y)
    flat = [(block / sigma).reshape(-1) for block in (*common, *columns, y)]
    prior = np.zeros((len(common), len(flat)))
    prior[:, : len(common)] = np.eye(len(common))
    small = np.asarray(np.linalg.qr(np.vstack([prior, np.array(flat).T]), mode="r"))
    left = small[len(common) :, len(common) :]
    scale = np.linalg.norm(left[:, :-1], axis=0)
    seen = scale > 1e-9 * max(float(scale.max()), 1e-300)
    return float(nnls(left[:, :-1][:, seen] / scale[seen], left[:, -1])[1] ** 2)


def _columns(arm: Arm, rows: Sequence[Row], free: Sequence[str], share: float) -> Vector:
    """Displacement (springs, n, 3) by each spring of 1 rad/(N m), as a model without effects has it."""
    chain = Chain(arm, share=share)
    slots = [chain.where[name] for name in free]
    out, known = np.zeros((len(free), len(rows), 3)), {}
    for i, row in enumerate(rows):
        key = np.concatenate([row.angles, row.force]).tobytes()
        if key not in known:
            chain.pose(arm.real(row.angles), np.zeros(chain.size))
            jacobian = chain.jacobian(row.point)[:, slots]
            known[key] = (jacobian * (row.force @ jacobian)).T
        out[:, i] = known[key]
    return out


def _common(noise: Noise, rows: Sequence[Row], y: Vector) -> list[Vector]:
    """What several readings have in common, each (n, axes) in m for one unit of it."""
    out = []
    if noise.scatter:
        poses = np.array([row.pose for row in rows])
        out += [noise.scatter * y * (poses == pose)[:, None] for pose in dict.fromkeys(poses.tolist())]
    if noise.session:
        days = np.array([row.moment.session for row in rows])
        for day in np.unique(days):
            out += [noise.session * np.outer(days == day, unit) for unit in np.eye(y.shape[1])]
    return out


NOTHING = np.zeros(3)


@dataclass(frozen=True)
class Nuisance:
    """What is a little off in every set, and not meant to be found.

    Metres by which bodies sit elsewhere (joints + 1, 3), rad of joint zeros, factors on loads (by level) and
    on masses, compliance of the casing before the elbow as a share of the shoulder's, and the part of its sag under
    its own weight that the controller compensates.
    """

    shifts: tuple[tuple[float, float, float], ...]
    zeros: tuple[float, ...]
    loads: tuple[float, ...]
    weigh: float
    casing: float
    compensated: float


def none(arm: Arm, compensated: float = 1.0) -> Nuisance:
    """Nothing is off."""
    count = len(arm.joints)
    return Nuisance(((0.0, 0.0, 0.0),) * (count + 1), (0.0,) * count, (1.0,), 1.0, 0.0, compensated)


def draw_nuisance(rng: np.random.Generator, arm: Arm, levels: int, compensated: float) -> Nuisance:
    """Lengths within 1 mm, zeros 0.03 deg, loads 0.5 % in common and 0.1 % each, masses 5 %, casings up to 2 %."""
    count = len(arm.joints)
    shifts = rng.uniform(-1e-3, 1e-3, (count + 1, 3))
    common = 1 + 0.005 * rng.normal()
    return Nuisance(
        tuple((float(x), float(y), float(z)) for x, y, z in shifts),
        tuple(np.radians(0.03 * rng.normal(size=count)).tolist()),
        tuple((common * (1 + 0.001 * rng.normal(size=levels))).tolist()),
        float(1 + 0.05 * rng.normal()),
        float(rng.uniform(0.005, 0.02)),
        compensated,
    )


class Truth:
    """An arm with its springs, effects and nuisances.

    ``rigid`` joints do not give way (an effect may say otherwise). ``gravity`` False is for checks of the bare chain.
    """

    def __init__(
        self,
        site: Site,
        effects: Sequence[Effect] = (),
        rigid: Sequence[str] = (),
        nuisance: Nuisance | None = None,
        gravity: bool = True,
    ) -> None:
        self.site, self.arm, self.effects = site, site.arm, list(effects)
        self.nuisance = nuisance or none(site.arm)
        wanted = self._wanted()
        shares = [e.number("share") for e in effects if e.family in ("load-path", "partial-load-path")]
        self.chain = Chain(
            self.arm,
            wanted,
            np.array(self.nuisance.shifts),
            self.nuisance.weigh,
            shares[0] if shares else None,
        )
        if not gravity:
            self.chain.model.opt.gravity[:] = 0
        self.C = self._compliances(rigid)
        self.remembers = any(effect.remembers for effect in effects)
        self.timed = any(effect.timed for effect in effects)

    def _wanted(self) -> dict[str, tuple[str, ...]]:
        wanted: dict[str, set[str]] = {}
        for effect in self.effects:
            for place, directions in effect.freedoms(self.arm).items():
                wanted.setdefault(place, set()).update(directions)
        if self.nuisance.casing:
            wanted.setdefault(self._elbow(), set()).update(DIRECTIONS)
        return {place: tuple(directions) for place, directions in wanted.items()}

    def _elbow(self) -> str:
        return self.arm.names[2]

    def _compliances(self, rigid: Sequence[str]) -> Vector:
        where = self.chain.where
        C = np.zeros((self.chain.size, self.chain.size))
        for name, spring in self.site.springs.items():
            C[where[name], where[name]] = 0.0 if name in rigid else 1 / spring
        for effect in self.effects:
            effect.compliance(C, where, self.site)
        if self.nuisance.casing:
            elbow = self.arm.joints[2]
            bending = np.linalg.norm(elbow.position) * self.site.springs[self.arm.names[1]] / self.nuisance.casing
            turned = np.kron(np.eye(2), elbow.rotation)
            slots = [where[f"{elbow.name}.{direction}"] for direction in DIRECTIONS]
            tip = beam(elbow.position, float(bending), float(0.8 * bending), float(200 * bending))
            C[np.ix_(slots, slots)] += turned.T @ tip @ turned
        return C

    def _stand(self, table: Vector) -> Vector:
        """Angles of the hinges before anything gives way."""
        real = self.arm.real(table)
        for effect in self.effects:
            real = effect.angles(real, self.site)
        real = real + np.array(self.nuisance.zeros)
        if self.nuisance.compensated:
            self.chain.pose(real, np.zeros(self.chain.size))
            sag = self.chain.mix @ (self.C @ self.chain.torque(NOTHING, NOTHING))
            real = real - self.nuisance.compensated * sag[: len(real)]
        return np.asarray(real)

    def _law(self, table: Vector, moment: Moment, extras: Sequence[Extra]) -> Law:
        C = self.C
        factors: dict[int, float] = {}
        for effect in self.effects:
            for freedom, factor in effect.factors(table, moment, self.chain.where, self.site).items():
                factors[freedom] = factors.get(freedom, 1.0) * factor
        if factors:
            root = np.ones(len(C))
            root[list(factors)] = np.sqrt(list(factors.values()))
            C = C * np.outer(root, root)

        def law(torque: Vector) -> Vector:
            out = np.asarray(C @ torque)
            for extra in extras:
                out[extra.freedom] += extra.more(float(torque[extra.freedom]), moment)
            return out

        return law

    def readings(self, rows: Sequence[Row], held_out: bool = False) -> Vector:
        """Displacement (n, 3) in m as a gauge without noise has it: loaded less unloaded equilibrium.

        Rows of the same set-up follow one another. ``held_out`` leaves what fades with gauge and clock away.
        """
        effects = [e for e in self.effects if not (held_out and e.fading)]
        for effect in effects:
            effect.begin()
        moved = self._moved(rows, held_out)
        out = np.zeros((len(rows), 3))
        for i, (row, (position, displacement)) in enumerate(zip(rows, moved, strict=True)):
            reading = displacement
            for effect in effects:
                reading = effect.reading(reading, row, position)
            out[i] = reading
        return out

    def _moved(self, rows: Sequence[Row], held_out: bool) -> list[tuple[Vector, Vector]]:
        """Position and displacement of the point that is read, row by row."""
        extras = [x for e in self.effects if not (held_out and e.fading) for x in e.extras(self.chain.where, self.site)]
        out: list[tuple[Vector, Vector]] = []
        known: dict[bytes, tuple[Vector, Vector]] = {}
        last: Row | None = None
        start = np.zeros(self.chain.size)
        for row in rows:
            fresh = last is None or row.pose != last.pose or bool(np.any(row.angles != last.angles))
            key = np.concatenate([row.angles, self._load(row), row.point]).tobytes()
            if fresh:
                stand = self._stand(row.angles)
                loaded, read = self._levers(row)
                start = self._unloaded(stand, loaded, row, extras, start)
                base = self.chain.point(read)
            elif self.remembers and last is not None and row.repeat != last.repeat:
                start = self._go(stand, NOTHING, loaded, row, extras, start)
            if self.remembers or self.timed or key not in known:
                start = self._go(stand, self._load(row), loaded, row, extras, start)
                known[key] = (base, self.chain.point(read) - base)
            out.append(known[key])
            last = row
        return out

    def _go(
        self, stand: Vector, force: Vector, lever: Vector, row: Row, extras: Sequence[Extra], start: Vector
    ) -> Vector:
        law = self._law(row.angles, row.moment, extras)
        deflection, torque = self.chain.settle(stand, force, lever, law, start)
        for extra in extras:
            extra.keep(float(torque[extra.freedom]), row.moment)
        return deflection

    def _unloaded(self, stand: Vector, lever: Vector, row: Row, extras: Sequence[Extra], start: Vector) -> Vector:
        """Equilibrium before the load; what remembers has come to rest, which depends on it in turn."""
        before = replace(row.moment, progress=-1.0)
        law = self._law(row.angles, before, extras)
        for _ in range(4 if self.remembers else 1):
            start, torque = self.chain.settle(stand, NOTHING, lever, law, start)
            for extra in extras:
                extra.rest(float(torque[extra.freedom]), before)
        if self.remembers:
            start, _torque = self.chain.settle(stand, NOTHING, lever, law, start)
        return start

    def _levers(self, row: Row) -> tuple[Vector, Vector]:
        loaded, read = row.point, row.point
        for effect in self.effects:
            loaded, read = effect.lever(loaded, read)
        return loaded, read

    def _load(self, row: Row) -> Vector:
        loads = self.nuisance.loads
        force = row.force * loads[min(row.level, len(loads) - 1)]
        for effect in self.effects:
            force = effect.force(force, row)
        return np.asarray(force)
