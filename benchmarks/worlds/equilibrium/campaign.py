"""Which poses, loads and repeats a campaign takes, and in which order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .arm import Arm, Vector
from .chain import GRAVITY, Chain
from .effect import Row, Site

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
