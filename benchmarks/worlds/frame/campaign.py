"""Who measured when and where, what the arm answers, noise on top of it, and how much springs leave of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ..shared import Effect, log_uniform
from .arm import ANGLE_DIGITS, STIFF, Arm, Row, Section, Spec, rotation, turns
from .other_laws import EVERY
from .plan import Event, Joint, Moment, Plan, build, run, some_pose, usable

Array = NDArray[np.float64]
DAY = 86400.0


def point_of(spec: Spec) -> Array:
    """Where it is loaded and read, flange frame."""
    return np.array(spec.point) if spec.point else spec.of.tool


def grid_joints(arm: Arm, poses: int) -> list[int]:
    """Those that a factorial plan of three levels turns."""
    swings = [1, 3, 5, 4] if len(arm.joints) == 7 else [1, 2, 4, 3]
    return swings[: round(np.log(poses) / np.log(3))]


def _grid(rng: np.random.Generator, arm: Arm, poses: int, good: Callable[[Array], bool]) -> list[Array]:
    """Three levels of some joints, all allowed; none where no such plan was found."""
    turned = grid_joints(arm, poses)
    for _ in range(400):
        base = some_pose(rng, arm)
        half = np.minimum(0.35 * (arm.high - arm.low), 55.0) * rng.uniform(0.4, 1.0, len(base))
        steps = np.array(np.meshgrid(*[[-1, 0, 1]] * len(turned), indexing="ij")).reshape(len(turned), -1).T
        plan = np.tile(base, (len(steps), 1))
        plan[:, turned] += steps * half[turned]
        if all(good(q) for q in plan):
            return list(np.round(plan, ANGLE_DIGITS))
    return []


def draw_poses(
    rng: np.random.Generator, arm: Arm, poses: int, grid: bool, true: Callable[[Array], Array]
) -> list[Array]:
    """Angles (n,) in deg as the table states them, which stand for usable poses. ValueError: there are none."""

    def good(q: Array) -> bool:
        return arm.allows(q) and usable(arm, true(q))

    found = _grid(rng, arm, poses, good) if grid else []
    for _ in range(60000):
        if len(found) >= poses:
            return found[:poses]
        q = np.round(some_pose(rng, arm), ANGLE_DIGITS)
        if good(q):
            found.append(q)
    raise ValueError("no such poses")


def directions(spec: Spec, visits: int) -> list[Array]:
    """Of the loads, set-up by set-up."""
    down = np.array([0.0, 0, -1])
    return [np.array(spec.second) if spec.second and v % 2 else down for v in range(visits)]


def steps_of(spec: Spec) -> list[tuple[str, float]]:
    """Phase and load of a cycle's readings."""
    up = [("loading", load) for load in sorted(spec.loads)]
    return up + [("unloading", load) for _, load in reversed(up[:-1])] if spec.down else up


def schedule(spec: Spec, visits: int, repeats: int, what: int) -> list[Row]:
    """Rows without poses, in order: when each cycle is zeroed, and when each reading is taken."""
    rng = spec.rng(2, what)
    every, between = rng.uniform(18, 50), rng.uniform(70, 200)
    rows: list[Row] = []
    clock = start = 0.0
    session, none = 0, np.zeros(0)
    for visit in range(visits):
        if visit * spec.sessions // visits != session:
            session += 1
            start = clock = session * DAY + rng.uniform(-3600, 3600)
        clock += between * rng.uniform(0.7, 1.3)
        for cycle in range(repeats):
            zero = round(clock, 1)
            for phase, load in steps_of(spec):
                clock += every * rng.uniform(0.8, 1.2)
                force = np.array([load, 0, 0])
                now = round(clock, 1)
                pose = f"P{visit + 1:02d}"
                rows.append(Row(visit, cycle, session, now - start, now, zero, phase, pose, none, force, none, none))
            clock += 25.0
    first = rows[0].time_s
    return [replace(r, time_s=round(r.time_s - first, 1), zero_s=r.zero_s - first) for r in rows]


