"""What a passive arm can do under its loads, whatever its springs: the yardstick for readings before any calibration.

A passive arm gives way by ``d = sum_j c_j a_j`` with compliances c_j >= 0: ``a_j`` what a spring about joint j's axis
gives (:func:`fem.statics.flexibility.spring_influence`), what the links give, free to be more or less than the model
has it, and something in series with the arm that gives along the force (tool, fixture, foundation). Readings that no
such arm comes near are no deflections of this arm, whatever numbers a calibration makes of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from doe.estimation.problem import Problem
from fem import spring_influence
from robots.arrays import Array, Integers

# Ways of giving that move readings by less than this share of what the strongest one does are rounding.
BLIND = 1e-12


@dataclass(frozen=True)
class PassiveArm:
    """m read components beside what a passive arm can do.

    ``ways`` (m, k): what each way of giving adds to the readings, per unit of it (m or rad); ``value`` (m,) as read;
    ``row`` (m,): reading it belongs to, ``component`` (m,): 0..5; ``setup`` (n, d): joints, load and point of each
    reading.
    """

    ways: Array
    value: Array
    row: Integers
    component: Integers
    setup: Array

    @staticmethod
    def of(p: Problem) -> PassiveArm:
        """The arm with a problem's geometry, links and load path, and the problem's readings."""
        at = p.free.at
        influence, rest = spring_influence(p.free.model, at.q, at.wrench, at.point)
        series = np.where(p.component < 3, at.wrench[p.row, p.component], 0.0)
        ways = np.column_stack([influence[p.row, :, p.component], rest[p.row, p.component], series])
        return PassiveArm(ways, p.value, p.row, p.component, np.column_stack([at.q, at.wrench, at.point]))

    def over(self, size: Array) -> PassiveArm:
        """The same with readings over ``size`` (m,), and each way of giving of length one; blind ones are left out."""
        ways = self.ways / size[:, None]
        norm = np.linalg.norm(ways, axis=0)
        seen = norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300)
        return PassiveArm(ways[:, seen] / norm[seen], self.value / size, self.row, self.component, self.setup)

    def fit(self) -> tuple[Array, int]:
        """Readings (m,) of the passive arm nearest to what was read, and in how many ways it gives."""
        if not self.ways.shape[1]:
            return np.zeros(len(self.value)), 0
        amount, _ = nnls(self.ways, self.value)
        return np.asarray(self.ways @ amount), int(np.count_nonzero(amount))
