"""Which combinations of variables are determined when not all of them are: linear algebra of a null space.

The readings determine w^T x exactly if w is orthogonal to every direction z that moves no reading. Rows of a reduced
echelon form are such w with as few variables as can be (no row has another one's variables among its own), and the
form splits the variables into groups that have nothing to do with one another (the components of a matroid: Oxley,
Matroid Theory, 2nd ed., section 4.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from robots.arrays import Array, Bools, Indices

# Entries of an echelon form below this are rounding; variables have columns of norm one, null vectors length one.
ROUNDING = 1e-6
# Echelon forms that are compared for the one with the fewest entries.
TRIES = 60


@dataclass(frozen=True)
class Combination:
    """A weighted sum of the estimator's variables: ``names`` and ``weights`` (k,), the largest 1 where units agree.

    ``value`` and ``sd`` in ``unit``; ``relative``: sd over the sum of its terms' sizes.
    """

    names: tuple[str, ...]
    weights: Array
    value: float
    sd: float
    unit: str
    relative: float
    words: str


def echelon(rows: Array, order: Indices) -> tuple[Array, Indices]:
    """Reduced echelon form (r, p) of rows (k, p) and its r pivots, pivots sought in a given order of the columns."""
    M, pivots, r = rows.copy(), [], 0
    for c in order:
        if r == len(M):
            break
        k = r + int(np.argmax(np.abs(M[r:, c])))
        if abs(M[k, c]) < ROUNDING:
            continue
        M[[r, k]] = M[[k, r]]
        M[r] /= M[r, c]
        others = np.arange(len(M)) != r
        M[others] -= np.outer(M[others, c], M[r])
        pivots.append(c)
        r += 1
    M = M[:r]
    M[np.abs(M) < ROUNDING * np.abs(M).max(initial=1.0)] = 0.0
    return M, np.array(pivots, dtype=np.intp)


def sparsest(rows: Array) -> tuple[Array, Indices]:
    """The echelon form with the fewest entries among some; the same for the same rows."""
    p = rows.shape[1]
    rng = np.random.default_rng(0)
    forms = [echelon(rows, np.arange(p) if k == 0 else rng.permutation(p)) for k in range(TRIES if p > 2 else 1)]
    return min(forms, key=lambda form: np.count_nonzero(form[0]))


def groups(joined: Bools) -> list[Indices]:
    """Sets of two or more things that ``joined`` (n, n) connects, pair by pair."""
    count, label = connected_components(joined, directed=False)
    sets = (np.flatnonzero(label == k) for k in range(count))
    return [members for members in sets if members.size > 1]


def components(null: Array) -> list[Indices]:
    """Groups of two or more variables that null vectors (d, p) join."""
    there = echelon(null, np.arange(null.shape[1]))[0] != 0.0
    return groups(there.T @ there)


def complement(null: Array) -> Array:
    """Rows (p - d, p), orthonormal, orthogonal to the null vectors (d, p)."""
    _, s, V = np.linalg.svd(null, full_matrices=True)
    return np.asarray(V[int((s > ROUNDING).sum()) :])


def alike(null: Array) -> list[Indices]:
    """Sets of two or more variables of which only one and the same combination is ever seen."""
    W = complement(null)
    P = W.T @ W
    size = np.sqrt(np.maximum(np.diag(P), 0.0))
    same = np.abs(P) > (1.0 - ROUNDING) * np.outer(size, size)
    same &= (size[:, None] > ROUNDING) & (size[None, :] > ROUNDING)
    return groups(same)
