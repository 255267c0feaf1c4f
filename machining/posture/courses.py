"""Cheapest course through layers of states: dynamic programming, exact for the states and links that there are.

A layer holds the poses that the arm may take at one path point. Two poses of neighbouring layers are linked if no
joint moves farther than it may. A course takes one state a layer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Bools, Integers

# A motion of exactly the allowed size must not fail by rounding.
ROUNDING = 1.0 + 1e-9
# Up to so many pairs of states all are looked at; a search tree for the near ones only pays beyond.
FEW_PAIRS = 2000
# Rad that a unit of motion is at least.
SMALLEST = 1e-6
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

    def kept(self, keep: Bools) -> Layers:
        """Those of the states (k,) that are to be kept."""
        start = np.concatenate([[0], np.cumsum(keep)]).astype(np.int64)[self.start]
        return Layers(start, self.q[keep], self.gamma[keep], self.cost[keep], self.merit[keep])

    def behind(self, before: Layers) -> Layers:
        """These layers with the last one of others in front."""
        rows = before.rows(before.n - 1)
        start = np.concatenate([[0], self.start + (rows.stop - rows.start)])
        pairs = ((getattr(before, name)[rows], getattr(self, name)) for name in ("q", "gamma", "cost", "merit"))
        return Layers(start, *(np.concatenate(pair) for pair in pairs))


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

    def at(self, segments: slice) -> Links:
        """Those of some segments."""
        return Links(self.step[segments], self.turns(segments), self.unit[segments], self.weight)

    def in_units(self, unit: Array) -> Links:
        """The same, whose cost is in ``unit`` (n - 1,) rad for all joints where that is less than their own."""
        return Links(self.step, self.gamma_step, np.clip(unit[:, None], SMALLEST, self.unit), self.weight)

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
        # Joint by joint: sums over a last axis of six are slow.
        total = np.zeros(dq.shape[:-1])
        for j in range(dq.shape[-1]):
            total += (dq[..., j] / unit[..., j]) ** 2
        return np.asarray(self.weight * (total / dq.shape[-1]))


@dataclass(frozen=True, eq=False)
class Gap:
    """No link leads on from layer ``after``: ``poses`` (2, dof) rad of the nearest pair of states, there and behind.

    ``excess``: the largest share of the allowed step between them; 1 or less if gamma is in the way.
    """

    after: int
    poses: Array
    excess: float


@dataclass(frozen=True, eq=False)
class Ahead:
    """What is known at the last layer: ``value`` (k,) of each state, and for all layers but the first ``source``.

    ``source`` (s,): which state of the layer before leads to it best, the layers one after another.
    """

    value: Array
    source: NDArray[np.int32]


def cheapest_course(layers: Layers, links: Links) -> Integers | Gap:
    """Indices (n,) of the states of the cheapest course, or where all courses end."""
    ahead = least_cost(layers, links, layers.cost[layers.rows(0)])
    return ahead if isinstance(ahead, Gap) else trace(layers.start, ahead.source, int(np.argmin(ahead.value)))


def least_cost(layers: Layers, links: Links, total: Array) -> Ahead | Gap:
    """Least cost of each state of the last layer if those of the first have ``total`` (k,)."""
    sources: list[Integers] = []
    i = 0
    while i < layers.n - 1:
        onto = layers.rows(i + 1)
        many = (onto.stop - onto.start) * len(total) > FEW_PAIRS
        for known in [None] if many else _runs(_dense_run(layers, links, i)):
            if known is None:
                totals, through, source = _near_ones(layers, links, i, total)
            else:
                step = _side_by_side if len(known) > 1 else _crossing
                totals, through, source = step(layers, i, total, known)
            open_ = (through < np.inf).any(axis=1)
            if not open_.all():
                lost = int(np.argmin(open_))
                return _gap(layers, links, i + lost, np.isfinite(totals[lost]))
            total, i = totals[-1], i + len(through)
            sources.append(source)
    return Ahead(total, np.concatenate([np.zeros(0, dtype=np.int32), *sources], dtype=np.int32))


def _runs(known: Array) -> Iterator[Array]:
    """Costs (count, k, m) of links of layers, split where no states cross over between them, and singly elsewhere."""
    count, k, m = known.shape
    alone = np.zeros(count, dtype=np.bool_)
    if k == m:
        alone = np.asarray(~np.isfinite(known[:, ~np.eye(k, dtype=np.bool_)]).any(axis=1))
    yield from np.split(known, np.flatnonzero(~(alone[1:] & alone[:-1])) + 1)


# Costs of states at layer i and those after it, costs after each link, and the sources of all but layer i.
_Costs = tuple[Sequence[Array], Array, Integers]


def _side_by_side(layers: Layers, i: int, total: Array, known: Array) -> _Costs:
    """Costs along layers whose states are linked with those at the same place only."""
    count, k = known.shape[:2]
    first = int(layers.start[i + 1])
    steps = np.empty((2 * count + 1, k))
    steps[0], steps[1::2] = total, np.diagonal(known, axis1=1, axis2=2)
    steps[2::2] = layers.cost[first : first + count * k].reshape(count, k)
    sums = np.cumsum(steps, axis=0)
    return list(sums[::2]), sums[1::2], np.tile(np.arange(k), count)


def _crossing(layers: Layers, i: int, total: Array, known: Array) -> _Costs:
    """Costs from a layer to the next, any of whose states may be linked."""
    through = total[:, None] + known[0]
    source = through.argmin(axis=0)
    best = through[source, np.arange(len(source))]
    return (total, best + layers.cost[layers.rows(i + 1)]), best[None], source


def _near_ones(layers: Layers, links: Links, i: int, total: Array) -> _Costs:
    """The same where there are so many states that only those near to one another are looked at."""
    onto = layers.rows(i + 1)
    a, b = _pairs(layers, links, i, np.isfinite(total))
    dq = layers.q[onto][b] - layers.q[layers.rows(i)][a]
    best, source = _least(total[a] + links.cost(i, dq), a, b, onto.stop - onto.start)
    return (total, best + layers.cost[onto]), best[None], source


def highest_floor(layers: Layers, links: Links) -> float | Gap:
    """Largest merit that some course nowhere goes below, or where all courses end."""
    ahead = floors(layers, links, layers.merit[layers.rows(0)])
    return ahead if isinstance(ahead, Gap) else float(ahead.value.max())


def floors(layers: Layers, links: Links, floor: Array) -> Ahead | Gap:
    """Floor of the best course to each state of the last layer if those to the first have ``floor`` (k,)."""
    for i in range(layers.n - 1):
        a, b = _pairs(layers, links, i, np.isfinite(floor))
        onto = layers.rows(i + 1)
        lost, _ = _least(-floor[a], a, b, onto.stop - onto.start)
        if not np.isfinite(lost).any():
            return _gap(layers, links, i, np.isfinite(floor))
        floor = np.minimum(-lost, layers.merit[onto])
    return Ahead(floor, np.zeros(0, dtype=np.int32))


def course_cost(links: Links, q: Array, cost: Array) -> float:
    """Cost of a course of poses q (n, dof) rad whose states cost (n,); its links are not checked."""
    return float(cost.sum() + links.cost(slice(None), np.diff(q, axis=0)).sum())


def summed(steps: Array, knots: Integers) -> Array:
    """What segments (n - 1, ...) between points come to from knot to knot, (k - 1, ...)."""
    return np.asarray(np.add.reduceat(steps, knots[:-1], axis=0) if len(knots) > 1 else steps[:0])


def _dense_run(layers: Layers, links: Links, i: int) -> Array:
    """Costs (count, k, m) of all links from layer i to the next, and from those after it that have as many states.

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
    far = np.zeros(dq.shape[:-1], dtype=np.bool_)
    for j in range(dq.shape[-1]):
        far |= np.abs(dq[..., j]) > links.step[i : i + count, j, None, None] * ROUNDING
    most = links.turns(slice(i, i + count))
    if np.isfinite(most).any():
        turn = layers.gamma[onto][:, None] - layers.gamma[rows][:, :, None]
        far |= _short_way(turn) > most[:, None, None] * ROUNDING + 1e-12
    return np.where(far, np.inf, links.cost(slice(i, i + count), dq))


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


def trace(start: Integers, source: NDArray[np.int32], last: int) -> Integers:
    """Indices (n,) of the states of the course that ends in state ``last`` of the last of n layers.

    ``start`` (n + 1,) and ``source`` as in :class:`Layers` and :class:`Ahead`.
    """
    n = len(start) - 1
    course = np.empty(n, dtype=np.int64)
    course[-1] = last
    place = start - start[min(1, n)]
    for i in range(n - 2, -1, -1):
        course[i] = source[place[i + 1] + course[i + 1]]
    return course + start[:-1]


def _gap(layers: Layers, links: Links, i: int, open_: Bools) -> Gap:
    before, behind = layers.start[i] + np.flatnonzero(open_), np.arange(layers.start[i + 1], layers.start[i + 2])
    least = (np.inf, int(before[0]), int(behind[0]))
    for a in before:
        share = (np.abs(layers.q[behind] - layers.q[a]) / links.step[i]).max(axis=1)
        b = int(np.argmin(share))
        if share[b] < least[0]:
            least = (float(share[b]), int(a), int(behind[b]))
    excess, a, b = least
    return Gap(i, layers.q[[a, b]], excess)
