"""Coefficients of a basis from runs by a stable solver, and the condition number."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.linalg.lapack import dtrcon

from robots.arrays import Array
from robots.errors import InputError

# With orthonormal functions a larger condition number means that the poses do not tell terms apart.
WORST_CONDITION = 1e10
# Up to this many terms the condition number is exact; beyond, LAPACK's estimate in the 1-norm takes a fraction of it.
_EXACT_CONDITION = 1500


class Solution(NamedTuple):
    """``coefficients`` (t, m); ``condition`` of the matrix."""

    coefficients: Array
    condition: float


def solve(A: Array, b: Array) -> Solution:
    """Least squares for A (n, t) and b (n, m) by Householder's QR, never by normal equations.

    Raises
    ------
    InputError
        More terms than runs, or poses that leave terms undetermined.
    """
    if A.shape[1] > len(A):
        raise InputError(
            f"fit: the basis has {A.shape[1]} terms, but there are {len(A)} runs",
            code="S004",
            allowed="at least as many runs as terms (twice as many is sound)",
            remedy="add runs, lower the degree or order, or fix one of the coordinates",
        )
    b = b.reshape(len(b), -1)
    Q, R = (np.asarray(part, dtype=np.float64) for part in scipy.linalg.qr(A, mode="economic", check_finite=False))
    condition = condition_of(R)
    if not condition < WORST_CONDITION:
        raise InputError(
            f"fit: the poses do not determine all {A.shape[1]} terms (condition {condition:.3g})",
            code="S004",
            allowed=f"a condition number below {WORST_CONDITION:.0e}",
            remedy="use poses that fill the domain (no grids of few levels, no repeats) or fewer terms",
        )
    x = scipy.linalg.solve_triangular(R, Q.T @ b, check_finite=False)
    return Solution(np.asarray(x, dtype=np.float64), condition)


def condition_of(R: Array) -> float:
    """Condition number of a triangular matrix (t, t): 2-norm, or an estimate in the 1-norm where t is large."""
    if len(R) <= _EXACT_CONDITION:
        singular = scipy.linalg.svdvals(R)
        return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float(np.inf)
    reciprocal, _ = dtrcon(R, norm="1", uplo="U")
    return float(1.0 / reciprocal) if reciprocal > 0.0 else float(np.inf)
