"""How far a reading that was not used may lie from its prediction: 95 % intervals, and how many readings they hold.

The variance of a reading's error is that of its own scatter (gauge, share of the deflection, and its set-up's, in which
the lack of fit shows) and what the parameters' covariance makes of the prediction: ``v = s^2 + J S J^T``. Both are by a
noise that was itself estimated; Satterthwaite's degrees of freedom of v give Student's quantile
(:func:`doe.certainty.uncertainty.satterthwaite`).

Readings that brought their own standard deviations say nothing of a lack of fit by these: where the residuals are
larger, all is widened by Birge's ratio, the root of chi-square over its degrees of freedom (Birge 1932,
doi:10.1103/PhysRev.40.207).

Limits of validity: first order in the parameters, and lack of fit that is alike at poses read and not read. Far beyond
the angles and loads that were read a model that misses something is off by more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from doe.certainty.uncertainty import satterthwaite
from doe.estimation.estimate import Estimate
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from robots.arrays import Array

# A share of normal errors in an interval of 95 %.
UPPER = 0.975


@dataclass(frozen=True)
class Coverage:
    """How many readings that were predicted with an interval lie in it."""

    inside: int
    readings: int

    @property
    def share(self) -> float:
        """Of the readings; NaN without any."""
        return self.inside / self.readings if self.readings else float("nan")

    @staticmethod
    def of(error: Array, half: Array) -> Coverage:
        """Of errors (m,) and half widths (m,) of intervals about the predictions; NaN where there is none."""
        known = ~np.isnan(error) & ~np.isnan(half)
        return Coverage(int((np.abs(error[known]) <= half[known]).sum()), int(known.sum()))


def birge(e: Estimate) -> tuple[float, float]:
    """Factor on variances by noise that was given, and the residuals' degrees of freedom; 1 for estimated noise."""
    spare = float(len(e.problem) - int(e.seen.sum()))
    if e.estimated or spare <= 0.0:
        return 1.0, spare
    white = e.covariance.whiten(e.residual[:, None])
    return max(float(np.sum(white**2)) / spare, 1.0), spare


def half_width95(
    e: Estimate,
    p: Problem,
    f: Array,
    parts: Array,
    covariance: Array,
    J: Array,
    *,
    less: int = 0,
    share: Array | float = 1.0,
) -> Array:
    """Half widths (n,) of the 95 % intervals of readings ``p`` that the estimate has not seen, predicted as f (n,).

    ``parts`` (n,): variance by the parameters, by the noise of ``e``; ``covariance`` (q, q) and derivatives J (n, q):
    of the variables of ``e``, for the degrees of freedom. ``less``: how many readings behind ``e`` do not count, for
    they were left out; ``share``: variance of the noise without these, over that of ``e``. NaN where no reading
    is to spare.
    """
    given, spare = birge(e)
    left = spare - less
    own = e.noise.spread(p, f) ** 2
    if e.estimated:
        if left <= 0.0:
            return np.full(len(f), np.nan)
        whole = own + np.einsum("ni,ij,nj->n", J, covariance, J)
        dof = satterthwaite(e, covariance, e.seen, J.T, whole, _patterns(e.estimated, p, f)) * left / spare
    else:
        dof = np.full(len(f), left if given > 1.0 and left > 0.0 else np.inf)
    quantile = stdtrit(np.clip(dof, 1.0, 1e9), UPPER)
    return np.asarray(quantile * np.sqrt(given * (share if e.estimated else 1.0) * (own + parts)))


def _patterns(names: tuple[str, ...], p: Problem, f: Array) -> Array:
    """Slopes (k, n) of the readings' own variances by the variances named."""
    zero, out = Noise((0.0, 0.0)), []
    for name in names:
        out.append(zero.with_variances((name,), np.ones(1)).spread(p, f) ** 2)
    return np.where(np.isnan(p.sigma) | np.array([n.startswith("pose") for n in names])[:, None], np.array(out), 0.0)
