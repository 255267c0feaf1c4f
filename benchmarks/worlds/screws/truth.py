"""How a campaign is designed, what of an effect springs cannot take up, and the truth of a set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from .arm import Arm, Array, Whole, arm, body_motions
from .mechanics import (
    KINDS,
    Campaign,
    Chance,
    Effect,
    Instrument,
    World,
    instrument,
    readings,
    situation,
    spring_columns,
)
from .outside_laws import BAR, CATALOGUE, OUTSIDE, PAIRED

ROBOTS = ("kr60-3", "tx200", "mast7", "picker5", "xr701")
SORTS = ("single", "none", "outside", "pairs")


@dataclass(frozen=True)
class Design:
    """What is drawn in equal parts of a sort of sets."""

    robot: str
    poses: int
    reads: str
    loads: int
    aims: str
    unloading: bool
    repeats: int
    in_passes: bool
    scatter: float
    noise: str
    outliers: bool
    order: str
    factorial: bool
    thermometer: str
    sessions: int
    point: str
    carried: bool
    held: bool


def level(seed: int, sort: str, factor: int, index: int, count: int) -> int:
    """Level of a factor of so many: each block of ``count`` sets has each level once, in an order of its own."""
    rng = np.random.default_rng([seed, SORTS.index(sort), 77, factor, index // count])
    return int(rng.permutation(count)[index % count])


def designed(seed: int, sort: str, index: int, needs_bar: bool, needs_links: bool, needs_xyz: bool) -> Design:
    """The design of a set; ``needs_bar`` asks for the arm with a parallelogram, ``needs_links`` for one without."""

    def pick(factor: int, among: Sequence[object]) -> object:
        return among[level(seed, sort, factor, index, len(among))]

    robots = ("xr701",) if needs_bar else ROBOTS[:4] if needs_links else ROBOTS
    reads = "xyz" if needs_xyz else str(pick(2, ("z", "xyz")))
    noise = str(pick(8, KINDS))
    sessions = int(str(pick(12, (1, 2, 3))))
    return Design(
        robot=str(pick(0, robots)),
        poses=int(str(pick(1, (9, 27, 81)))),
        reads=reads,
        loads=int(str(pick(3, (2, 3, 4)))),
        aims=str(pick(4, ("down", "down", "several"))) if reads == "xyz" else "down",
        unloading=bool(pick(5, (True, True, False))),
        repeats=int(str(pick(6, (1, 2, 3, 4)))),
        in_passes=bool(pick(7, (False, False, True))),
        scatter=0.015 if pick(9, (0, 1)) else 0.0,
        noise=noise,
        outliers=bool(pick(10, (0, 1))),
        order=str(pick(11, ("random", "random", "random", "pose"))),
        factorial=bool(pick(13, (0, 1))),
        thermometer=str(pick(14, ("none", "air", "housing"))),
        sessions=max(sessions, 3) if noise == "session" else sessions,
        point=str(pick(15, ("flange", "flange", "aside"))),
        carried=bool(pick(16, (False, False, True))),
        held=reads == "z" and bool(pick(17, (0, 0, 1))),
    )


def reachable(a: Arm, q_deg: Array) -> Array:
    """Which poses (n, joints) somebody would set up: clear of the floor, out of the trunk, within coupled limits."""
    motions = body_motions(a.screws, a.joint_angles(np.deg2rad(q_deg)))
    tip = (motions[:, -1] @ a.flange)[:, :3, 3]
    good = (tip[:, 2] > 0.15) & (np.hypot(tip[:, 0], tip[:, 1]) > 0.45)
    if a.folded_deg is not None:
        low, high = a.folded_deg
        forearm = 180.0 + q_deg[:, 1] - q_deg[:, 2]
        good &= (forearm >= low) & (forearm <= high)
    return np.asarray(good)


def moving(a: Arm) -> list[int]:
    """Joints that a factorial plan moves, the most important first: the two that lift, then bend and roll."""
    lift = [j for j in range(a.size) if abs(a.screws[2, j]) < 0.5][:2]
    wrist = [j for j in (a.size - 2, a.size - 3, a.size - 1) if j not in lift]
    return [*lift, *wrist][:4]


def anywhere(a: Arm, rng: np.random.Generator, count: int) -> Array:
    """Poses (count, joints) at random in the arm's box."""
    found: list[Array] = []
    while sum(len(f) for f in found) < count:
        tried = rng.uniform(a.box_deg[:, 0], a.box_deg[:, 1], size=(4 * count, a.size))
        found.append(tried[reachable(a, tried)])
    return np.round(np.concatenate(found)[:count], 2)


