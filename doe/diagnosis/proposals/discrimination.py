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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.special import softmax

from doe.planning.optimal_choice import exchange
from robots.arrays import Array, Bools, Indices, Integers
from robots.progress import Progress, report_progress

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
    across = np.swapaxes(m, -1, -2)[..., None, :, :]
    Am = inverse @ across
    left = np.swapaxes(np.sum(Am * across, axis=-2), -1, -2)
    own = np.einsum("...jkj->...jk", Am)
    both = m @ np.swapaxes(own, -1, -2)
    square = left - 2.0 * both + np.einsum("...jk,...jk->...j", m, own)[..., None, :]
    out = 0.5 * (trace - k + log_det[..., None, :] - log_det[..., :, None] + np.maximum(square, 0.0))
    return np.asarray(np.maximum(out, 0.0))


def information(p: Predictions, kl: Array) -> Array:
    """What the right rival's name gains (...,) by readings with divergences ``kl`` (..., h, h), in nat."""
    D = np.where(p.same, 0.0, 0.25 * np.minimum(kl, np.swapaxes(kl, -1, -2)))
    return np.asarray(-np.log(np.exp(-D) @ p.weight) @ p.weight)


def choose(p: Predictions, n: int, progress: Progress | None = None) -> Choice:
    """Choose n experiments: the best one by one, then swaps until none gains (Fedorov exchange)."""
    h, r = len(p.code), p.mean.shape[2]
    rounds = count(1)

    def score(taken: list[int]) -> Array:
        report_progress(progress, min(next(rounds), n * (1 + SWEEPS)), n * (1 + SWEEPS))
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


def told(p: Predictions, chosen: Sequence[int]) -> float:
    """What the name gains by experiments, in nat: the lower estimate that :func:`choose` goes by."""
    return float(information(p, divergence(*joint(p, chosen)))) if len(chosen) else 0.0


def without_idle(p: Predictions, chosen: Sequence[int], least: float) -> list[int]:
    """The experiments without those that, one after the other, tell less than ``least`` (nat) beside the rest."""
    kept = list(chosen)
    while kept:
        rest = [[k for k in kept if k != out] for out in kept]
        left = [told(p, some) for some in rest]
        best = int(np.argmax(left))
        if told(p, kept) - left[best] >= least:
            break
        kept = rest[best]
    return kept


@dataclass(frozen=True)
class Outcome:
    """What is to be expected of a diagnosis if one rival is true.

    ``belief``: mean probability of the right name; ``right``, ``wrong``: chances that the verdict is right, and that
    it names something else. Otherwise nothing is settled.
    """

    belief: float
    right: float
    wrong: float

    @property
    def open(self) -> float:
        """The chance that nothing is settled."""
        return max(1.0 - self.right - self.wrong, 0.0)


# What a diagnosis with such probabilities (..., h) of the rivals says: the number of a name, or -1 where it is open.
Verdicts = Callable[[Array], Integers]


def outcomes(
    p: Predictions,
    chosen: Sequence[int],
    names: Sequence[str],
    verdict: Verdicts,
    rng: np.random.Generator,
    draws: int = 2000,
) -> dict[str, Outcome]:
    """What comes of experiments if each of the codes is true, by simulation; of none what stands already.

    ``names``: of each code of ``p`` what it is called (its family); ``verdict`` gets probabilities by code and answers
    with the number of a code, whose name counts.
    """
    codes = list(dict.fromkeys(p.code))
    of_code = np.array([[one == code for code in codes] for one in p.code], dtype=np.float64)
    name = dict(zip(p.code, names, strict=True))
    numbers = np.array([list(name.values()).index(name[code]) for code in codes])
    each = max(draws // len(p.code), 20) if len(chosen) else 1
    sums = {code: np.zeros(4) for code in codes}
    for i, code in enumerate(p.code):
        belief = _beliefs(p, chosen, i, each, rng) @ of_code
        mine = numbers[codes.index(code)]
        said = verdict(belief)
        said_name = np.where(said < 0, -1, numbers[np.maximum(said, 0)])
        parts = (
            belief[:, numbers == mine].sum(axis=1).mean(),
            np.mean(said_name == mine),
            np.mean((said_name != mine) & (said_name >= 0)),
        )
        sums[code] += p.weight[i] * np.array([1.0, *parts])
    return {code: Outcome(*(x[1:] / max(x[0], 1e-300)).tolist()) for code, x in sums.items()}


def _beliefs(p: Predictions, chosen: Sequence[int], true: int, draws: int, rng: np.random.Generator) -> Array:
    """Probabilities (draws, h) of the rivals after readings of experiments, drawn as one of them predicts them."""
    if not len(chosen):
        return np.tile(p.weight, (draws, 1))
    mean, S = joint(p, chosen)
    L = np.linalg.cholesky(S)
    log_det = 2.0 * np.log(np.einsum("hkk->hk", L)).sum(axis=1)
    y = mean[true] + rng.standard_normal((draws, mean.shape[1])) @ L[true].T
    z = np.linalg.solve(L, (y[None] - mean[:, None]).transpose(0, 2, 1))
    log = np.log(p.weight)[:, None] - 0.5 * (log_det[:, None] + np.sum(z**2, axis=1))
    return np.asarray(softmax(log, axis=0).T)
