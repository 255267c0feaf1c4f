"""Degrees of freedom of a parameter's variance, by Satterthwaite's method.

The variance of an estimate is itself estimated, from variances t of the noise with covariance W (twice the inverse of
``tr(P V_i P V_j)``, :mod:`doe.estimation.restricted_likelihood`). Matching the first two moments of a chi-square
distribution gives ``2 v^2 / (g^T W g)`` degrees of freedom for a variance v with slopes g = dv/dt (Giesbrecht and Burns
1985, doi:10.2307/2530872; Fai and Cornelius 1996, doi:10.1080/00949659608811740). With white noise alone that is
readings less parameters; where set-ups scatter, it is near the number of set-ups less parameters.

A variance that was found to be zero is as uncertain as one that was not, and counts: with nine set-ups readings can
hardly tell which kind of scatter there is, and intervals that take the choice for certain hold the truth 80 to 90 %
of the time where it was wrong (docs/validation/calibration_coverage.md).
"""

from __future__ import annotations

import math

import numpy as np

from doe.estimation.estimate import Estimate
from doe.estimation.noise import likelihood
from robots.arrays import Array, Bools


def degrees_of_freedom(e: Estimate, covariance: Array, seen: Bools) -> Array:
    """Degrees of freedom (p,) of the variances on the diagonal of ``covariance`` (p, p); infinite for given noise.

    ``seen`` (p,): which parameters took part in the fit. NaN where there are fewer readings than those.
    """
    p, names = e.problem, e.estimated
    if not names:
        return np.full(len(e.u), math.inf)
    of = likelihood(p, names, e.noise, e.prediction, e.jacobian[:, seen], e.residual, e.weight)
    if of.basis.shape[1] >= len(p):
        return np.full(len(e.u), math.nan)
    at = of.at(e.noise.variances(names))
    information = at.information()
    Y = at.V.solve(e.jacobian) @ covariance
    slopes = []
    for term in of.terms:
        if term.common:
            slopes.append(np.sum(of.blocks.add(term.pattern[:, None] * Y) ** 2, axis=0))
        else:
            slopes.append(term.pattern @ Y**2)
    g = np.array(slopes)
    scale = 1.0 / np.sqrt(np.diag(information))
    W = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-10, hermitian=True)
    spread = np.einsum("ip,ij,jp->p", g * scale[:, None], W, g * scale[:, None])
    v = np.diag(covariance)
    return np.asarray(np.where(spread > 0.0, 2.0 * v**2 / np.where(spread > 0.0, spread, 1.0), math.inf))
