"""The rival that no catalogue names: a smooth discrepancy over pose and load, a share of the deflection.

A normal process over the joint angles that matter, with a squared-exponential kernel (Kennedy and O'Hagan 2001,
doi:10.1111/1467-9868.00294), written as columns: the poses' kernel has as many directions as there are poses. It may
change with the load and differ between loading and unloading.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from doe.diagnosis.setting import Setting
from fem.compiled.compliance import deflection
from robots.arrays import Array, Bools

# Lengths over which it varies, in half ranges of the joints as read; sizes as shares of the deflection.
LENGTHS = (0.8, 1.8)
SIZES = (0.03, 0.08, 0.2)
# Shares of the size with which it changes with the load and the phase.
LOAD, PHASE = 0.7, 0.5
# Directions of the kernel weaker than this carry nothing.
NEGLIGIBLE = 1e-4


def discrepancies(s: Setting) -> Iterator[Array]:
    """Columns (m, k), standard normal each, for every length and size."""
    p = s.data
    q = np.array([p.free.at.q[p.row[p.pose == g][0]] for g in range(len(p.poses))])
    moving = np.ptp(q, axis=0) > 1e-6
    moving &= _matters(s)
    x = q[:, moving]
    x = (x - x.mean(axis=0)) / np.maximum(0.5 * np.ptp(x, axis=0), 1e-9)
    factors = _load_factors(s)
    for length in LENGTHS:
        distance = np.sum((x[:, None] - x[None]) ** 2, axis=2)
        values, vectors = np.linalg.eigh(np.exp(-0.5 * distance / length**2))
        kept = values > NEGLIGIBLE * values.max(initial=1.0)
        poses = vectors[:, kept] * np.sqrt(values[kept])
        for size in SIZES:
            yield np.hstack([size * f[:, None] * poses[p.pose] for f in factors])


def _matters(s: Setting) -> Bools:
    """Joints (dof,) whose angle changes any reading."""
    at, out = s.data.free.at, []
    for k in range(at.q.shape[1]):
        q = at.q.copy()
        q[:, k] += 0.05
        d = deflection(s.arm, q, at.wrench, at.point)[s.data.row, s.data.component]
        out.append(bool(np.max(np.abs(d - s.prediction)) > 1e-6 * np.max(np.abs(s.prediction), initial=1e-300)))
    return np.array(out)


def _load_factors(s: Setting) -> list[Array]:
    """Size of the deflection (m,), alone and times load and phase, for each component."""
    p = s.data
    size = _size_of_pose(s)
    force = np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1)
    spread = float(np.ptp(force))
    load = (force - force.mean()) / (0.5 * spread) if spread > 1e-9 else np.zeros(len(force))
    out = []
    for component in np.unique(p.component):
        mine = np.where(p.component == component, size, 0.0)
        out.append(mine)
        if spread > 1e-9:
            out.append(LOAD * load * mine)
        if s.history.is_known:
            out.append(PHASE * np.where(s.unloading[p.row], 1.0, -1.0) * mine)
    return out


def _size_of_pose(s: Setting) -> Array:
    """Length of the predicted displacement (m,), of the kind that was read."""
    p = s.data
    square = np.zeros((len(p.free.at), 2))
    np.add.at(square, (p.row, (p.component >= 3).astype(int)), s.prediction**2)
    return np.asarray(np.sqrt(square)[p.row, (p.component >= 3).astype(int)])
