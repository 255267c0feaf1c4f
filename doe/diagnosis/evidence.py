"""Evidence of linear models with normal priors, for given noise; of many candidates at once: :mod:`doe.diagnosis.fits`.

``y = f + A u + X v + e``, e normal with covariance V (blocks), u and v normal with means mu and precisions L:

``ln Z = -(ln|2 pi V| + ln|S| - ln|L|  + r^T V^-1 r - b^T S^-1 b) / 2``, S = A^T V^-1 A + L,

(Bishop 2006, section 3.5; MacKay 1992, doi:10.1162/neco.1992.4.3.415). A number that cannot be negative multiplies the
evidence by the ratio of the posterior's and the prior's mass above zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from doe.estimation.blocks import Alike, Covariance
from robots.arrays import Array, Integers


@dataclass(frozen=True)
class Base:
    """Columns A (m, b) common to all candidates with priors, and the readings' residual r (m,) at their means.

    ``floor`` (b,): how far each number may go below its mean; -inf where there is no limit.
    """

    columns: Array
    residual: Array
    precision: Array
    floor: Array

    def beside(
        self, columns: Array, mean: Array | float = 0.0, sd: Array | float = 1.0, floor: Array | float = -np.inf
    ) -> Base:
        """The base with more columns (m, k): of numbers with means, standard deviations and floors (k,)."""
        k = columns.shape[1]
        mean, sd, floor = (np.broadcast_to(x, k) for x in (mean, sd, floor))
        return Base(
            np.hstack([self.columns, columns]),
            self.residual - columns @ mean,
            np.concatenate([self.precision, sd**-2.0]),
            np.concatenate([self.floor, floor]),
        )


class Whitened:
    """A base at one noise, ready for candidates.

    ``W`` (m, b), ``r`` (m,): whitened columns and residual; ``L`` (b, b): Cholesky factor of ``W^T W`` plus precisions,
    ``root`` its inverse; ``u`` (b,): posterior means. ``within``: at the same noise, a base whose numbers are the first
    of this one's, those before ``new``: what is known of it serves again.
    """

    def __init__(self, base: Base, V: Covariance, within: Whitened | None = None) -> None:
        self.base, self.V, self.within = base, V, within
        known = 0 if within is None else len(within.base.precision)
        self.new = slice(known, len(base.precision))
        white = V.whiten(np.column_stack([base.columns[:, self.new], base.residual]))
        new, self.r = white[:, :-1], white[:, -1]
        S = new.T @ new + np.diag(base.precision[self.new])
        if within is None:
            self.W, self.L = new, np.linalg.cholesky(S)
            self.root = _inverse(self.L)
        else:
            self.W = np.hstack([within.W, new])
            low = within.root @ (within.W.T @ new)
            own = np.linalg.cholesky(S - low.T @ low)
            root, none = _inverse(own), np.zeros_like(low)
            self.L = np.block([[within.L, none], [low.T, own]])
            self.root = np.block([[within.root, none], [-root @ (low.T @ within.root), root]])
        # What is left to fit in the numbers' own units.
        self.z = self.root @ (self.W.T @ self.r)
        self.u = self.root.T @ self.z
        log_det = V.log_det + 2.0 * float(np.log(np.diag(self.L)).sum()) - float(np.log(base.precision).sum())
        self.square = float(self.r @ self.r - self.z @ self.z)
        self.bounded = np.flatnonzero(np.isfinite(base.floor))
        self.inside = float(self.above(self.u[None, self.bounded], np.zeros((1, len(self.bounded))))[0])
        self.unbounded = -0.5 * (len(self.r) * float(np.log(2.0 * np.pi)) + log_det + self.square)
        self.log_evidence = self.unbounded + self.inside
        self._means: dict[int, tuple[Array, Array]] = {}

    @cached_property
    def inverse(self) -> Array:
        """Posterior covariance (b, b) of the base's numbers."""
        return np.asarray(self.root.T @ self.root)

    def of_means(self, alike: Alike, V: Covariance) -> tuple[Array, Array]:
        """Whitened columns (g, b) and residuals (g,) of the means of readings that are alike; V is the means' own."""
        if id(alike) not in self._means:
            both = np.column_stack([self.base.columns[:, self.new], self.base.residual])
            white = V.whiten(alike.mean(both, self.V.variance))
            W = white[:, :-1]
            if self.within is not None:
                W = np.hstack([self.within.of_means(alike, V)[0], W])
            self._means[id(alike)] = W, white[:, -1]
        return self._means[id(alike)]

    def above(self, u: Array, extra: Array) -> Array:
        """Log of the share of posterior over prior (n,) in which the base's numbers keep above their floors.

        u (n, f): posterior means of those that have one; ``extra`` (n, f): variance beyond the base's own. Marginals
        only.
        """
        k = self.bounded
        sd = np.sqrt(np.sum(self.root[:, k] ** 2, axis=0) + extra)
        before = self.base.floor[k] * np.sqrt(self.base.precision[k])
        return np.asarray(np.sum(log_ndtr((u - self.base.floor[k]) / sd) - log_ndtr(-before), axis=1))


def _inverse(L: NDArray[np.floating[Any]]) -> Array:
    """Inverse of a lower triangle (b, b)."""
    return np.asarray(solve_triangular(L, np.eye(len(L)), lower=True, check_finite=False))


@dataclass(frozen=True)
class LeftOut:
    """``error`` (m,): read minus predicted from all other poses; ``log_density`` (g,) of each pose's readings."""

    error: Array
    log_density: Array


def leave_one_pose_out(base: Base, V: Covariance, pose: Integers) -> LeftOut:
    """How well a hypothesis predicts poses that it has not seen: each from the others, at fixed noise.

    ``pose`` (m,): number of the pose of each component.
    """
    w = Whitened(base, V)
    error, density = np.zeros(len(w.r)), []
    for g in range(int(pose.max()) + 1):
        mine = pose == g
        # Block deletion: what is left of the whole fit's residual grows by the pose's share in it.
        W = w.W[mine]
        kept = np.eye(len(W)) - W @ w.inverse @ W.T
        fitted = w.r[mine] - W @ w.u
        left = np.linalg.solve(kept, fitted)
        density.append(0.5 * float(np.linalg.slogdet(kept)[1] - left @ fitted - len(left) * np.log(2.0 * np.pi)))
        error[mine] = base.residual[mine] - base.columns[mine] @ (w.u - w.inverse @ (W.T @ left))
    return LeftOut(error, np.array(density) - 0.5 * V.log_dets(pose))
