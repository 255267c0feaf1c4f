"""One stiffness of a joint over its angle: its law, the fullest that the angles can tell, with covariance.

``c(q) = exp(-b(q) . theta)``, theta the coefficients of ln k as model files hold them (:mod:`fem.springs`): constant,
Fourier series of order one or two, or a table between the angles measured. The compliance stays positive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.stats import t as student

from fem.springs import Basis, FourierBasis, TableBasis
from robots import InputError
from robots.arrays import Array, Indices

LawKind = Literal["constant", "fourier-1", "fourier-2", "table"]
LAWS: tuple[LawKind, ...] = ("constant", "fourier-1", "fourier-2", "table")
# Of Fourier series.
ORDERS: dict[LawKind, int] = {"constant": 0, "fourier-1": 1, "fourier-2": 2}
Status = Literal["determined", "one-sided", "not judged", "not determined", "not identified"]

MOST_STEPS = 60
# Two angles closer than this are one (a robot's repeatability is far below).
SAME_ANGLE = np.radians(0.05)
# A step that no longer changes ln k; far below any reading's noise.
SETTLED = 1e-13
# Angles for a law of order one and of order two: one more than it has numbers, or leaving one out leaves nothing to
# predict from. Order two needs angles over half a turn as well: over less it is curvature, which order one has.
FEWEST_FOR_A_LAW, FEWEST_FOR_ORDER_TWO = 4, 6
SPAN_FOR_ORDER_TWO = np.pi


@dataclass(frozen=True, eq=False)
class Law:
    """A fitted law of one angle: ``basis`` and ``coefficients`` of ln k, with their ``covariance``."""

    kind: LawKind
    basis: Basis
    coefficients: Array
    covariance: Array

    def functions(self, angle: Array) -> Array:
        """The basis (n, p) at angles (n,) rad."""
        return self.basis(angle[:, None])

    def value(self, angle: Array) -> Array:
        """Compliance (n,) at angles (n,) rad."""
        return np.asarray(np.exp(-(self.functions(angle) @ self.coefficients)))

    def compliance(self, angle: Array) -> tuple[Array, Array]:
        """Compliance (n,) at angles (n,) rad, and its standard deviation."""
        B, c = self.functions(angle), self.value(angle)
        return c, c * np.sqrt(np.maximum(np.einsum("np,pr,nr->n", B, self.covariance, B), 0.0))

    def slopes(self, angle: Array) -> Array:
        """Derivatives (n, p) of the compliance by the coefficients."""
        return -self.value(angle)[:, None] * self.functions(angle)


@dataclass(frozen=True, eq=False)
class Direction:
    """One stiffness of one joint, as identified: its law, its compliances by angle, how sure they are.

    ``status``: determined; one-sided (rigid is possible, at some angle measured at least: only a lower limit there);
    not judged (a number without an interval: nothing tells how sure it is, and ``spread``, ``sd`` and the law's
    covariance are NaN); not determined (the best compliance is not positive: a lower limit at most); not identified
    (never loaded or never read).
    ``law`` is None where there is no number. ``mean`` and ``spread``: the compliance of all set-ups together, m/N or
    rad/(N m), and its standard deviation. ``angle`` (a,) rad, ``value`` and ``sd`` (a,): compliances by angle, without
    any law. ``degrees_of_freedom``: of Student's t in 95 % intervals. ``scores``: of the laws tried, lowest is best.
    """

    joint: str
    row: str
    status: Status
    law: Law | None
    mean: float
    spread: float
    angle: Array
    value: Array
    sd: Array
    degrees_of_freedom: float
    scores: Mapping[str, float] = field(default_factory=dict)

    @property
    def quantile(self) -> float:
        """Student's 97.5 % quantile."""
        return float(student.ppf(0.975, self.degrees_of_freedom))

    @property
    def is_shift(self) -> bool:
        """Whether it is a stiffness against displacement, not against turning."""
        return self.row.startswith("t")

    @property
    def unit(self) -> str:
        """Unit of the stiffness."""
        return "N/m" if self.is_shift else "N m/rad"

    def compliance(self, angle: Array) -> tuple[Array, Array]:
        """Compliance (n,) at angles (n,) rad of its joint and its standard deviation; NaN where there is no number."""
        if self.law is None:
            return np.full(len(angle), np.nan), np.full(len(angle), np.nan)
        return self.law.compliance(angle)

    def stiffness(self, angle: Array) -> tuple[Array, Array, Array]:
        """Stiffness (n,) at angles (n,) rad and the ends of its 95 % interval (inf: no upper limit)."""
        value, sd = self.compliance(angle)
        c = value
        if self.law is None and self.status == "not determined":
            c, sd = np.full(len(angle), self.mean), np.full(len(angle), self.spread)
        low, high = c - self.quantile * sd, c + self.quantile * sd
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(low > 0.0, 1.0 / low, np.where(np.isnan(low), np.nan, np.inf))
            least = np.where(high > 0.0, 1.0 / high, np.nan)
        return 1.0 / value, least, most


def angles_of(angle: Array) -> tuple[Array, Indices]:
    """Distinct angles (a,) rad in rising order, and which of them each of (n,) is."""
    order = np.argsort(angle)
    step = np.diff(angle[order], prepend=-np.inf) > SAME_ANGLE
    place = np.empty(len(angle), dtype=np.intp)
    place[order] = np.cumsum(step) - 1
    count = np.bincount(place)
    return np.bincount(place, angle) / count, place