def rows_of(
    spec: Spec, true: Callable[[Array], Array], visits: int, repeats: int, what: int, grid: bool = False
) -> list[Row]:
    """All readings to be taken. ``what`` tells the campaign from others of the same set."""
    arm = spec.of
    rng = spec.rng(1, what)
    poses = draw_poses(rng, arm, visits, grid, true)
    if rng.random() < 0.5:
        poses = [poses[i] for i in rng.permutation(visits)]
    ways = directions(spec, visits)
    return [
        replace(r, angles=poses[r.visit], force=r.force[0] * ways[r.visit], point=point_of(spec), moment=np.zeros(3))
        for r in schedule(spec, visits, repeats, what)
    ]


KINDS = ("white", "component", "length", "load", "axis", "session", "heavy")
SESSION_ZERO = 20e-6  # m
ONE_IN = 50


def draw_noise(rng: np.random.Generator, kind: str) -> dict[str, Any]:
    """Sizes of a kind, in m or as a share. A dial gauge is good for some hundredths of a millimetre."""
    floor = rng.uniform(2e-6, 5e-6)
    sizes: dict[str, dict[str, Any]] = {
        "white": {"level": log_uniform(rng, 5e-6, 25e-6)},
        "component": {"share": rng.uniform(0.008, 0.03), "floor": floor},
        "length": {"share": rng.uniform(0.006, 0.025), "floor": floor},
        "load": {"level": log_uniform(rng, 8e-6, 35e-6), "floor": floor},
        "axis": {"axes": [log_uniform(rng, 4e-6, 30e-6) for _ in range(3)]},
        "session": {"level": log_uniform(rng, 5e-6, 20e-6), "by": rng.permutation([0.5, 1.0, 2.0]).tolist()},
        "heavy": {"level": log_uniform(rng, 5e-6, 20e-6)},
    }
    return {"kind": kind, **sizes[kind]}


def sds(spec: Spec, rows: list[Row], moved: Array) -> Array:
    """Standard deviation (n, 3) in m of each reading by itself, of true readings (n, 3)."""
    n, ones = spec.noise, np.ones_like(moved)
    if n["kind"] == "component":
        return np.hypot(n["share"] * moved, n["floor"])
    if n["kind"] == "length":
        return np.hypot(n["share"] * np.linalg.norm(moved, axis=1)[:, None], n["floor"]) * ones
    if n["kind"] == "load":
        loads = np.array([r.load for r in rows]) / max(spec.loads)
        return np.hypot(n["level"] * loads, n["floor"])[:, None] * ones
    if n["kind"] == "axis":
        return np.array(n["axes"]) * ones
    if n["kind"] == "session":
        return n["level"] * np.array([n["by"][r.session % 3] for r in rows])[:, None] * ones
    return n["level"] * ones


def has_sessions(spec: Spec) -> bool:
    """Whether the table has sessions, and so gauges that are set up anew."""
    return "session" in spec.columns


def measured(spec: Spec, rows: list[Row], moved: Array, what: int) -> Array:
    """What is written down (n, 3), m: true readings with everything that goes wrong."""
    out = moved.copy()
    for i, r in enumerate(rows):
        out[i] *= 1 + spec.scatter * spec.rng(8, r.visit).normal()
        if has_sessions(spec):
            out[i] += SESSION_ZERO * spec.rng(9, r.session).normal(size=3)
    rng, sd = spec.rng(10, what), sds(spec, rows, moved)
    # Three degrees of freedom have a variance of three.
    draws = rng.standard_t(3, out.shape) / np.sqrt(3) if spec.noise["kind"] == "heavy" else rng.normal(size=out.shape)
    out += sd * draws
    if spec.outliers:
        for i in np.flatnonzero(rng.random(len(rows)) < 1 / ONE_IN).tolist():
            k = rng.choice(spec.axes)
            out[i, k] += sd[i, k] * rng.uniform(5, 30) * rng.choice([-1, 1])
    return out


UNSEEN = 1e-9


