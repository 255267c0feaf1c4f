"""Constant springs fitted to all readings at once: bounded linear least squares in the compliances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, lsq_linear
from scipy.stats import t as student

from doe.parametric import WIDEST_Nm_per_rad
from doe.readings import Equations, rms_mm
from robots import InputError

Array = NDArray[np.float64]
Status = Literal["determined", "one-sided", "at bound", "not identified"]

# Columns whose norm is below this share of the largest carry no information about their spring.
BLIND = 1e-9
# Above this condition number of the scaled system only combinations of the springs are determined.
MAX_CONDITION = 1e6


@dataclass(frozen=True)
class SpringEstimate:
    """A constant spring with what the data say about it.

    ``stiffness`` N m/rad; ``interval``: 95 % (lower, upper), the upper one infinite where the data do not
    exclude a rigid joint. ``status``: "determined"; "one-sided" (only a lower limit); "at bound" (the fit
    stands at the widest bound); "not identified" (no reading moves with it; stiffness is NaN).
    """

    joint: str
    stiffness: float
    interval: tuple[float, float]
    status: Status


@dataclass(frozen=True)
class ConstantFit:
    """Bounded least squares of constant springs.

    ``compliance`` (dof,): full vector with those not fitted as given; ``residual_m`` (m,): simulated
    minus measured; ``sigma_m``: residual standard deviation (NaN without spare readings); ``remarks``: bounds hit and
    widened; ``condition``: of the scaled system.
    """

    springs: tuple[SpringEstimate, ...]
    compliance: Array
    residual_m: Array
    rms_mm: float
    sigma_m: float
    degrees_of_freedom: int
    remarks: tuple[str, ...]
    condition: float


def fit_constant(
    system: Equations, joints: tuple[str, ...], joint_names: tuple[str, ...], fixed: Array,
    bounds: tuple[float, float],
) -> ConstantFit:
    """Fit constant springs of ``joints``; all others keep their compliances ``fixed`` (dof,) or (m, dof).

    ``bounds`` (N m/rad) are where the fit starts; one that is hit is widened by tens up to the widest
    plausible range, and said so. The problem is linear and convex, so the result is the global optimum.

    Raises
    ------
    InputError
        Fewer readings than springs to be fitted.
    """
    columns = np.array([joint_names.index(joint) for joint in joints])
    others = np.array(np.broadcast_to(fixed, system.influence.shape))
    others[:, columns] = 0.0
    b = (system.value - system.predict(others)) / system.sigma
    A = system.influence[:, columns] / system.sigma[:, None]
    norm = np.linalg.norm(A, axis=0)
    seen = norm > BLIND * max(float(norm.max()), 1e-300)
    if seen.sum() > len(b):
        raise InputError(
            f"{len(b)} reading(s) cannot determine {int(seen.sum())} springs ({', '.join(joints)})",
            remedy="measure more poses or fit fewer joints (--joints)",
        )
    c, remarks = _widened_fit(A[:, seen], b, [j for j, s in zip(joints, seen, strict=True) if s], bounds)
    full = np.zeros(len(joints))
    full[seen] = c
    spare = len(b) - int(seen.sum())
    error = A @ full - b
    scale = float(np.sqrt(error @ error / spare)) if spare > 0 else float("nan")
    scaled = A[:, seen] / norm[seen]
    condition = float(np.linalg.cond(scaled)) if seen.any() else float("nan")
    if condition > MAX_CONDITION:
        remarks.append(
            f"the springs cannot be told apart (condition number {condition:.1e}): only combinations of them are determined"
        )
    springs = _estimates(A, b, full, joints, seen, scale, spare, condition)
    remarks += [
        f"{s.joint}: no reading moves with this spring; it is left out" for s in springs if s.status == "not identified"
    ]
    compliance = np.array(np.broadcast_to(fixed, system.influence.shape)[0])
    compliance[columns] = full
    residual = error * system.sigma
    return ConstantFit(
        springs, compliance, residual, rms_mm(residual, system.component),
        scale * float(np.median(system.sigma)), spare, tuple(remarks), condition,
    )


def _solve(A: Array, b: Array, low: Array, high: Array) -> Array:
    """Least squares with k in [low, high], columns scaled so the solver's tolerances fit."""
    scale = np.linalg.norm(A, axis=0)
    found = lsq_linear(A / scale, b, bounds=(scale / high, scale / low), method="bvls", tol=1e-14, max_iter=1000)
    return np.asarray(found.x / scale)


