"""Who measured when and where, and what the gauge says of it: true answers, noise, and how much springs leave."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..shared import FORCES, MOMENTS, POINT, READ, Effect, csv_text, number, numbers
from .arm import Arm, Now, direct, turn
from .known import KNOWN_ROWS
from .spec import STIFF, Case, Machine, Numbers, Pull, Rng, Row, Spec, air, anywhere, usable
from .strange import STRANGE_ROWS

Array = NDArray[np.float64]
Ints = NDArray[np.int_]
Convention = Callable[[Array], Array]  # from stated angles (n,) in deg to true ones
DAY = 86400.0
NONE = np.zeros(3)


@dataclass(frozen=True)
class Table:
    """Readings to be taken, as columns: (R,) or (R, 3) or (R, n). s, deg, N, m."""

    visit: Ints
    cycle: Ints
    session: Ints
    time_s: Array
    since_s: Array  # the session's start
    hold_s: Array  # the load was put on
    zero_s: Array  # when the gauge was zeroed, at no load
    up: NDArray[np.bool_]
    q: Array
    force: Array
    moment: Array
    point: Array

    @property
    def load(self) -> Array:
        """Sizes of the loads."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    def of(self, rows: Ints) -> Table:
        """Some of the readings."""
        return Table(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def blocks(self, one_by_one: bool) -> Iterator[Ints]:
        """Readings (V, K) of set-ups that went alike, or of one after the other."""
        cuts = np.flatnonzero(np.diff(self.visit)) + 1
        visits = np.split(np.arange(len(self.visit)), cuts)
        alike = {tuple(self.cycle[v].tolist()) for v in visits}
        if one_by_one or len(alike) > 1:
            yield from (v[None] for v in visits)
        else:
            yield np.stack(visits)


class Clock:
    """Goes on, and notes readings."""

    def __init__(self, start_s: float) -> None:
        self.now = self.start = start_s
        self.noted: list[tuple[Any, ...]] = []

    def read(self, visit: int, cycle: int, session: int, zero: float, wait: float, hold: float) -> None:
        """A reading ``wait`` seconds after the last, of which the load hangs a share ``hold``."""
        self.now += wait
        t = round(self.now, 1)
        self.noted.append((visit, cycle, session, t, t - self.start, hold * wait, zero))

    def columns(self) -> list[Any]:
        """Of a table, from ``visit`` to ``zero_s``."""
        return [np.array(column) for column in zip(*self.noted, strict=True)]


def steps_of(spec: Spec) -> list[tuple[float, bool]]:
    """Loads of a cycle, and whether they are being put on."""
    up = [(load, True) for load in sorted(spec.loads)]
    return up + [(load, False) for load, _ in reversed(up[:-1])] if spec.down else up


def timed(spec: Spec, visits: int, repeats: int, what: int) -> tuple[list[Any], list[tuple[float, bool]]]:
    """When each reading is taken, and each one's load: columns of a table from ``visit`` to ``zero_s``."""
    rng, steps = spec.rng(2, what), steps_of(spec)
    every, between, pauses = rng.uniform(15, 45), rng.uniform(60, 220), rng.uniform(0, 0.12)
    clock, session, hold = Clock(0.0), 0, rng.uniform(0.4, 0.8)
    for visit in range(visits):
        if visit * spec.sessions // visits != session:
            session += 1
            clock.now = clock.start = session * DAY + rng.uniform(-3600, 3600)
        clock.now += between * rng.uniform(0.6, 1.4) + (rng.uniform(600, 4000) if rng.random() < pauses else 0)
        for cycle in range(repeats):
            zero = round(clock.now, 1)
            for _ in steps:
                clock.read(visit, cycle, session, zero, every * rng.uniform(0.7, 1.4), hold)
            clock.now += 20.0
    columns = clock.columns()
    first = columns[3][0]
    columns[3], columns[6] = np.round(columns[3] - first, 1), columns[6] - first
    return columns, steps * (visits * repeats)


def session_span(spec: Spec) -> float:
    """Seconds of the longest session."""
    return float(timed(spec, spec.poses, spec.repeats, 0)[0][4].max())


def some_poses(rng: Rng, arm: Arm, count: int, grid: bool, true: Convention) -> Array:
    """Angles (count, n) in deg as the table states them, which stand for usable poses. ValueError: there are none."""

    def good(q: Array) -> NDArray[np.bool_]:
        return np.asarray(arm.allows(q) & usable(arm, true(q)))

    turned = [1, 2, 4, 3][: round(np.log(count) / np.log(3))]
    levels = np.stack(np.meshgrid(*[[-1, 0, 1]] * len(turned), indexing="ij"), axis=-1).reshape(-1, len(turned))
    for _ in range(12 if grid else 0):
        middles = anywhere(rng, arm, 1500)
        middles = middles[good(middles)][:40]
        half = np.minimum(0.4 * (arm.high - arm.low), 60.0) * rng.uniform(0.3, 1.0, middles.shape)
        plans = np.repeat(middles[:, None], len(levels), axis=1)
        plans[:, :, turned] += levels * half[:, None, turned]
        fits = np.flatnonzero(good(plans).all(axis=1))
        if fits.size:
            plan = np.round(plans[fits[0]], 3)
            return plan[rng.permutation(count)] if rng.random() < 0.5 else plan
    found = np.zeros((0, len(arm.low)))
    for _ in range(60):
        q = np.round(anywhere(rng, arm, 4000), 3)
        found = np.vstack([found, q[good(q)]])
        if len(found) >= count:
            return found[:count]
    raise ValueError("no such poses")


def campaign(spec: Spec, true: Convention, visits: int, repeats: int, what: int, grid: bool = False) -> Table:
    """All readings to be taken. ``what`` tells the campaign from others of the same set."""
    poses = some_poses(spec.rng(1, what), spec.of, visits, grid, true)
    columns, steps = timed(spec, visits, repeats, what)
    visit = columns[0]
    ways = np.array([[0.0, 0, -1], list(spec.second) or [0.0, 0, -1]])[visit % 2]
    load, up = (np.array(column) for column in zip(*steps, strict=True))
    point = np.tile(spec.loaded, (len(visit), 1))
    return Table(*columns, up, poses[visit], load[:, None] * ways, np.zeros_like(ways), point)


def later(table: Table, after: Table, visit: int) -> Table:
    """A campaign of one session that goes on ten minutes after another's end."""
    last = after.time_s[-1] + 600.0
    return replace(
        table,
        visit=table.visit + visit,
        session=0 * table.session + after.session[-1],
        zero_s=table.zero_s + last,
        time_s=np.round(table.time_s + last, 1),
        since_s=after.since_s[-1] + 600.0 + table.time_s,
    )


def own_columns(spec: Spec, table: Table, first: int) -> list[dict[str, str]]:
    """What the table says of when a reading was taken, from step ``first`` on."""
    warm = 20 + 4 * air(spec.air, table.since_s)
    said = {
        "step": [str(first + i) for i in range(len(warm))],
        "time_s": [f"{t:.1f}" for t in table.time_s],
        "session": [f"S{s + 1}" for s in table.session],
        "temperature_C": [f"{t:.1f}" for t in warm],
    }
    return [{name: said[name][i] for name in said if name in spec.columns} for i in range(len(warm))]


def measurement_table(spec: Spec, table: Table, said: Array, label: str = "P", first: int = 1, digits: int = 4) -> str:
    """As CSV, of readings (R, 3) in m."""
    lines = []
    own = own_columns(spec, table, first)
    number = np.unique(table.visit, return_inverse=True)[1] + 1
    for i, d in enumerate(said):
        line: dict[str, Any] = {"pose": f"{label}{number[i]:02d}"}
        line |= {c: f"{a:.3f}" for c, a in zip(spec.of.columns, table.q[i], strict=True)}
        line |= {f"f{x}_N": f"{f + 0.0:.4f}" for x, f in zip("xyz", table.force[i], strict=True)}
        if spec.point:
            line |= {f"p{x}_mm": f"{1e3 * p + 0.0:.3f}" for x, p in zip("xyz", table.point[i], strict=True)}
        line["repeat"] = int(table.cycle[i]) + 1
        if spec.down:
            line["phase"] = "loading" if table.up[i] else "unloading"
        lines.append(line | own[i] | {READ[k]: f"{1e3 * d[k]:.{digits}f}" for k in spec.axes})
    return csv_text(lines)


def of_sheet(spec: Spec, lines: list[dict[str, str]], visit: int, session: int, start_s: float) -> Table:
    """A sheet's lines as measured in order: a set-up is a run of lines at one pose, a cycle one of its repeats."""
    clock, arrays, last, zero, cycle = Clock(start_s), [], ((), ""), start_s, 0
    visit -= 1
    for line in lines:
        q, force, moment = (numbers(line, names) for names in (spec.of.columns, FORCES, MOMENTS))
        point = np.array([number(line, name, k) for name, k in zip(POINT, 1e3 * spec.loaded, strict=True)]) / 1e3
        here = (line.get("pose"), *q, *np.round(force / (np.linalg.norm(force) or 1), 6)), line.get("repeat") or ""
        if here != last:
            moves = here[0] != last[0]
            visit, cycle, clock.now = visit + moves, 0 if moves else cycle + 1, clock.now + (120.0 if moves else 20.0)
            zero = clock.now
        last = here
        clock.read(visit, cycle, session, zero, 30.0, 0.6)
        arrays.append((line.get("phase") != "unloading", q, force, moment, point))
    return Table(*clock.columns(), *(np.array(column) for column in zip(*arrays, strict=True)))


KNOWN: dict[str, Row] = {row.family: row for row in KNOWN_ROWS}
STRANGE: dict[str, Row] = {row.family: row for row in STRANGE_ROWS}
EVERY = KNOWN | STRANGE
KINDS = ("component", "length", "load", "constant", "resolution", "heavy")
SETTLE_S, OUTLIER = 400.0, 0.02


@dataclass(frozen=True)
class Off:
    """What is off beside the effects: the arm (lengths, zeros, large turns under its own weight), and chance."""

    arm: bool = False
    chance: bool = False


HONEST, SO_IT_IS = Off(), Off(arm=True, chance=True)


def convention(spec: Spec, effects: Iterable[Effect]) -> Convention:
    """True angles of stated ones."""

    def true(q: Array) -> Array:
        for e in effects:
            row = EVERY[e.family]
            q = row.angles(q, e.numbers, spec.of.joints.index(e.place)) if row.angles else q
        return q

    return true


def by_chance(spec: Spec, what: int, whose: NDArray[np.int_], count: int) -> Array:
    """Normal numbers (len, count) that go by whose they are."""
    return np.array([spec.rng(what, *np.atleast_1d(one)).normal(size=count) for one in whose])


def machine(spec: Spec, table: Table, effects: tuple[Effect, ...], off: Off) -> Machine:
    """The arm at the poses of a table that has one reading for each set-up."""
    arm, n = spec.of, len(spec.of.joints)
    if off.arm:
        rng = spec.rng(4)
        arm = arm.off(rng.normal(0, 4e-4, (n + 1, 3)), rng.normal(0, 0.02, n))
    springs: Array = np.tile(np.where(np.array(spec.stated) > 0, spec.springs, STIFF), (len(table.visit), 1))
    if off.chance:
        springs = springs * (1 + spec.scatter * by_chance(spec, 5, table.visit, n))
    q = convention(spec, effects)(table.q)
    m = Machine(arm, q, springs, spec.path, spec.balance, spec.air, off.arm)
    for e in effects:
        build = EVERY[e.family].build
        if build:
            build(m, e.numbers, e.place)
    m.close()
    return m


def pulled(spec: Spec, table: Table, rows: NDArray[np.int_], m: Machine, effects: tuple[Effect, ...], off: Off) -> Case:
    """What hangs where: every weight off by 0.05 %, every rope by 0.05 deg."""
    t = table.of(rows.ravel())
    force = t.force
    if off.chance:
        weights = 1 + 5e-4 * by_chance(spec, 6, np.round(10 * t.load).astype(int), 1)
        ropes = np.radians(0.05) * by_chance(spec, 7, t.visit, 2)
        for axis, lean in zip(np.eye(3)[:2], ropes.T, strict=True):
            force = direct(turn(axis, np.zeros(3), lean), force)
        force = force * weights

    def shaped(a: NDArray[Any]) -> Any:
        return a.reshape(*rows.shape, *a.shape[1:])

    case = Case(
        shaped(t.time_s),
        shaped(t.since_s),
        shaped(t.hold_s),
        shaped(t.zero_s),
        shaped(t.cycle),
        shaped(t.up),
        shaped(t.load),
        shaped(force),
        shaped(t.moment),
        shaped(t.point),
        shaped(t.point),
        spec.air,
        m,
    )
    for e in effects:
        load = EVERY[e.family].load
        if load:
            load(case, e.numbers)
    return case


def went(spec: Spec, t: Table, m: Machine, c: Case, memory: list[Array] | None) -> tuple[Array, list[Array]]:
    """How the point moved (V, K, 3) since its zero, and what is remembered; ``t``: set-ups' first readings."""
    V, K = c.time_s.shape
    still = Pull(np.zeros((V, 3)), np.zeros((V, 3)), c.load_at[:, 0])
    x, out = np.zeros((V, len(m.freedoms))), np.zeros((V, K, 3))
    kept: list[Array] = []
    clock = c.zero_s[:, 0] - SETTLE_S

    def step(pull: Pull, until: Array, k: int) -> None:
        nonlocal x, kept, clock
        cycles = t.visit * spec.repeats + c.cycle[:, k]
        now = Now(until, c.since_s[:, k] + until - c.time_s[:, k], np.maximum(until - clock, 0), cycles)
        x, kept = m.rest(x, pull, kept, now)
        y = x @ m.sums.T
        kept = [part.law.keep(y[:, p], kept[p], now) for p, part in enumerate(m.parts)]
        clock = until

    last = still
    for k in range(K):
        if k == 0 or c.cycle[0, k] != c.cycle[0, k - 1]:
            came = np.array([spec.rng(8, v, c.cycle[0, k] if spec.away else 0).uniform(-1, 1) for v in t.visit])
            if k == 0:
                old = memory or [np.zeros(0)] * len(m.parts)
                kept = [
                    o if memory and part.law.lasting else part.law.rest(came)
                    for o, part in zip(old, m.parts, strict=True)
                ]
            elif spec.away:
                kept = [part.law.again(one, came) for one, part in zip(kept, m.parts, strict=True)]
            step(still, c.zero_s[:, k], k)
            zero, last = x, still
        pull = Pull(c.force[:, k], c.moment[:, k], c.load_at[:, k])
        if any(one.shape[1] for one in kept):
            step(last, c.time_s[:, k] - c.hold_s[:, k], k)
        step(pull, c.time_s[:, k], k)
        last = pull
        if m.bent:
            out[:, k] = m.tip(m.shape(x), c.read_at[:, k]) - m.tip(m.shape(zero), c.read_at[:, k])
        else:
            out[:, k] = np.einsum("bnc,bn->bc", m.lever(c.read_at[:, k]), x - zero)
    return out, kept


def readings(spec: Spec, table: Table, effects: tuple[Effect, ...] | None = None, off: Off = HONEST) -> Array:
    """What a gauge without noise says (R, 3), m. RuntimeError: an arm finds no equilibrium."""
    effects = spec.effects if effects is None else effects
    out = np.zeros((len(table.visit), 3))
    memory: list[Array] | None = None
    for rows in table.blocks(any(e.numbers.get("lasting") for e in effects)):
        first = table.of(rows[:, 0])
        m = machine(spec, first, effects, off)
        case = pulled(spec, table, rows, m, effects, off)
        moved, memory = went(spec, first, m, case, memory if len(rows) == 1 else None)
        for e in effects:
            read = EVERY[e.family].read
            moved = read(case, e.numbers, moved, e.place) if read else moved
        out[rows] = moved
    return out


def draw_noise(rng: Rng, kind: str, sessions: int) -> Numbers:
    """Sizes, in m or as a share; what an axis has more than others; what a gauge set up anew is off by."""
    level = float(np.exp(rng.uniform(np.log(6e-6), np.log(28e-6))))
    axes = [float(x) for x in np.exp(rng.uniform(-0.7, 0.7, 3))] if rng.random() < 0.5 else [1.0, 1.0, 1.0]
    reset = rng.uniform(8e-6, 25e-6) if sessions > 1 else rng.uniform(1e-6, 6e-6) * (rng.random() < 0.5)
    return {
        "kind": kind,
        "level": level,
        "share": rng.uniform(0.006, 0.028),
        "floor": rng.uniform(3e-6, 6e-6),
        "axes": axes,
        "reset": float(reset),
        "reset_by": "session" if sessions > 1 else "pose",
        "step": float(rng.choice([5e-6, 1e-5, 2e-5])) if kind == "resolution" else 0.0,
    }


def sds(spec: Spec, table: Table, moved: Array) -> Array:
    """Standard deviation (R, 3) in m of each reading by itself, of true readings (R, 3)."""
    n = spec.noise
    size: Array = np.full(moved.shape, n["level"])
    match n["kind"]:
        case "component":
            size = np.hypot(n["share"] * moved, n["floor"])
        case "length":
            size = np.hypot(n["share"] * np.linalg.norm(moved, axis=1, keepdims=True), n["floor"]) + 0 * moved
        case "load":
            size = np.hypot(n["level"] * table.load / max(spec.loads), n["floor"])[:, None] + 0 * moved
        case "resolution":
            size = size / 2
    return np.asarray(np.hypot(size * n["axes"], n["step"] / np.sqrt(12)))


def measured(spec: Spec, table: Table, moved: Array, what: int) -> Array:
    """What is written down (R, 3), m."""
    n, rng = spec.noise, spec.rng(10, what)
    sd = np.sqrt(sds(spec, table, moved) ** 2 - n["step"] ** 2 / 12)
    reset = by_chance(spec, 9, table.session if n["reset_by"] == "session" else table.visit + 1000, 3)
    # A t of three degrees of freedom has a variance of three.
    draws = rng.standard_t(3, moved.shape) / np.sqrt(3) if n["kind"] == "heavy" else rng.normal(size=moved.shape)
    out = moved + n["reset"] * reset + sd * draws
    if spec.outliers:
        for i in np.flatnonzero(rng.random(len(out)) < OUTLIER):
            k = rng.choice(spec.axes)
            out[i, k] += sd[i, k] * rng.uniform(6, 30) * rng.choice([-1, 1])
    return np.asarray(np.round(out / n["step"]) * n["step"]) if n["step"] else out


def spring_motions(spec: Spec, table: Table) -> Array:
    """What the point moves by for 1 rad/(N m) of each drive, (R, 3, n), as the table states it."""
    moves = spec.of.levers(table.q, table.point)
    about = spec.of.lines(table.q)[1].copy()
    if spec.path == "parallelogram":
        moves[:, 1], about[:, 1] = moves[:, 1] - moves[:, 2], about[:, 1] - about[:, 2]
    torque = np.einsum("rnc,rc->rn", moves, table.force) + np.einsum("rnc,rc->rn", about, table.moment)
    return np.asarray(np.swapaxes(moves * torque[..., None], 1, 2))


def excess(spec: Spec, table: Table, alone: Array, whole: Array) -> float:
    """Smallest chi-square of true readings ``alone`` (R, 3) with the springs that the model has free, none below 0.

    Noise is that of ``whole`` (R, 3): each reading's own, springs' scatter and the gauge's zero set-up by set-up; a
    session's zeros are unknowns of a known variance, which comes to the same as a full covariance.
    """
    axes, n = spec.axes, spec.noise
    free = [i for i, k in enumerate(spec.stated) if k]
    motions = spring_motions(spec, table)[:, axes][:, :, free]
    share = spec.scatter / np.array(spec.springs)[free]
    sessions = sorted(set(table.session.tolist())) if n["reset_by"] == "session" else []
    unit = np.eye(len(axes))
    whitened: list[Array] = []
    for visit in sorted(set(table.visit.tolist())):
        rows = np.flatnonzero(table.visit == visit)
        A = motions[rows].reshape(-1, len(free))
        own = sds(spec, table, whole)[rows][:, axes].ravel()
        zeros = np.tile(unit, (len(rows), 1)) * n["reset"]
        V = np.diag(own**2) + (A * share) @ (A * share).T
        if not sessions:
            V += zeros @ zeros.T
        columns = [A, *(zeros * (table.session[rows[0]] == s) for s in sessions), alone[rows][:, axes].reshape(-1, 1)]
        whitened.append(np.linalg.solve(np.linalg.cholesky(V), np.hstack(columns)))
    A = np.vstack(whitened)
    count = len(sessions) * len(axes)
    A = np.vstack([A, np.hstack([np.zeros((count, len(free))), np.eye(count), np.zeros((count, 1))])])
    # Only the triangle is left to be solved. A joint without a lever moves readings by round-off only.
    size = np.linalg.norm(A[:, : len(free)], axis=0) / np.array(spec.springs)[free]
    seen = np.append(size > 1e-9 * np.linalg.norm(A[:, -1]), np.ones(count + 1, dtype=bool))
    R = np.asarray(np.linalg.qr(A[:, seen], mode="r"))
    B, y, springs = R[:, :-1], R[:, -1], int(seen[: len(free)].sum())
    scale = np.linalg.norm(B, axis=0)
    B = B / scale
    return float(nnls(np.hstack([B, -B[:, springs:]]), y)[1] ** 2)
