"""What a surrogate is, where it holds, and the stiffness it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robots.errors import InputError
from robots.robot import LIMIT_TOLERANCE_RAD
from surrogate.basis import Basis, as_box

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Target = Literal["compliance", "log-compliance"]

TARGETS: tuple[Target, ...] = ("compliance", "log-compliance")
SCHEMA = "stiffarm-surrogate/1"
# How many offending rows a message spells out; the rest are counted.
_ROWS_SHOWN = 5


@dataclass(frozen=True, eq=False)
class Couplings:
    """Limits on sums of inputs: ``lower <= matrix @ q <= upper``, all rad.

    Offsets and fixed coordinates of the robot's own limits are already taken into the bounds.

    Parameters
    ----------
    names : (c,)
    matrix : (c, k)
    lower, upper : (c,) rad; may be infinite on one side
    """

    names: tuple[str, ...]
    matrix: Array
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("matrix", "lower", "upper"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))
        sizes = {len(self.names), len(self.matrix), len(self.lower), len(self.upper)}
        if self.matrix.ndim != 2 or len(sizes) != 1:
            raise InputError("couplings", allowed="one name, row, lower and upper bound for each")
        if not np.isfinite(self.matrix).all() or not np.all(self.lower <= self.upper):
            raise InputError("couplings", allowed="finite factors, and lower bounds not above upper ones")

    @classmethod
    def none(cls, n_inputs: int) -> Couplings:
        """No couplings over k inputs."""
        return cls((), np.empty((0, n_inputs)), np.empty(0), np.empty(0))

    def kept(self, Q: Array) -> Flags:
        """Which couplings hold; Q (n, k) rad -> (n, c)."""
        return _between(Q @ self.matrix.T, self.lower, self.upper)


@dataclass(frozen=True, eq=False, kw_only=True)
class Scope:
    """What a surrogate is about and where it holds.

    Parameters
    ----------
    robot, model_hash : name of the robot and content hash of the model the runs came from
    load_direction : (3,) unit vector in the base frame; the stiffness is |F| / |d . F/|F|| along it
    inputs : (k,) names of the coordinates that vary, as in 'q2_deg'
    fixed_deg : the other coordinates, name -> degrees
    lower, upper : (k,) rad, the domain
    couplings : limits on sums of inputs; combinations that break them cannot be reached

    Raises
    ------
    InputError
        Counts that differ, a name given twice, an empty range, a direction not of length 1.
    """

    robot: str
    model_hash: str
    load_direction: tuple[float, float, float]
    inputs: tuple[str, ...]
    fixed_deg: Mapping[str, float] = field(default_factory=dict)
    lower: Array
    upper: Array
    couplings: Couplings

    def __post_init__(self) -> None:
        k = len(self.inputs)
        for name, limits in zip(("lower", "upper"), as_box(self.lower, self.upper), strict=True):
            object.__setattr__(self, name, _frozen(limits))
        if len(self.lower) != k:
            raise InputError("surrogate: domain", allowed=f"a lower and an upper limit for {k} inputs")
        names = [*self.inputs, *self.fixed_deg]
        if len(set(names)) < len(names):
            raise InputError("surrogate: coordinates", value=", ".join(names), allowed="each one once")
        if not np.isfinite([*self.fixed_deg.values()]).all():
            raise InputError("surrogate: fixed_deg", value=dict(self.fixed_deg), allowed="finite")
        if self.couplings.matrix.shape[1] != k:
            raise InputError("surrogate: couplings", allowed=f"one factor for each of {k} inputs")
        # 1e-9: a direction that went through a text file with ten digits still counts as a unit vector.
        length = float(np.linalg.norm(self.load_direction))
        if len(self.load_direction) != 3 or not abs(length - 1.0) <= 1e-9:
            raise InputError("surrogate: load_direction", value=self.load_direction, allowed="a unit (3,)")

    def inside(self, Q: Array) -> Flags:
        """Which inputs of which poses lie in the domain; Q (n, k) rad -> (n, k)."""
        return _between(Q, self.lower, self.upper)

    def poses(self, Q: Array, what: str) -> Array:
        """Check a batch of poses (n, k) rad; raises InputError for a wrong shape, NaN or infinity."""
        poses = np.asarray(Q, dtype=np.float64)
        k = len(self.inputs)
        if poses.ndim != 2 or poses.shape[1] != k:
            raise InputError(f"{what}: shape {poses.shape}", allowed=f"(n, {k}): {', '.join(self.inputs)}")
        bad = ~np.isfinite(poses)
        if bad.any():
            first = np.argwhere(bad)[:_ROWS_SHOWN]
            shown = "; ".join(f"row {i + 1}: {self.inputs[j]} = {poses[i, j]}" for i, j in first)
            raise InputError(
                f"{what}: {_count(np.any(bad, axis=1))} with an angle that is no finite number: {shown}",
                remedy="give these angles or drop the rows",
            )
        return poses

    def faults(self, Q: Array) -> list[str]:
        """Say what is wrong with the first few poses outside of the domain or the couplings, in degrees."""
        inside, kept = self.inside(Q), self.couplings.kept(Q)
        out = []
        for i in np.flatnonzero(~(inside.all(axis=1) & kept.all(axis=1)))[:_ROWS_SHOWN]:
            for j in np.flatnonzero(~inside[i]):
                out.append(f"row {i + 1}: {self.inputs[j]} = {_range(Q[i, j], self.lower[j], self.upper[j])}")
            for j in np.flatnonzero(~kept[i]):
                c, factors = self.couplings, self.couplings.matrix[j]
                terms = " ".join(f"{f:+g} {n}" for f, n in zip(factors, self.inputs, strict=True) if f != 0.0)
                shown = _range(factors @ Q[i], c.lower[j], c.upper[j])
                out.append(f"row {i + 1}: {c.names[j]}: {terms} = {shown}")
        return out


@dataclass(frozen=True)
class ErrorFigures:
    """How far a surrogate's compliance is off on runs that were kept out of its fit.

    Relative errors are ``|predicted / true - 1|`` (1, not %). ``condition_number`` is that of the least
    squares matrix; ``degree`` is the total degree or the trigonometric order.
    """

    basis: str
    degree: int
    target: str
    n_terms: int
    n_train: int
    n_test: int
    rms_relative: float
    p95_relative: float
    max_relative: float
    condition_number: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Surrogate(Scope):
    """Compliance as a sum of basis functions of the inputs, with its held-out errors.

    ``c(q) = sum_t coefficients[t] basis_t(q)`` in m/N, or ``ln(c N/m)`` is that sum for the target
    'log-compliance'. Valid inside the domain and the couplings only.

    Raises
    ------
    InputError
        As for `Scope`; also coefficients of the wrong number or not finite, or figures that are not.
    """

    basis: Basis
    target: Target
    coefficients: Array
    errors: ErrorFigures
    notes: tuple[str, ...] = ()
    schema_version: str = SCHEMA

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "coefficients", _frozen(self.coefficients))
        if self.target not in TARGETS:
            raise InputError("surrogate: target", value=self.target, allowed=", ".join(TARGETS))
        if self.basis.n_inputs != len(self.inputs):
            raise InputError("surrogate: basis", allowed=f"one of {len(self.inputs)} inputs")
        if self.coefficients.shape != (self.basis.n_terms,):
            raise InputError(f"surrogate: {self.coefficients.size} coefficients", allowed="one for each term")
        if not np.isfinite(self.coefficients).all():
            raise InputError("surrogate: coefficients", value="NaN or infinity", allowed="finite numbers")
        figures = [value for value in vars(self.errors).values() if isinstance(value, float)]
        if not all(np.isfinite(f) and f >= 0.0 for f in figures):
            raise InputError("surrogate: error figures", value=figures, allowed="finite and 0 or more")


@dataclass(frozen=True, eq=False)
class QueryResult:
    """Stiffness at n poses.

    Parameters
    ----------
    stiffness_N_per_mm : (n,) directional stiffness
    relative_error : (n,) one standard deviation of the stiffness over itself: the held-out RMS relative
        error. Infinite where the pose is outside of the domain or cannot be reached: nothing is known there
    inside_domain : (n,) each input within the domain
    reachable : (n,) the couplings hold
    """

    stiffness_N_per_mm: Array  # noqa: N815 - units are written as the shop writes them
    relative_error: Array
    inside_domain: Flags
    reachable: Flags


def predict_compliance(surrogate: Surrogate, Q: Array) -> Array:
    """Compliance as the fit gives it; Q (n, k) rad -> (n,) m/N.

    Domain and couplings are not checked, and with the target 'compliance' a poor fit can give values of
    zero or less; `query` refuses both.

    Raises
    ------
    InputError
        Wrong shape, an angle that is not finite, or so far outside of the domain that the fit overflows.
    """
    poses = surrogate.poses(Q, f"query of {surrogate.robot}")
    # Far outside of the domain anything may overflow; what comes of it is refused just below.
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        compliance = surrogate.basis.evaluate(poses, surrogate.coefficients)
        if surrogate.target == "log-compliance":
            compliance = np.exp(compliance)
    _refuse(surrogate, compliance, ~np.isfinite(compliance))
    return compliance


def query(surrogate: Surrogate, Q: Array, extrapolate: bool = False) -> QueryResult:
    """Directional stiffness (N/mm) with error bars; Q (n, k) rad in the order of ``surrogate.inputs``.

    Parameters
    ----------
    extrapolate : answer outside of the domain and of the couplings too, flagged and without error bar

    Raises
    ------
    InputError
        A pose outside of the domain or of a coupling (unless ``extrapolate``), an angle that is not finite,
        or a pose where the fit gives no valid (positive, finite) compliance.
    """
    poses = surrogate.poses(Q, f"query of {surrogate.robot}")
    inside: Flags = np.all(surrogate.inside(poses), axis=1)
    reachable: Flags = np.all(surrogate.couplings.kept(poses), axis=1)
    good = inside & reachable
    if not extrapolate and not good.all():
        raise InputError(
            f"query of {surrogate.robot}: {_count(~good)} outside of what was fitted: "
            + "; ".join(surrogate.faults(poses)),
            remedy="ask inside these ranges, fit a surrogate on a larger domain, or pass `--extrapolate` "
            "(extrapolate=True) to get flagged values without an error bar",
        )
    compliance = predict_compliance(surrogate, poses)
    # 1e-300 m/N: below it 1/c overflows, and no structure is that stiff anyway.
    _refuse(surrogate, compliance, ~(compliance > 1e-300))
    error = np.where(good, surrogate.errors.rms_relative, np.inf)
    return QueryResult(1e-3 / compliance, error, inside, reachable)


def _refuse(surrogate: Surrogate, compliance: Array, bad: Flags) -> None:
    if bad.any():
        rows = "; ".join(f"row {i + 1}: {compliance[i]:.3g} m/N" for i in np.flatnonzero(bad)[:_ROWS_SHOWN])
        raise InputError(
            f"query of {surrogate.robot}: the fit is not valid at {_count(bad)}: {rows}",
            allowed="a positive, finite compliance",
            remedy="use the target 'log-compliance', the trigonometric basis, more runs or a smaller domain",
        )


def _between(values: Array, lower: Array, upper: Array) -> Flags:
    return np.asarray((values >= lower - LIMIT_TOLERANCE_RAD) & (values <= upper + LIMIT_TOLERANCE_RAD))


def _frozen(values: Array) -> Array:
    # A read-only copy: a frozen dataclass is then frozen all the way down.
    out = np.array(values, dtype=np.float64)
    out.flags.writeable = False
    return out


def _count(bad: Flags) -> str:
    many = np.count_nonzero(bad)
    return f"{many} of {len(bad)} rows" + (f" (first {_ROWS_SHOWN} shown)" if many > _ROWS_SHOWN else "")


def _range(value: float, lower: float, upper: float) -> str:
    shown, low, high = (f"{np.degrees(x):.6g}" for x in (value, lower, upper))
    return f"{shown} deg (allowed {low} to {high} deg)"
