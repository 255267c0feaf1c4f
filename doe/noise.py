"""What scatters: gauge, share of the deflection, and set-up; variances estimated by restricted likelihood.

A reading in pose g, component k, is ``y = f + e + a_gk + b_gk f``: white noise ``e`` with variance
``white^2 + (share f)^2`` (or the reading's own sigma), and two terms that all readings of one component in one
set-up have in common, with standard deviations ``pose`` (m or rad) and ``pose_share``. Readings of one set-up are
therefore not independent, and intervals that ignore it are too narrow. The covariance is made of one small block
for each pose and component. Variances: restricted maximum likelihood (Patterson and Thompson 1971,
doi:10.1093/biomet/58.3.545), which does not take the fitted parameters' share of the scatter for noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from doe.problem import Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Fewer poses or readings than these say nothing about a variance beside the parameters.
FEWEST_POSES, FEWEST_READINGS = 6, 16
# Deflections must differ by this factor before a share can be told from a constant.
SHARE_SPAN = 1.8
# Standard deviations are sought within these factors of the residuals' scale.
SEARCH = (1e-4, 1e2)
# Adding a variance must gain this much log-likelihood (half of chi-square's 80 % point, one-sided).
LEAST_GAIN = 0.35
TERMS = ("share", "pose_share", "pose0", "pose1")


@dataclass(frozen=True)
class Noise:
    """Standard deviations: ``white`` and ``pose`` (2,) for translations (m) and rotations (rad); shares (-)."""

    white: tuple[float, float]
    share: float = 0.0
    pose: tuple[float, float] = (0.0, 0.0)
    pose_share: float = 0.0

    def variance(self, p: Problem, f: Array) -> Array:
        """Variance (m,) of the white part at predictions f (m,)."""
        kind = (p.component >= 3).astype(int)
        own = np.where(np.isnan(p.sigma), np.array(self.white)[kind], p.sigma)
        return np.asarray(own**2 + (self.share * f) ** 2)

    def common(self, p: Problem, f: Array) -> Array:
        """Columns (m, 2) of what a set-up's readings have in common, times its standard deviation."""
        kind = (p.component >= 3).astype(int)
        return np.stack([np.array(self.pose)[kind], self.pose_share * f], axis=1)

    @property
    def has_common(self) -> bool:
        """Whether readings of one set-up are correlated."""
        return bool(any(self.pose) or self.pose_share)


@dataclass(frozen=True)
class Blocks:
    """Readings sorted into blocks of one pose and component, and the blocks by size: index arrays (b, n)."""

    sizes: tuple[Indices, ...]

    @staticmethod
    def of(p: Problem) -> Blocks:
        """Blocks of a problem."""
        key = 6 * p.pose + p.component
        order = np.argsort(key, kind="stable")
        _, counts = np.unique(key, return_counts=True)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        sizes = []
        for n in np.unique(counts):
            sizes.append(order[starts[counts == n][:, None] + np.arange(n)])
        return Blocks(tuple(sizes))

    def whiten(self, variance: Array, common: Array, columns: Array) -> tuple[Array, float]:
        """Turn columns (m, c) into ones of unit covariance, and ln|V|; V = diag(variance) + common common^T."""
        out = np.empty_like(columns)
        log_det = 0.0
        if not common.any():
            return columns / np.sqrt(variance)[:, None], float(np.log(variance).sum())
        for index in self.sizes:
            C = common[index]
            V = C @ np.swapaxes(C, 1, 2)
            diagonal = np.arange(index.shape[1])
            V[:, diagonal, diagonal] += variance[index]
            L = np.linalg.cholesky(V)
            out[index] = np.linalg.solve(L, columns[index])
            log_det += 2.0 * float(np.log(L[:, diagonal, diagonal]).sum())
        return out, log_det

    def inverse(
        self, variance: Array, common: Array, J: Array, error: Array
    ) -> tuple[Array, Array, Array, float, Array]:
        """``V^-1 J``, ``V^-1 error``, the diagonal of V^-1, ln|V| and ``V^-1 common``."""
        columns = np.column_stack([J, error, common])
        if not common.any():
            out = columns / variance[:, None]
            return out[:, :-3], out[:, -3], 1.0 / variance, float(np.log(variance).sum()), out[:, -2:]
        out, diagonal, log_det = np.empty_like(columns), np.empty(len(variance)), 0.0
        for index in self.sizes:
            C = common[index]
            V = C @ np.swapaxes(C, 1, 2)
            d = np.arange(index.shape[1])
            V[:, d, d] += variance[index]
            inverse = np.linalg.inv(V)
            out[index] = inverse @ columns[index]
            diagonal[index] = inverse[:, d, d]
            log_det += float(np.linalg.slogdet(V)[1].sum())
        return out[:, :-3], out[:, -3], diagonal, log_det, out[:, -2:]