def factorial(a: Arm, rng: np.random.Generator, count: int) -> Array | None:
    """All combinations of three levels of two, three or four joints; nothing if the arm cannot reach them all."""
    joints = moving(a)[: {9: 2, 27: 3, 81: 4}[count]]
    for _ in range(30):
        base = anywhere(a, rng, 1)[0]
        middle, half = a.box_deg.mean(axis=1), 0.5 * np.ptp(a.box_deg, axis=1) * rng.uniform(0.55, 0.95)
        levels = [np.round(middle[j] + half[j] * np.array([-1.0, 0.0, 1.0]), 1) for j in joints]
        grid = np.stack(np.meshgrid(*levels, indexing="ij"), -1).reshape(-1, len(joints))
        q = np.tile(base, (len(grid), 1))
        q[:, joints] = grid
        if reachable(a, q).all():
            return q
    return None


def forces(d: Design, a: Arm, rng: np.random.Generator) -> list[Array]:
    """Loads (loads, 3) in N of each direction, smallest first: 15 to 60 % of the payload."""
    share = np.linspace(rng.uniform(0.13, 0.22), rng.uniform(0.48, 0.62), d.loads)
    size = np.round(share * a.payload_newton / 5.0) * 5.0
    aims = [np.array([0.0, 0.0, -1.0])]
    if d.aims == "several":
        aims += [np.array([1.0, 0.0, 0.0]), np.array([0.0, float(rng.choice([-1.0, 1.0])), 0.0])][: rng.integers(1, 3)]
    return [size[:, None] * aim for aim in aims]


def conducted(d: Design, rng: np.random.Generator) -> Campaign:
    """The campaign of a design: poses, visits, cycles, the clock, the air."""
    a = arm(d.robot)
    q = factorial(a, rng, d.poses) if d.factorial else None
    q = anywhere(a, rng, d.poses) if q is None else q
    plan = forces(d, a, rng)
    passes, at_once = (d.repeats, 1) if d.in_passes else (1, d.repeats)
    rows: list[tuple[int, int, int, int, bool, Array]] = []  # setup, repeat, stay, cycle, unloading, force
    stay = cycle = 0
    for turn in range(passes):
        order = rng.permutation(d.poses) if d.order == "random" else np.arange(d.poses)
        for setup in order.tolist():
            for again in range(at_once):
                for loads in plan:
                    rows += [(setup, turn + again + 1, stay, cycle, False, f) for f in loads]
                    if d.unloading:
                        rows += [(setup, turn + again + 1, stay, cycle, True, f) for f in loads[-2::-1]]
                    cycle += 1
            stay += 1
    setup, repeat, stays, cycles, back = (np.array([r[i] for r in rows]) for i in range(5))
    session = stays * d.sessions // (stays.max() + 1)
    time = clock(rng, stays, session)
    beside = np.round(rng.uniform([-0.15, -0.1, 0.0], [0.15, 0.1, 0.1]), 3) if d.point == "aside" else np.zeros(3)
    return Campaign(
        q_deg=q[setup],
        force=np.stack([r[5] for r in rows]),
        point=np.tile(beside, (len(rows), 1)),
        setup=setup,
        repeat=repeat,
        visit=stays if d.carried else cycles,
        cycle=cycles,
        stay=stays,
        unloading=back.astype(bool),
        time_s=time,
        session=session,
        air_celsius=air(rng, time),
    )


def clock(rng: np.random.Generator, stay: Whole, session: Whole) -> Array:
    """Time stamps (n,) in s: 20 to 50 s a reading, 1 to 4 min to the next pose, a night between sessions."""
    reading = rng.uniform(20.0, 50.0) * rng.uniform(0.8, 1.3, len(stay))
    moved, night = np.diff(stay, prepend=stay[0]) > 0, np.diff(session, prepend=session[0]) > 0
    reading[moved] += rng.uniform(60.0, 240.0, int(moved.sum()))
    reading[night] += rng.uniform(10.0, 16.0, int(night.sum())) * 3600.0
    return np.asarray(np.round(np.cumsum(reading), 1))


def air(rng: np.random.Generator, time_s: Array) -> Array:
    """Temperature (n,) of the air in C: a wave of the day, and a heater that goes on and off."""
    day, phase = rng.uniform(0.5, 3.0), rng.uniform(-np.pi, np.pi)
    hours = time_s / 3600.0
    wave = day * np.sin(2 * np.pi * hours / 24.0 + phase) + 0.3 * np.sin(2 * np.pi * hours / rng.uniform(0.5, 1.5))
    return np.asarray(rng.uniform(19.0, 23.0) + wave)


