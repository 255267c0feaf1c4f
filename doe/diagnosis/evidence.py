"""Evidence of linear models with normal priors, for given noise: many candidates on one base at once.

``y = f + A u + X v + e``, e normal with covariance V (blocks), u and v normal with means mu and precisions L:

``ln Z = -(ln|2 pi V| + ln|S| - ln|L|  + r^T V^-1 r - b^T S^-1 b) / 2``, S = A^T V^-1 A + L,

and a candidate's columns X add to a base's evidence by their Schur complement (Bishop 2006, section 3.5;
MacKay 1992, doi:10.1162/neco.1992.4.3.415). An amplitude that cannot be negative multiplies the evidence by the
ratio of the posterior's and the prior's mass above zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import log_ndtr

from doe.diagnosis.signatures import Signature
from doe.estimation.blocks import Covariance
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
            np.hstack([self.columns, columns]), self.residual - columns @ mean,
            np.concatenate([self.precision, sd**-2.0]), np.concatenate([self.floor, floor]),
        )  # fmt: skip


@dataclass(frozen=True)
class Fitted:
    """A candidate at one noise: log evidence, posterior means and covariance of its amplitudes, excess of chi-square.

    ``excess``: fall of the weighted sum of squares by the candidate's columns, the base free to follow;
    ``base`` (b,): posterior means of the base's numbers, from their prior means.
    """

    log_evidence: float
    mean: Array
    covariance: Array
    excess: float
    base: Array


class Whitened:
    """A base at one noise, ready for candidates."""

    def __init__(self, base: Base, V: Covariance) -> None:
        self.base, self.V = base, V
        self.W = V.whiten(base.columns)
        self.r = V.whiten(base.residual[:, None])[:, 0]
        S = self.W.T @ self.W + np.diag(base.precision)
        self.L = np.linalg.cholesky(S)
        b = self.W.T @ self.r
        self.u = np.asarray(cho_solve((self.L, True), b))
        m = len(self.r)
        log_det = V.log_det + 2.0 * float(np.log(np.diag(self.L)).sum()) - float(np.log(base.precision).sum())
        self.square = float(self.r @ self.r - b @ self.u)
        self.inverse = np.asarray(cho_solve((self.L, True), np.eye(len(S))))
        self.bounded = np.flatnonzero(np.isfinite(base.floor))
        self.inside = float(self.above(self.u[None], np.zeros((1, len(S), 0)), np.zeros((1, 0, 0)))[0])
        self.log_evidence = -0.5 * (m * float(np.log(2.0 * np.pi)) + log_det + self.square) + self.inside

    def above(self, u: Array, K: Array, covariance: Array) -> Array:
        """Log of the share of posterior over prior (n,) in which the base's numbers keep above their floors.

        u (n, b): posterior means; their covariance is the base's own and ``K covariance K^T``. Marginals only.
        """
        k = self.bounded
        extra = np.einsum("nbk,nkl,nbl->nb", K[:, k], covariance, K[:, k])
        sd = np.sqrt(self.inverse[k, k] + extra)
        before = self.base.floor[k] * np.sqrt(self.base.precision[k])
        return np.asarray(np.sum(log_ndtr((u[:, k] - self.base.floor[k]) / sd) - log_ndtr(-before), axis=1))


@dataclass(frozen=True)
class Whitening:
    """Columns WX (m, k) of many candidates, whitened at one noise, and their products ``own`` (n, a, a) by width."""

    V: Covariance
    candidates: Sequence[Signature]
    WX: Array
    starts: Integers
    own: dict[int, tuple[list[int], Array]]

    @staticmethod
    def of(V: Covariance, candidates: Sequence[Signature]) -> Whitening:
        """Whiten candidates' columns; those without amplitudes are not for here."""
        widths = [c.columns.shape[1] for c in candidates]
        starts = np.concatenate([[0], np.cumsum(widths)]).astype(np.int64)
        columns = [c.columns for c in candidates] or [np.zeros((len(V.variance), 0))]
        WX, own = V.whiten(np.hstack(columns)), {}
        for width in sorted(set(widths)):
            mine = [i for i, k in enumerate(widths) if k == width]
            x = np.moveaxis(WX[:, starts[mine][:, None] + np.arange(width)], 1, 0)
            own[width] = mine, np.asarray(np.swapaxes(x, 1, 2) @ x)
        return Whitening(V, candidates, WX, starts, own)


def fit_all(w: Whitened, candidates: Sequence[Signature] | Whitening) -> list[Fitted]:
    """Every candidate's fit on a base; those without amplitudes are not for here."""
    x = candidates if isinstance(candidates, Whitening) else Whitening.of(w.V, candidates)
    across = w.W.T @ x.WX
    g = x.WX.T @ w.r - across.T @ w.u
    half = solve_triangular(w.L, across, lower=True)
    solved = w.inverse @ across
    out: list[Fitted | None] = [None] * len(x.candidates)
    for width, (mine, own) in x.own.items():
        at = x.starts[mine][:, None] + np.arange(width)
        h = np.moveaxis(half[:, at], 1, 0)
        G = own - np.swapaxes(h, 1, 2) @ h
        K = np.moveaxis(solved[:, at], 1, 0)
        for i, found in zip(mine, _stack(w, [x.candidates[i] for i in mine], G, g[at], K), strict=True):
            out[i] = found
    return [one for one in out if one is not None]


def _stack(w: Whitened, candidates: Sequence[Signature], G: Array, g: Array, K: Array) -> list[Fitted]:
    """Fits of candidates with as many amplitudes; G (n, k, k), g (n, k); K (n, b, k): how the base makes room."""
    mean = np.stack([c.mean for c in candidates])
    precision = np.stack([c.sd for c in candidates]) ** -2.0
    S = G + precision[:, :, None] * np.eye(G.shape[1])
    covariance: Array = np.asarray(np.linalg.inv(S), dtype=np.float64)
    h = g + precision * mean
    v = np.einsum("nkl,nl->nk", covariance, h)
    gain = 0.5 * np.einsum("nk,nk->n", h, v) - 0.5 * np.sum(precision * mean**2, axis=1)
    gain += 0.5 * (np.log(precision).sum(axis=1) - np.linalg.slogdet(S)[1])
    positive = np.stack([c.positive for c in candidates])
    sd = np.sqrt(np.einsum("nkk->nk", covariance))
    above = log_ndtr(v / sd) - log_ndtr(mean * np.sqrt(precision))
    gain += np.sum(np.where(positive, above, 0.0), axis=1)
    u = w.u - np.einsum("nbk,nk->nb", K, v)
    unbounded = w.log_evidence - w.inside
    gain += w.above(u, K, covariance)
    least = np.linalg.pinv(G, rcond=1e-9, hermitian=True)
    excess = np.einsum("nk,nkl,nl->n", g, least, g)
    return [
        Fitted(unbounded + float(a), b, c, float(d), e)
        for a, b, c, d, e in zip(gain, v, covariance, excess, u, strict=True)
    ]


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
    return LeftOut(error, np.array(density))
