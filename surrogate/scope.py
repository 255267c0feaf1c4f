"""What a surrogate is about, and the poses at which it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.arrays import Array, Bools
from robots.errors import InputError
from robots.robot import LIMIT_TOLERANCE_RAD

# How many offending rows a message spells out; the rest are counted.
ROWS_SHOWN = 5


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
            object.__setattr__(self, name, frozen(getattr(self, name)))
        sizes = {len(self.names), len(self.matrix), len(self.lower), len(self.upper)}
        if self.matrix.ndim != 2 or len(sizes) != 1:
            raise InputError("couplings", code="F007", allowed="one name, row, lower and upper bound for each")
        if not np.isfinite(self.matrix).all() or not np.all(self.lower <= self.upper):
            raise InputError("couplings", code="F007", allowed="finite factors, and lower bounds not above upper ones")

    @classmethod
    def none(cls, n_inputs: int) -> Couplings:
        """No couplings over k inputs."""
        return cls((), np.empty((0, n_inputs)), np.empty(0), np.empty(0))

    def kept(self, Q: Array) -> Bools:
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
    periodic : (k,) inputs of more than a turn whose whole turns do not matter, so that one turn says it all

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
    periodic: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        k = len(self.inputs)
        object.__setattr__(self, "periodic", tuple(self.periodic) or (False,) * k)
        if len(self.periodic) != k:
            raise InputError("surrogate: periodic", code="F007", allowed=f"one of true and false for {k} inputs")
        for name, limits in zip(("lower", "upper"), as_box(self.lower, self.upper), strict=True):
            object.__setattr__(self, name, frozen(limits))
        if len(self.lower) != k:
            raise InputError("surrogate: domain", code="F007", allowed=f"a lower and an upper limit for {k} inputs")
        names = [*self.inputs, *self.fixed_deg]
        if len(set(names)) < len(names):
            raise InputError("surrogate: coordinates", code="F007", value=", ".join(names), allowed="each one once")
        if not np.isfinite([*self.fixed_deg.values()]).all():
            raise InputError("surrogate: fixed_deg", code="F007", value=dict(self.fixed_deg), allowed="finite")
        if self.couplings.matrix.shape[1] != k:
            raise InputError("surrogate: couplings", code="F007", allowed=f"one factor for each of {k} inputs")
        # 1e-9: a direction that went through a text file with ten digits still counts as a unit vector.
        length = float(np.linalg.norm(self.load_direction))
        if len(self.load_direction) != 3 or not abs(length - 1.0) <= 1e-9:
            raise InputError("surrogate: load_direction", code="F007", value=self.load_direction, allowed="a unit (3,)")

    def inside(self, Q: Array) -> Bools:
        """Which inputs of which poses lie in the domain; Q (n, k) rad -> (n, k)."""
        return _between(Q, self.lower, self.upper)

    def poses(self, Q: Array, what: str) -> Array:
        """Check a batch of poses (n, k) rad; raises InputError for a wrong shape, NaN or infinity."""
        poses = np.asarray(Q, dtype=np.float64)
        k = len(self.inputs)
        if poses.ndim != 2 or poses.shape[1] != k:
            raise InputError(f"{what}: shape {poses.shape}", code="S001", allowed=f"(n, {k}): {', '.join(self.inputs)}")
        bad = ~np.isfinite(poses)
        if bad.any():
            first = np.argwhere(bad)[:ROWS_SHOWN]
            shown = "; ".join(f"row {i + 1}: {self.inputs[j]} = {poses[i, j]}" for i, j in first)
            raise InputError(
                f"{what}: {count_rows(np.any(bad, axis=1))} with an angle that is no finite number: {shown}",
                code="S001",
                remedy="give these angles or drop the rows",
            )
        return poses

    def faults(self, Q: Array) -> list[str]:
        """Say what is wrong with the first few poses outside of the domain or the couplings, in degrees."""
        bad = np.flatnonzero(~(every(self.inside(Q)) & every(self.couplings.kept(Q))))[:ROWS_SHOWN]
        return [f"row {i + 1}: {words}" for i, words in zip(bad, self.words_of_faults(Q[bad]), strict=True)]

    def words_of_faults(self, Q: Array) -> list[str]:
        """Say what is wrong with each pose (n, k) outside of the domain or the couplings, in degrees."""
        out: list[list[str]] = [[] for _ in Q]
        c = self.couplings
        named = [(f"{name} =", self.lower[j], self.upper[j]) for j, name in enumerate(self.inputs)]
        for name, factors, low, high in zip(c.names, c.matrix, c.lower, c.upper, strict=True):
            terms = " ".join(f"{f:+g} {n}" for f, n in zip(factors, self.inputs, strict=True) if f != 0.0)
            named.append((f"{name}: {terms} =", low, high))
        for (name, low, high), values in zip(named, (*Q.T, *(c.matrix @ Q.T)), strict=True):
            for i in np.flatnonzero(~_between(values, low, high)):
                out[i].append(f"{name} {_range(values[i], low, high)}")
        return ["; ".join(words) for words in out]


def as_box(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Check the limits (k,) rad of a box: InputError unless finite, each lower one below its upper one."""
    lo, hi = np.atleast_1d(np.asarray(lower, np.float64)), np.atleast_1d(np.asarray(upper, np.float64))
    if lo.shape != hi.shape or lo.ndim != 1:
        raise InputError(
            "domain: lower and upper", code="S001", value=f"shapes {lo.shape} and {hi.shape}", allowed="(k,)"
        )
    if not (np.all(np.isfinite(lo)) and np.all(np.isfinite(hi)) and np.all(lo < hi)):
        raise InputError(
            "domain",
            code="S001",
            value=f"{np.degrees(lo).tolist()} to {np.degrees(hi).tolist()} deg",
            allowed="finite, each lower limit below its upper limit",
            remedy="give a range to each input, or make the input a fixed coordinate",
        )
    return lo, hi


def every(kept: Bools) -> Bools:
    """Which rows (n,) of (n, k) are all true; mostly all are, and going along short rows takes long."""
    return np.ones(len(kept), dtype=np.bool_) if kept.all() else np.asarray(kept.all(axis=1))


def _between(values: Array, lower: Array | float, upper: Array | float) -> Bools:
    return np.asarray((values >= lower - LIMIT_TOLERANCE_RAD) & (values <= upper + LIMIT_TOLERANCE_RAD))


def frozen(values: ArrayLike, dtype: type[np.generic] = np.float64) -> NDArray[Any]:
    """A read-only copy: a frozen dataclass is then frozen all the way down."""
    out = np.array(values, dtype=dtype)
    out.flags.writeable = False
    return out


def count_rows(bad: Bools) -> str:
    """How many rows are flagged, in words."""
    many = np.count_nonzero(bad)
    return f"{many} of {len(bad)} rows" + (f" (first {ROWS_SHOWN} shown)" if many > ROWS_SHOWN else "")


def _range(value: float, lower: float, upper: float) -> str:
    shown, low, high = (f"{np.degrees(x):.6g}" for x in (value, lower, upper))
    return f"{shown} deg (allowed {low} to {high} deg)"
