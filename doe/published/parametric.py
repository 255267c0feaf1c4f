"""Parametric studies: the best of all combinations of levels, then of finer levels around it.

Of the springs of a stage at one pose (:func:`fit_pose`: bounds are widened, the nearest of many matches is taken), and
of any parameters on all readings of a stage (:func:`level_study`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, lsq_linear, minimize

from doe.estimation.campaign import FEWEST_LEVELS
from doe.estimation.problem import Problem
from doe.planning.designs import level_grid
from doe.planning.screening import inner
from robots import InputError, require_at_least, require_one_of
from robots.arrays import Array, Bools

# Springs outside this range are as good as absent or rigid on any arm; widening stops here.
WIDEST_Nm_per_rad = (1e3, 1e9)
MAX_ROUNDS = 40
# A spring whose whole contribution is below half a gauge digit reads the same as a rigid one.
RIGID_SHARE_OF_GAUGE = 0.5
# Several springs matched to one reading leave a valley of equal matches. The grid leans towards the starting
# values: in the first round 50 um of error weigh as much as a factor e in one spring (for a gauge of 10 um),
# and every later round lets go by a factor of four, so the match wins in the end.
TIE_WEIGHT = 100.0
# Lower and upper bounds are widened by these factors.
WIDER = np.array([[0.1], [10.0]])
# Levels that differ by less than this (relative) cannot be told apart by any reading.
SAME_LEVEL = 1e-6
# Refinement of any parameters ends when levels are this close together: ratio of positive numbers, share of the range
# of others.
SAME = 1e-3


@dataclass(frozen=True)
class PoseFit:
    """The best-matching springs of one stage at one pose.

    ``stiffness`` (k,) N m/rad; ``error_mm``: RMS of simulated minus measured at this pose (signed for a
    single reading); ``runs``: model runs of the grids; ``first_error_mm``: RMS after the first grid;
    ``remarks``: bounds that were hit and widened, or what could not be matched; ``matched``: within the
    gauge; ``equivalent`` (k, 2): smallest and largest stiffness of each spring that match as well with
    some value of the others (NaN where nothing matches; 1e9 N m/rad stands for rigid).
    """

    pose: str
    joints: tuple[str, ...]
    stiffness: Array
    error_mm: float
    first_error_mm: float
    runs: int
    rounds: int
    matched: bool
    remarks: tuple[str, ...]
    equivalent: Array


def fit_pose(
    pose: str,
    A: Array,
    base: Array,
    joints: tuple[str, ...],
    levels: int,
    bounds: tuple[float, float],
    gauge_m: float,
    start: float,
    spacing: str = "log",
) -> PoseFit:
    """Level grid over the springs of some joints at one pose, refined about the best level.

    A grid finds *a* match. Of several springs that match one reading in many ways, those nearest to
    ``start`` (least sum of squared logarithms of the ratios) are then taken, so that the answer does not
    depend on where the levels happened to lie; they match no worse than the grid's best level. Where the
    levels of several springs find no match, the exact least squares (the model is linear) decide.

    Parameters
    ----------
    A : (m, k) displacement (m or rad) of what was read per unit compliance of each of the k springs
    base : (m,) what all else gives, less what was read
    levels : levels of each spring in each round, at least FEWEST_LEVELS
    bounds : first lower and upper stiffness, N m/rad
    gauge_m : refinement ends when the RMS error is within this
    start : stiffness (N m/rad) that ties between several springs lean towards
    spacing : "log" or "linear" levels

    Raises
    ------
    InputError
        Too few levels, bounds out of order, or another spacing.
    """
    _check(levels, bounds, spacing)
    ends = np.tile(np.array(bounds)[:, None], len(joints))
    bound, limit = ends.copy(), _widest(A, bounds, gauge_m)
    runs, first, best_k, best_error = 0, np.nan, np.sqrt(ends[0] * ends[1]), np.inf
    for round_number in range(1, MAX_ROUNDS + 1):
        grids = [_levels(a, b, levels, spacing) for a, b in ends.T]
        k = level_grid(grids)
        error = np.sqrt(np.mean((base + (1.0 / k) @ A.T) ** 2, axis=1))
        score = (error / gauge_m) ** 2
        if len(joints) > 1:
            # All matches are equally good, and the nearest to the start is taken.
            tie = TIE_WEIGHT / 4.0**round_number * np.sum(np.log(k / start) ** 2, axis=1)
            score = np.maximum(score, 1.0) + tie
        runs += len(k)
        index = int(np.argmin(score))
        best_k, best_error = k[index], float(error[index])
        first = best_error if round_number == 1 else first
        if best_error <= gauge_m:
            break
        widened = _widen(best_k, bound, limit)
        ends = _refined(best_k, grids, bound, widened)
        if not widened.any() and np.all(ends[1] / ends[0] < 1.0 + SAME_LEVEL):
            break
    if best_error > gauge_m and len(joints) > 1:
        best_k, best_error = _least_squares(A, base, best_k, bound, limit)
    matched = best_error <= gauge_m
    if matched and len(joints) > 1:
        best_k = _nearest_match(A, base, best_k, bound, gauge_m, start)
    left = base + A @ (1.0 / best_k)
    remarks = _bound_remarks(best_k, bounds, bound, joints)
    if not matched:
        remarks.append(_why_unmatched(left, A))
    return PoseFit(
        pose=pose,
        joints=joints,
        stiffness=best_k,
        error_mm=float(left[0] if len(left) == 1 else np.sqrt(np.mean(left**2))) * 1e3,
        first_error_mm=first * 1e3,
        runs=runs,
        rounds=round_number,
        matched=matched,
        remarks=tuple(remarks),
        equivalent=_equivalent(A, base, max(gauge_m, float(np.abs(left).max())), bounds, matched),
    )


def _check(levels: int, bounds: tuple[float, float], spacing: str) -> None:
    require_at_least("levels of a parametric study", levels, FEWEST_LEVELS, code="M002")
    if not 0.0 < bounds[0] < bounds[1] < np.inf:
        text = f"{bounds[0]:g} to {bounds[1]:g} N m/rad"
        raise InputError("bounds of a parametric study", code="M002", value=text, allowed="0 < lower < upper, finite")
    require_one_of("spacing of the levels", spacing, ("log", "linear"), code="M002")


def _widest(A: Array, bounds: tuple[float, float], gauge_m: float) -> Array:
    """How far each bound (2, k) may be widened: up to where the spring reads the same as a rigid one."""
    rigid = np.abs(A).max(axis=0) / (RIGID_SHARE_OF_GAUGE * gauge_m)
    high = np.clip(rigid, bounds[1], max(WIDEST_Nm_per_rad[1], bounds[1]))
    return np.array([np.full(A.shape[1], min(WIDEST_Nm_per_rad[0], bounds[0])), high])


def _levels(low: float, high: float, count: int, spacing: str) -> Array:
    return np.geomspace(low, high, count) if spacing == "log" else np.linspace(low, high, count)


def _widen(best: Array, bound: Array, limit: Array) -> Bools:
    """Move each bound (2, k) that the best level sits on by a factor of ten, up to its limit; which were (2, k)."""
    wider = np.clip(bound * WIDER, limit[0], limit[1])
    widened = np.isclose(best, bound) & ~np.isclose(wider, bound)
    bound[widened] = wider[widened]
    return np.asarray(widened)


def _refined(best: Array, grids: list[Array], bound: Array, widened: Bools) -> Array:
    """One level to both sides of the best one (2, k); up to the new bound where one was just widened.

    Where the best level is the last one of its grid, the search goes on beyond it, by one such level.
    """
    grid = np.array(grids).T
    beyond = np.vstack([grid[0] ** 2 / grid[1], grid, grid[-1] ** 2 / grid[-2]])
    at, column = np.argmin(np.abs(np.log(grid / best)), axis=0), np.arange(best.size)
    # A grid's own levels lie within the bounds.
    ends = np.clip([beyond[at, column], beyond[at + 2, column]], bound[0], bound[1])
    ends = np.where(widened, bound, ends)
    return np.array([np.minimum(ends[0], best), np.maximum(ends[1], best)])


def _least_squares(A: Array, base: Array, best: Array, bound: Array, limit: Array) -> tuple[Array, float]:
    """Finish where levels along the axes stick in a slanting valley: the optimum, bounds widened to hold it."""
    scale = np.abs(A).max(axis=0)
    scale[scale == 0.0] = 1.0
    box = (scale / limit[1], scale / limit[0])
    found = lsq_linear(A / scale, -base, bounds=box, method="bvls", tol=1e-14, max_iter=1000)
    candidates = [best, np.clip(scale / found.x, limit[0], limit[1])]
    errors = [float(np.sqrt(np.mean((base + A @ (1.0 / k)) ** 2))) for k in candidates]
    k = candidates[int(np.argmin(errors))]
    while (beyond := np.array([k < bound[0] * (1.0 - SAME_LEVEL), k > bound[1] * (1.0 + SAME_LEVEL)])).any():
        bound[beyond] = np.clip(bound * WIDER, limit[0], limit[1])[beyond]
    return k, min(errors)


def _nearest_match(A: Array, base: Array, best: Array, bound: Array, gauge_m: float, start: float) -> Array:
    """Of all springs that match as well as the best level, those nearest to ``start``."""
    # In y = start / k the match is linear, and y is of order one.
    rows, target = A / (start * gauge_m), -base / gauge_m
    allowed = max(float(np.abs(base + A @ (1.0 / best)).max()) / gauge_m, SAME_LEVEL)

    def distance(y: Array) -> float:
        return float(np.sum(np.log(y) ** 2))

    def slope(y: Array) -> Array:
        return np.asarray(2.0 * np.log(y) / y)

    found = minimize(
        distance,
        start / best,
        jac=slope,
        method="SLSQP",
        bounds=Bounds(start / bound[1], start / bound[0]),
        constraints=LinearConstraint(rows, target - allowed, target + allowed),
        options={"ftol": 1e-12, "maxiter": 200},
    )
    k = np.clip(start / found.x, bound[0], bound[1])
    nearer = distance(start / k) < distance(start / best)
    still_matched = np.sqrt(np.mean((base + A @ (1.0 / k)) ** 2)) <= gauge_m
    return np.asarray(k) if nearer and still_matched else best


def _bound_remarks(best: Array, first: tuple[float, float], last: Array, joints: tuple[str, ...]) -> list[str]:
    """Say which springs lie outside the first bounds, and which stand at a bound."""
    out = []
    for i, joint in enumerate(joints):
        for side, name in ((0, "lower"), (1, "upper")):
            outside = best[i] > first[1] * (1.0 + SAME_LEVEL) if side else best[i] < first[0] * (1.0 - SAME_LEVEL)
            at_end = np.isclose(best[i], last[side][i], rtol=10.0 * SAME_LEVEL)
            bound = f"{joint}: {name} bound {first[side]:.2g} N m/rad"
            if outside:
                end = " and stands there" if at_end else ""
                out.append(f"{bound} hit, widened to {last[side][i]:.2g}{end}")
            elif np.isclose(best[i], first[side], rtol=10.0 * SAME_LEVEL):
                out.append(f"{bound} hit, stands there")
    return out


def _why_unmatched(left: Array, A: Array) -> str:
    """In words; for a single reading by the side on which the springs ran out of range."""
    error_mm = float(np.sqrt(np.mean(left**2))) * 1e3
    if len(left) > 1:
        return f"not matched: no level brings the readings of this pose within the gauge (RMS {error_mm:.3f} mm)"
    if not A.any():
        return f"not matched: {error_mm:.3f} mm off, and the reading does not move with the spring"
    # A softer spring moves the reading along the sign of its influence.
    if np.all(left[0] * A[0] >= 0.0):
        stands = "this spring stands where it reads" if A.size == 1 else "these springs stand where they read"
        return (
            f"not matched: the rest of the model alone bends {error_mm:.3f} mm more than was measured, "
            f"so {stands} the same as {'a rigid one' if A.size == 1 else 'rigid ones'}"
        )
    return f"not matched: {error_mm:.3f} mm less deflection than measured at the softest springs"


def _equivalent(A: Array, base: Array, tolerance: float, bounds: tuple[float, float], matched: bool) -> Array:
    """Range of each spring over all combinations that match within the tolerance, by linear programming."""
    k = A.shape[1]
    out = np.full((k, 2), np.nan)
    if not matched:
        return out
    # Scaled to c in 1e-6 rad/(N m) and readings in um, so the solver's tolerances mean something.
    rows = np.vstack([A, -A])
    limit = np.concatenate([tolerance - base, tolerance + base]) * 1e6
    widest = min(WIDEST_Nm_per_rad[0], bounds[0]), max(WIDEST_Nm_per_rad[1], bounds[1])
    box = [(1e6 / widest[1], 1e6 / widest[0])] * k
    for i in range(k):
        for side, sign in ((1, 1.0), (0, -1.0)):
            cost = np.zeros(k)
            cost[i] = sign
            found = linprog(cost, A_ub=rows, b_ub=limit, bounds=box, method="highs")
            if found.x is not None:
                out[i, side] = 1e6 / found.x[i]
    return out


@dataclass(frozen=True)
class LevelStudy:
    """The best combination of levels.

    ``u`` (p,): its estimator's variables; ``first`` (p,): the first round's best; ``rms``, ``first_rms``: of the
    residuals (m or rad) with either; ``runs``: model evaluations; ``at_bound``: parameters whose best level is an end
    of their range.
    """

    u: Array
    first: Array
    rms: float
    first_rms: float
    runs: int
    rounds: int
    at_bound: tuple[str, ...]


def level_study(p: Problem, levels: int, *, refine: bool = True) -> LevelStudy:
    """All combinations of ``levels`` of each parameter over its range (in the logarithm where positive).

    With ``refine`` the range narrows to one level on either side of the best one until levels are 0.1 % apart. The
    best is that with the smallest root mean square of residuals, all weighted alike, as in published studies.
    """
    k = len(p.parameters)
    low, high = np.zeros(k), np.ones(k)
    first: tuple[Array, float] | None = None
    runs = rounds = 0
    while True:
        grid = level_grid([np.linspace(a, b, levels) for a, b in zip(low, high, strict=True)])
        u = inner(p.parameters, grid)
        error = np.array([_rms(p, one) for one in u])
        best = int(np.argmin(error))
        runs, rounds = runs + len(grid), rounds + 1
        first = first or (u[best], float(error[best]))
        step = (high - low) / (levels - 1)
        if not refine or rounds == MAX_ROUNDS or np.all(_ratio(p, step) < SAME):
            break
        low, high = np.maximum(grid[best] - step, 0.0), np.minimum(grid[best] + step, 1.0)
    ends = tuple(q.name for q, x in zip(p.parameters, grid[best], strict=True) if x in (0.0, 1.0))
    return LevelStudy(u[best], first[0], float(error[best]), first[1], runs, rounds, ends)


def _rms(p: Problem, u: Array) -> float:
    return float(np.sqrt(np.mean((p.value - p.evaluate(u)[0]) ** 2)))


def _ratio(p: Problem, step: Array) -> Array:
    """How far two neighbouring levels are apart."""
    span = [1.0 if q.scale == "linear" else float(np.log(q.upper / q.lower)) for q in p.parameters]
    return np.asarray(step * np.array(span))