def shrink_common(p: Problem, blocks: Blocks, noise: Noise, f: Array, weight: Array, error: Array) -> Array:
    """Best prediction (m,) of the common part of the errors (m,): what remains is the readings' own."""
    if not noise.has_common:
        return np.zeros(len(error))
    variance, common = noise.variance(p, f) / weight, noise.common(p, f)
    white, _ = blocks.whiten(variance, common, np.column_stack([error, common]))
    out = np.zeros(len(error))
    for index in blocks.sizes:
        e, U = white[index, 0], white[index, 1:]
        out[index] = np.einsum("bnc,bc->bn", common[index], np.einsum("bnc,bn->bc", U, e))
    return out


def estimable(p: Problem, f: Array) -> tuple[bool, bool]:
    """Whether the data can tell a share of the deflection from a constant, and a set-up's scatter from white."""
    size = np.abs(f[p.component < 3]) if (p.component < 3).any() else np.abs(f)
    size = size[size > 0.0]
    spread = size.size > 0 and np.quantile(size, 0.9) > SHARE_SPAN * np.quantile(size, 0.1)
    shared = len(p) >= FEWEST_READINGS and bool(spread)
    several = max(b.shape[1] for b in Blocks.of(p).sizes) > 1
    return shared, several and len(p.poses) >= FEWEST_POSES


@dataclass(frozen=True)
class _Search:
    """Everything the restricted likelihood needs but the variances."""

    p: Problem
    blocks: Blocks
    f: Array
    J: Array
    error: Array
    weight: Array


def fit_noise(
    p: Problem, f: Array, J: Array, error: Array, start: Noise, floor: tuple[float, float], weight: Array,
    *, choose: bool = True,
) -> Noise:  # fmt: skip
    """Variances by restricted likelihood from residuals ``error`` (m,) = read - f, with derivatives J (m, k).

    ``choose``: terms are added one after the other (white; share; set-up in proportion; set-up absolute) as long
    as the data can tell them and the likelihood asks for them; else those that ``start`` has are refined.
    ``weight`` (m,) divides the white variance of outliers. White noise never falls below ``floor``.
    """
    own = np.isnan(p.sigma)
    turns, shifts = (p.component >= 3), (p.component < 3)
    white = [name for name, there in (("white0", (own & shifts).any()), ("white1", (own & turns).any())) if there]
    search = _Search(p, Blocks.of(p), f, _independent(J), error, weight)
    if not choose:
        return _fitted(search, start, [*white, *(n for n in TERMS if _value(start, n) > 0.0)], floor)[0]
    best, loss = _fitted(search, Noise(white=start.white), white, floor)
    shared, common = estimable(p, f)
    trials = [["share"]] if shared else []
    if common:
        trials += [["pose_share"], ["pose0"] * bool(shifts.any()) + ["pose1"] * bool(turns.any())]
    names = white
    for extra in trials:
        found, lower = _fitted(search, best, [*names, *extra], floor)
        if lower < loss - LEAST_GAIN:
            best, loss, names = found, lower, [*names, *extra]
    return best


def _independent(J: Array) -> Array:
    """A basis of the columns' span: the likelihood must not hang on directions that no reading tells."""
    norm = np.linalg.norm(J, axis=0)
    U, s, _ = np.linalg.svd(J[:, norm > 0.0] / norm[norm > 0.0], full_matrices=False)
    return np.asarray(U[:, s > 1e-8 * s.max(initial=1e-300)])


