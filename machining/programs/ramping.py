"""The way into and out of a correction of the path: over a stated length of the moves beside the cuts."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array, Bools


def ramped(moved: Array, milled: Bools, points: Array, length: float) -> Array:
    """A correction that fades in before each cut and out behind it.

    Parameters
    ----------
    moved : (n, 3) m, the correction where a move mills
    milled : (n,) moves that mill; the point before the first of a cut is where the cut begins
    points : (n, 3) m, uncorrected
    length : m along the path, over which the correction of the nearest cut falls to nothing; 0: in one step

    Returns
    -------
    (n, 3) m: ``moved`` where a move mills. A point where a cut begins has the correction of that cut's first point.
    Between two cuts that are nearer to each other both count, by how near they are.
    """
    out = np.where(milled[:, None], moved, 0.0)
    cuts, others = np.flatnonzero(milled), np.flatnonzero(~milled)
    if not length > 0.0 or not len(cuts) or not len(others):
        return out
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    after = np.searchsorted(cuts, others)
    last, following = cuts[np.maximum(after - 1, 0)], cuts[np.minimum(after, len(cuts) - 1)]
    # The next cut begins at the point before its first move.
    apart = np.stack([way[others] - way[last], way[following - 1] - way[others]])
    exists = np.stack([after > 0, after < len(cuts)])
    weight = np.where(exists, np.clip(1.0 - apart / length, 0.0, 1.0), 0.0)
    weight /= np.maximum(1.0, weight.sum(axis=0))
    out[others] = weight[0][:, None] * moved[last] + weight[1][:, None] * moved[following]
    return np.asarray(out)