def blocks(labels: Whole, columns: Array) -> Array:
    """Low-rank root (n, axes, groups): each group's own column (n, axes) where its label is, zero elsewhere."""
    names, where = np.unique(labels, return_inverse=True)
    out = np.zeros((*columns.shape, len(names)))
    out[np.arange(len(labels)), :, where] = columns
    return out


def whitened(covariance: Array, root: Array, columns: Array) -> Array:
    """Columns (n, axes, k) as (n axes, k), whitened by ``covariance + root root'`` of blocks (n, axes, axes)."""
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))

    def flat(a: Array) -> Array:
        return np.asarray(np.einsum("nij,njk->nik", inverse, a).reshape(a.shape[0] * a.shape[1], a.shape[2]))

    white, low = flat(columns), flat(root)
    if low.shape[1] == 0:
        return white
    values, vectors = np.linalg.eigh(low.T @ low)
    values = np.maximum(values, 1e-300)
    shrink = -np.expm1(-0.5 * np.log1p(values)) / values
    reach = low @ vectors
    return np.asarray(white - reach @ (shrink[:, None] * (reach.T @ white)))


def unexplained(covariance: Array, root: Array, springs: Array, seen: Array) -> float:
    """Chi-square of ``seen`` (n, axes) after fitting compliances, never negative, of columns (n, axes, joints)."""
    white = whitened(covariance, root, np.concatenate([springs, seen[:, :, None]], axis=2))
    A, b = white[:, :-1], white[:, -1]
    size = np.linalg.norm(A, axis=0)
    A = A[:, size > 1e-9 * max(float(size.max()), 1e-300)]
    A = A / np.linalg.norm(A, axis=0)
    _, R = np.linalg.qr(np.column_stack([A, b]))
    left = nnls(R[:, :-1], R[:, -1])[1]
    return float(left**2)


DETECTABLE = 30.0
TRIES = 20


@dataclass(frozen=True)
class Truth:
    """All there is to know of a set; ``clean`` is the world without nuisance, ``free`` the springs the model has."""

    seed: int
    sort: str
    index: int
    design: Design
    arm: Arm
    campaign: Campaign
    effects: tuple[Effect, ...]
    excess: tuple[float, ...]
    both: float
    clean: World
    built: World
    instrument: Instrument
    nominal: Array
    free: tuple[int, ...]
    model_path: float
    beam: bool

    @property
    def axes(self) -> list[int]:
        """Which of x, y, z the gauge reads."""
        return [0, 1, 2] if self.design.reads == "xyz" else [2]

    def rng(self, *purpose: int) -> np.random.Generator:
        """A generator of this set for a purpose."""
        return np.random.default_rng([self.seed, SORTS.index(self.sort), self.index, *purpose])


def names_of(seed: int, sort: str, index: int, rng: np.random.Generator) -> list[str]:
    """Families that a set hides; of pairs the first draw."""
    if sort == "single":
        return [list(CATALOGUE)[level(seed, sort, 50, index, len(CATALOGUE))]]
    if sort == "outside":
        return [list(OUTSIDE)[level(seed, sort, 50, index, len(OUTSIDE))]]
    return [str(n) for n in rng.choice(PAIRED, 2, replace=False)] if sort == "pairs" else []


def as_built(world: World, d: Design, rng: np.random.Generator, share: dict[str, float], force: Array) -> World:
    """The world with nuisance: lengths 1 mm, zeros 0.03 deg, loads 0.5 % together and 0.1 % each, links."""
    a = world.arm
    sizes = sorted({round(float(f), 3) for f in np.linalg.norm(force, axis=1)})
    return World(
        arm=a.displaced(rng.normal(scale=1e-3, size=(a.size, 3)), rng.normal(scale=1e-3, size=3)),
        soft=world.soft,
        bar_path=world.bar_path,
        link_share=share,
        zeros=np.deg2rad(rng.normal(scale=0.03, size=a.size)),
        load_scale=1.0 + 0.005 * float(rng.normal()),
        load_errors={f: 0.001 * float(rng.normal()) for f in sizes},
    )


def link_shares(a: Arm, clean: World, c: Campaign, beam: bool, rng: np.random.Generator) -> dict[str, float]:
    """Share of each link's own beam in the truth: all of it and 3 % (beams), or 1 to 3 % of the deflection (rigid)."""
    if beam:
        return {link.name: float(1.0 + 0.03 * rng.normal()) for link in a.links}
    whole = World(a, np.zeros(a.size), clean.bar_path, {link.name: 1.0 for link in a.links}, np.zeros(a.size))
    part = float(np.mean(readings(whole, (), c) ** 2) / np.mean(readings(clean, (), c) ** 2)) ** 0.5
    wanted = rng.uniform(0.01, 0.03) / part
    return {link.name: float(wanted * rng.uniform(0.6, 1.4)) for link in a.links}