def on_one_turn(angle: Array) -> Array:
    """Angles (n,) rad, those that differ by whole turns brought together: a joint stands the same in them.

    Each takes the turn of the one nearest to zero; all others stay as they are.
    """
    out = angle.astype(np.float64)
    turn = 2.0 * np.pi
    for i in np.argsort(np.abs(angle), kind="stable"):
        away = out - out[i]
        whole = np.round(away / turn)
        same = (whole != 0.0) & (np.abs(away - whole * turn) <= SAME_ANGLE)
        out[same] -= whole[same] * turn
    return np.asarray(out)


def check_law(kind: LawKind, joint: str, angles: Array) -> None:
    """Raise InputError where the angles measured cannot tell a law."""
    needed = 2 if kind == "table" else 2 * ORDERS[kind] + 1
    if len(angles) < needed:
        raise InputError(
            f"law {kind} of joint {joint}: angles measured",
            code="J004",
            value=len(angles),
            allowed=f"{needed} or more",
            remedy=f"measure joint {joint} at more angles, or ask for --law constant",
        )


def fit_law(kind: LawKind, angle: Array, c: Array, variance: Array, scatter: float) -> Law | None:
    """Weighted least squares of compliances c (n,) at angles (n,) rad; None where it does not settle.

    ``variance`` (n,) of each, beside a scatter of set-ups by the share ``scatter`` of the law itself: weights follow
    the law, not the single reading, which would favour those that happen to be soft.
    """
    basis: Basis = TableBasis(0, angles_of(angle)[0]) if kind == "table" else FourierBasis(0, ORDERS[kind])
    mean = float(np.sum(c / variance) / np.sum(1.0 / variance))
    if not mean > 0.0:
        return None
    theta = np.zeros(basis.size)
    # Where each function is a node's, all start at the mean; else the first one is the constant.
    theta[: basis.size if kind == "table" else 1] = -np.log(mean)
    law = Law(kind, basis, theta, np.full((basis.size, basis.size), np.nan))
    for _ in range(MOST_STEPS):
        f, J, weight = _weighted(law, angle, variance, scatter)
        step, _, rank, _ = np.linalg.lstsq(J, (c - f) * weight, rcond=1e-10)
        if rank < basis.size:
            return None
        # Beyond a factor of e at once the linearised law says nothing.
        law = replace(law, coefficients=law.coefficients + step / max(1.0, float(np.abs(step).max())))
        if np.abs(step).max() < SETTLED * (1.0 + np.abs(law.coefficients).max()):
            break
    else:
        if np.abs(step).max() > 1e-6:
            return None
    inverse = np.linalg.inv(np.linalg.qr(_weighted(law, angle, variance, scatter)[1])[1])
    return replace(law, covariance=inverse @ inverse.T)


def _weighted(law: Law, angle: Array, variance: Array, scatter: float) -> tuple[Array, Array, Array]:
    """Compliances (n,) by a law, their derivatives (n, p) over their standard deviations, and one over these (n,)."""
    f = law.value(angle)
    weight = 1.0 / np.sqrt(variance + (scatter * f) ** 2)
    return f, law.slopes(angle) * weight[:, None], weight


def left_out_score(kind: LawKind, angle: Array, c: Array, variance: Array, scatter: float) -> float:
    """Mean squared error of compliances at angles left out one at a time, over their variance; inf if it fails."""
    place = angles_of(angle)[1]
    total = 0.0
    for a in range(int(place.max()) + 1):
        rest = place != a
        law = fit_law(kind, angle[rest], c[rest], variance[rest], scatter) if rest.any() else None
        if law is None:
            return np.inf
        f = law.value(angle[~rest])
        total += float(np.sum((c[~rest] - f) ** 2 / (variance[~rest] + (scatter * f) ** 2)))
    return total / len(c)


def choose_law(angle: Array, c: Array, variance: Array, scatter: float) -> tuple[LawKind, dict[str, float]]:
    """The law to use, and how well each predicts angles left out.

    The fullest law that the angles can tell (:func:`fullest`). None is chosen for its score: where readings are too
    coarse to see that a stiffness varies, or that it varies twice a turn, the interval of the simpler law would be as
    narrow as if it did not, and miss the truth at most angles. Of truths with two harmonics of 12 % the 95 % intervals
    held 88 % while order two had to predict clearly better to be taken.
    """
    angles = angles_of(angle)[0]
    if len(angles) < FEWEST_FOR_A_LAW:
        return "constant", {}
    several = len(angles) >= FEWEST_FOR_ORDER_TWO
    tried: tuple[LawKind, ...] = ("constant", "fourier-1", "fourier-2") if several else ("constant", "fourier-1")
    scores = {str(kind): left_out_score(kind, angle, c, variance, scatter) for kind in tried}
    return fullest(angles), scores


def fullest(angles: Array) -> LawKind:
    """The law with most numbers that distinct angles (a,) rad can tell.

    A constant below :data:`FEWEST_FOR_A_LAW` of them, a Fourier series of order two from
    :data:`FEWEST_FOR_ORDER_TWO` on, over :data:`SPAN_FOR_ORDER_TWO` or more; else of order one.
    """
    if len(angles) < FEWEST_FOR_A_LAW:
        return "constant"
    wide = len(angles) >= FEWEST_FOR_ORDER_TWO and np.ptp(angles) >= SPAN_FOR_ORDER_TWO - SAME_ANGLE
    return "fourier-2" if wide else "fourier-1"