def spring_motions(spec: Spec, rows: list[Row]) -> Array:
    """What the point moves by for every compliance of 1 rad/(N m), (n, 3, joints), as the table states it."""
    arm, out = spec.of, []
    for r in rows:
        stand = arm.stand(r.angles)
        moves, _ = turns(arm, stand, r.point)
        about = stand.axes.copy()
        if spec.path == "parallelogram":
            # The third drive turns the forearm against the carousel, so the second moves it without turning it.
            moves[1], about[1] = moves[1] - moves[2], about[1] - about[2]
        torques = moves @ r.force + about @ r.moment
        out.append(moves.T * torques)
    return np.array(out)


def excess(spec: Spec, rows: list[Row], alone: Array, whole: Array) -> float:
    """Smallest chi-square of true readings ``alone`` (n, 3) with the springs that the model has free and none below 0.

    Noise is that of the set's readings ``whole`` (n, 3). What is in common to a set-up's readings or to a session's is
    one more unknown with a variance of its own, which is the same as a full covariance.
    """
    axes = spec.axes
    sd = sds(spec, rows, whole)[:, axes].ravel()
    free = [i for i, k in enumerate(spec.stated) if k]
    springs = spring_motions(spec, rows)[:, axes][:, :, free].reshape(len(sd), -1)
    common = []
    if spec.scatter:
        for visit in sorted({r.visit for r in rows}):
            of = np.array([r.visit == visit for r in rows])[:, None]
            common.append((spec.scatter * whole[:, axes] * of).ravel())
    if has_sessions(spec):
        for session in sorted({r.session for r in rows}):
            of = np.array([r.session == session for r in rows])[:, None]
            common += [(SESSION_ZERO * of * (np.array(axes) == k)).ravel() for k in axes]
    shared = np.array(common).reshape(-1, len(sd)).T
    # What a spring's readings come to by its stated stiffness: a joint without a lever moves them by round-off only.
    sizes = np.linalg.norm(springs / sd[:, None], axis=0)
    seen = sizes / np.array(spec.stated)[free] > UNSEEN * np.linalg.norm(whole[:, axes].ravel() / sd)
    springs, scale = springs[:, seen], sizes[seen]
    A = np.hstack([springs / scale, shared]) / sd[:, None]
    A = np.vstack([A, np.hstack([np.zeros((shared.shape[1], len(scale))), np.eye(shared.shape[1])])])
    y = np.concatenate([alone[:, axes].ravel() / sd, np.zeros(shared.shape[1])])
    # Only the triangle is left to be solved: thousands of readings become a hundred rows.
    R = np.asarray(np.linalg.qr(np.hstack([A, y[:, None]]), mode="r"))
    low = np.concatenate([np.zeros(len(scale)), np.full(shared.shape[1], -np.inf)])
    found = lsq_linear(R[:, :-1], R[:, -1], (low, np.full(len(low), np.inf)), tol=1e-14)
    return float(2 * found.cost)


REST = 20.0  # s between the end of settling and the gauge's zero


@dataclass(frozen=True)
class Off:
    """What is off beside the effects: the arm (lengths, zeros, soft links), and weights and ropes."""

    arm: bool = True
    loads: bool = True


HONEST = Off(arm=False, loads=False)


def true_arm(spec: Spec, off: Off) -> Arm:
    """Lengths off by 0.5 mm and joint zeros by 0.03 deg."""
    arm = spec.of
    if not off.arm:
        return arm
    rng, n = spec.rng(4), len(arm.joints)
    return arm.shifted(rng.normal(0, 5e-4, (n + 1, 3)), rng.normal(0, 0.03, n))


def true_force(spec: Spec, row: Row, off: Off) -> Array:
    """Every weight off by 0.1 %, and every set-up's rope by 0.1 deg."""
    if not off.loads or row.load == 0:
        return row.force
    weight = 1 + 1e-3 * spec.rng(5, round(10 * row.load)).normal()
    lean = np.radians(spec.rng(6, row.visit).normal(0, 0.1, 2))
    return weight * rotation(np.array([0.0, 1, 0]), lean[0]) @ rotation(np.array([1.0, 0, 0]), lean[1]) @ row.force


def true_angles(effects: Iterable[Effect], arm: Arm, q: Array) -> Array:
    """What the table's angles (n,) stand for, deg."""
    for e in effects:
        q = EVERY[e.family].true_angles(e, arm, q)
    return q


