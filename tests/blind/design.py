"""Poses that fill the reachable ranges, and the campaign of loads measured at them."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

from .arm import LOADS, Arm, Array
from .kinematics import allowed, frames
from .spec import Readings, SetSpec

# The paper's nine seed poses, degrees: q2, q3real, q4, q5.
PAPER = [
    (-35, 40, -200, 100), (-35, 40, 0, -100), (-35, 40, 0, 0),
    (5, 77.5, -200, 100), (5, 77.5, 0, -100), (5, 77.5, 0, 0),
    (45, 115, -200, 100), (45, 115, 0, -100), (45, 115, 0, 0),
]  # fmt: skip


def poses(arm: Arm, n: int, rng: np.random.Generator, kind: str = "filling") -> Array:
    """Poses (n, 6) in rad, rounded to 0.01 deg so that the table holds them exactly.

    The first n points of a scrambled Sobol sequence over 80 % of the limits that the couplings, the floor and
    the pedestal allow.
    """
    if kind == "paper":
        if arm.name != "xr701" or n != len(PAPER):
            raise ValueError("the paper's design is nine poses of the xr701")
        return np.radians(np.array([(0, *row, 0) for row in PAPER], dtype=float))
    middle, half = arm.limits.mean(1), 0.8 * np.diff(arm.limits, axis=1)[:, 0] / 2
    sequence = qmc.Sobol(6, seed=rng)
    found = np.zeros((0, 6))
    while len(found) < n:
        q = np.radians(np.round(np.degrees(middle + half * (2 * sequence.random(128) - 1)), 2))
        found = np.vstack([found, q[allowed(arm, q)]])
    return found[:n]


def cycles(arm: Arm, spec: SetSpec) -> list[tuple[Array, list[bool]]]:
    """Load vectors (m, 3) of each cycle and which of them are unloading."""
    up = np.array(LOADS[arm.name])
    loads = np.r_[up, up[::-1]] if spec.up_down else up
    unloading = [k >= len(up) for k in range(len(loads))]
    directions = [np.array([0, 0, -1.0])]
    if spec.load_axes == "xyz":
        directions += [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]
    return [(loads[:, None] * direction, unloading) for direction in directions]


def campaign(arm: Arm, spec: SetSpec, rng: np.random.Generator) -> Readings:
    """All readings in the order of time: pose by pose, its cycles repeated before the arm moves on."""
    q = poses(arm, spec.poses, rng, spec.design)
    order = rng.permutation(len(q))
    if spec.order == "sorted":
        tool = frames(arm, q).tool
        order = np.argsort(np.hypot(tool[:, 0], tool[:, 1]))
    q = q[order]
    one = cycles(arm, spec)
    rows_q, force, setup, cycle, unloading, repeat = [], [], [], [], [], []
    count = 0
    for p in range(len(q)):
        for r in range(spec.repeats):
            for loads, down in one:
                m = len(loads)
                rows_q.append(np.tile(q[p], (m, 1)))
                force.append(loads)
                setup += [p] * m
                cycle += [count] * m
                unloading += down
                repeat += [r + 1] * m
                count += 1
    n = len(setup)
    return Readings(
        q=np.vstack(rows_q),
        force=np.vstack(force),
        setup=np.array(setup),
        cycle=np.array(cycle),
        unloading=np.array(unloading),
        repeat=np.array(repeat),
        clock=np.linspace(0, 1, n),
        peak=np.zeros((count, 3)),
    )
