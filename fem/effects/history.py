"""The order in which loads were put on and taken off, for effects with a memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools, Indices


@dataclass(frozen=True)
class History:
    """When n readings were taken.

    ``cycle`` (n,): number of the load cycle a reading belongs to, each of which starts unloaded; ``order`` (n,): its
    place in the cycle, from 0, equal for readings taken at one time; ``clock`` (n,): time in the whole campaign, 0 at
    the first reading, 1 at the last; NaN where it is not known. ``is_known``: whether loading and unloading are told
    apart; else each reading is taken as a loading from zero.
    """

    cycle: Indices
    order: Indices
    clock: Array
    is_known: bool

    def unloading(self, size: Array) -> Bools:
        """Whether readings (n,) were taken on the way down; ``size`` (n,): of their loads.

        That is, a larger load came before in the cycle.
        """
        most = np.zeros(int(self.cycle.max(initial=-1)) + 1)
        out = np.zeros(len(size), dtype=bool)
        for step in range(int(self.order.max(initial=-1)) + 1):
            now = np.flatnonzero(self.order == step)
            mine = self.cycle[now]
            out[now] = size[now] < most[mine] - 1e-9
            np.maximum.at(most, mine, size[now])
        return out

    def play(self, x: Array, width: Array | float) -> Array:
        """The play operator over every cycle: y (n,) follows x (n,) at a distance of at most ``width``.

        ``y_i = max(x_i - r, min(x_i + r, y_(i-1)))`` with y = 0 before the first (Visintin 1994,
        doi:10.1007/978-3-662-11557-2, ch. III).
        """
        r = np.broadcast_to(np.asarray(width, dtype=np.float64), x.shape)
        y, last = np.zeros(len(x)), np.zeros(int(self.cycle.max(initial=-1)) + 1)
        for step in range(int(self.order.max(initial=-1)) + 1):
            now = np.flatnonzero(self.order == step)
            mine = self.cycle[now]
            y[now] = np.maximum(x[now] - r[now], np.minimum(x[now] + r[now], last[mine]))
            last[mine] = y[now]
        return y

    def take(self, rows: Indices) -> History:
        """The history of some readings; a memory only knows what is still there, so keep whole cycles."""
        cycle = np.unique(self.cycle[rows], return_inverse=True)[1].astype(np.intp)
        return History(cycle, self.order[rows], self.clock[rows], self.is_known)


def plain_history(n: int) -> History:
    """Each of n readings a loading of its own, from zero; no clock."""
    return History(np.arange(n), np.zeros(n, dtype=np.intp), np.full(n, np.nan), is_known=False)
