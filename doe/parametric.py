"""One parametric study: level grid over the springs of a stage, at one pose, refined and widened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from doe.designs import level_grid
from doe.readings import Equations

Array = NDArray[np.float64]

# Springs outside this range are as good as absent or rigid on any arm; widening stops here.
WIDEST_Nm_per_rad = (1e3, 1e9)
MAX_ROUNDS = 40
# A spring whose whole contribution is below half a gauge digit reads the same as a rigid one.
RIGID_SHARE_OF_GAUGE = 0.5
# Two springs matched to one reading leave a valley. The tie goes to the springs nearest to the starting
# values: in the first round 50 um of error weigh as much as a factor e in one spring, and every later round
# lets go by a factor of four, so the match wins in the end.
TIE_WEIGHT = 100.0


@dataclass(frozen=True)
class PoseFit:
    """The best-matching springs of one stage at one pose.

    ``stiffness`` (k,) N m/rad; ``error_mm``: RMS of simulated minus measured at this pose (signed for a
    single reading); ``runs``: model runs spent; ``first_error_mm``: after the first grid;
    ``remarks``: bounds that were hit and widened, or what could not be matched; ``matched``: within the
    gauge; ``equivalent`` (k, 2): smallest and largest stiffness of each spring that match as well with
    some value of the others (NaN where nothing matches).
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
    system: Equations, fixed: Array, columns: list[int], joints: tuple[str, ...], levels: int,
    bounds: tuple[float, float], gauge_m: float, start: float, spacing: str = "log",
) -> PoseFit:
    """Level grid over the springs in ``columns`` at one pose, refined about the best level.

    Parameters
    ----------
    system : equations of this pose only
    fixed : (dof,) compliances of all springs; those in ``columns`` are overwritten
    levels : levels of each spring in each round
    bounds : first lower and upper stiffness, N m/rad
    gauge_m : refinement ends when the RMS error is within this
    start : stiffness (N m/rad) that ties between several springs lean towards
    spacing : "log" or "linear" levels
    """
    base = system.rest + system.influence @ np.where(_mask(columns, fixed.size), 0.0, fixed) - system.value
    A = system.influence[:, columns]
    low, high = np.full(len(columns), bounds[0]), np.full(len(columns), bounds[1])
    bound, limit = (low.copy(), high.copy()), _widest(A, bounds, gauge_m)
    remarks: list[str] = []
    runs, first, best_k, best_error = 0, np.nan, np.sqrt(low * high), np.inf
    for round_number in range(1, MAX_ROUNDS + 1):
        grids = [_levels(a, b, levels, spacing) for a, b in zip(low, high, strict=True)]
        k = level_grid(grids)
        error = np.sqrt(np.mean((base + (1.0 / k) @ A.T) ** 2, axis=1))
        score = (np.maximum(error, gauge_m) / gauge_m) ** 2
        if len(columns) > 1:
            score += TIE_WEIGHT / 4.0**round_number * np.sum(np.log(k / start) ** 2, axis=1)
        runs += len(k)
        index = int(np.argmin(score))
        best_k, best_error = k[index], float(error[index])
        first = best_error if round_number == 1 else first
        if best_error <= gauge_m:
            break
        hit = _widen(best_k, bound, limit, joints, remarks)
        low, high = _refined(best_k, grids, bound)
        if not hit and np.all(high / low < 1.0 + 1e-6):
            break
    matched = best_error <= gauge_m
    signed = float(base[0] + A[0] @ (1.0 / best_k)) if len(system) == 1 else best_error
    if not matched:
        remarks.append(_why_unmatched(signed, system))
    return PoseFit(
        pose=system.pose[0], joints=joints, stiffness=best_k, error_mm=signed * 1e3, first_error_mm=first * 1e3,
        runs=runs, rounds=round_number, matched=matched, remarks=tuple(remarks),
        equivalent=_equivalent(A, -base, max(gauge_m, best_error), matched),
    )


