"""Where the arm is measured and under what: poses within limits and above the floor, weights, habits of the day."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.campaign import Cycle, Habits, Timeline, cycle, run
from benchmarks.worlds.shopfloor.statics import postures

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
