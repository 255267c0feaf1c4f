"""Cheapest course through layers of states: dynamic programming, exact for the states and links that there are.

A layer holds the poses that the arm may take at one path point. Two poses of neighbouring layers are linked if no
joint moves farther than it may. A course takes one state a layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools, Integers

# A motion of exactly the allowed size must not fail by rounding.
ROUNDING = 1.0 + 1e-9
# Up to so many pairs of states all are looked at; a search tree for the near ones only pays beyond.
FEW_PAIRS = 2000
# Layers whose links are worked out at once.
RUN = 256


@dataclass(frozen=True, eq=False)
class Layers:
    """States of n layers, sorted by layer.

    ``start`` (n + 1,) offsets of the layers, ``q`` (k, dof) rad, ``gamma`` (k,) rad, ``cost`` (k,) of being there,
    ``merit`` (k,) large is good.
    """

    start: Integers
    q: Array
    gamma: Array
    cost: Array
    merit: Array

    @property
    def n(self) -> int:
        """Number of layers."""
        return len(self.start) - 1

    def rows(self, i: int) -> slice:
        """States of layer i."""
        return slice(int(self.start[i]), int(self.start[i + 1]))


@dataclass(frozen=True, eq=False)
class Links:
    """What links states.

    ``step`` (n - 1, dof) rad each joint may move, inf for any; ``gamma_step`` rad, one for all or (n - 1,), likewise.
    The cost of a link is ``weight * mean over joints of (dq / unit)^2`` with ``unit`` (n - 1, dof) rad.
    """

    step: Array
    gamma_step: float | Array
    unit: Array
    weight: float

    def turns(self, some: slice) -> Array:
        """How far gamma may change from layers to the next, (k,) rad."""
        return np.broadcast_to(np.asarray(self.gamma_step, dtype=np.float64), len(self.step))[some]

    def cost(self, i: int | slice, dq: Array) -> Array:
        """Cost (...) of motions dq (..., dof) rad from layer i to the next; of several: dq (layers, ..., dof)."""
        if self.weight == 0.0:
            return np.zeros(dq.shape[:-1])
        unit = self.unit[i]
        if unit.ndim == 2:
            unit = np.expand_dims(unit, tuple(range(1, dq.ndim - 1)))
        return np.asarray(self.weight * ((dq / unit) ** 2).mean(axis=-1))


@dataclass(frozen=True)
class Gap:
    """No link leads on from layer ``after``: the nearest pair of states ``before`` and ``behind`` of all layers.

    ``dq`` (dof,) rad between them, ``excess`` the largest share of the allowed step; 1 or less if gamma is in the way.
    """

    after: int
    before: int
    behind: int
    dq: Array
    excess: float


def cheapest_course(layers: Layers, links: Links) -> Integers | Gap:
    """Indices (n,) of the states of the cheapest course, or where all courses end."""
    total = layers.cost[layers.rows(0)]
    back: list[Integers] = []
    known: list[Array] = []
    for i in range(layers.n - 1):
        onto = layers.rows(i + 1)
        if (onto.stop - onto.start) * len(total) <= FEW_PAIRS:
            if not known:
                known = _dense_run(layers, links, i)
            through = total[:, None] + known.pop()
            source = through.argmin(axis=0)
            best = through[source, np.arange(len(source))]
        else:
            known = []
            a, b = _pairs(layers, links, i, np.isfinite(total))
            dq = layers.q[onto][b] - layers.q[layers.rows(i)][a]
            best, source = _least(total[a] + links.cost(i, dq), a, b, onto.stop - onto.start)
        if not best.min() < np.inf:
            return _gap(layers, links, i, np.isfinite(total))
        total = best + layers.cost[onto]
        back.append(source)
    return _trace(layers, back, int(np.argmin(total)))


def highest_floor(layers: Layers, links: Links) -> float | Gap:
    """Largest merit that some course nowhere goes below, or where all courses end."""
    floor = layers.merit[layers.rows(0)]
    for i in range(layers.n - 1):
        a, b = _pairs(layers, links, i, np.isfinite(floor))
        onto = layers.rows(i + 1)
        lost, _ = _least(-floor[a], a, b, onto.stop - onto.start)
        if not np.isfinite(lost).any():
            return _gap(layers, links, i, np.isfinite(floor))
        floor = np.minimum(-lost, layers.merit[onto])
    return float(floor.max())


def course_cost(layers: Layers, links: Links, course: Integers) -> float:
    """Cost of a course; its links are not checked."""
    dq = np.diff(layers.q[course], axis=0)
    return float(layers.cost[course].sum() + links.cost(slice(None), dq).sum())


def summed(steps: Array, knots: Integers) -> Array:
    """What segments (n - 1, ...) between points come to from knot to knot, (k - 1, ...)."""
    return np.asarray(np.add.reduceat(steps, knots[:-1], axis=0) if len(knots) > 1 else steps[:0])


def _dense_run(layers: Layers, links: Links, i: int) -> list[Array]:
    """Costs (k, m) of all links from layer i to the next, and from those after it that have as many states; last first.

    Along most of a path every point allows the same branches: the links of many points are worked out together.
    """
    sizes = np.diff(layers.start[i : i + RUN + 2])
    k, m = int(sizes[0]), int(sizes[1])
    others = np.flatnonzero(sizes[1:] != m)
    count = 1 if k != m else int(others[0]) if len(others) else len(sizes) - 1
    first = int(layers.start[i])
    rows = first + np.arange(k) + k * np.arange(count)[:, None]
    onto = first + k + np.arange(m) + m * np.arange(count)[:, None]
    dq = layers.q[onto][:, None] - layers.q[rows][:, :, None]
    far = (np.abs(dq) > links.step[i : i + count, None, None] * ROUNDING).any(axis=3)
    most = links.turns(slice(i, i + count))
    if np.isfinite(most).any():
        turn = layers.gamma[onto][:, None] - layers.gamma[rows][:, :, None]
        far |= _short_way(turn) > most[:, None, None] * ROUNDING + 1e-12
    return list(np.where(far, np.inf, links.cost(slice(i, i + count), dq)))[::-1]


def _pairs(layers: Layers, links: Links, i: int, open_: Bools) -> tuple[Integers, Integers]:
    """States of layer i that a course leads to, and states of the next that they are linked with."""
    sources = np.flatnonzero(open_)
    A, B = layers.q[layers.rows(i)][sources], layers.q[layers.rows(i + 1)]
    if np.isfinite(links.step[i]).any():
        scale = np.where(np.isfinite(links.step[i]), 1.0 / links.step[i], 0.0)
        from scipy.spatial import cKDTree

        # Neighbours in the largest share of its step that any joint moves.
        found = cKDTree(A * scale).sparse_distance_matrix(cKDTree(B * scale), ROUNDING, p=np.inf, output_type="ndarray")
        a, b = found["i"].astype(np.int64), found["j"].astype(np.int64)
    else:
        a, b = (index.ravel() for index in np.indices((len(A), len(B))))
    most = float(links.turns(slice(i, i + 1))[0])
    if np.isfinite(most):
        turn = layers.gamma[layers.rows(i + 1)][b] - layers.gamma[layers.rows(i)][sources][a]
        near = _short_way(turn) <= most * ROUNDING + 1e-12
        a, b = a[near], b[near]
    return sources[a], b


def _short_way(turn: Array) -> Array:
    return np.abs(turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi)))


def _least(value: Array, a: Integers, b: Integers, size: int) -> tuple[Array, Integers]:
    """Least value and its source a for each of ``size`` targets b; inf and -1 where there is none."""
    best, source = np.full(size, np.inf), np.full(size, -1, dtype=np.int64)
    # Sorted by target, then value, then source: the first of each target is the least, ties by order.
    order = np.lexsort((a, value, b))
    target = b[order]
    first = order[np.flatnonzero(np.diff(target, prepend=-1))]
    best[b[first]], source[b[first]] = value[first], a[first]
    return best, source


def _trace(layers: Layers, back: list[Integers], last: int) -> Integers:
    course = np.empty(layers.n, dtype=np.int64)
    course[-1] = last
    for i in range(layers.n - 2, -1, -1):
        course[i] = back[i][course[i + 1]]
    return course + layers.start[:-1]


def _gap(layers: Layers, links: Links, i: int, open_: Bools) -> Gap:
    before, behind = layers.start[i] + np.flatnonzero(open_), np.arange(layers.start[i + 1], layers.start[i + 2])
    least = (np.inf, int(before[0]), int(behind[0]))
    for a in before:
        share = (np.abs(layers.q[behind] - layers.q[a]) / links.step[i]).max(axis=1)
        b = int(np.argmin(share))
        if share[b] < least[0]:
            least = (float(share[b]), int(a), int(behind[b]))
    excess, a, b = least
    return Gap(i, a, b, layers.q[b] - layers.q[a], excess)
