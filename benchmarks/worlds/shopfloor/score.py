"""How loud a hidden effect is: chi-square of noise-free readings that the model's springs leave, by the true noise."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import nnls

from benchmarks.worlds.shopfloor.arms import Floats, Ints, Robot
from benchmarks.worlds.shopfloor.beams import beams
from benchmarks.worlds.shopfloor.campaign import Timeline
from benchmarks.worlds.shopfloor.noise import Noise, common
from benchmarks.worlds.shopfloor.statics import postures


def spring_columns(arm: Robot, q: Floats, line: Timeline, springs: Ints, loop: bool) -> Floats:
    """Displacement (n_reads, 3, m) by a compliance of one in each spring, as the model computes it from the table."""
    rows = line.reads
    turns = postures(arm, q, loop=loop).turns[line.pose[rows]][:, springs]
    torque = np.einsum("nki,ni->nk", turns[..., :3], line.force[rows])
    return np.asarray(np.einsum("nki,nk->nik", turns[..., :3], torque))


def bending(arm: Robot, q: Floats, line: Timeline) -> Floats:
    """Displacement (n_reads, 3) by the links alone, as a model with beams computes it from the table."""
    rows, d = line.reads, np.zeros((len(line.reads), 3))
    parts = postures(arm, q).parts[line.pose[rows]]
    for beam in beams(arm.name):
        x = parts[:, beam.body, :3]
        d += np.einsum("nij,jk,nlk,nl->ni", x, beam.flexibility, x, line.force[rows])
    return d


def excess_chi2(clean: Floats, known: Floats, columns: Floats, noise: Noise, line: Timeline, axes: slice) -> float:
    """Weighted sum of squares that is left after fitting compliances of zero or more.

    clean : (n_reads, 3) m without noise; known : what the model has beside its springs, columns : by its springs
    """
    rows = line.reads
    weight = 1.0 / noise.variance(clean, line.force[rows])[:, axes].ravel()
    y = (clean - known)[:, axes].ravel()
    a = columns[:, axes].reshape(len(y), -1)
    u = common(noise, clean, line.pose[rows], line.session[rows])[:, axes].reshape(len(y), -1)
    core = cho_factor(np.eye(u.shape[1]) + u.T @ (weight[:, None] * u)) if u.shape[1] else None

    def by_covariance(x: Floats) -> Floats:
        """Inverse covariance times x, by Woodbury."""
        wx = weight[:, None] * x
        return wx if core is None else wx - weight[:, None] * (u @ cho_solve(core, u.T @ wx))

    scale = np.sqrt(np.maximum(np.einsum("ni,ni->i", a, weight[:, None] * a), 1e-300))
    seen = scale > 1e-9 * scale.max()
    a = a[:, seen] / scale[seen]
    gram, right = a.T @ by_covariance(a), a.T @ by_covariance(y[:, None])
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-13 * values[-1]
    root = vectors[:, keep] * np.sqrt(values[keep])
    target = (vectors[:, keep] / np.sqrt(values[keep])).T @ right[:, 0]
    c, _ = nnls(root.T, target, maxiter=1000)
    rest = (y - a @ c)[:, None]
    return float((rest.T @ by_covariance(rest))[0, 0])
