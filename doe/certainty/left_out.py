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
from robots.arrays import Array, Bools, Indices, Integers, in_blocks
from robots.progress import Progress

# A pose whose readings hold all but this share of what is known in some direction is left out by a fit anew.
SHARE_LEFT = 1e-3
# Predictions that are not linear are fitted anew where a pose's loss moves them by more than this, in standard
# deviations, all readings together: what a linear step then misses is of the order of its square.
NEAR = 0.3
# Slopes at a bound below this share of their size are rounding.
LEVEL = 1e-9
# Numbers that poses take while they are left out together: some 40 MB.
_BLOCK = 1_000_000
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
    each, done = np.diff(ends), np.zeros(len(p.poses), dtype=np.bool_)
    for n in np.unique(each[each > 0]):
        alike = np.flatnonzero(each == n)
        for part in in_blocks(len(alike), max(1, _BLOCK // (n * (n + len(e.u))))):
            if progress is not None:
                progress(int(done.sum()), len(done))
            group = alike[part]
            mine = order[ends[group][:, None] + np.arange(n)]
            fine, found, variance[mine], size[mine] = whole.all_without(mine)
            done[group], error[mine[fine]] = fine, found[fine]
    for k in np.flatnonzero(~done):
        label = p.poses[k]
        if progress is not None and k % max(len(p.poses) // TOLD, 1) == 0:
            progress(int(k), len(p.poses))
        mine = order[ends[k] : ends[k + 1]]
        step = whole.step_without(mine)
        try:
            if step is None:
                found, variance[mine], unknown = _fitted_anew(e, mine)
            else:
                J = e.jacobian[mine]
                found, unknown = e.residual[mine] - J @ step, moving_with(p, J, e.seen, whole.null)
        except InputError as reason:
            reasons[label] = reason.prose
            continue
        if unknown:
            reasons[label] = f"without pose {label} the readings do not determine {', '.join(unknown)}"
        else:
            error[mine] = found
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

    def all_without(self, mine: Indices) -> tuple[Bools, Array, Array, Array]:
        """Errors, variances and sizes of the noise (k, n) of poses with components ``mine`` (k, n), each left out.

        By matrices (n, n): the inverse of ``I - Q^T Q`` is ``I + Q^T (I - Q Q^T)^-1 Q``. The size is the mean square of
        the residuals in units of the noise, to first order and bounds aside: the sum of squares falls by
        ``e^T (I - Q Q^T)^-1 e`` (Cook and Weisberg, section 2.2). The first value (k,): for which poses the errors
        hold; the others meet a bound, need a fit anew (with a variance of its own), or move with what is left open.
        """
        (low, high), n = self.room, mine.shape[1]
        J, Q, own = self.e.jacobian[mine], self.Q[mine], self.white[mine]
        left, way = np.linalg.eigh(np.eye(n) - Q @ Q.swapaxes(1, 2))
        # What the others do not tell has no part.
        scale = np.where(left > SHARE_LEFT, 1.0 / np.sqrt(np.maximum(left, SHARE_LEFT)), 0.0)
        half = scale[:, :, None] * way.swapaxes(1, 2)
        B = J @ self.turn
        variance = np.sum(B**2, axis=2) + np.sum((half @ (Q @ B.swapaxes(1, 2))) ** 2, axis=1)
        total, spare, share = float(self.white @ self.white), len(self.white) - Q.shape[2], np.ones(len(mine))
        if total > 0.0 and spare > n:
            drop = np.sum(_times(half, own) ** 2, axis=1)
            # Noise that stands at the gauge's resolution is larger than the residuals: no less is known of it then.
            share = np.maximum(total - drop, 0.0) / (spare - n) / min(total / spare, 1.0)
        size = np.repeat(share[:, None], n, axis=1)
        use = np.flatnonzero((low < 0.0) & (high > 0.0) & self.R.any(axis=0))
        norm = np.linalg.norm(self.R[:, use], axis=0)
        U, s, V = np.linalg.svd(self.R[:, use] / norm, full_matrices=False)
        if len(s) < len(use) or (s <= ROUNDING * s.max(initial=0.0)).any():
            return np.zeros(len(mine), dtype=np.bool_), np.zeros(mine.shape), variance, size
        # The step: where it is free in all variables used, and what pulls at those that stand at a bound.
        h = self.g - _times(Q.swapaxes(1, 2), own)
        P, H = Q @ U, h @ U
        inner = np.eye(n) - P @ P.swapaxes(1, 2)
        inner[left[:, 0] < SHARE_LEFT] = np.eye(n)
        y = H + _times(P.swapaxes(1, 2), np.linalg.solve(inner, _times(P, H)[:, :, None])[:, :, 0])
        step = np.zeros((len(mine), len(low)))
        step[:, use] = (y / s) @ V / norm
        moved = y @ U.T
        pull = (h - moved + _times(Q.swapaxes(1, 2), _times(Q, moved))) @ self.R
        norms = np.sqrt(np.maximum(np.sum(self.R**2, axis=0) - np.sum((Q @ self.R) ** 2, axis=1), 0.0))
        rest = LEVEL * norms * np.sqrt(np.sum(h**2, axis=1) + np.sum(_times(half, _times(Q, h)) ** 2, axis=1))[:, None]
        fine = (left[:, 0] >= SHARE_LEFT) & ((step >= low) & (step <= high)).all(axis=1)
        at_low, at_high = (low >= 0.0) & (pull <= rest), (high <= 0.0) & (pull >= -rest)
        fine &= ((low < 0.0) & (high > 0.0) | at_low | at_high).all(axis=1)
        if not self.e.problem.is_linear:
            fine &= np.linalg.norm(moved, axis=1) <= NEAR
        fine &= ~moves_with(J, self.seen, self.null).any(axis=1)
        return fine, self.e.residual[mine] - _times(J, step), variance, size


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
    open_ = moves_with(J[None], seen, null)[0]
    return [q.name for q, unknown in zip(p.parameters, open_, strict=True) if unknown]


def moves_with(J: Array, seen: Bools, null: Array) -> Bools:
    """Which parameters (k, p) :func:`moving_with` names, of k groups of readings with derivatives J (k, n, p)."""
    open_ = ~seen & (np.linalg.norm(J, axis=1) > 1e-9 * np.sqrt(np.sum(J**2, axis=(1, 2)))[:, None])
    for row in null:
        mixed = np.linalg.norm(J @ row, axis=1) > 1e-6 * np.sqrt(np.sum((J * row) ** 2, axis=(1, 2)))
        open_ |= mixed[:, None] & (row != 0.0)
    return np.asarray(open_)


def _times(A: Array, x: Array) -> Array:
    """Matrices (k, m, n) times vectors (k, n), one by one."""
    return np.asarray((A @ x[:, :, None])[:, :, 0])
