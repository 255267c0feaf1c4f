"""Ends of intervals by profile likelihood: how far one variable may go before the others cannot make up for it.

A value belongs to the interval if, with the best values of all others within their bounds, the sum of squares rises
by no more than quantile^2 (Venzon and Moolgavkar 1988, doi:10.2307/2347496). The root of the rise is sought, because
for a linear problem it is proportional to the way gone: then two or three trials are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from doe.estimation.estimate import Estimate
from doe.estimation.least_squares import bounded_step, is_convex, minimise
from robots.arrays import Array

# The root (>= 0) of the rise of the sum of squares at a value of one variable.
Rise = Callable[[float], float]

# Ends are found to this share of the quantile.
PRECISE = 1e-3
TRIALS = 60
# Standard deviations, all readings together: the last step may be as long as this, and derivatives as far away.
NEARLY, NEARBY = 0.03, 4.0


def rise_of(e: Estimate, k: int, covariance: Array) -> Rise:
    """The rise for variable k; ``covariance`` (p, p) says where the others go first."""
    if is_convex(e.problem):
        return _linear_rise(e, k)
    return _general_rise(e, k, covariance)


def _linear_rise(e: Estimate, k: int) -> Rise:
    """By bounded least squares on the triangular factor of the whitened derivatives."""
    low, high = e.problem.bounds
    rows = np.column_stack([e.whitened, e.covariance.whiten(e.residual[:, None])])
    R = np.asarray(np.linalg.qr(rows, mode="r"))
    A, b = R[:, :-1], R[:, -1]
    least = float(b @ b)
    others = np.arange(A.shape[1]) != k
    columns, box = A[:, others], ((low - e.u)[others], (high - e.u)[others])

    def rise(value: float) -> float:
        left = b - A[:, k] * (value - e.u[k])
        left = left - columns @ bounded_step(columns, left, *box)
        return math.sqrt(max(float(left @ left) - least, 0.0))

    return rise


def _general_rise(e: Estimate, k: int, covariance: Array) -> Rise:
    """By solving the whole problem with one variable held, from where the parabola expects the others.

    The sum of squares is flat around its minimum, so a coarse end and derivatives from nearby change it little.
    """
    p = e.problem
    low, high = p.bounds
    along = covariance[:, k] / covariance[k, k] if covariance[k, k] > 0.0 else np.zeros(len(e.u))
    along[k] = 1.0

    def rise(value: float) -> float:
        start = np.clip(e.u + along * (value - e.u[k]), low, high)
        start[k] = value
        square = minimise(p, e.covariance, start, k, still=NEARLY, fresh=NEARBY, known=(e.u, e.jacobian))[1]
        return math.sqrt(max(square - e.square, 0.0))

    return rise


def profile_end(rise: Rise, u: float, end: float, quantile: float, guess: float) -> float:
    """Where ``rise`` passes ``quantile`` between the estimate u and the end of the range; ``end`` if it does not.

    ``guess``: how far from u to look first.
    """
    if u == end:
        return u
    sign, most = math.copysign(1.0, end - u), abs(end - u)
    # Ways gone, with the rise there less the quantile: inside of the interval, and outside of it.
    near, near_miss = 0.0, -quantile
    far, far_miss = most, math.nan
    way = min(guess, most)
    for _ in range(TRIALS):
        miss = rise(u + sign * way) - quantile
        if abs(miss) < PRECISE * quantile:
            return u + sign * way
        if miss < 0.0:
            if way >= most:
                return end
            near, near_miss, last_near = way, miss, True
        else:
            far, far_miss, last_near = way, miss, False
        if math.isnan(far_miss):
            # Still inside: as far again as the slope so far says, and a little more.
            way = min(max(1.1 * near * quantile / max(near_miss + quantile, 1e-3 * quantile), 1.5 * near), most)
        else:
            way = (near * far_miss - far * near_miss) / (far_miss - near_miss)
            # Illinois: an end that stays counts half, so that both close in.
            if last_near:
                far_miss *= 0.5
            else:
                near_miss *= 0.5
        if far - near < 1e-12 * far:
            break
    return u + sign * near
