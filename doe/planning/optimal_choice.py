"""Which of many possible experiments to do next: D-, A- and I-optimal choice by exchange.

Experiment j adds the information ``B_j^T B_j`` (B_j (r, p): derivatives of its readings with unit covariance). To
what is known already, M, a choice of n is added that makes the covariance ``C = (M + sum B_j^T B_j)^-1`` small: in
volume (D: ln det C), in the mean variance of the parameters (A: tr C), or in the mean variance of predictions
(I: tr(W C), W the mean of ``x x^T`` over the predictions x). Greedy choice, then Fedorov exchange until no single
swap gains, from several starts (Atkinson, Donev and Tobias 2007, Optimum Experimental Designs with SAS, ch. 12). A
local optimum: good, not proven best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robots import InputError, require_one_of
from robots.arrays import Array, Integers
from robots.progress import Progress, report_progress

Criterion = Literal["D", "A", "I"]

CRITERIA: tuple[Criterion, ...] = ("D", "A", "I")
MOST_SWEEPS = 30
# A swap must gain this share of the criterion, or sweeps would go on over rounding.
LEAST_GAIN = 1e-9
# Random plans: their median is then uncertain by some 6 % of one plan's standard deviation.
PLANS = 400


@dataclass(frozen=True)
class Choice:
    """The experiments chosen.

    ``chosen`` (n,): in the order of choice; ``covariance`` (p, p) after them; ``value`` of the criterion, smaller is
    better (D: ln det C; A, I: the trace).
    """

    chosen: Integers
    covariance: Array
    value: float


def choose(
    known: Array,
    experiments: Array,
    n: int,
    criterion: Criterion = "D",
    *,
    weight: Array | None = None,
    rng: np.random.Generator | None = None,
    starts: int = 4,
    progress: Progress | None = None,
) -> Choice:
    """Choose n of N experiments, each at most once.

    Parameters
    ----------
    known : (p, p) information so far, positive definite (a weak prior makes it so)
    experiments : (N, r, p) the factors B_j; rows of zeros where an experiment reads less
    weight : (p, p) positive semi-definite W of the A and I criteria; identity for A
    starts : the greedy one, then random ones; needs ``rng`` beyond the first

    Raises
    ------
    InputError
        n out of range, unknown criterion, or information that is not positive definite.
    """
    require_one_of("criterion of a plan", criterion, CRITERIA, code="C005")
    if not 0 < n <= len(experiments):
        raise InputError(
            "experiments to choose", code="C005", value=n, allowed=f"1 to {len(experiments)}, the number of candidates"
        )
    W = np.eye(len(known)) if weight is None else weight

    def score(taken: list[int]) -> Array:
        C = _covariance(_information(known, experiments, np.array(taken, dtype=np.int64)))
        out = _gains(C, experiments, criterion, W) - _value(C, criterion, W)
        out[taken] = -np.inf
        return out

    found: list[tuple[list[int], float]] = []
    for start in range(starts if rng is not None else 1):
        first = rng.choice(len(experiments), n, replace=False).tolist() if start and rng is not None else []
        found.append(exchange(score, n, first))
        report_progress(progress, start + 1, starts)
    best = max(found, key=lambda one: one[1])
    return judge(known, experiments, np.array(best[0]), criterion, W)


def exchange(
    score: Callable[[list[int]], Array],
    n: int,
    first: Sequence[int] = (),
    *,
    least_gain: float = LEAST_GAIN,
    sweeps: int = MOST_SWEEPS,
) -> tuple[list[int], float]:
    """Choose n candidates: greedily beyond ``first``, then swap one for a better one until nothing gains.

    ``score``: value (N,) of each candidate together with those taken, larger is better; -inf for one that may not join.
    A swap must gain ``least_gain``, as a share of the value where that is larger than one.

    Returns
    -------
    the choice, and its value
    """
    chosen, now = list(first), -np.inf
    while len(chosen) < n:
        scores = score(chosen)
        chosen.append(int(np.argmax(scores)))
        now = float(scores[chosen[-1]])
    for _ in range(sweeps):
        before = now
        for k in range(n):
            scores = score(chosen[:k] + chosen[k + 1 :])
            better = int(np.argmax(scores))
            if scores[better] - now > least_gain * max(abs(scores[better]), 1.0):
                chosen[k], now = better, float(scores[better])
        if now - before <= least_gain * max(abs(now), 1.0):
            break
    return chosen, now


def judge(
    known: Array, experiments: Array, chosen: Integers, criterion: Criterion, weight: Array | None = None
) -> Choice:
    """The value of a given choice."""
    W = np.eye(len(known)) if weight is None else weight
    C = _covariance(_information(known, experiments, chosen))
    return Choice(np.asarray(chosen), C, _value(C, criterion, W))


def _information(known: Array, experiments: Array, chosen: Integers) -> Array:
    B = experiments[chosen].reshape(-1, experiments.shape[2])
    return np.asarray(known + B.T @ B)


def _covariance(M: Array) -> Array:
    try:
        L = np.linalg.cholesky(M)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "what is known already does not bound all parameters",
            code="C004",
            remedy="give the parameters ranges or priors",
        ) from error
    half = np.linalg.solve(L, np.eye(len(M)))
    return np.asarray(half.T @ half)


def _value(C: Array, criterion: Criterion, W: Array) -> float:
    return float(np.linalg.slogdet(C)[1]) if criterion == "D" else float(np.sum(W * C))


def _gains(C: Array, experiments: Array, criterion: Criterion, W: Array) -> Array:
    """By how much each experiment (N,) lowers the criterion when added to covariance C."""
    BC = experiments @ C
    inner = BC @ np.swapaxes(experiments, 1, 2)
    r = np.arange(inner.shape[1])
    inner[:, r, r] += 1.0
    if criterion == "D":
        return np.asarray(np.linalg.slogdet(inner)[1])
    return np.asarray(np.trace(np.linalg.solve(inner, BC @ W @ np.swapaxes(BC, 1, 2)), axis1=1, axis2=2))


def random_values(
    known: Array,
    experiments: Array,
    most: int,
    criterion: Criterion,
    weight: Array | None,
    rng: np.random.Generator,
    plans: int = PLANS,
) -> Array:
    """What chance would give, the yardstick of a plan: the criterion (plans, most) after the first 1, 2 ... ``most``.

    Experiments are drawn without replacement; arguments as of :func:`choose`.
    """
    W = np.eye(len(known)) if weight is None else weight
    out = np.empty((plans, most))
    for k in range(plans):
        B = experiments[rng.choice(len(experiments), most, replace=False)]
        M = known + np.cumsum(np.swapaxes(B, 1, 2) @ B, axis=0)
        out[k] = -np.linalg.slogdet(M)[1] if criterion == "D" else np.sum(W * np.linalg.inv(M), axis=(1, 2))
    return out
