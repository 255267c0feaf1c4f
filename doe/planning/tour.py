"""A short way through a set of poses."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array, Integers

# Starts of the nearest-neighbour tours; sweeps of improvement.
MOST_STARTS, MOST_SWEEPS = 40, 50


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
