"""Which readings are left out together: all of a pose, whatever their rows, targets, repeats and labels.

Readings of a pose share what is wrong with the arm there. Left out one by one they are predicted by their own pose, and
the error comes out too small.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from robots.arrays import Array, Integers

# Angles of a pose come back to this from an encoder, rad; what drifts on beyond so many times that is a path.
SAME_rad, PATH = 5e-4, 4.0
# Fewer groups than this are left out one at a time.
SPLIT = 10


def pose_numbers(q: Array) -> Integers:
    """Number of the pose (n,) of readings at coordinates q (n, dof) rad: those that differ by an encoder's scatter."""
    at, number = np.unique(np.round(q, 9), axis=0, return_inverse=True)
    a, b = cKDTree(at).query_pairs(SAME_rad, p=np.inf, output_type="ndarray").T
    pairs = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(len(at), len(at)))
    group = connected_components(pairs, directed=False)[1]
    order = np.argsort(group, kind="stable")
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    extent = np.maximum.reduceat(at[order], first) - np.minimum.reduceat(at[order], first)
    path = np.asarray((extent > PATH * SAME_rad).any(axis=1))[group]
    group = np.where(path, len(at) + np.arange(len(at)), group)
    return np.unique(group[number.reshape(-1)], return_inverse=True)[1].reshape(-1).astype(np.int64)


def folds_of(group: Integers, folds: int, seed: int, split: int = SPLIT) -> Integers:
    """The fold (n,) in which each reading is left out, its group (n,) as a whole; as many groups in each as can be.

    Fewer than ``split`` groups are left out one at a time.
    """
    groups = int(group.max()) + 1
    count = groups if groups < split else min(folds, groups)
    order = np.random.default_rng(seed).permutation(groups)
    of_group = np.empty(groups, dtype=np.int64)
    of_group[order] = np.arange(groups) % count
    return np.asarray(of_group[group])
