"""Laws of a joint's compliance over its angle: chosen by leaving out one angle at a time, fitted with covariance.

``c(q) = exp(-b(q) . theta)``, theta the coefficients of ln k as model files hold them (:mod:`fem.springs`): constant,
Fourier series of order one or two, or a table between the angles measured. The compliance stays positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fem.springs import Basis, FourierBasis, LawSpring, TableBasis
from robots import InputError
from robots.arrays import Array, Indices

LawKind = Literal["constant", "fourier-1", "fourier-2", "table"]
LAWS: tuple[LawKind, ...] = ("constant", "fourier-1", "fourier-2", "table")

MOST_STEPS = 60
# Two angles closer than this are one (a robot's repeatability is far below).
SAME_ANGLE = np.radians(0.05)
# A step that no longer changes ln k; far below any reading's noise.
SETTLED = 1e-13
# Left-out scores differ by a fifth or so by chance; a law with more numbers must do better than that.
CLEARLY = 0.7
# Angles for a law, and for a choice between its orders: one more than it has numbers, or leaving one out leaves
# nothing to predict from.
FEWEST_FOR_A_LAW, FEWEST_FOR_ORDER_TWO = 4, 6


@dataclass(frozen=True, eq=False)
class Law:
    """A fitted law: ``spring`` (basis and coefficients of ln k), ``covariance`` of the coefficients."""

    kind: LawKind
    spring: LawSpring
    covariance: Array

    def compliance(self, q: Array) -> tuple[Array, Array]:
        """Compliance (n,) at poses q (n, dof), and its standard deviation."""
        B = self.spring.basis(q)
        c = np.exp(-(B @ self.spring.coefficients))
        spread = np.sqrt(np.maximum(np.einsum("np,pr,nr->n", B, self.covariance, B), 0.0))
        return c, c * spread


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


def basis_of(kind: LawKind, column: int, angles: Array) -> Basis:
    """The law's functions of the angle in one column of a pose."""
    if kind == "table":
        return TableBasis(column, angles)
    return FourierBasis(column, {"constant": 0, "fourier-1": 1, "fourier-2": 2}[kind])


def check_law(kind: LawKind, joint: str, angles: Array) -> None:
    """Raise InputError where the angles measured cannot tell a law."""
    needed = {"constant": 1, "fourier-1": 3, "fourier-2": 5, "table": 2}[kind]
    if len(angles) < needed:
        raise InputError(
            f"law {kind} of joint {joint}: angles measured",
            value=len(angles),
            allowed=f"{needed} or more",
            remedy=f"measure joint {joint} at more angles, or ask for --law constant",
        )


def fit_law(kind: LawKind, basis: Basis, q: Array, c: Array, variance: Array, scatter: float) -> Law | None:
    """Weighted least squares of compliances c (n,) at poses q (n, dof); None where it does not settle.

    ``variance`` (n,) of each, beside a scatter of set-ups by the share ``scatter`` of the law itself: weights follow
    the law, not the single reading, which would favour those that happen to be soft.
    """
    B = basis(q)
    theta = np.zeros(basis.size)
    mean = float(np.sum(c / variance) / np.sum(1.0 / variance))
    if not mean > 0.0:
        return None
    # Where each function is a node's, all start at the mean; else the first one is the constant.
    theta[:] = -np.log(mean) if isinstance(basis, TableBasis) else 0.0
    theta[0] = -np.log(mean)
    for _ in range(MOST_STEPS):
        f = np.exp(-(B @ theta))
        weight = 1.0 / np.sqrt(variance + (scatter * f) ** 2)
        J = -f[:, None] * B * weight[:, None]
        step, _, rank, _ = np.linalg.lstsq(J, (c - f) * weight, rcond=1e-10)
        if rank < basis.size:
            return None
        # Beyond a factor of e at once the linearised law says nothing.
        theta = theta + step / max(1.0, float(np.abs(step).max()))
        if np.abs(step).max() < SETTLED * (1.0 + np.abs(theta).max()):
            break
    else:
        if np.abs(step).max() > 1e-6:
            return None
    f = np.exp(-(B @ theta))
    J = -f[:, None] * B / np.sqrt(variance + (scatter * f) ** 2)[:, None]
    _, R = np.linalg.qr(J)
    inverse = np.linalg.inv(R)
    return Law(kind, LawSpring(basis, theta), inverse @ inverse.T)


def left_out_score(
    kind: LawKind, column: int, q: Array, c: Array, variance: Array, scatter: float
) -> float:  # fmt: skip
    """Mean squared error of compliances at angles left out one at a time, over their variance; inf if it fails."""
    angles, place = angles_of(q[:, column])
    total = 0.0
    for a in range(len(angles)):
        rest = place != a
        basis = basis_of(kind, column, np.delete(angles, a))
        law = fit_law(kind, basis, q[rest], c[rest], variance[rest], scatter) if rest.any() else None
        if law is None:
            return np.inf
        f = law.compliance(q[~rest])[0]
        total += float(np.sum((c[~rest] - f) ** 2 / (variance[~rest] + (scatter * f) ** 2)))
    return total / len(c)


def choose_law(column: int, q: Array, c: Array, variance: Array, scatter: float) -> tuple[LawKind, dict[str, float]]:
    """The law to use, and how well each predicts angles left out.

    With four angles or more a Fourier series of order one; of order two where that predicts angles left out clearly
    better (:data:`CLEARLY`).
    A constant is not chosen for its score: where readings are too coarse to see that a stiffness varies, its interval
    would be as narrow as if it did not, and miss the truth at most angles.
    """
    count = len(angles_of(q[:, column])[0])
    if count < FEWEST_FOR_A_LAW:
        return "constant", {}
    several = count >= FEWEST_FOR_ORDER_TWO
    tried: tuple[LawKind, ...] = ("constant", "fourier-1", "fourier-2") if several else ("constant", "fourier-1")
    scores = {kind: left_out_score(kind, column, q, c, variance, scatter) for kind in tried}
    better = scores.get("fourier-2", np.inf) < CLEARLY * scores["fourier-1"]
    return ("fourier-2" if better else "fourier-1"), {str(kind): score for kind, score in scores.items()}
