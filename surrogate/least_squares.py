"""Coefficients of a basis from runs: stable solvers, their condition number, and leverage."""

from __future__ import annotations

import warnings
from typing import Literal, NamedTuple, get_args

import numpy as np
import scipy.linalg
from scipy.linalg.lapack import dtrcon
from sklearn.linear_model import RidgeCV

from robots.arrays import Array
from robots.errors import InputError, require_one_of

Solver = Literal["qr", "ridge"]

SOLVERS: tuple[Solver, ...] = get_args(Solver)
# With orthonormal functions a larger condition number means that the poses do not tell terms apart.
WORST_CONDITION = 1e10
# Up to this many terms the condition number is exact; beyond, LAPACK's estimate in the 1-norm takes a fraction of it.
_EXACT_CONDITION = 1500
# Penalties tried by ridge regression, over the mean square of a column.
_PENALTIES = np.logspace(-14.0, 0.0, 29)


class Solution(NamedTuple):
    """``coefficients`` (t, m); ``condition`` of the matrix; ``penalty`` of ridge."""

    coefficients: Array
    condition: float
    penalty: float


def solve(A: Array, b: Array, solver: Solver = "qr") -> Solution:
    """Least squares for A (n, t) and b (n, m), never by normal equations.

    'qr' is Householder's QR. 'ridge' adds a penalty on the coefficients, chosen by generalised cross-validation
    (scikit-learn's RidgeCV on the singular values): for runs that hardly determine all terms.

    Raises
    ------
    InputError
        More terms than runs, an unknown solver, or poses that leave terms undetermined.
    """
    require_one_of("solver", solver, SOLVERS, code="S004")
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
    if solver == "ridge":
        size = float(np.mean(np.sum(A**2, axis=0)))
        with warnings.catch_warnings():
            # It fits columns of very unlike size on purpose; the condition number is reported instead.
            warnings.simplefilter("ignore", scipy.linalg.LinAlgWarning)
            found = RidgeCV(_PENALTIES * size, fit_intercept=False, gcv_mode="svd").fit(A, b)
        return Solution(np.reshape(found.coef_, (b.shape[1], -1)).T, condition, float(found.alpha_))
    if not condition < WORST_CONDITION:
        raise InputError(
            f"fit: the poses do not determine all {A.shape[1]} terms (condition {condition:.3g})",
            code="S004",
            allowed=f"a condition number below {WORST_CONDITION:.0e}",
            remedy="use poses that fill the domain (no grids of few levels, no repeats), fewer terms or --solver ridge",
        )
    x = scipy.linalg.solve_triangular(R, Q.T @ b, check_finite=False)
    return Solution(np.asarray(x, dtype=np.float64), condition, 0.0)


def condition_of(R: Array) -> float:
    """Condition number of a triangular matrix (t, t): 2-norm, or an estimate in the 1-norm where t is large."""
    if len(R) <= _EXACT_CONDITION:
        singular = scipy.linalg.svdvals(R)
        return float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float(np.inf)
    reciprocal, _ = dtrcon(R, norm="1", uplo="U")
    return float(1.0 / reciprocal) if reciprocal > 0.0 else float(np.inf)
