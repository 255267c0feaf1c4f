"""Variances by restricted maximum likelihood: Fisher scoring with exact expected information.

``V = V_0 + sum_i t_i V_i`` with variances t_i >= their lower limits; residuals e = read - predicted, whose part in
the span of the derivatives J tells nothing about V. With ``P = V^-1 - V^-1 J (J^T V^-1 J)^-1 J^T V^-1`` twice the
restricted log-likelihood is ``-ln|V| - ln|J^T V^-1 J| - e^T P e``, its slope by t_i ``e^T P V_i P e - tr(P V_i)``, and
the expected information of t_i and t_j ``tr(P V_i P V_j) / 2`` (Patterson and Thompson 1971,
doi:10.1093/biomet/58.3.545; Harville 1977, doi:10.1080/01621459.1977.10480998). Since V is linear in the variances, a
step of Fisher scoring needs no good start, and one with a variance at zero needs no logarithm of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import nnls

from doe.estimation.blocks import Blocks, Covariance
from robots.arrays import Array

STEPS = 40
# A step that promises less log-likelihood than this is the last one. Steps shrink tenfold or more each time, so what
# is then left is far below what moves an interval.
LAST = 1e-2
# One that promises less than this starts from near enough for second derivatives in place of their expectation.
NEAR = 0.5
# Smallest eigenvalue of the second derivatives that a step reckons with, in units of the expected ones' diagonal.
CONVEX = 0.02
# Information serves as far away as this, in standard deviations of the variances by it.
NEARBY = 0.3


@dataclass(frozen=True)
class Term:
    """One variance: V_i is diag(pattern) or, if ``common``, pattern pattern^T within every block; pattern (m,).

    ``column``: the column of a covariance's common part that it stands in (two terms of one column never meet).
    """

    name: str
    pattern: Array
    common: bool
    column: int = 0


@dataclass(frozen=True)
class Likelihood:
    """What the restricted likelihood is made of, but the variances.

    ``fixed`` (m,): the diagonal V_0; ``basis`` (m, r): independent columns with the span of the derivatives;
    ``error`` (m,).
    """

    blocks: Blocks
    terms: tuple[Term, ...]
    fixed: Array
    basis: Array
    error: Array

    def covariance(self, t: Array) -> Covariance:
        """V at variances t (k,)."""
        variance, common = self.fixed.copy(), np.zeros((len(self.error), 2))
        for term, value in zip(self.terms, t, strict=True):
            if term.common:
                common[:, term.column] += np.sqrt(value) * term.pattern
            else:
                variance += value * term.pattern
        return self.blocks.covariance(variance, common)

    def at(self, t: Array) -> Point:
        """The likelihood at variances t (k,)."""
        V = self.covariance(t)
        shared = [term.pattern for term in self.terms if term.common]
        r = self.basis.shape[1]
        solved = V.solve(np.column_stack([self.basis, self.error, *shared]))
        L = np.linalg.cholesky(self.basis.T @ solved[:, :r])
        Z = solved[:, :r] @ np.linalg.inv(L).T
        Pe = solved[:, r] - Z @ (Z.T @ self.error)
        loss = V.log_det + 2.0 * float(np.log(np.diag(L)).sum()) + float(self.error @ Pe)
        return Point(self, t, V, 0.5 * loss, Z, Pe, solved[:, r + 1 :])


@dataclass(frozen=True)
class Point:
    """The likelihood at variances ``t``: minus its logarithm is ``loss``. P = V^-1 - Z Z^T; ``Pe`` = P error.

    ``Vc`` (m, c): V^-1 times the patterns of the common terms.
    """

    of: Likelihood
    t: Array
    V: Covariance
    loss: float
    Z: Array
    Pe: Array
    Vc: Array

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal (m,) of V^-1."""
        V = self.V
        if V.common is None:
            return np.asarray(1.0 / V.variance)
        inner = V.middle[V.blocks.number] @ V.E[:, :, None]
        return np.asarray(1.0 / V.variance - np.sum(V.E * inner[:, :, 0], axis=1))

    @cached_property
    def moved(self) -> Array:
        """V_i P e (m, k)."""
        return np.column_stack([self._times(x, self.Pe[:, None]) for x in self.of.terms])

    def slope(self) -> Array:
        """Slope (k,) of the log-likelihood by the variances: e^T P V_i P e less tr(P V_i), halved."""
        add, own, solved = self.of.blocks.add, self.diagonal - np.sum(self.Z**2, axis=1), iter(self.Vc.T)
        traces = [
            x.pattern @ next(solved) - np.sum(add(x.pattern[:, None] * self.Z) ** 2) if x.common else x.pattern @ own
            for x in self.of.terms
        ]
        return np.asarray(0.5 * (self.Pe @ self.moved - np.array(traces)))

    def information(self) -> Array:
        """Expected information (k, k) of the variances, ``tr(P V_i P V_j) / 2``."""
        moved = [self._times(x, self.Z) for x in self.of.terms]
        projected = np.array([self.Z.T @ one for one in moved]).reshape(len(moved), -1)
        across = [[np.vdot(solved, other) for other in moved] for solved in map(self.V.solve, moved)]
        return np.asarray(0.5 * (self._pairs() + projected @ projected.T) - np.array(across))

    def curvature(self, expected: Array) -> Array:
        """Minus the second derivatives (k, k), made convex; ``expected``: their expectation, which gives the scale.

        ``e^T P V_i P V_j P e - tr(P V_i P V_j) / 2``: steps by it close in quadratically, where those by the
        expectation go to and fro for a hundred rounds about a variance that is all but zero.
        """
        B, Zb = self.moved, self.Z.T @ self.moved
        scale = 1.0 / np.sqrt(np.maximum(np.diag(expected), 1e-300))
        size, way = np.linalg.eigh((B.T @ self.V.solve(B) - Zb.T @ Zb - expected) * np.outer(scale, scale))
        return np.asarray((way * np.maximum(np.abs(size), CONVEX)) @ way.T / np.outer(scale, scale))

    def _times(self, x: Term, Y: Array) -> Array:
        """V_i Y (m, c)."""
        out = x.pattern[:, None] * Y
        return x.pattern[:, None] * self.of.blocks.add(out)[self.of.blocks.number] if x.common else out

    def _pairs(self) -> Array:
        """tr(V^-1 V_i V^-1 V_j) (k, k)."""
        add, V = self.of.blocks.add, self.V
        common = np.array([x.common for x in self.of.terms])
        patterns = np.array([x.pattern for x in self.of.terms])
        c, d, out = patterns[common], patterns[~common], np.empty((len(common), len(common)))
        out[np.ix_(common, common)] = np.sum(add(c.T[:, :, None] * self.Vc[:, None, :]) ** 2, axis=0)
        out[np.ix_(~common, common)] = d @ self.Vc**2
        out[np.ix_(common, ~common)] = out[np.ix_(~common, common)].T
        h = 1.0 / V.variance
        own = (d * (h * (2.0 * self.diagonal - h))) @ d.T
        if V.common is not None:
            # The elements beside the diagonal of E M E^T, squared: E^T V_i E within every block.
            EdE = add(d.T[:, :, None, None] * (V.E[:, :, None] * V.E[:, None, :])[:, None])
            M = V.middle[:, None]
            own += np.einsum("bikl,bjkl->ij", M @ EdE @ M, EdE)
        out[np.ix_(~common, ~common)] = own
        return out