def excess_of(t: Truth, effects: Sequence[Effect], *, nuisance: bool = False) -> float:
    """Chi-square of effects beyond all springs of the model, with the true covariance; usually without nuisance."""
    seen = readings(t.built if nuisance else t.clean, effects, t.campaign)
    still = World(t.arm, np.zeros(t.arm.size), t.model_path, t.clean.link_share, np.zeros(t.arm.size))
    covariance, root = covariances(t, seen, t.campaign)
    fixed = readings(still, (), t.campaign) if t.beam else np.zeros_like(seen)
    columns = spring_columns(t.arm, t.campaign, t.model_path)[:, t.axes][:, :, list(t.free)]
    return unexplained(covariance, root, columns, (seen - fixed)[:, t.axes])


def covariances(t: Truth, seen: Array, c: Campaign) -> tuple[Array, Array]:
    """Covariance (n, axes, axes) of each reading's own noise, and the root (n, axes, groups) of what groups share."""
    s = situation(t.clean, (), c)
    full = float(np.linalg.norm(t.campaign.force, axis=1).max())
    own = t.instrument.covariance(seen, s.point, c.force, full)[:, t.axes][:, :, t.axes]
    part = seen[:, t.axes]
    groups = [np.zeros((*part.shape, 0))]
    if t.design.scatter > 0.0:
        groups.append(blocks(c.stay, t.design.scatter * part))
    if t.instrument.offset > 0.0:
        for axis in range(len(t.axes)):
            one = np.zeros_like(part)
            one[:, axis] = t.instrument.offset
            groups.append(blocks(c.session, one))
    return own, np.concatenate(groups, axis=2)


def _rigid(t: Truth, effects: Sequence[Effect]) -> Truth:
    """The truth with the effects' joints out of the model's springs."""
    gone = {e.softness[0] for e in effects if e.softness is not None}
    soft = t.clean.soft.copy()
    soft[list(gone)] = 0.0
    clean = World(t.arm, soft, t.clean.bar_path, t.clean.link_share, t.clean.zeros)
    free = tuple(j for j in t.free if j not in gone)
    return replace(t, clean=clean, free=free, effects=tuple(effects))


def _drawn(t: Truth, names: Sequence[str], rng: np.random.Generator) -> Truth:
    """The truth with effects of these families, and how far they stand out."""
    bare = situation(t.clean, (), t.campaign)
    chance = Chance(rng, t.arm, t.clean.soft, t.campaign, bare, t.model_path)
    families = CATALOGUE | OUTSIDE
    u = _rigid(t, [families[name](chance) for name in names])
    alone = tuple(excess_of(u, [e]) for e in u.effects)
    both = excess_of(u, u.effects) if len(alone) > 1 else (alone[0] if alone else excess_of(u, ()))
    return replace(u, excess=alone, both=both)


def truth(seed: int, sort: str, index: int) -> Truth:
    """The truth of set ``index`` of a sort."""
    rng = np.random.default_rng([seed, SORTS.index(sort), index, 0])
    names = names_of(seed, sort, index, rng)
    bar, links = bool(set(names) & set(BAR)), "link-flexibility" in names
    d = designed(seed, sort, index, bar, links, "turned-frame" in names)
    beam = links and bool(rng.random() < 0.5)
    a, c = arm(d.robot), conducted(d, rng)
    nominal = np.array([float(f"{k:.3g}") for k in a.springs])
    soft = 1.0 / (nominal * np.exp(rng.uniform(np.log(0.5), np.log(2.0), a.size)))
    free = tuple(range(a.size))
    if d.held:
        free = free[1:-1]
        soft[[0, -1]] = 0.0
    model_path = 0.0 if a.pin is None or (names == ["load-path"] and rng.random() < 0.5) else 1.0
    shares = {link.name: 1.0 for link in a.links} if beam else {}
    clean = World(a, soft, model_path, shares, np.zeros(a.size))
    gauge = instrument(d.noise, rng, 2.0)
    t = Truth(seed, sort, index, d, a, c, (), (), 0.0, clean, clean, gauge, nominal, free, model_path, beam)
    u = _drawn(t, names, rng)
    for _ in range(TRIES - 1):
        if sort != "pairs" or settled(u):
            break
        u = _drawn(t, names_of(seed, sort, index, rng), rng)
    built = as_built(u.clean, d, rng, link_shares(a, clean, c, beam, rng), c.force)
    return replace(u, built=built)


def settled(t: Truth) -> bool:
    """Whether both of a pair stand out alone, and are not at one and the same joint."""
    first, second = t.effects
    return min(t.excess) >= DETECTABLE and (first.place != second.place or first.place not in t.arm.joints)
