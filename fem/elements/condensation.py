"""Exact static condensation of a link's FE model to its interfaces."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from robots.arrays import Array

# A backward stable factorisation leaves some 1e-14 of |K| |x|; a wrong or broken one leaves far more.
RESIDUAL = 1e-9
# Below this size SciPy is done before pypardiso has found its library on the disk (a second or so).
SMALL = 3000
# What MKL's PARDISO says of a pivot that is zero or negative.
PARDISO_PIVOT = -4
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Superelement:
    """A link condensed to i interfaces (root first), in its body's frame.

    ``points`` (i, 3) m. ``stiffness`` (6i, 6i): all interfaces free (six zero-energy modes).
    ``flexibility`` (6(i-1), 6(i-1)): root clamped, displacement (m, rad) of the others per wrench (N, N m).
    """

    name: str
    interfaces: tuple[str, ...]
    points: Array
    stiffness: Array
    flexibility: Array


def condense(name: str, interfaces: tuple[str, ...], points: Array, K: sp.csc_array, nodes: Array) -> Superelement:
    """Condense a free stiffness matrix to the freedoms of the interface ``nodes`` (six each).

    The flexibility comes from a solve with the root clamped, not from inverting the condensed
    stiffness: both are exact, and that keeps one independent of the other.
    """
    kept = (6 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(6)).ravel()
    inner = np.setdiff1d(np.arange(K.shape[0]), kept)
    stiffness = K[kept][:, kept].toarray()
    if inner.size:
        coupling = K[inner][:, kept].toarray()
        stiffness = stiffness - coupling.T @ solve_positive_definite(K[inner][:, inner], coupling)
    free = np.setdiff1d(np.arange(K.shape[0]), kept[:6])
    loaded = np.searchsorted(free, kept[6:])
    unit = np.zeros((free.size, loaded.size))
    unit[loaded, np.arange(loaded.size)] = 1.0
    flexibility = solve_positive_definite(K[free][:, free], unit)[loaded]
    return Superelement(name, interfaces, points, 0.5 * (stiffness + stiffness.T), 0.5 * (flexibility + flexibility.T))


def solve_positive_definite(K: sp.csc_array, b: Array) -> Array:
    """Solve ``K x = b`` (n, r) for a symmetric positive definite K (n, n) with the fastest solver installed.

    pypardiso, then scikit-sparse's CHOLMOD, else SciPy; small systems by SciPy at once. Memory for the factor is
    given back before returning.

    Raises
    ------
    ArithmeticError
        K is singular to working precision: the residual stays above ``RESIDUAL``, or a pivot is not positive.
    """
    if not (K.diagonal() > 0.0).all():
        raise ArithmeticError("the stiffness matrix is singular")
    for solver in (_superlu,) if K.shape[0] < SMALL else (_pardiso, _cholmod, _superlu):
        try:
            x = solver(sp.csc_array(K), b)
        except ImportError:
            continue
        break
    if not is_solution(K, x, b):
        raise ArithmeticError("the stiffness matrix is singular to working precision")
    return x


def is_solution(K: sp.csc_array, x: Array, b: Array) -> bool:
    """Whether ``K x = b`` (n, r) holds to what a backward stable solver leaves."""
    # Against K x term by term, so that a stiff system's large forces from rounded displacements do not count.
    scale = abs(K).sum(axis=0).max() * np.abs(x).max(axis=0) + np.abs(b).max(axis=0)
    return bool((np.abs(K @ x - b).max(axis=0) <= RESIDUAL * scale).all())


def _pardiso(K: sp.csc_array, b: Array) -> Array:
    pypardiso = importlib.import_module("pypardiso")
    upper = _upper(K)
    with _ONE_AT_A_TIME:
        solver = _pardiso_solver(pypardiso.PyPardisoSolver)
        try:
            solver.factorize(upper)
            return np.asarray(solver.solve(upper, b))
        except pypardiso.pardiso_wrapper.PyPardisoError as error:
            if error.value == PARDISO_PIVOT:
                raise ArithmeticError("the stiffness matrix is singular") from error
            raise
        finally:
            solver.free_memory(everything=True)


def _upper(K: sp.csc_array) -> sp.csr_matrix:
    """Upper triangle of a symmetric matrix, by rows; sp.triu takes four times as long, by way of triplets."""
    K.sort_indices()
    # Its columns are its rows.
    rows = np.repeat(np.arange(K.shape[0], dtype=K.indices.dtype), np.diff(K.indptr))
    kept = np.asarray(K.indices) >= rows
    starts = np.concatenate([[0], np.cumsum(kept)])[K.indptr]
    return sp.csr_matrix((K.data[kept], K.indices[kept], starts), shape=K.shape)


@cache
def _pardiso_solver(kind: Callable[..., Any]) -> Any:
    """Solver for positive definite matrices; one a process, since each looks for MKL on the disk, for a second."""
    solver = kind(mtype=2)
    solver.set_iparm(1, 1)
    solver.set_iparm(2, 2)  # METIS nested dissection
    return solver


def _cholmod(K: sp.csc_array, b: Array) -> Array:
    cholmod = importlib.import_module("sksparse.cholmod")
    try:
        return np.asarray(cholmod.cholesky(sp.csc_matrix(K))(b))
    except cholmod.CholmodNotPositiveDefiniteError as error:
        raise ArithmeticError("the stiffness matrix is singular") from error


def _superlu(K: sp.csc_array, b: Array) -> Array:
    # MMD on A'+A with symmetric mode: the default COLAMD ordering is 6 times slower on such matrices.
    try:
        factor = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise ArithmeticError("the stiffness matrix is singular") from error
    return np.asarray(factor.solve(b))
