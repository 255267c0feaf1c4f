"""Who measured when and where: poses, loads up and down, repeats, sessions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .arms import Arm
from .laws import some_pose, usable
from .spec import ANGLE_DIGITS, Row, Spec

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
