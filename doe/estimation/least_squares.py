"""Bounded least squares: one linear step, and as many damped ones as a problem that is not linear needs.

Linear problems are convex: the step is the global optimum. Else Levenberg and Marquardt's method (Moré 1978,
doi:10.1007/BFb0067700) with the bounds kept in every step, so that a variable may go along its bound.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from doe.estimation.blocks import Covariance
from doe.estimation.problem import Problem
from robots.arrays import Array, Bools

# Columns below this share of the largest (each times the range of its variable) move no reading.
BLIND = 1e-9
# Directions this much weaker than the strongest are left alone: they are rounding.
ROUNDING = 1e-10
# Columns that keep this share of their length across all before them are solved for by their products, which is
# faster than a factorisation and loses three digits of sixteen.
INDEPENDENT = 0.05
STEPS = 100
# Steps stop when all readings together move by less than this, in standard deviations.
STILL = 1e-7
# Derivatives serve as long as the readings have moved by less than this since, all together.
FRESH = 0.1


def prior_residual(p: Problem, u: Array) -> tuple[Array, Array]:
    """Standardised distances (k,) from the priors' means, and their derivatives (k, p)."""
    index = [k for k, q in enumerate(p.parameters) if q.prior is not None]
    rows, slopes = np.zeros(len(index)), np.zeros((len(index), len(u)))
    for row, k in enumerate(index):
        q, v = p.parameters[k], float(u[k])
        mean, sd = q.prior or (0.0, 1.0)
        if q.scale == "compliance":
            v = max(v, 1e-300)
            rows[row], slopes[row, k] = (-np.log(v) - mean) / sd, -1.0 / (v * sd)
        else:
            rows[row], slopes[row, k] = (v - mean) / sd, 1.0 / sd
    return rows, slopes


def spanning(A: Array, weak: float) -> Array:
    """Orthonormal columns (m, r) with the span of A (m, p); directions below ``weak`` of the strongest are rounding."""
    norm = np.linalg.norm(A, axis=0)
    U, s, _ = np.linalg.svd(A[:, norm > 0.0] / norm[norm > 0.0], full_matrices=False)
    return np.asarray(U[:, s > weak * s.max(initial=1e-300)])


def is_convex(p: Problem) -> bool:
    """Whether the sum of squares is a parabola: all linear, and no prior."""
    return p.is_linear and all(q.prior is None for q in p.parameters)


def bounded_step(A: Array, b: Array, low: Array, high: Array) -> Array:
    """The x (p,) between ``low`` and ``high`` (p,; zero between them) that minimises |b - A x|.

    Where columns A (m, p) depend on one another the shortest x is taken (columns of norm one); columns that are
    next to zero stay where they are.
    """
    norm = np.sqrt(np.einsum("mp,mp->p", A, A))
    reach = norm * (high - low)
    seen = np.flatnonzero(reach > BLIND * max(float(reach.max(initial=0.0)), 1e-300))
    out = np.zeros(A.shape[1])
    if not seen.size:
        return out
    S = A[:, seen] / norm[seen]
    if len(S) > seen.size + 1:
        S, b = _square(S, b)
    box = low[seen] * norm[seen], high[seen] * norm[seen]
    x = np.linalg.lstsq(S, b, rcond=ROUNDING)[0]
    if (x < box[0]).any() or (x > box[1]).any():
        x = lsq_linear(S, b, bounds=box, method="bvls", tol=1e-14, max_iter=1000).x
    out[seen] = np.clip(x / norm[seen], low[seen], high[seen])
    return out


def _square(S: Array, b: Array) -> tuple[Array, Array]:
    """R (k, k) and z (k,) with |b - S x|^2 = |z - R x|^2 + a constant; S (m, k) with columns of norm one."""
    try:
        L = np.linalg.cholesky(S.T @ S)
    except np.linalg.LinAlgError:
        L = np.zeros((1, 1))
    if L.diagonal().min() > INDEPENDENT:
        return np.asarray(L.T), np.asarray(np.linalg.solve(L, S.T @ b))
    R = np.asarray(np.linalg.qr(np.column_stack([S, b]), mode="r"))[: S.shape[1]]
    return R[:, :-1], R[:, -1]


def minimise(
    p: Problem,
    V: Covariance,
    start: Array,
    held: int | None = None,
    *,
    still: float = STILL,
    fresh: float = FRESH,
    known: tuple[Array, Array] | None = None,
) -> tuple[Array, float]:
    """Variables (p,) with the least sum of squares |V^(-1/2) (y - f(u))|^2 plus the priors', and that sum.

    Linear variables go first, then all together. ``held``: a variable that stays where it is. ``still``, ``fresh``:
    how exact the end, and how far from where they were found derivatives serve. ``known``: variables near the start
    and the derivatives (m, p) there.
    """
    low, high = p.bounds
    free = np.arange(len(start)) != held
    linear = free & np.array([q.is_linear for q in p.parameters], dtype=bool)
    u = np.array(start, dtype=np.float64)
    if known is not None:
        at, W, residual = known[0], V.whiten(known[1]), _residual(p, V, u)
    else:
        f, J = p.evaluate(u)
        white = V.whiten(np.column_stack([J, p.value - f]))
        at, W, residual = u, white[:, :-1], np.concatenate([white[:, -1], prior_residual(p, u)[0]])
    if known is None and linear.any() and not linear[free].all():
        step = bounded_step(W[:, linear], residual[: len(p)], (low - u)[linear], (high - u)[linear])
        u = _moved(u, linear, step, low, high)
        residual = _residual(p, V, u)
    square, damping = float(residual @ residual), 0.0
    for _ in range(STEPS):
        if not p.is_linear and np.linalg.norm(W @ (u - at)) > fresh:
            at, W = u, V.whiten(p.evaluate(u)[1])
        A = np.vstack([W, -prior_residual(p, u)[1]])
        step = _damped(A[:, free], residual, (low - u)[free], (high - u)[free], damping)
        there = _moved(u, free, step, low, high)
        way = A @ (there - u)
        if is_convex(p) or (damping <= 1.0 and np.linalg.norm(way) < still):
            return there, float(np.sum((residual - way) ** 2))
        r = _residual(p, V, there)
        found = float(r @ r)
        if found <= square:
            u, residual, square = there, r, found
            damping = damping / 10.0 if damping > 1e-6 else 0.0
        elif not np.array_equal(at, u):
            at, W = u, V.whiten(p.evaluate(u)[1])
        else:
            damping = max(10.0 * damping, 1e-4)
    return u, square


def _moved(u: Array, which: Bools, step: Array, low: Array, high: Array) -> Array:
    out = u.copy()
    out[which] = np.clip(u[which] + step, low[which], high[which])
    return out


def _damped(A: Array, b: Array, low: Array, high: Array, damping: float) -> Array:
    if damping == 0.0:
        return bounded_step(A, b, low, high)
    rows = np.diag(np.sqrt(damping) * np.linalg.norm(A, axis=0))
    return bounded_step(np.vstack([A, rows]), np.concatenate([b, np.zeros(len(rows))]), low, high)


def _residual(p: Problem, V: Covariance, u: Array) -> Array:
    """Whitened residuals of the readings, and the priors' (k,)."""
    return np.concatenate([V.whiten((p.value - p.predict(u))[:, None])[:, 0], prior_residual(p, u)[0]])
