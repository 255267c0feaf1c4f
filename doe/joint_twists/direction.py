"""One stiffness of one joint, as identified: its law, its compliances by angle, how sure they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.stats import t as student

from doe.joint_twists.laws import Law
from robots.arrays import Array

Status = Literal["determined", "one-sided", "not judged", "not determined", "not identified"]


@dataclass(frozen=True, eq=False)
class Direction:
    """One stiffness of one joint.

    ``status``: determined; one-sided (rigid is possible: only a lower limit); not judged (a number without an
    interval: nothing tells how sure it is, and ``spread``, ``sd`` and the law's covariance are NaN); not determined
    (the best compliance is not positive: a lower limit at most); not identified (never loaded or never read).
    ``law`` is None where there is no number. ``mean`` and ``spread``: the compliance of all set-ups together, m/N or
    rad/(N m), and its standard deviation. ``angle`` (a,) rad, ``value`` and ``sd`` (a,): compliances by angle, without
    any law. ``degrees_of_freedom``: of Student's t in 95 % intervals. ``scores``: of the laws tried, lowest is best.
    """

    joint: str
    row: str
    status: Status
    law: Law | None
    mean: float
    spread: float
    angle: Array
    value: Array
    sd: Array
    degrees_of_freedom: float
    scores: Mapping[str, float] = field(default_factory=dict)

    @property
    def quantile(self) -> float:
        """Student's 97.5 % quantile."""
        return float(student.ppf(0.975, self.degrees_of_freedom))

    @property
    def unit(self) -> str:
        """Unit of the stiffness."""
        return "N/m" if self.row.startswith("t") else "N m/rad"

    def compliance(self, q: Array) -> tuple[Array, Array]:
        """Compliance (n,) at poses q (n, dof) and its standard deviation; NaN where there is no number."""
        if self.law is None:
            return np.full(len(q), np.nan), np.full(len(q), np.nan)
        return self.law.compliance(q)

    def stiffness(self, q: Array) -> tuple[Array, Array, Array]:
        """Stiffness (n,) at poses q and the ends of its 95 % interval (inf: no upper limit)."""
        c, sd = self.compliance(q)
        if self.law is None and self.status == "not determined":
            c, sd = np.full(len(q), self.mean), np.full(len(q), self.spread)
        low, high = c - self.quantile * sd, c + self.quantile * sd
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(low > 0.0, 1.0 / low, np.where(np.isnan(low), np.nan, np.inf))
            least = np.where(high > 0.0, 1.0 / high, np.nan)
        return (1.0 / c if self.law is not None else np.full(len(q), np.nan)), least, most
