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

import numpy as np

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

    def slope_and_information(self) -> tuple[Array, Array]:
        """Slope (k,) of the log-likelihood by the variances and their expected information (k, k)."""
        # Not kept: they hold this point, and a circle of large arrays waits for the collector.
        own = _Own(self, np.array([x.pattern for x in self.of.terms if not x.common]).reshape(-1, len(self.Pe)))
        shared = _Shared(self, np.array([x.pattern for x in self.of.terms if x.common]).reshape(-1, len(self.Pe)))
        traces, squares = zip(own.traces(), shared.traces(), strict=True)
        slope = 0.5 * (np.concatenate(squares) - np.concatenate(traces))
        A = np.concatenate([own.projected, shared.projected]).reshape(len(slope), -1)
        mixed = own.with_shared(shared)
        whole = np.block([[own.pairs(), mixed], [mixed.T, shared.pairs()]]) + A @ A.T
        back = np.argsort(np.argsort([x.common for x in self.of.terms], kind="stable"), kind="stable")
        return slope[back], 0.5 * whole[np.ix_(back, back)]

    def curvature(self, expected: Array) -> Array:
        """Minus the second derivatives (k, k), made convex; ``expected``: their expectation, which gives the scale.

        ``e^T P V_i P V_j P e - tr(P V_i P V_j) / 2``: steps by it close in quadratically, where those by the
        expectation go to and fro for a hundred rounds about a variance that is all but zero.
        """
        add, number = self.of.blocks.add, self.of.blocks.number
        B = np.stack(
            [x.pattern * (add(x.pattern * self.Pe)[number] if x.common else self.Pe) for x in self.of.terms], axis=1
        )
        Zb = self.Z.T @ B
        scale = 1.0 / np.sqrt(np.maximum(np.diag(expected), 1e-300))
        size, way = np.linalg.eigh((B.T @ self.V.solve(B) - Zb.T @ Zb - expected) * np.outer(scale, scale))
        return np.asarray((way * np.maximum(np.abs(size), CONVEX)) @ way.T / np.outer(scale, scale))


class _Shared:
    """Terms c c^T of a block: ``c`` (j, m). Per block c^T V^-1 c' (b, j, j), Z^T c (b, j, r); Z^T V_j Z (j, r, r)."""

    def __init__(self, at: Point, c: Array) -> None:
        add = at.of.blocks.add
        self.at, self.c = at, c
        self.cVc = add(c.T[:, :, None] * at.Vc[:, None, :])
        self.cZ = add(c.T[:, :, None] * at.Z[:, None, :])
        columns = np.ascontiguousarray(np.moveaxis(self.cZ, 1, 0))
        self.projected = columns.swapaxes(1, 2) @ columns

    def traces(self) -> tuple[Array, Array]:
        """tr(P V_j) and e^T P V_j P e."""
        inner = np.einsum("bjj->j", self.cVc) - np.einsum("jrr->j", self.projected)
        return inner, np.sum(self.at.of.blocks.add((self.c * self.at.Pe).T) ** 2, axis=0)

    def pairs(self) -> Array:
        """tr(P V_i P V_j) less the product of the projected terms."""
        across = self.cZ @ self.cZ.swapaxes(1, 2)
        return np.asarray(np.sum(self.cVc * (self.cVc - 2.0 * across), axis=0))


class _Own:
    """Terms diag(d): ``d`` (i, m), with the diagonal of V^-1 (m,) and Z^T V_i Z (i, r, r)."""

    def __init__(self, at: Point, d: Array) -> None:
        self.at, self.d = at, d
        self.z2 = np.sum(at.Z**2, axis=1)
        self.h = 1.0 / at.V.variance
        self.dZ = d[:, :, None] * at.Z
        self.projected = self.dZ.swapaxes(1, 2) @ at.Z
        self.diagonal = self.h
        self.middle: Array | None = None
        if at.V.common is not None:
            self.middle = at.V.middle
            inner = self.middle[at.of.blocks.number] @ at.V.E[:, :, None]
            self.diagonal = self.h - np.sum(at.V.E * inner[:, :, 0], axis=1)

    def traces(self) -> tuple[Array, Array]:
        """tr(P V_i) and e^T P V_i P e."""
        return self.d @ (self.diagonal - self.z2), self.d @ self.at.Pe**2

    def pairs(self) -> Array:
        """tr(P V_i P V_j) less the product of the projected terms."""
        d, h = self.d, self.h
        out = (d * (h * (2.0 * (self.diagonal - self.z2) - h))) @ d.T
        if self.middle is None or not len(d):
            return np.asarray(out)
        E, add = self.at.V.E, self.at.of.blocks.add
        EdE = [add(E[:, :, None] * (one[:, None] * E)[:, None, :]) for one in d]
        EdZ = [add(E[:, :, None] * one[:, None, :]) for one in self.dZ]
        left = np.array([self.middle @ one @ self.middle for one in EdE]).reshape(len(d), -1)
        right = np.array([self.middle @ one for one in EdZ]).reshape(len(d), -1)
        out += left @ np.array(EdE).reshape(len(d), -1).T
        return np.asarray(out + 2.0 * right @ np.array(EdZ).reshape(len(d), -1).T)

    def with_shared(self, other: _Shared) -> Array:
        """tr(P V_i P V_j) with the terms that blocks share, less the product of the projected terms."""
        add, Vc = self.at.of.blocks.add, self.at.Vc
        out = self.d @ Vc**2
        for i, dZ in enumerate(self.dZ):
            VcZ = add(Vc[:, :, None] * dZ[:, None, :])
            out[i] -= 2.0 * np.sum(VcZ * other.cZ, axis=(0, 2))
        return np.asarray(out)


def maximise(of: Likelihood, start: Array, low: Array) -> Array:
    """Variances (k,) >= ``low`` (k,) of the largest likelihood, from ``start`` (k,)."""
    here = of.at(np.maximum(start, low))
    for _ in range(STEPS):
        slope, information = here.slope_and_information()
        step = _step(slope, information, low - here.t)
        if _promise(slope, information, step) < NEAR:
            information = here.curvature(information)
            step = _step(slope, information, low - here.t)
        if _promise(slope, information, step) < LAST:
            return np.asarray(np.maximum(here.t + step, low))
        for half in range(12):
            there = _point(of, np.maximum(here.t + 0.5**half * step, low))
            if there is not None and there.loss < here.loss:
                break
        else:
            break
        assert there is not None  # noqa: S101 - left by the break above
        here = there
    return here.t


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
    """The step (k,) >= ``least`` that maximises slope^T x - x^T information x / 2: a few variances, by active sets."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    s, H, low = slope * scale, information * np.outer(scale, scale), least / scale
    H = H + 1e-10 * np.eye(len(s))
    held = np.zeros(len(s), dtype=bool)
    x = np.zeros(len(s))
    for _ in range(3 * len(s) + 3):
        x[held] = low[held]
        free = ~held
        x[free] = np.linalg.solve(H[np.ix_(free, free)], s[free] - H[np.ix_(free, held)] @ x[held])
        below = free & (x < low)
        if below.any():
            held |= below
            continue
        pull = s - H @ x
        leaving = held & (pull > 1e-9)
        if not leaving.any():
            break
        held[np.argmax(np.where(leaving, pull, -np.inf))] = False
    return np.asarray(np.maximum(x, low) * scale)
