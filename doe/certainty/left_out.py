"""Each pose predicted from all the others: by updates of the estimate, not by fits anew.

The covariance of the readings, weights of outliers included, is that of the whole estimate. Readings of different
poses are independent, so taking a pose out takes its rows out of the whitened derivatives ``A = Q R``: what is left
has the triangular factor ``(I - Q_k^T Q_k)^(1/2) R``, a matrix as small as there are parameters (block deletion; Cook
and Weisberg, Residuals and Influence in Regression, 1982, section 3.6). The bounded step on it from the estimate is
exact where the predictions are linear in the parameters, whichever of them come to stand at a bound or leave it: where
the bounds that hold stay the same it is one small solve, else bounded least squares of the same small matrix.

Fitted anew are only the poses that alone tell something, and, where predictions are not linear, those whose loss moves
the predictions noticeably. The shares of all poses in what is determined add up to the number of parameters, so these
are at most a few times as many as there are parameters, however many poses there are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.certainty.predictive import half_width95
from doe.certainty.uncertainty import determined_covariance, null_directions
from doe.estimation.estimate import Estimate, check_enough, seen_columns
from doe.estimation.least_squares import ROUNDING, bounded_step, minimise, prior_residual
from doe.estimation.problem import Problem
from robots import InputError
from robots.arrays import Array, Bools, Indices, Integers
from robots.progress import Progress

# A pose whose readings hold all but this share of what is known in some direction is left out by a fit anew.
SHARE_LEFT = 1e-3
# Predictions that are not linear are fitted anew where a pose's loss moves them by more than this, in standard
# deviations, all readings together: what a linear step then misses is of the order of its square.
NEAR = 0.3
# Slopes at a bound below this share of their size are rounding.
LEVEL = 1e-9
# Progress is told this often.
TOLD = 100


def leave_one_pose_out(e: Estimate, progress: Progress | None = None) -> tuple[Array, Array, dict[str, str]]:
    """Errors (m,) read minus predicted of each pose by an estimate on the others; NaN where they cannot tell.

    The second value (m,): half widths of the predictions' 95 % intervals, in which the pose's own readings have no part
    either: the covariance is that of the others, and so is the size of the noise (its make-up is the whole
    estimate's). A pose that alone determines a parameter is not predicted; the third value says why, by pose.
    """
    p, whole = e.problem, _Whole.of(e)
    error, variance, size = np.full(len(p), np.nan), np.full(len(p), np.nan), np.ones(len(p))
    reasons = dict[str, str]()
    order = np.argsort(p.pose, kind="stable")
    ends = np.searchsorted(p.pose[order], np.arange(len(p.poses) + 1))
    for k, label in enumerate(p.poses):
        if progress is not None and k % max(len(p.poses) // TOLD, 1) == 0:
            progress(k, len(p.poses))
        mine = order[ends[k] : ends[k + 1]]
        step = whole.step_without(mine)
        try:
            found, spread, unknown = _fitted_anew(e, mine) if step is None else whole.predicted(mine, step)
        except InputError as reason:
            reasons[label] = reason.prose
            continue
        if unknown:
            reasons[label] = f"without pose {label} the readings do not determine {', '.join(unknown)}"
        else:
            error[mine], variance[mine], size[mine] = found, spread, whole.size_without(mine)
    return error, _half_widths(e, error, variance, size, np.bincount(p.pose)[p.pose]), reasons


def _half_widths(e: Estimate, error: Array, variance: Array, size: Array, each: Integers) -> Array:
    """Half widths (m,) of the intervals about predictions with errors (m,) and variances (m,) by the parameters.

    ``size`` (m,): variance of the noise without the pose, over that with it; ``each`` (m,): readings of its pose.
    """
    p, half = e.problem, np.full(len(error), np.nan)
    covariance = determined_covariance(e.rows, e.seen)[0]
    for n in np.unique(each):
        mine = (each == n) & ~np.isnan(error)
        if mine.any():
            f = (p.value - error)[mine]
            half[mine] = half_width95(
                e, p.take(mine), f, variance[mine], covariance, e.jacobian[mine], less=int(n), share=size[mine]
            )
    return half


@dataclass(frozen=True)
class _Whole:
    """An estimate's whitened readings as a product ``A = Q R``, ready for poses to be taken out.

    ``Q`` (m, r): orthonormal columns, ``R`` (r, p), ``turn`` (p, r) its inverse; ``g`` (r,): Q^T times the whitened
    residual, priors included; ``white`` (m,): whitened residual; ``held`` (p,): variables that stand at a bound.
    """

    e: Estimate
    Q: Array
    R: Array
    turn: Array
    g: Array
    white: Array
    room: tuple[Array, Array]
    seen: Bools
    null: Array

    @staticmethod
    def of(e: Estimate) -> _Whole:
        """The estimate taken apart, columns that no reading moves with left out."""
        p, seen = e.problem, e.seen
        prior, slopes = prior_residual(p, e.u)
        A = np.vstack([e.whitened, -slopes])
        norm = np.where(seen, np.linalg.norm(A, axis=0), 1.0)
        few = np.linalg.qr(A[:, seen] / norm[seen], mode="r") if seen.any() else np.zeros((0, 0))
        s, V = np.linalg.svd(few)[1:]
        good = s > ROUNDING * s.max(initial=0.0)
        s, V = s[good], V[: len(s)][good]
        turn, R = np.zeros((len(norm), len(s))), np.zeros((len(s), len(norm)))
        turn[seen] = V.T / s / norm[seen, None]
        R[:, seen] = s[:, None] * V * norm[seen]
        white = e.covariance.whiten(e.residual[:, None])[:, 0]
        Q = e.whitened @ turn
        g = Q.T @ white - (slopes @ turn).T @ prior
        low, high = p.bounds
        return _Whole(e, Q, R, turn, g, white, (low - e.u, high - e.u), seen, null_directions(e.rows, seen))

    def step_without(self, mine: Indices) -> Array | None:
        """The step (p,) of the variables to the estimate without the components ``mine``; None: fit it anew."""
        Q = self.Q[mine]
        size, way = np.linalg.eigh(np.eye(Q.shape[1]) - Q.T @ Q)
        if size.size and size[0] < SHARE_LEFT:
            return None
        root = np.sqrt(size)
        A = (way * root) @ way.T @ self.R
        b = (way / root) @ (way.T @ (self.g - Q.T @ self.white[mine]))
        step = _bounded(A, b, *self.room)
        if not self.e.problem.is_linear and np.linalg.norm(self.R @ step) > NEAR:
            return None
        return step

    def predicted(self, mine: Indices, step: Array) -> tuple[Array, Array, list[str]]:
        """Errors of the components ``mine`` after a step, their variances by the parameters, and unknown ones.

        Unknown: the parameters that these components move with and the others do not determine.
        """
        J, Q = self.e.jacobian[mine], self.Q[mine]
        B = J @ self.turn
        variance = np.sum(B * np.linalg.solve(np.eye(Q.shape[1]) - Q.T @ Q, B.T).T, axis=1)
        unknown = moving_with(self.e.problem, J, self.seen, self.null)
        return self.e.residual[mine] - J @ step, variance, unknown

    def size_without(self, mine: Indices) -> float:
        """Mean square of the residuals in units of the noise by a fit without the components ``mine``.

        To first order, and bounds aside: the sum of squares falls by ``e^T (I - Q Q^T)^-1 e`` (Cook and Weisberg,
        section 2.2).
        """
        total, spare = float(self.white @ self.white), len(self.white) - self.Q.shape[1]
        if total == 0.0 or spare <= len(mine):
            return 1.0
        Q, own = self.Q[mine], self.white[mine]
        kept = np.eye(len(own)) - Q @ Q.T
        size, way = np.linalg.eigh(kept)
        told = size > SHARE_LEFT
        drop = float(np.sum((way[:, told].T @ own) ** 2 / size[told]))
        # Noise that stands at the gauge's resolution is larger than the residuals: no less is known of it then.
        return float(max(total - drop, 0.0) / (spare - len(mine)) / min(total / spare, 1.0))


def _bounded(A: Array, b: Array, low: Array, high: Array) -> Array:
    """The bounded step for A (r, p); first as if those at a bound stayed there, which is nearly always so."""
    free = (low < 0.0) & (high > 0.0)
    x = np.zeros(A.shape[1])
    norm = np.linalg.norm(A, axis=0)
    use = np.flatnonzero(free & (norm > 0.0))
    x[use] = np.linalg.lstsq(A[:, use] / norm[use], b, rcond=ROUNDING)[0] / norm[use]
    left = b - A @ x
    pull = A.T @ left
    rest = LEVEL * norm * np.linalg.norm(b)
    stay = free | ((low >= 0.0) & (pull <= rest)) | ((high <= 0.0) & (pull >= -rest))
    if stay.all() and (x >= low).all() and (x <= high).all():
        return x
    return bounded_step(A, b, low, high)


def _fitted_anew(e: Estimate, mine: Indices) -> tuple[Array, Array, list[str]]:
    """As :meth:`_Whole.predicted`, by a fit to all others."""
    others = np.ones(len(e.problem), dtype=np.bool_)
    others[mine] = False
    rest = e.problem.take(others)
    check_enough(rest)
    common = e.noise.common(e.problem, e.prediction)[others]
    V = rest.blocks.covariance(e.covariance.variance[others], common)
    u = minimise(rest, V, e.u)[0]
    left = e.problem.take(~others)
    value, J = left.evaluate(u)
    A = np.vstack([V.whiten(rest.evaluate(u)[1]), prior_residual(rest, u)[1]])
    seen = seen_columns(rest, A)
    S, (_, null) = determined_covariance(A, seen)
    return left.value - value, np.einsum("ni,ij,nj->n", J, S, J), moving_with(rest, J, seen, null)


def moving_with(p: Problem, J: Array, seen: Bools, null: Array) -> list[str]:
    """Names of parameters not determined that readings with derivatives J (m, p) move with.

    ``seen`` (p,): those that the readings behind an estimate move with; ``null`` (d, p): directions that they leave
    open.
    """
    moves = np.linalg.norm(J, axis=0) > 1e-9 * np.linalg.norm(J)
    open_ = ~seen & moves
    for row in null:
        if np.linalg.norm(J @ row) > 1e-6 * np.linalg.norm(J * row):
            open_ |= row != 0.0
    return [q.name for q, unknown in zip(p.parameters, open_, strict=True) if unknown]