def _soft(spec: Spec, arm: Arm) -> dict[int, Section]:
    """Links of which each gives as much as it takes to add up to a share of what the second joint gives."""
    lengths = np.append(np.linalg.norm(arm.frames[:, :3, 3], axis=1), np.linalg.norm(arm.flange))
    # A beam's end turns by M L / (E I).
    each = spec.springs[1] / (spec.soft_links * 0.5)
    return {i: Section(1e14, each * x, each * x, 1.0, 1.0) for i, x in enumerate(lengths.tolist()) if x > 0.1}


def plan_of(spec: Spec, arm: Arm, effects: tuple[Effect, ...], off: Off, q: Array, point: Array, when: Moment) -> Plan:
    """The frame's plan at stated angles (n,) in deg."""
    q = true_angles(effects, arm, q)
    turn = np.radians(arm.signs * q + arm.offsets)
    # A joint that the model holds rigid is so, until a law says what it is.
    joints = [Joint(k if stated else STIFF) for k, stated in zip(spec.springs, spec.stated, strict=True)]
    plan = Plan(arm, arm.stand(q), joints, turn, point, path=spec.path, balance=spec.balance)
    if off.arm and spec.soft_links:
        plan.beams |= _soft(spec, arm)
    for e in effects:
        EVERY[e.family].change(e, plan, when)
    return plan


def _pulls(spec: Spec, rows: list[Row], effects: tuple[Effect, ...], off: Off) -> list[tuple[Array, Array, Array]]:
    """Of every row the true force, where it acts and where it is read."""
    out = []
    for row in rows:
        pull = (true_force(spec, row, off), row.point, row.point)
        for e in effects:
            pull = EVERY[e.family].pull(e, row, *pull)
        out.append(pull)
    return out


def _events(plan: Plan, rows: list[Row], pulls: list[tuple[Array, Array, Array]]) -> list[Event]:
    """No load until the gauge is zeroed, then the loads, for each cycle."""
    start = rows[0].zero_s - REST
    events: list[Event] = []
    cycle = None
    for row, (force, at, read) in zip(rows, pulls, strict=True):
        last = events[-1].until_s if events else 0.0
        if row.cycle != cycle:
            events.append(Event(last, row.zero_s - start, np.zeros(6), True))
            cycle, last = row.cycle, row.zero_s - start
        moment = row.moment + np.cross(plan.stand.turned[-1] @ (at - read), force)
        events.append(Event(last, row.time_s - start, np.append(force, moment), True))
    return events


def _stay(spec: Spec, arm: Arm, rows: list[Row], effects: tuple[Effect, ...], off: Off) -> Array:
    """Readings (n, 3) in m while the arm stays where it is."""
    first = rows[0]
    came = float(np.sign(spec.rng(7, first.visit, first.cycle if spec.moves else 0).normal()))
    when = Moment(first.visit, first.time_s, first.session, first.since_s, came)
    pulls = _pulls(spec, rows, effects, off)
    plan = plan_of(spec, arm, effects, off, first.angles, pulls[0][2], when)
    deck, nodes = build(plan)
    found = iter(run(plan, deck, nodes, _events(plan, rows, pulls), spec.settle_s)[:, :3])
    out = []
    for _, cycle in groupby(rows, lambda r: r.cycle):
        one = list(cycle)
        zero = next(found)
        moved = np.array([next(found) - zero for _ in one])
        for e in effects:
            moved = EVERY[e.family].read(e, one, moved)
        out.append(moved)
    return np.vstack(out)


def readings(spec: Spec, rows: list[Row], effects: tuple[Effect, ...] | None = None, off: Off = HONEST) -> Array:
    """What a gauge without noise says (n, 3), m. RuntimeError: a frame finds no equilibrium."""
    effects = spec.effects if effects is None else effects
    arm = true_arm(spec, off)
    stays = groupby(rows, lambda r: (r.visit, r.cycle if spec.moves else 0))
    return np.vstack([_stay(spec, arm, list(stay), effects, off) for _, stay in stays])
