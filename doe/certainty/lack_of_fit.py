"""Is the model wrong beyond the noise? Pure error from replicates, the F test, chi-square, outliers, patterns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, f

from doe.estimation.estimate import OUTLIER, Estimate
from doe.estimation.least_squares import spanning
from robots.arrays import Array, Indices

# Beyond this many standard deviations a reading is named as an outlier: one in 16 000 good ones is.
FLAGGED = 4.0
# Directions whose singular value is below this share of the largest are rounding (columns of norm one).
ROUNDING = 1e-9


@dataclass(frozen=True)
class LackOfFit:
    """Tests of an estimate against the scatter of its replicates.

    ``pure_error_m``: standard deviation of replicates of translations (NaN without any); ``pure_dof``;
    ``ratio``: F = mean square of the lack of fit over that of pure error, in units of each reading's variance;
    ``fit_dof``; ``p_value`` (NaN without replicates or spare groups). ``chi_square`` and ``chi_dof``: of the
    residuals against the noise as estimated (close to one another by construction when the noise was free).
    """

    pure_error_m: float
    pure_dof: int
    ratio: float
    fit_dof: int
    p_value: float
    chi_square: float
    chi_dof: int
    chi_p_value: float


def lack_of_fit(e: Estimate) -> LackOfFit:
    """Classical test of lack of fit (Draper and Smith, Applied Regression Analysis, 3rd ed., section 2.1).

    Readings are weighted by their white variance, and what the parameters could still follow with these weights (the
    estimate itself may weigh set-ups) is taken out: then the ratio has an F distribution if the model is right.
    Parameters at an end of their range follow nothing and do not count as fitted. What set-ups have in common is in
    the numerator: a set-up's scatter looks like lack of fit to this test, and the estimated noise beside it says how
    much of it that may be. The chi-square test is one of the noise where that was given: noise that was estimated from
    the same residuals agrees with them by construction.
    """
    p = e.problem
    w = np.sqrt(e.weight / e.noise.variance(p, e.prediction))
    groups = int(p.replicate.max()) + 1
    count = np.bincount(p.replicate, minlength=groups)
    # Weighted mean residual of each group; readings of a group share their prediction, so weights are equal but for
    # given sigmas and outliers.
    mean = np.bincount(p.replicate, w**2 * e.residual, minlength=groups) / np.bincount(
        p.replicate, w**2, minlength=groups
    )
    within = e.residual - mean[p.replicate]
    pure, pure_dof = float(np.sum((within * w) ** 2)), int((count - 1).sum())
    basis = _free_directions(e, w)
    z = e.residual * w
    fit_dof = groups - basis.shape[1]
    lack = max(float(z @ z) - float(np.sum((basis.T @ z) ** 2)) - pure, 0.0)
    ratio = (lack / fit_dof) / (pure / pure_dof) if fit_dof > 0 and pure_dof > 0 and pure > 0.0 else math.nan
    p_value = float(f.sf(ratio, fit_dof, pure_dof)) if not math.isnan(ratio) else math.nan
    linear = p.component < 3
    linear_dof = int(sum(max(n - 1, 0) for n in np.bincount(p.replicate[linear])))
    spread = math.sqrt(float(np.sum(within[linear] ** 2)) / linear_dof) if linear_dof else math.nan
    white = e.covariance.whiten(e.residual[:, None])
    square, dof = float(np.sum(white**2)), len(p) - basis.shape[1]
    return LackOfFit(
        spread,
        pure_dof,
        ratio,
        max(fit_dof, 0),
        p_value,
        square,
        dof,
        float(chi2.sf(square, dof)) if dof > 0 else math.nan,
    )


def _free_directions(e: Estimate, w: Array) -> Array:
    """Orthonormal columns (m, r): what the parameters that are not at an end of their range can follow, weighted."""
    low, high = e.problem.bounds
    return spanning((e.jacobian * w[:, None])[:, (e.u > low) & (e.u < high)], ROUNDING)


def outliers(e: Estimate) -> Indices:
    """Positions of the components that stand out, farthest first."""
    far = np.abs(e.own)
    return np.asarray([k for k in np.argsort(-far) if far[k] > FLAGGED], dtype=np.intp)


def downweighted(e: Estimate) -> int:
    """How many components count less than the others."""
    return int(np.sum(np.abs(e.own) > OUTLIER))