def _widest(A: Array, bounds: tuple[float, float], gauge_m: float) -> tuple[Array, Array]:
    """How far each bound may be widened: up to where the spring reads the same as a rigid one."""
    rigid = np.abs(A).max(axis=0) / (RIGID_SHARE_OF_GAUGE * gauge_m)
    high = np.clip(rigid, bounds[1], max(WIDEST_Nm_per_rad[1], bounds[1]))
    return np.full(A.shape[1], min(WIDEST_Nm_per_rad[0], bounds[0])), high


def _mask(columns: list[int], size: int) -> NDArray[np.bool_]:
    mask = np.zeros(size, dtype=np.bool_)
    mask[columns] = True
    return mask


def _levels(low: float, high: float, count: int, spacing: str) -> Array:
    return np.geomspace(low, high, count) if spacing == "log" else np.linspace(low, high, count)


def _widen(
    best: Array, bound: tuple[Array, Array], limit: tuple[Array, Array], joints: tuple[str, ...],
    remarks: list[str],
) -> bool:
    """Move a bound that the best level sits on by a factor of ten, up to its limit; say so."""
    hit = False
    for i, joint in enumerate(joints):
        for side, name, step in ((1, "upper", 10.0), (0, "lower", 0.1)):
            at = bound[side][i]
            wider = min(at * step, limit[1][i]) if side else max(at * step, limit[0][i])
            if np.isclose(best[i], at) and not np.isclose(wider, at):
                remarks.append(f"{joint}: {name} bound {at:.2g} N m/rad hit, widened to {wider:.2g}")
                bound[side][i] = wider
                hit = True
    return hit


def _refined(best: Array, grids: list[Array], bound: tuple[Array, Array]) -> tuple[Array, Array]:
    """One level to both sides of the best one; a whole new decade where a bound was just widened."""
    low, high = np.empty_like(best), np.empty_like(best)
    for i, grid in enumerate(grids):
        at = int(np.argmin(np.abs(np.log(grid / best[i]))))
        low[i] = grid[at - 1] if at > 0 else max(bound[0][i], grid[0] ** 2 / grid[1])
        high[i] = grid[at + 1] if at < len(grid) - 1 else min(bound[1][i], grid[-1] ** 2 / grid[-2])
        if at == 0 and bound[0][i] < grid[0]:
            low[i] = bound[0][i]
        if at == len(grid) - 1 and bound[1][i] > grid[-1]:
            high[i] = bound[1][i]
        low[i], high[i] = min(low[i], best[i]), max(high[i], best[i])
    return low, high


def _why_unmatched(signed: float, system: Equations) -> str:
    """In words, for a single reading by its sign against the reading (a deflection has the load's sign)."""
    if len(system) > 1:
        return f"not matched: no level brings all readings of this pose within the gauge (RMS {signed * 1e3:.3f} mm)"
    too_much = signed * float(system.value[0]) > 0.0
    if too_much:
        return (
            f"not matched: the rest of the model alone bends {abs(signed) * 1e3:.3f} mm more than was measured, "
            "so this spring stands where it reads the same as a rigid one"
        )
    return f"not matched: {abs(signed) * 1e3:.3f} mm less deflection than measured at the softest springs"


def _equivalent(A: Array, target: Array, tolerance: float, matched: bool) -> Array:
    """Range of each spring over all combinations that match within the tolerance, by linear programming."""
    k = A.shape[1]
    out = np.full((k, 2), np.nan)
    if not matched:
        return out
    # Scaled to c in 1e-6 rad/(N m) and readings in um, so the solver's tolerances mean something.
    rows = np.vstack([A, -A])
    limit = np.concatenate([target + tolerance, -target + tolerance]) * 1e6
    box = [(1e6 / WIDEST_Nm_per_rad[1], 1e6 / WIDEST_Nm_per_rad[0])] * k
    for i in range(k):
        for side, sign in ((1, 1.0), (0, -1.0)):
            cost = np.zeros(k)
            cost[i] = sign
            found = linprog(cost, A_ub=rows, b_ub=limit, bounds=box, method="highs")
            if found.x is not None:
                out[i, side] = 1e6 / found.x[i]
    return out
