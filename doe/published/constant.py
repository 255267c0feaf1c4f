"""Constant springs fitted to all readings at once: bounded linear least squares in the compliances."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import brentq, lsq_linear
from scipy.stats import t as student

from doe.published.parametric import WIDEST_Nm_per_rad
from doe.published.readings import Equations, rms_mm
from robots import InputError
from robots.arrays import Array, Bools, Indices

Status = Literal["determined", "one-sided", "at bound", "not identified"]

# Columns whose norm is below this share of the largest carry no information about their spring.
BLIND = 1e-9
# Directions whose singular value is below 1/this of the largest are not determined (columns of norm one).
MAX_CONDITION = 1e6
# A spring with more than this part in an undetermined direction is not determined by itself.
MIXED = 1e-6
# A compliance this close (relative) to an end of the widest range stands at it.
AT_END = 1e-6


@dataclass(frozen=True)
class SpringEstimate:
    """A constant spring with what the data say about it.

    ``stiffness`` N m/rad; ``interval``: 95 % (lower, upper), the upper one infinite where the data do not
    exclude a rigid joint, NaN without spare readings. ``status``: "determined"; "one-sided" (only a lower
    limit); "at bound" (the fit stands at an end of the widest range: rigid, or as soft as none);
    "not identified" (no reading moves with it, then the stiffness is NaN; or only sums with other springs are
    determined, or any stiffness fits: then it is one value of many, good only with the other springs' ones).
    """

    joint: str
    stiffness: float
    interval: tuple[float, float]
    status: Status


@dataclass(frozen=True)
class ConstantFit:
    """Bounded least squares of constant springs.

    ``compliance`` (dof,): full vector with those not fitted as given (at the first equation's pose) and zero
    for those that no reading moves with; ``residual_m`` (m,): simulated minus measured; ``sigma_m``:
    residual standard deviation (NaN without spare readings); ``degrees_of_freedom``: equations minus springs
    that they move with; ``remarks``: bounds hit, and what is not identified; ``condition``: of the scaled
    system. ``covariance`` (p, p): of the compliances of ``springs``, (rad/(N m))^2, zero for those at bounds or not
    seen, of the determined combinations alone where only those are; NaN without spare readings. ``blind`` (d, p):
    directions of the compliances that no reading determines, length one, without the springs that no reading sees.
    """

    springs: tuple[SpringEstimate, ...]
    compliance: Array
    residual_m: Array
    rms_mm: float
    sigma_m: float
    degrees_of_freedom: int
    remarks: tuple[str, ...]
    condition: float
    covariance: Array
    blind: Array


@dataclass(frozen=True)
class _Scaled:
    """``min |A x - b|``, ``low <= x <= high``: columns of norm one, x the compliances times their norms."""

    A: Array
    b: Array
    low: Array
    high: Array

    def solve(self) -> Array:
        found = lsq_linear(self.A, self.b, bounds=(self.low, self.high), method="bvls", tol=1e-14, max_iter=1000)
        return np.asarray(found.x)

    def square(self, x: Array) -> float:
        return float(np.sum((self.A @ x - self.b) ** 2))

    def square_with(self, index: int, value: float) -> float:
        """Smallest sum of squares with one unknown held."""
        rest = np.arange(len(self.low)) != index
        b = self.b - self.A[:, index] * value
        if not rest.any():
            return float(np.sum(b**2))
        part = _Scaled(self.A[:, rest], b, self.low[rest], self.high[rest])
        return part.square(part.solve())


def fit_constant(
    system: Equations,
    joints: tuple[str, ...],
    joint_names: tuple[str, ...],
    fixed: Array,
    bounds: tuple[float, float],
) -> ConstantFit:
    """Fit constant springs of ``joints``; all others keep their compliances ``fixed`` (dof,) or (m, dof).

    ``bounds`` (N m/rad) are where the springs are expected; they are widened up to the widest plausible range
    where the data ask for it, and said so. The problem is linear and convex, so the result is the global
    optimum over that range.

    The intervals are those of the profile likelihood with Student's t: a value belongs to it if, with the
    best values of all the other springs, the sum of squares rises by less than the residual variance times
    t(0.975)^2. They hold for independent errors of the relative sizes ``system.sigma``; away from the bounds
    they are the classical ones. A spring at its bound is counted as fitted in the residual variance, so that
    they are wider rather than narrower.

    Raises
    ------
    InputError
        Unknown or repeated joints, bounds out of order, no readings, or fewer of them than springs.
    """
    columns = _columns(joints, joint_names, bounds, len(system))
    others = np.array(np.broadcast_to(fixed, system.influence.shape))
    others[:, columns] = 0.0
    b = (system.value - system.predict(others)) / system.sigma
    A = system.influence[:, columns] / system.sigma[:, None]
    norm, seen = _column_norms(A)
    if seen.sum() > len(b):
        raise InputError(
            f"{len(b)} reading(s) cannot determine {int(seen.sum())} springs ({', '.join(joints)})",
            remedy="measure more poses or fit fewer joints (--joints)",
        )
    soft, rigid = 1.0 / min(WIDEST_Nm_per_rad[0], bounds[0]), 1.0 / max(WIDEST_Nm_per_rad[1], bounds[1])
    problem = _Scaled(A[:, seen] / norm[seen], b, norm[seen] * rigid, norm[seen] * soft)
    x = problem.solve() if seen.any() else np.zeros(0)
    full = np.zeros(len(joints))
    full[seen] = x / norm[seen]
    spare = len(b) - int(seen.sum())
    error = A @ full - b
    scale = float(np.sqrt(error @ error / spare)) if spare > 0 else float("nan")
    singular = np.linalg.svd(problem.A, compute_uv=False) if seen.any() else np.zeros(0)
    springs = _estimates(problem, x, joints, norm, seen, scale, spare)
    compliance = np.array(np.broadcast_to(fixed, system.influence.shape)[0])
    compliance[columns] = full
    residual = error * system.sigma
    return ConstantFit(
        springs=springs,
        compliance=compliance,
        residual_m=residual,
        rms_mm=rms_mm(residual, system.component),
        sigma_m=scale * float(np.median(system.sigma)),
        degrees_of_freedom=spare,
        remarks=tuple(_remarks(springs, bounds, (1.0 / soft, 1.0 / rigid), spare)),
        condition=float(singular[0] / singular[-1]) if singular.size and singular[-1] > 0.0 else float("inf"),
        covariance=_covariance(problem, x, norm, seen, scale),
        blind=_blind(A, seen, norm),
    )


def blind_directions(A: Array) -> Array:
    """Find the directions (d, p) of the compliances, of length one, in which no row of A (m, p) moves.

    A prediction is determined by the rows of A only if its own row is orthogonal to all of these.
    """
    norm, seen = _column_norms(A)
    return np.vstack([np.eye(A.shape[1])[~seen], _blind(A, seen, norm)])


def _blind(A: Array, seen: Bools, norm: Array) -> Array:
    """Directions (d, p), length one, in which no row of A moves though each of their columns does."""
    small, V = _null_space(A[:, seen] / norm[seen])
    rows = np.zeros((int(small.sum()), A.shape[1]))
    rows[:, seen] = V[small] / norm[seen]
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _covariance(problem: _Scaled, x: Array, norm: Array, seen: Bools, scale: float) -> Array:
    """Covariance (p, p) of the compliances; those at an end of the range are held there."""
    out = np.zeros((len(seen), len(seen)))
    inner = (x > problem.low * (1.0 + AT_END)) & (x < problem.high * (1.0 - AT_END))
    columns = np.flatnonzero(seen)[inner]
    if columns.size:
        inverse = np.linalg.pinv(problem.A[:, inner], rcond=1.0 / MAX_CONDITION)
        size = norm[columns]
        out[np.ix_(columns, columns)] = scale**2 * (inverse @ inverse.T) / np.outer(size, size)
    return out


def _columns(
    joints: tuple[str, ...], joint_names: tuple[str, ...], bounds: tuple[float, float], readings: int
) -> Indices:
    for joint in joints:
        if joint not in joint_names:
            raise InputError("joint to calibrate", value=joint, allowed=", ".join(joint_names))
    if len(set(joints)) < len(joints) or not joints:
        raise InputError("joints to calibrate", value=", ".join(joints) or "none", allowed="each joint once")
    if not 0.0 < bounds[0] < bounds[1] < math.inf:
        text = f"{bounds[0]:g} to {bounds[1]:g} N m/rad"
        raise InputError("bounds of the springs", value=text, allowed="0 < lower < upper, finite")
    if readings == 0:
        raise InputError("no reading to calibrate on", remedy="select poses or loads that were measured")
    return np.array([joint_names.index(joint) for joint in joints])


def _column_norms(A: Array) -> tuple[Array, Bools]:
    """Norms (p,) of the columns, and which of them carry information."""
    norm = np.linalg.norm(A, axis=0)
    return norm, norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300)


def _null_space(A: Array) -> tuple[Bools, Array]:
    """Which right singular vectors (rows of V, all p of them) are not determined."""
    if A.shape[1] == 0:
        return np.zeros(0, dtype=np.bool_), np.zeros((0, 0))
    _, s, V = np.linalg.svd(A, full_matrices=True)
    s = np.concatenate([s, np.zeros(len(V) - len(s))])
    return s * MAX_CONDITION < s[0], V


def _estimates(
    problem: _Scaled, x: Array, joints: tuple[str, ...], norm: Array, seen: Bools, scale: float, spare: int
) -> tuple[SpringEstimate, ...]:
    nan = float("nan")
    springs = {j: SpringEstimate(j, nan, (nan, nan), "not identified") for j in joints}
    names = [joint for joint, visible in zip(joints, seen, strict=True) if visible]
    small, V = _null_space(problem.A)
    mixed = np.any(np.abs(V[small]) > MIXED, axis=0)
    limits = np.full((len(names), 2), nan)
    if spare > 0:
        limits = _profile_limits(problem, x, scale * float(student.ppf(0.975, spare)), mixed)
    for i, (joint, size) in enumerate(zip(names, norm[seen], strict=True)):
        # The stiffer end is the smaller compliance.
        interval = (float(size / limits[i, 1]), float(size / limits[i, 0]))
        rigid_fits = limits[i, 0] <= problem.low[i] * (1.0 + AT_END)
        soft_fits = limits[i, 1] >= problem.high[i] * (1.0 - AT_END)
        status: Status = "determined"
        if mixed[i] or (rigid_fits and soft_fits):
            status, interval = "not identified", (nan, nan)
        elif x[i] <= problem.low[i] * (1.0 + AT_END):
            status, interval = "at bound", (interval[0], math.inf)
        elif x[i] >= problem.high[i] * (1.0 - AT_END):
            status, interval = "at bound", (0.0, interval[1])
        elif rigid_fits:
            status, interval = "one-sided", (interval[0], math.inf)
        springs[joint] = SpringEstimate(joint, float(size / x[i]), interval, status)
    return tuple(springs.values())


def _profile_limits(problem: _Scaled, x: Array, rise: float, skip: Bools) -> Array:
    """Limits (p, 2) of x: where the profile of the sum of squares has risen by ``rise`` squared."""
    inverse = np.linalg.pinv(problem.A, rcond=1.0 / MAX_CONDITION)
    covariance = inverse @ inverse.T
    free = inverse @ problem.b
    limit = problem.square(x) + rise**2
    out = np.full((len(x), 2), np.nan)
    for i in np.flatnonzero(~skip):
        # Without bounds the profile is a parabola, which bounds can only raise: its ends enclose the limits.
        half = math.sqrt(max(limit - problem.square(free), 0.0) * covariance[i, i])
        for side, sign in enumerate((-1.0, 1.0)):
            end = free + sign * half / covariance[i, i] * covariance[:, i]
            inside = bool(np.all((end >= problem.low) & (end <= problem.high)))
            far = float(np.clip(end[i], problem.low[i], problem.high[i]))
            out[i, side] = far if inside else _profile_limit(problem, int(i), float(x[i]), far, limit)
    return out


def _profile_limit(problem: _Scaled, index: int, best: float, far: float, limit: float) -> float:
    """Where the profile passes ``limit`` between the best value and ``far``; ``far`` if it does not."""
    if best == far or problem.square_with(index, far) <= limit:
        return far

    def excess(value: float) -> float:
        return problem.square_with(index, value) - limit

    # The best value itself is below the limit but for round-off, and then it is the limit.
    return float(brentq(excess, best, far, xtol=1e-6 * abs(far - best))) if excess(best) < 0.0 else best


def _remarks(
    springs: tuple[SpringEstimate, ...], bounds: tuple[float, float], widest: tuple[float, float], spare: int
) -> list[str]:
    out = [text for s in springs if s.status != "not identified" for text in bound_remark(s, bounds, widest)]
    together = [s.joint for s in springs if s.status == "not identified" and not math.isnan(s.stiffness)]
    if len(together) > 1:
        out.append(f"{', '.join(together)}: cannot be told apart, only combinations of them are determined")
    elif together:
        out.append(f"{together[0]}: any stiffness fits, its share is lost in the noise")
    out += [f"{s.joint}: no reading moves with this spring; it is left out" for s in springs if math.isnan(s.stiffness)]
    if spare == 0:
        out.append("as many springs as readings: no residual is left, so no error bars can be given")
    return out


def bound_remark(spring: SpringEstimate, bounds: tuple[float, float], widest: tuple[float, float]) -> list[str]:
    """What to say of a spring outside the range in which it was expected."""
    k, at_bound = spring.stiffness, spring.status == "at bound"
    if bounds[0] <= k <= bounds[1] and not at_bound:
        return []
    side = int(k > math.sqrt(bounds[0] * bounds[1]))
    if math.isclose(bounds[side], widest[side]):
        return [f"{spring.joint}: bound {bounds[side]:.0e} N m/rad hit, as wide as it goes"]
    decades = max(math.ceil(abs(math.log10(k / bounds[side])) - AT_END), 1)
    wider = bounds[side] * 10.0 ** (decades if side else -decades)
    wider = min(wider, widest[1]) if side else max(wider, widest[0])
    end = " and is hit there too" if at_bound else ""
    return [f"{spring.joint}: bound {bounds[side]:.0e} N m/rad hit, widened to {wider:.0e}{end}"]
