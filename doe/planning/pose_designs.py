"""Sets of poses a robot can take: factorials, Latin hypercube, Sobol points; off the floor and out of fixtures.

And a short way through such a set.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.linalg import hadamard
from scipy.stats import qmc

from robots import InputError, Robot, forward_kinematics, require_one_of, tool_position
from robots.arrays import Array, Bools, Integers

Method = Literal["factorial", "fractional", "latin", "sobol"]

METHODS: tuple[Method, ...] = ("factorial", "fractional", "latin", "sobol")
# Points drawn before a share of reachable poses below 1 in 1000 is called none.
MOST_DRAWN = 400_000
# Between two joints the arm is looked at in so many points.
ALONG = 5
MOST_RUNS = 100_000
# Starts of the nearest-neighbour tours; sweeps of improvement.
MOST_STARTS, MOST_SWEEPS = 40, 50


@dataclass(frozen=True)
class Zone:
    """Where the arm must not be: below ``floor`` (m, base z; None: no floor) and inside ``boxes`` (b, 2, 3) m.

    ``own`` (m): how far wrist and tool (from the last but one joint on) keep from the line base - joint 2 - joint 3;
    arms of fewer than five joints are not tested for it. All is tested on the line through the joints to the tool,
    in points: keep boxes larger than the links are thick. No collision check: cables, fixtures and the shape of the
    casings are not known here.
    """

    floor: float | None = None
    boxes: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = ()
    own: float = 0.0

    def free(self, robot: Robot, q: Array) -> Bools:
        """Which poses q (n, dof) keep clear of it (n,)."""
        frames = forward_kinematics(robot, q)
        joints = [*np.moveaxis(frames.p[:, 1:], 1, 0), frames.p_flange, tool_position(robot, frames)]
        line = np.stack(joints, axis=1)
        share = np.linspace(0.0, 1.0, ALONG)[:, None]
        points = (line[:, :-1, None] * (1.0 - share) + line[:, 1:, None] * share).reshape(len(q), -1, 3)
        out = np.ones(len(q), dtype=np.bool_)
        if self.floor is not None:
            # The joints before the arm leaves the base stand where they stand.
            moving = points[:, ALONG:] if robot.dof > 1 else points
            out &= (moving[:, :, 2] >= self.floor).all(axis=1)
        for low, high in self.boxes:
            inside = np.all((points >= np.array(low)) & (points <= np.array(high)), axis=2)
            out &= ~np.any(inside, axis=1)
        if self.own > 0.0 and robot.dof >= 5:
            end = points[:, -2 * ALONG :] if robot.dof < 6 else points[:, -3 * ALONG :]
            for k in range(3):
                out &= (_distance(end, frames.p[:, k], frames.p[:, k + 1]) >= self.own).all(axis=1)
        return out


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Distance (n, m) of points (n, m, 3) from the segments start (n, 3) to end (n, 3)."""
    way = (end - start)[:, None]
    off = points - start[:, None]
    length = np.maximum(np.sum(way**2, axis=2), 1e-30)
    share = np.clip(np.sum(off * way, axis=2) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - share[..., None] * way, axis=2))


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
    require_one_of("design of poses", method, METHODS)
    names = robot.coordinates if coordinates is None else coordinates
    columns = [robot.coordinate_index(name) for name in names]
    base = np.clip(np.zeros(robot.dof), *robot.limits.T) if fixed is None else np.asarray(fixed, dtype=np.float64)
    low, high = robot.limits[columns].T
    if method in ("factorial", "fractional"):
        unit = _full(len(columns), levels) if method == "factorial" else _fraction(len(columns))
        return _allowed(robot, _poses(base, columns, low, high, unit), zone)
    if not 0 < n <= MOST_RUNS:
        raise InputError("poses of a design", value=n, allowed=f"1 to {MOST_RUNS}")
    generator = np.random.default_rng(0) if rng is None else rng
    return _drawn(robot, n, method, base, columns, low, high, zone, generator)


def _drawn(
    robot: Robot, n: int, method: Method, base: Array, columns: list[int], low: Array, high: Array,
    zone: Zone | None, rng: np.random.Generator,
) -> Array:  # fmt: skip
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
            "levels of a full factorial", value=levels, allowed=f"2 or more, at most {MOST_RUNS} runs in all"
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
