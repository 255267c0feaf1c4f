"""Poses that fill the reachable ranges, and the campaign of loads measured at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc

from rehearsal.arm import Arm
from rehearsal.kinematics import CLEAR, allowed
from rehearsal.readings import Readings
from robots.arrays import Array, Bools
from robots.errors import InputError

# Points drawn before an arm is taken to have no such poses.
MOST_DRAWN = 128 * 400


def filling(arm: Arm, n: int, rng: np.random.Generator, clear: tuple[float, float] = CLEAR) -> Array:
    """Poses (n, dof) within 80 % of the limits that the couplings, the floor and the pedestal allow."""
    half = 0.8 * np.diff(arm.limits, axis=1)[:, 0] / 2
    found = between(arm, arm.limits.mean(1), half, n, rng, lambda q: allowed(arm, q, clear=clear))
    if len(found) < n:
        raise InputError(
            f"poses of {arm.name}",
            code="C005",
            value=len(found),
            allowed=f"{n} within 80 % of the limits and all couplings",
            remedy="give a sheet with poses that it can take",
        )
    return found


def between(
    arm: Arm, middle: Array, half: Array, n: int, rng: np.random.Generator, good: Callable[[Array], Bools]
) -> Array:
    """Poses (n, dof) in rad, rounded to 0.01 deg so that a table holds them exactly; fewer where there are hardly any.

    The first n points of a scrambled Sobol sequence over the ranges ``middle`` +- ``half`` that are ``good``.
    """
    sequence = qmc.Sobol(arm.dof, seed=rng)
    found, drawn = np.zeros((0, arm.dof)), 0
    while len(found) < n and drawn < MOST_DRAWN:
        q = np.radians(np.round(np.degrees(middle + half * (2 * sequence.random(128) - 1)), 2))
        found, drawn = np.vstack([found, q[good(q)]]), drawn + 128
    return found[:n]


def poses_of(arm: Arm, n: int, rng: np.random.Generator) -> Array:
    """Poses (n, dof) that keep clear of floor and pedestal by shares of the reach, where the arm has such poses."""
    try:
        return filling(arm, n, rng, (0.05 * arm.reach, 0.2 * arm.reach))
    except InputError:
        return filling(arm, n, rng, (-np.inf, 0.0))


def repeated(q: Array, cycles: Sequence[tuple[Array, Sequence[bool]]], repeats: int) -> Readings:
    """All readings in the order of time: pose by pose, its cycles repeated before the arm moves on.

    ``cycles``: load vectors (m, 3) of each and which of them are unloading.
    """
    rows_q, force = list[Array](), list[Array]()
    setup, cycle, unloading, repeat = list[int](), list[int](), list[bool](), list[int]()
    count = 0
    for p in range(len(q)):
        for r in range(repeats):
            for loads, down in cycles:
                m = len(loads)
                rows_q.append(np.tile(q[p], (m, 1)))
                force.append(loads)
                setup += [p] * m
                cycle += [count] * m
                unloading += down
                repeat += [r + 1] * m
                count += 1
    return Readings(
        q=np.vstack(rows_q),
        force=np.vstack(force),
        setup=np.array(setup),
        cycle=np.array(cycle),
        unloading=np.array(unloading),
        repeat=np.array(repeat),
        clock=np.linspace(0, 1, len(setup)),
        peak=np.zeros((count, 3)),
    )


def up_and_down(sizes: Sequence[float], direction: Array) -> tuple[Array, list[bool]]:
    """One cycle (2 m, 3) through rising loads and back, and which of its readings are unloading."""
    up = np.array(sizes)
    loads = np.r_[up, up[::-1]]
    return loads[:, None] * direction, [k >= len(up) for k in range(len(loads))]