def _fitted(search: _Search, start: Noise, names: list[str], floor: tuple[float, float]) -> tuple[Noise, float]:
    p, error, f = search.p, search.error, search.f
    kind = {"0": p.component < 3, "1": p.component >= 3}
    relative = error / np.maximum(np.abs(f), 1e-3 * np.abs(f).max(initial=1e-300))
    scale = [_rms(error[kind[n[-1]]] if n[-1] in kind else relative) for n in names]
    least = [floor[int(n[-1])] if n.startswith("white") else 0.0 for n in names]
    low = np.log([max(m, SEARCH[0] * max(v, 1e-12)) for m, v in zip(least, scale, strict=True)])
    high = np.maximum(np.log([SEARCH[1] * max(v, 1e-12) for v in scale]), low + 1e-6)
    first = [_value(start, n) or 0.5 * v for n, v in zip(names, scale, strict=True)]
    if not names:
        return start, _loss(search, start, [])[0]

    def loss(x: Array) -> tuple[float, Array]:
        return _loss(search, _noise(start, names, np.exp(x)), names)

    begin = np.clip(np.log(np.maximum(first, 1e-300)), low, high)
    found = minimize(loss, begin, jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
                     options={"ftol": 1e-8, "gtol": 1e-4})  # fmt: skip
    return _noise(start, names, np.exp(found.x)), float(found.fun)


def _loss(search: _Search, noise: Noise, names: list[str]) -> tuple[float, Array]:
    """Minus the restricted log-likelihood (up to a constant), and its slope by the logarithms of ``names``.

    With P = V^-1 - V^-1 J (J^T V^-1 J)^-1 J^T V^-1 and residuals r: ``(ln|V| + ln|J^T V^-1 J| + r^T P r) / 2``, its
    derivative by a variance ``(tr(P dV) - r^T P dV P r) / 2``.
    """
    p, f, J = search.p, search.f, search.J
    variance, common = noise.variance(p, f) / search.weight, noise.common(p, f)
    VJ, Vr, diagonal, log_det, Vc = search.blocks.inverse(variance, common, J, search.error)
    G = J.T @ VJ
    L = np.linalg.cholesky(G)
    half = np.linalg.solve(L, VJ.T).T
    Pr = Vr - half @ (half.T @ search.error)
    value = 0.5 * (log_det + 2.0 * float(np.log(np.diag(L)).sum()) + float(search.error @ Pr))
    spread = diagonal - np.sum(half**2, axis=1)
    slopes = []
    kind = (p.component >= 3).astype(int)
    for name in names:
        if name.startswith("white"):
            mine = (kind == int(name[-1])) & np.isnan(p.sigma)
            d = np.where(mine, noise.white[int(name[-1])] ** 2, 0.0) / search.weight
            slopes.append(float(np.sum(d * (spread - Pr**2))))
        elif name == "share":
            d = (noise.share * f) ** 2 / search.weight
            slopes.append(float(np.sum(d * (spread - Pr**2))))
        else:
            column = int(name == "pose_share")
            c = common[:, column] if column else np.where(kind == int(name[-1]), common[:, 0], 0.0)
            slopes.append(_common_slope(search.blocks, c, Vc[:, column], half, Pr))
    return value, np.array(slopes)


def _common_slope(blocks: Blocks, c: Array, Vc: Array, half: Array, Pr: Array) -> float:
    """Slope by the logarithm of the standard deviation of a term ``c`` (m,) that blocks have in common."""
    out = 0.0
    for index in blocks.sizes:
        own = np.sum(c[index] * Vc[index], axis=1)
        fitted = np.einsum("bn,bnp->bp", c[index], half[index])
        out += float(np.sum(own) - np.sum(fitted**2) - np.sum(np.sum(c[index] * Pr[index], axis=1) ** 2))
    return out


def _value(noise: Noise, name: str) -> float:
    return {
        "white0": noise.white[0],
        "white1": noise.white[1],
        "share": noise.share,
        "pose0": noise.pose[0],
        "pose1": noise.pose[1],
        "pose_share": noise.pose_share,
    }[name]


def _noise(start: Noise, names: list[str], values: Array) -> Noise:
    given = dict(zip(names, values.tolist(), strict=True))
    return replace(
        start,
        white=(given.get("white0", start.white[0]), given.get("white1", start.white[1])),
        pose=(given.get("pose0", start.pose[0]), given.get("pose1", start.pose[1])),
        share=given.get("share", start.share),
        pose_share=given.get("pose_share", start.pose_share),
    )


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else 0.0
