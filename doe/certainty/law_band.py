"""What an estimated law says about the spring at some angles: the stiffness and its 95 % band."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from doe.certainty.uncertainty import Certainty
from doe.estimation.estimate import Estimate
from fem.free.parameters import FreeLaw
from robots.arrays import Array

# A law's part in what is not determined that counts as rounding.
ROUNDING = 1e-6
QUANTILE = 0.975


@dataclass(frozen=True)
class LawBand:
    """``stiffness``, ``low``, ``high`` (n,) N m/rad at n poses; NaN where the readings do not determine it."""

    stiffness: Array
    low: Array
    high: Array


def law_band(e: Estimate, c: Certainty, law: FreeLaw, q: Array) -> LawBand:
    """The spring of a law with its pointwise 95 % band at poses q (n, dof) rad.

    By the covariance of ln k, linear in the coefficients, with Student's t of the coefficient with the fewest degrees
    of freedom. NaN where a coefficient counts that no reading moves with or that stands at an end of its range, or a
    combination that no reading determines. Priors that keep a law flat are part of the covariance: where nothing was
    read the band is as wide as these say.
    """
    B = law.basis(q)
    mine = slice(law.first, law.first + law.basis.size)
    log_k = B @ e.u[mine]
    sd = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", B, c.covariance[mine, mine], B), 0.0))
    coefficients = c.estimates[mine]
    lost = np.array([k.status == "at bound" for k in coefficients]) | ~e.seen[mine]
    told = np.abs(B[:, lost]).max(axis=1, initial=0.0) < ROUNDING
    told &= np.abs(B @ c.null[:, mine].T).max(axis=1, initial=0.0) < ROUNDING
    dof = min((k.degrees_of_freedom for k in coefficients), default=math.nan)
    # An infinite number of degrees of freedom: the normal distribution's quantile.
    t = math.nan if not dof > 0.0 else float(stdtrit(min(max(dof, 1.0), 1e9), QUANTILE))
    k = np.where(told, np.exp(log_k), np.nan)
    return LawBand(k, k * np.exp(-t * sd), k * np.exp(t * sd))