def _widened_fit(
    A: Array, b: Array, joints: list[str], bounds: tuple[float, float]
) -> tuple[Array, list[str]]:
    low, high = np.full(len(joints), bounds[0]), np.full(len(joints), bounds[1])
    remarks: list[str] = []
    while True:
        c = _solve(A, b, low, high)
        k = 1.0 / c
        at_high = np.isclose(k, high, rtol=1e-9) & (high < WIDEST_Nm_per_rad[1])
        at_low = np.isclose(k, low, rtol=1e-9) & (low > WIDEST_Nm_per_rad[0])
        if not (at_high.any() or at_low.any()):
            break
        high[at_high] *= 10.0
        low[at_low] /= 10.0
    for joint, a, z, value in zip(joints, low, high, k, strict=True):
        if a < bounds[0] or z > bounds[1]:
            end = " and is hit there too" if value >= z * (1 - 1e-9) or value <= a * (1 + 1e-9) else ""
            remarks.append(
                f"{joint}: bound {bounds[1] if z > bounds[1] else bounds[0]:.0e} N m/rad hit, "
                f"widened to {z if z > bounds[1] else a:.0e}{end}"
            )
    return c, remarks


def _estimates(
    A: Array, b: Array, c: Array, joints: tuple[str, ...], seen: NDArray[np.bool_], scale: float, spare: int,
    condition: float,
) -> tuple[SpringEstimate, ...]:
    nan = float("nan")
    known = seen & np.isfinite(np.where(c > 0, 1.0 / np.where(c > 0, c, 1.0), np.inf))
    free = known & (c > 1.0 / WIDEST_Nm_per_rad[1] * (1.0 + 1e-6))
    covariance = np.full((len(joints), len(joints)), nan)
    if spare > 0 and free.any() and condition <= MAX_CONDITION:
        covariance[np.ix_(free, free)] = scale**2 * np.linalg.inv(A[:, free].T @ A[:, free])
    out = []
    for i, joint in enumerate(joints):
        if not seen[i]:
            out.append(SpringEstimate(joint, nan, (nan, nan), "not identified"))
        elif condition > MAX_CONDITION:
            out.append(SpringEstimate(joint, 1.0 / c[i], (nan, nan), "not identified"))
        elif not free[i]:
            floor = 1.0 / _compliance_limit(A, b, c, i, seen, scale, spare) if spare > 0 else nan
            out.append(SpringEstimate(joint, 1.0 / c[i], (floor, float("inf")), "at bound"))
        elif spare <= 0:
            out.append(SpringEstimate(joint, 1.0 / c[i], (nan, nan), "determined"))
        else:
            out.append(_two_sided(joint, c[i], float(np.sqrt(covariance[i, i])) * student.ppf(0.975, spare)))
    return tuple(out)


def _two_sided(joint: str, c: float, half: float) -> SpringEstimate:
    if half < c:
        return SpringEstimate(joint, 1.0 / c, (1.0 / (c + half), 1.0 / (c - half)), "determined")
    return SpringEstimate(joint, 1.0 / c, (1.0 / (c + half), float("inf")), "one-sided")


def _compliance_limit(
    A: Array, b: Array, c: Array, index: int, seen: NDArray[np.bool_], scale: float, spare: int
) -> float:
    """Upper 95 % limit of a compliance that stands at its lower bound, by its profile likelihood."""
    others = np.flatnonzero(seen & (np.arange(len(c)) != index))
    best = float(np.sum((A @ c - b) ** 2))
    allowed = best + (scale * student.ppf(0.95, spare)) ** 2
    low, high = (np.full(others.size, k) for k in WIDEST_Nm_per_rad)

    def excess(value: float) -> float:
        rest = b - A[:, index] * value
        fit = _solve(A[:, others], rest, low, high) if others.size else np.zeros(0)
        return float(np.sum((A[:, others] @ fit - rest) ** 2)) - allowed

    upper = 1.0 / WIDEST_Nm_per_rad[0]
    if excess(upper) < 0.0:
        return upper
    return float(brentq(excess, c[index], upper, xtol=1e-14))
