"""Numbers of two results side by side: by how much they differ, and whether beyond noise.

A number that was estimated is compared in the variable in which its error is normal (the compliance of a stiffness),
with the standard deviations of both: the difference over its own follows Student's t (Welch 1947). Of several numbers
some differ by chance: they are judged together (Holm 1979), and where both covariances are stored all at once by the
chi-square of the differences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.stats import chi2, t

from robots.schema.uncertainty import CalibrationUncertainty

Verdict = Literal["beyond the noise", "perhaps", "within the noise", "undecided", "other"]
LEVEL: Final = 0.05
# Standard deviations below this share of the number are those of an exact one.
EXACT: Final = 1e-9


@dataclass(frozen=True)
class Figure:
    """A number with what is known of it: its 95 % interval, open where None; ``sd`` of its ``variable``, NaN if none.

    ``value`` None: not determined.
    """

    name: str
    unit: str
    value: float | None
    low: float | None
    high: float | None
    variable: str = "value"
    sd: float = math.nan
    freedom: float = math.inf

    @property
    def inner(self) -> float:
        """The value in its variable."""
        if self.value is None:
            return math.nan
        if self.variable == "1/value":
            return 1.0 / self.value if self.value else math.inf
        return math.log(self.value) if self.variable == "ln value" and self.value > 0.0 else self.value


@dataclass(frozen=True)
class Pair:
    """One number of both: ``change``: second over first less one, or their difference where a share means nothing.

    ``p``: probability of such a difference by noise alone, NaN where that is not known.
    """

    name: str
    unit: str
    a: Figure | None
    b: Figure | None
    change: float = math.nan
    is_share: bool = False
    p: float = math.nan
    verdict: Verdict = "other"


@dataclass(frozen=True)
class Joint:
    """All shared numbers at once: chi-square of their differences, degrees of freedom and its probability."""

    chi2: float
    freedom: int
    p: float


def pairs(first: Sequence[Figure], second: Sequence[Figure]) -> list[Pair]:
    """Both lists side by side by name; numbers that only one has come last."""
    a, b = ({_name(f.name): replace(f, name=_name(f.name)) for f in some} for some in (first, second))
    both = [_pair(a[name], b[name]) for name in a if name in b]
    alone = [Pair(name, f.unit, f, None) for name, f in a.items() if name not in b]
    alone += [Pair(name, f.unit, None, f) for name, f in b.items() if name not in a]
    return [*_judged(both), *alone]


def _name(name: str) -> str:
    """One name of a spring about a joint's axis, which has two."""
    place, _, row = name.rpartition(".")
    return f"{place}.stiffness" if row == "rz" and place not in ("base", "tool") else name


def _pair(a: Figure, b: Figure) -> Pair:
    if a.unit != b.unit:
        return Pair(a.name, f"{a.unit} and {b.unit}", a, b)
    change, is_share = math.nan, False
    if a.value is not None and b.value is not None:
        is_share = a.value > 0.0 and b.value > 0.0
        change = b.value / a.value - 1.0 if is_share else b.value - a.value
    p, verdict = math.nan, _by_ends(a, b)
    sd = math.hypot(a.sd, b.sd)
    if math.isfinite(sd) and math.isfinite(a.inner - b.inner) and a.variable == b.variable:
        size = max(abs(a.inner), abs(b.inner), 1e-300)
        if sd > EXACT * size:
            freedom = sd**4 / max(a.sd**4 / a.freedom + b.sd**4 / b.freedom, 1e-300)
            p = float(2.0 * t.sf(abs(b.inner - a.inner) / sd, min(freedom, 1e6)))
        else:
            p = 1.0 if abs(b.inner - a.inner) <= EXACT * size else 0.0
    return Pair(a.name, a.unit, a, b, change, is_share, p, verdict)


def _by_ends(a: Figure, b: Figure) -> Verdict:
    """Of numbers without a standard deviation: beyond the noise only where their intervals do not touch."""
    ends = [(-math.inf if f.low is None else f.low, math.inf if f.high is None else f.high) for f in (a, b)]
    if all(not math.isfinite(x) for pair in ends for x in pair):
        return "undecided"
    apart = ends[0][1] < ends[1][0] or ends[1][1] < ends[0][0]
    return "beyond the noise" if apart else "undecided"


def _judged(some: Sequence[Pair]) -> list[Pair]:
    """Verdicts of all together: of twenty numbers one differs by chance."""
    known = sorted((k for k, one in enumerate(some) if math.isfinite(one.p)), key=lambda k: some[k].p)
    out, still = list(some), True
    for rank, k in enumerate(known):
        still = still and some[k].p <= LEVEL / (len(known) - rank)
        verdict: Verdict = "beyond the noise" if still else "perhaps" if some[k].p <= LEVEL else "within the noise"
        out[k] = replace(some[k], verdict=verdict)
    return out


def joint(u: CalibrationUncertainty, v: CalibrationUncertainty) -> Joint | None:
    """All numbers that both determine, at once, by their covariances; None where there are none."""
    theirs = {_name(name): j for j, name in enumerate(v.parameters)}
    both = [(i, theirs[_name(name)]) for i, name in enumerate(u.parameters) if _name(name) in theirs]
    rows = [
        (i, j) for i, j in both if u.variable[i] == v.variable[j] and "not identified" not in (u.status[i], v.status[j])
    ]
    if not rows:
        return None
    i, j = (np.array(column) for column in zip(*rows, strict=True))
    d = np.array(v.estimate)[j] - np.array(u.estimate)[i]
    V = np.array(u.covariance)[np.ix_(i, i)] + np.array(v.covariance)[np.ix_(j, j)]
    sd = np.sqrt(np.diag(V))
    good = sd > 0.0
    if not good.any():
        return None
    z, R = d[good] / sd[good], (V / np.outer(np.maximum(sd, 1e-300), np.maximum(sd, 1e-300)))[np.ix_(good, good)]
    values, vectors = np.linalg.eigh(R)
    known = values > EXACT * values.max()
    square, freedom = float(np.sum((vectors.T @ z)[known] ** 2 / values[known])), int(known.sum())
    return Joint(square, freedom, float(chi2.sf(square, freedom)))
