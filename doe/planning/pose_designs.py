"""Sets of poses a robot can take: factorials, Latin hypercube, Sobol points. And a short way through such a set."""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np
from scipy.linalg import hadamard
from scipy.stats import qmc

from doe.planning.zones import Zone
from robots import InputError, Robot, require_one_of
from robots.arrays import Array, Integers

Method = Literal["factorial", "fractional", "latin", "sobol"]

METHODS: tuple[Method, ...] = ("factorial", "fractional", "latin", "sobol")
# Points drawn before a share of reachable poses below 1 in 1000 is called none.
MOST_DRAWN = 400_000
MOST_RUNS = 100_000
# Starts of the nearest-neighbour tours; sweeps of improvement.
MOST_STARTS, MOST_SWEEPS = 40, 50


def pose_design(
    robot: Robot,
    n: int,
    method: Method = "sobol",
    *,
    coordinates: tuple[str, ...] | None = None,
    fixed: Array | None = None,
    levels: int = 3,
    zone: Zone | None = None,
    rng: np.random.Generator | None = None,
) -> Array:
    """Poses (m, dof) rad that the robot can take; ``coordinates`` vary, the others stand at ``fixed`` (dof,) rad.

    Latin hypercube and Sobol give n poses: points that cannot be taken are replaced by further ones. Factorials give
    what is left of all their runs (``n`` is not used): full with ``levels`` in each coordinate; fractional with two,
    a Hadamard (Plackett-Burman) fraction of resolution III, at a quarter and three quarters of the ranges.

    Raises
    ------
    InputError
        Unknown method or coordinate, ranges in which hardly any pose can be taken, too many runs.
    """
    require_one_of("design of poses", method, METHODS, code="C005")
    names = robot.coordinates if coordinates is None else coordinates
    columns = [robot.coordinate_index(name) for name in names]
    base = np.clip(np.zeros(robot.dof), *robot.limits.T) if fixed is None else np.asarray(fixed, dtype=np.float64)
    low, high = robot.limits[columns].T
    if method in ("factorial", "fractional"):
        unit = _full(len(columns), levels) if method == "factorial" else _fraction(len(columns))
        return _allowed(robot, _poses(base, columns, low, high, unit), zone)
    if not 0 < n <= MOST_RUNS:
        raise InputError("poses of a design", code="C005", value=n, allowed=f"1 to {MOST_RUNS}")
    generator = np.random.default_rng(0) if rng is None else rng
    return _drawn(robot, n, method, base, columns, low, high, zone, generator)


def _drawn(
    robot: Robot,
    n: int,
    method: Method,
    base: Array,
    columns: list[int],
    low: Array,
    high: Array,
    zone: Zone | None,
    rng: np.random.Generator,
) -> Array:
    sampler: qmc.QMCEngine = (
        qmc.Sobol(len(columns), rng=rng) if method == "sobol" else qmc.LatinHypercube(len(columns), rng=rng)
    )
    kept: list[Array] = []
    found = drawn = 0
    while found < n:
        size = int(min(2 ** np.ceil(np.log2(max(4 * (n - found), 256))), 65536))
        if method == "latin" and not drawn:
            size = n
        drawn += size
        kept.append(_allowed(robot, _poses(base, columns, low, high, sampler.random(size)), zone))
        found += len(kept[-1])
        # Where nothing turned up among a tenth of them, nothing will.
        if found < n and (drawn > MOST_DRAWN or (not found and drawn > MOST_DRAWN / 10)):
            raise InputError(
                f"poses that {robot.name} can take: {found} of {drawn} tried",
                code="C005",
                allowed=f"{n} or more",
                remedy="widen the limits, lower the floor, move the boxes, or let more coordinates vary",
            )
    return np.concatenate(kept)[:n]


def _poses(base: Array, columns: list[int], low: Array, high: Array, unit: Array) -> Array:
    q = np.tile(base, (len(unit), 1))
    q[:, columns] = low + unit * (high - low)
    return q


def _allowed(robot: Robot, q: Array, zone: Zone | None) -> Array:
    q = q[robot.reachable(q)]
    return q if zone is None or len(q) == 0 else np.asarray(q[zone.free(robot, q)])


def _full(k: int, levels: int) -> Array:
    if levels < 2 or levels**k > MOST_RUNS:
        raise InputError(
            "levels of a full factorial",
            code="C005",
            value=levels,
            allowed=f"2 or more, at most {MOST_RUNS} runs in all",
        )
    return np.array(list(product(np.linspace(0.0, 1.0, levels), repeat=k)))


def _fraction(k: int) -> Array:
    size = 2 ** int(np.ceil(np.log2(k + 1)))
    return 0.5 + 0.25 * hadamard(size)[:, 1 : k + 1].astype(np.float64)


def travel(q: Array) -> Array:
    """Way (n, n) from pose to pose of q (n, dof) rad: joints move together, so the longest turn counts.

    A thousandth of the sum of all turns settles ties.
    """
    turn = np.abs(q[:, None] - q[None])
    return np.asarray(turn.max(axis=2) + 1e-3 * turn.sum(axis=2))


def length(way: Array, order: Integers) -> float:
    """Length of an open tour."""
    return float(way[order[:-1], order[1:]].sum())


def short_tour(q: Array) -> Integers:
    """Order (n,) of poses q (n, dof) rad for a short open tour: nearest neighbours, then 2-opt (Croes 1958).

    A good tour, not proven the shortest.
    """
    n = len(q)
    if n < 3:
        return np.arange(n)
    way = travel(q)
    tours = [_improved(way, _nearest(way, start)) for start in range(min(n, MOST_STARTS))]
    return min(tours, key=lambda tour: length(way, tour))


def _nearest(way: Array, start: int) -> Integers:
    order, left = [start], np.ones(len(way), dtype=np.bool_)
    left[start] = False
    while left.any():
        here = np.where(left, way[order[-1]], np.inf)
        order.append(int(np.argmin(here)))
        left[order[-1]] = False
    return np.array(order)


def _improved(way: Array, order: Integers) -> Integers:
    """Turn stretches of the tour round as long as that shortens it."""
    n = len(order)
    for _ in range(MOST_SWEEPS):
        changed = False
        for i in range(n - 1):
            # Reversing order[i..j] changes the steps before i and after j only.
            j = np.arange(i + 1, n)
            first, last = order[i], order[j]
            before = order[i - 1] if i else None
            following = order[np.minimum(j + 1, n - 1)]
            inside = j + 1 < n
            gain = np.where(inside, way[last, following] - way[first, following], 0.0)
            if before is not None:
                gain = gain + way[before, first] - way[before, last]
            best = int(np.argmax(gain))
            if gain[best] > 1e-12:
                order = order.copy()
                order[i : j[best] + 1] = order[i : j[best] + 1][::-1]
                changed = True
        if not changed:
            break
    return order
