"""How well a hypothesis predicts the readings of poses that it has not seen: each pose left out in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.diagnosis.evidence import Base
from doe.diagnosis.signatures import Signature
from doe.estimation.blocks import Covariance
from robots.arrays import Array, Integers


@dataclass(frozen=True)
class LeftOut:
    """``error`` (m,): read minus predicted from all other poses; ``log_density`` (g,) of each pose's readings."""

    error: Array
    log_density: Array


def extended(base: Base, candidate: Signature | None) -> Base:
    """The base with a candidate's columns and priors."""
    if candidate is None:
        return base
    floor = np.where(candidate.positive, -candidate.mean, -np.inf)
    return Base(
        np.hstack([base.columns, candidate.columns]),
        base.residual - candidate.columns @ candidate.mean,
        np.concatenate([base.precision, candidate.sd**-2.0]),
        np.concatenate([base.floor, floor]),
    )


def leave_one_pose_out(base: Base, V: Covariance, pose: Integers) -> LeftOut:
    """Every pose predicted from the others, at fixed noise; ``pose`` (m,): number of the pose of each component."""
    W, r = V.whiten(base.columns), V.whiten(base.residual[:, None])[:, 0]
    S, b = W.T @ W + np.diag(base.precision), W.T @ r
    error, density = np.zeros(len(r)), []
    for g in range(int(pose.max()) + 1):
        mine = pose == g
        Wg = W[mine]
        without = S - Wg.T @ Wg
        mean = np.linalg.solve(without, b - Wg.T @ r[mine])
        left = r[mine] - Wg @ mean
        spread = np.eye(len(left)) + Wg @ np.linalg.solve(without, Wg.T)
        L = np.linalg.cholesky(0.5 * (spread + spread.T))
        z = np.linalg.solve(L, left)
        density.append(-0.5 * float(z @ z) - float(np.log(np.diag(L)).sum()) - 0.5 * len(left) * np.log(2.0 * np.pi))
        error[mine] = base.residual[mine] - base.columns[mine] @ mean
    return LeftOut(error, np.array(density))
