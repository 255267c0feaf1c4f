"""Exact static condensation of a link's FE model to its interfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

Array = NDArray[np.float64]


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
        stiffness = stiffness - coupling.T @ _factor(K[inner][:, inner]).solve(coupling)
    free = np.setdiff1d(np.arange(K.shape[0]), kept[:6])
    loaded = np.searchsorted(free, kept[6:])
    unit = np.zeros((free.size, loaded.size))
    unit[loaded, np.arange(loaded.size)] = 1.0
    flexibility = _factor(K[free][:, free]).solve(unit)[loaded]
    return Superelement(name, interfaces, points, 0.5 * (stiffness + stiffness.T), 0.5 * (flexibility + flexibility.T))


def _factor(K: sp.csc_array) -> SuperLU:
    # MMD on A'+A with symmetric mode: the default COLAMD ordering is 6 times slower on such matrices.
    return splu(sp.csc_array(K), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
