"""Which of many possible experiments tells rival hypotheses apart: expected evidence, and a choice by exchange.

Rival i says that the readings y of some experiments are normal, ``N(m_i, S_i)``, parameters' uncertainty included.
If i is true the log Bayes factor against j is expected to grow by the Kullback-Leibler divergence

``KL(i || j) = (tr(S_j^-1 S_i) - k + ln|S_j| - ln|S_i| + (m_i - m_j)^T S_j^-1 (m_i - m_j)) / 2``

(Box and Hill 1967, doi:10.1080/00401706.1967.10490441; for two rivals with known noise it is the T-criterion of
Atkinson and Fedorov 1975, doi:10.1093/biomet/62.1.57). Its sum over pairs grows without end where one pair is settled
already, so experiments are chosen by what the name of the right rival gains in information, by the bound for mixtures
``-sum_i p_i ln sum_j p_j exp(-D_ij)`` (Kolchinsky and Tracey 2017, doi:10.3390/e19070361) with
``D_ij = min(KL(i || j), KL(j || i)) / 4``, which for equal covariances is the Bhattacharyya distance. For two rivals
the bound rises with D alone, so that the choice is the T-optimal one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from doe.planning.optimal_choice import exchange
from robots.arrays import Array, Bools, Indices

# Numbers in the covariances that are worked on at once: some 60 MB.
AT_ONCE = 4_000_000
# A swap must gain this share of the criterion.
LEAST_GAIN = 1e-4
SWEEPS = 2


@dataclass(frozen=True)
class Predictions:
    """What h rivals predict for N experiments of r readings each, in units of the noise (unit covariance).

    ``code`` (h,): the same code twice is one rival in two shapes; ``weight`` (h,): probabilities, sum 1; ``mean``
    (h, N, r); ``factor``: (N, r, b) for each rival, by which its parameters move the readings: experiments j and k
    have the covariance ``F_j F_k^T`` on top of the noise.
    """

    code: tuple[str, ...]
    weight: Array
    mean: Array
    factor: tuple[Array, ...]

    def __len__(self) -> int:
        return int(self.mean.shape[1])

    @property
    def same(self) -> Bools:
        """Which rivals (h, h) go by one name."""
        names = np.array(self.code)
        return np.asarray(names[:, None] == names[None, :])


@dataclass(frozen=True)
class Choice:
    """Experiments ``chosen`` (n,) and what they tell of the right rival's name.

    ``information`` (nat, a lower estimate), of ``entropy`` that is open: of the rivals' names.
    """

    chosen: Indices
    information: float
    entropy: float


def joint(p: Predictions, chosen: Sequence[int] | Indices) -> tuple[Array, Array]:
    """Means (..., h, k) and covariances (..., h, k, k), noise included, of the readings of experiments (..., n)."""
    index = np.asarray(chosen, dtype=np.intp)
    mean = np.moveaxis(p.mean[:, index], 0, -3)
    mean = mean.reshape(*mean.shape[:-2], -1)
    flat = [F[index].reshape(*index.shape[:-1], mean.shape[-1], -1) for F in p.factor]
    return mean, np.stack([F @ np.swapaxes(F, -1, -2) for F in flat], axis=-3) + np.eye(mean.shape[-1])


def divergence(mean: Array, covariance: Array) -> Array:
    """KL(i || j) (..., h, h) of normals with mean (..., h, k) and covariance (..., h, k, k)."""
    k = mean.shape[-1]
    inverse = np.linalg.inv(covariance)
    log_det = np.linalg.slogdet(covariance)[1]
    flat = (*covariance.shape[:-2], k * k)
    trace = covariance.reshape(flat) @ np.swapaxes(inverse.reshape(flat), -1, -2)
    # Differences of products lose digits where all means are far from zero.
    m = mean - mean.mean(axis=-2, keepdims=True)
    Am = np.einsum("...jkl,...il->...ijk", inverse, m)
    left = np.einsum("...ik,...ijk->...ij", m, Am)
    own = np.einsum("...jjk->...jk", Am)
    both = np.einsum("...ik,...jk->...ij", m, own)
    square = left - 2.0 * both + np.einsum("...jk,...jk->...j", m, own)[..., None, :]
    out = 0.5 * (trace - k + log_det[..., None, :] - log_det[..., :, None] + np.maximum(square, 0.0))
    return np.asarray(np.maximum(out, 0.0))


def information(p: Predictions, kl: Array) -> Array:
    """What the right rival's name gains (...,) by readings with divergences ``kl`` (..., h, h), in nat."""
    D = np.where(p.same, 0.0, 0.25 * np.minimum(kl, np.swapaxes(kl, -1, -2)))
    return np.asarray(-np.log(np.exp(-D) @ p.weight) @ p.weight)


def choose(p: Predictions, n: int) -> Choice:
    """Choose n experiments: the best one by one, then swaps until none gains (Fedorov exchange)."""
    h, r = len(p.code), p.mean.shape[2]

    def score(taken: list[int]) -> Array:
        k = (len(taken) + 1) * r
        together = np.column_stack([np.tile(taken, (len(p), 1)), np.arange(len(p))]).astype(np.intp)
        # Covariances, their inverses, and the products of every pair of rivals.
        parts = np.array_split(together, -(-len(p) * (2 * h * k * k + h * h * k) // AT_ONCE))
        out = np.concatenate([information(p, divergence(*joint(p, part))) for part in parts])
        out[taken] = -np.inf
        return out

    chosen, best = exchange(score, n, least_gain=LEAST_GAIN, sweeps=SWEEPS)
    names = {code: float(p.weight[np.array(p.code) == code].sum()) for code in p.code}
    share = np.array(list(names.values()))
    return Choice(np.array(chosen, dtype=np.intp), best, float(-share @ np.log(np.maximum(share, 1e-300))))


def right_names(
    p: Predictions, chosen: Sequence[int], group: dict[str, str], rng: np.random.Generator, draws: int = 2000
) -> dict[str, float]:
    """How probable each code's group (family) is to come out on top if the code is true, by simulation.

    ``group``: of each code; the top is the group with the largest sum of probabilities.
    """
    mean, S = joint(p, chosen)
    L = np.linalg.cholesky(S)
    groups = list(dict.fromkeys(group[code] for code in p.code))
    member = np.array([[group[code] == g for g in groups] for code in p.code], dtype=np.float64)
    hits: dict[str, list[float]] = {}
    each = max(draws // len(p.code), 20)
    log_det = 2.0 * np.log(np.einsum("hkk->hk", L)).sum(axis=1)
    for i, code in enumerate(p.code):
        y = mean[i] + rng.standard_normal((each, mean.shape[1])) @ L[i].T
        z = np.linalg.solve(L, (y[None] - mean[:, None]).transpose(0, 2, 1))
        log = np.log(p.weight)[:, None] - 0.5 * (log_det[:, None] + np.sum(z**2, axis=1))
        posterior = np.exp(log - log.max(axis=0)).T @ member
        right = np.argmax(posterior, axis=1) == groups.index(group[code])
        hits.setdefault(code, []).append(float(p.weight[i]) * float(right.mean()))
    total = {code: float(p.weight[np.array(p.code) == code].sum()) for code in hits}
    return {code: sum(parts) / max(total[code], 1e-300) for code, parts in hits.items()}
