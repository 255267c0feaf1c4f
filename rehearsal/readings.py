"""Readings as they are taken: poses, loads, set-ups, cycles."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from robots.arrays import Array, Bools, Indices, Integers


@dataclass(frozen=True)
class Readings:
    """One row a reading, in the order they were taken. A cycle starts from the unloaded arm at rest."""

    q: Array  # (n, dof) rad, as written in the table
    force: Array  # (n, 3) N, as written in the table
    setup: Integers  # (n,) which pose was set up
    cycle: Integers  # (n,) rows of one cycle follow one another
    unloading: Bools
    repeat: Integers
    clock: Array  # (n,) 0 at the campaign's first reading, 1 at its last, beyond for extra readings
    peak: Array = field(default_factory=lambda: np.zeros(0))  # (cycles, 3) load reached before a cycle's first row
    moment: Array | None = None  # (n, 3) N m; None: none
    point: Array | None = None  # (n, 3) m in the flange frame where loads act and readings are taken; NaN: tool point

    def __len__(self) -> int:
        return len(self.q)

    @property
    def wrench(self) -> Array:
        """Loads as written (n, 6)."""
        return np.concatenate([self.force, np.zeros_like(self.force) if self.moment is None else self.moment], 1)

    @property
    def kinds(self) -> tuple[Array, Indices, Array | None]:
        """Distinct poses with their points: q (u, dof), which of them each reading has (n,), points (u, 3) if any."""
        if self.point is None:
            unique, index = np.unique(self.q, axis=0, return_inverse=True)
            return unique, index.ravel(), None
        # Where no point is given it is far away, for NaN equals nothing.
        both = np.concatenate([self.q, np.nan_to_num(self.point, nan=1e9)], 1)
        _, first, index = np.unique(both, axis=0, return_index=True, return_inverse=True)
        return self.q[first], index.ravel(), self.point[first]

    def moved(self, q: Array) -> Readings:
        """The same loads at other angles."""
        return replace(self, q=q)


def path_index(cycle: Integers) -> tuple[Integers, Integers]:
    """Row and column of each reading in a table with one row a cycle; column 0 is kept for the peak before it."""
    _, row = np.unique(cycle, return_inverse=True)
    start = np.r_[True, cycle[1:] != cycle[:-1]]
    first = np.maximum.accumulate(np.where(start, np.arange(len(cycle)), 0))
    return row, np.arange(len(cycle)) - first + 1


def in_cycles(
    q: Array, force: Array, unloading: Bools, repeat: Integers, highest: float, first_setup: int = 0
) -> tuple[Integers, Integers, Array]:
    """Set-up and cycle (n,) of readings in the order of time, and the load each cycle came down from (cycles, 3).

    A set-up ends where the pose changes; a cycle ends there too, where the repeat or the direction of the load
    changes, or where loading follows unloading. A cycle that begins with unloading comes down from ``highest`` N, or
    the largest load of all.
    """
    setup, cycle, peaks = np.zeros(len(q), int), np.zeros(len(q), int), []
    size = np.linalg.norm(force, axis=1)
    highest = max(size.max(initial=0.0), highest)
    for k in range(len(q)):
        new_setup = k == 0 or bool(np.any(q[k] != q[k - 1]))
        turned = k > 0 and force[k] @ force[k - 1] < 0.999 * size[k] * size[k - 1]
        new_cycle = new_setup or repeat[k] != repeat[k - 1] or turned or (unloading[k - 1] and not unloading[k])
        setup[k] = first_setup if k == 0 else setup[k - 1] + new_setup
        cycle[k] = 0 if k == 0 else cycle[k - 1] + new_cycle
        if new_cycle:
            direction = force[k] / size[k] if size[k] > 0 else np.zeros(3)
            peaks.append(highest * direction if unloading[k] else np.zeros(3))
    return setup, cycle, np.array(peaks).reshape(-1, 3)