@dataclass(frozen=True)
class Known:
    """The expected information (k, k) of variances ``t`` (k,), which serves near them."""

    t: Array
    information: Array

    def serves(self, t: Array) -> bool:
        """Whether variances t (k,) are no farther than a fraction of their standard deviations."""
        way = t - self.t
        return bool(way @ self.information @ way < NEARBY**2)


def maximise(of: Likelihood, start: Array, low: Array, known: Known | None = None) -> tuple[Array, Known | None]:
    """Variances (k,) >= ``low`` (k,) of the largest likelihood, from ``start`` (k,).

    The information is dear beside the slope, and hardly changes near the end: where what is ``known`` serves at the
    start, that is taken; what it was last is given back for the next time.
    """
    if of.basis.shape[1] >= len(of.error):
        return np.maximum(start, low), known  # no residual that could tell
    here = of.at(np.maximum(start, low))
    for _ in range(STEPS):
        slope = here.slope()
        near = known is not None and known.serves(here.t)
        if known is None or not near:
            known = Known(here.t, here.information())
            information = known.information
            step = _step(slope, information, low - here.t)
            near = _promise(slope, information, step) < NEAR
        if near:
            information = here.curvature(known.information)
            step = _step(slope, information, low - here.t)
        if _promise(slope, information, step) < LAST:
            return np.asarray(np.maximum(here.t + step, low)), known
        for half in range(12):
            there = _point(of, np.maximum(here.t + 0.5**half * step, low))
            if there is not None and there.loss < here.loss:
                break
        else:
            break
        assert there is not None  # noqa: S101 - left by the break above
        here, known = there, None
    return here.t, known


def _promise(slope: Array, information: Array, step: Array) -> float:
    """What a step is expected to add to the log-likelihood."""
    return float(slope @ step - 0.5 * step @ information @ step)


def _point(of: Likelihood, t: Array) -> Point | None:
    """The likelihood at variances t, None where they are so unequal that rounding leaves no digit of it."""
    try:
        return of.at(t)
    except np.linalg.LinAlgError:
        return None


def _step(slope: Array, information: Array, least: Array) -> Array:
    """The step (k,) >= ``least`` that maximises slope^T x - x^T information x / 2."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    L = np.linalg.cholesky(information * np.outer(scale, scale) + 1e-10 * np.eye(len(slope)))
    low = least / scale
    return np.asarray((low + nnls(L.T, np.linalg.solve(L, slope * scale) - L.T @ low)[0]) * scale)
