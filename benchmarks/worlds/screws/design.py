"""Who measured what: a balanced draw of robots, poses, loads, order, instrument; and the campaign that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .arms import Arm, arm
from .campaign import Campaign
from .instruments import KINDS
from .screws import Array, Whole, body_motions

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
