"""What readings scatter by of their own, told by their repeats alone: no error of a model touches that.

Of n readings of one component under the same pose, load and phase, n - 1 differences tell their scatter: Helmert's
contrasts, which are independent where the readings are, and in which the deflection and what a set-up's readings have
in common cancel. Variances are those of the restricted likelihood of all contrasts
(:mod:`doe.estimation.restricted_likelihood`), for one structure of the noise after the other
(:data:`doe.estimation.noise.Structure`); the likeliest is taken, with the tails that fit it best. Outliers and heavy
tails lose weight inside the likelihood (Lange, Little and Taylor 1989, doi:10.1080/01621459.1989.10478852).

What moves between repeats though nothing was set otherwise is followed: a drift with the clock, another zero in another
session. Between visits to a pose set-ups scatter anew: a term of its own, which all loads of a visit have in common.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.special import gammaln

from doe.estimation.blocks import Blocks
from doe.estimation.least_squares import spanning
from doe.estimation.noise import (
    AXES,
    OUTLIERS,
    WHITE,
    WIDER,
    Noise,
    Structure,
    estimable,
    own_terms,
    pattern,
    terms_of,
)
from doe.estimation.problem import Problem
from doe.estimation.restricted_likelihood import Likelihood, Term, maximise
from doe.estimation.robust import robust_sd
from robots.arrays import Array, Indices

# Contrasts from which on their scatter is told: to within a sixth.
FEWEST_CONTRASTS = 20
# Degrees of freedom of tails that are tried; 0: normal with a few outliers. Structures are compared with one of them.
TAILS = (0.0, 8.0, 5.0, 3.0)
MIDDLE_TAIL = 5.0
# Log likelihood by which another structure than the usual one must be the better.
ANOTHER = 1.0
# Log likelihood that tails, and a scatter between visits, must add to be believed.
TAIL_GAIN, VISIT_GAIN = 2.0, 3.0
# Half waves over the clock that a drift may have, straight lines apart.
BENDS = 4
# Contrasts there must be for each column that follows a drift or a session.
TO_SPARE = 10
ROUNDS = 12
# Weights have settled when none changes by more.
SETTLED = 0.03
# White noise (m or rad) that no gauge stays below.
LEAST = 1e-7
# Loads must differ by this factor for noise in proportion to them to be told.
LOAD_SPAN = 1.3


@dataclass(frozen=True)
class Repeats:
    """What repeats tell: the readings' own ``noise``, from so many contrasts (``count``), and its rivals.

    ``worth``: log likelihood of every structure, less what its numbers cost; ``others``: their noises; ``visit``: what
    all readings of one visit to a pose have in common, as a share of the deflection; ``apart``: whether that is sure.
    """

    noise: Noise
    structure: Structure
    count: int
    worth: dict[Structure, float]
    others: dict[Structure, Noise]
    visit: float
    apart: bool


@dataclass(frozen=True)
class _Contrasts:
    """``value`` (N,); ``row`` (N,): a reading that has each one's pattern; ``f`` (m,): deflections by the repeats."""

    p: Problem
    value: Array
    row: Indices
    f: Array
    blocks: Blocks
    trends: Array
    visits: bool


def repeated(p: Problem) -> Repeats | None:
    """What the repeats among readings tell of their scatter; None where there are too few of them."""
    if "repeats" not in p.memory:
        few = len(p) - len(np.unique(p.replicate)) < FEWEST_CONTRASTS
        c = None if few else _contrasts(p)
        p.memory["repeats"] = None if c is None or len(c.value) < FEWEST_CONTRASTS else _told(c)
    found = p.memory["repeats"]
    assert found is None or isinstance(found, Repeats)  # noqa: S101 - by its name
    return found


def structures(p: Problem, f: Array) -> tuple[Structure, ...]:
    """Structures of the noise that readings can tell apart; predictions f (m,)."""
    out: list[Structure] = ["share"]
    if not estimable(p, f)[0]:
        return tuple(out)
    length, size = p.lengths(f), np.abs(f)
    if np.sum((length - size) ** 2) > 0.01 * np.sum(size**2):
        out.append("vector")
    if p.load.max() > LOAD_SPAN * max(float(p.load.min()), 1e-12):
        out.append("load")
    if max(len(np.unique(p.component[p.component // 3 == kind])) for kind in (0, 1)) > 1:
        out.append("axes")
    return tuple(out)


def costs(structure: Structure, p: Problem, readings: int) -> float:
    """What a structure's numbers beyond white noise and one more cost, by Schwarz's criterion."""
    kinds = np.unique(p.component // 3)
    extra = len(np.unique(p.component)) - len(kinds) - 1 if structure == "axes" else 0
    extra = len(kinds) - 1 if structure == "load" else extra
    return 0.5 * max(extra, 0) * float(np.log(readings))


def _contrasts(p: Problem) -> _Contrasts:
    order = np.argsort(p.replicate, kind="stable")
    count = np.bincount(p.replicate)
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    f, at = p.value.copy(), 0
    entry: list[tuple[Array, Array, Array]] = []
    row, number, visits = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)], False
    for n in np.unique(count[count > 1]).tolist():
        group = order[first[count == n][:, None] + np.arange(n)]
        f[group] = np.median(p.value[group], axis=1)[:, None]
        group = group[np.isnan(p.sigma[group]).all(axis=1)]
        H = _helmert(n)
        lines = at + np.arange(len(group) * (n - 1)).reshape(len(group), n - 1)
        entry.append(
            (
                np.tile(H, (len(group), 1, 1)).reshape(-1),
                np.repeat(lines.reshape(-1), n),
                np.repeat(group, n - 1, axis=0).reshape(-1),
            )
        )
        at += lines.size
        row.append(np.repeat(group[:, 0], n - 1))
        number.append(np.tile(np.arange(n - 1), len(group)))
        visits = visits or (p.when is not None and bool((np.ptp(p.when.visit[group], axis=1) > 0).any()))
    parts = [np.concatenate(x) for x in zip(*entry, strict=True)] if entry else [np.zeros(0)] * 3
    K = csr_array((parts[0], (parts[1].astype(np.intp), parts[2].astype(np.intp))), shape=(at, len(p)))
    rows, k = np.concatenate(row), np.concatenate(number)
    blocks = Blocks.of((6 * p.pose[rows] + p.component[rows]) * int(count.max(initial=1)) + k)
    return _Contrasts(p, K @ p.value, rows, f, blocks, np.asarray(K @ _trends(p, f)), visits)


def _helmert(n: int) -> Array:
    """Contrasts (n - 1, n): each reading against the mean of those before it, all of norm one."""
    k = np.arange(1, n)
    out = np.where(np.arange(n) < k[:, None], 1.0 / k[:, None], 0.0)
    out[np.arange(n - 1), k] = -1.0
    return np.asarray(out * np.sqrt(k / (k + 1.0))[:, None])


def _trends(p: Problem, f: Array) -> Array:
    """Columns (m, k) that a drift with the clock and the zeros of sessions have, component by component.

    A drift bends as far as there are readings to tell it from noise.
    """
    if p.when is None:
        return np.zeros((len(p), 0))
    columns = [np.zeros(len(p))]
    clock, count = p.when.clock, len(np.unique(p.component))
    known = bool(np.isfinite(clock).all())
    spare = len(p) - len(np.unique(p.replicate))
    waves = [np.cos(np.pi * k * clock) for k in range(1, 1 + min(BENDS, spare // (2 * count * TO_SPARE)))]
    for component in np.unique(p.component):
        mine = p.component == component
        columns += [np.where(mine, x * y, 0.0) for x in (clock, *waves) for y in (1.0, f) if known]
        columns += [(mine & (p.when.session == k)).astype(float) for k in np.unique(p.when.session)[1:]]
    return np.column_stack(columns)


def _told(c: _Contrasts) -> Repeats:
    every = structures(c.p, c.f)
    found = {structure: _fitted(c, structure, MIDDLE_TAIL) for structure in every}
    worth = {s: one[0] - costs(s, c.p, len(c.value)) - ANOTHER * (s != "share") for s, one in found.items()}
    best = max(worth, key=lambda s: worth[s])
    tails = {tail: _fitted(c, best, tail) for tail in TAILS}
    tail = max(TAILS, key=lambda t: tails[t][0])
    if tails[tail][0] < tails[0.0][0] + TAIL_GAIN:
        tail = 0.0
    _, noise, visit, gain = tails[tail]
    # As wide as the best one in the middle of the distribution: others differ in what scatter depends on.
    others = {s: replace(one[1], tail=tail) for s, one in found.items() if s != best}
    return Repeats(noise, best, len(c.value), worth, others, visit, gain > VISIT_GAIN)


def _fitted(c: _Contrasts, structure: Structure, tail: float) -> tuple[float, Noise, float, float]:
    """Log likelihood of the contrasts, the noise, the visits' share, and the log likelihood that this added."""
    p, one = c.p, np.ones(len(c.p))
    names = own_terms(terms_of(p, c.f, structure))
    slopes = [np.asarray(pattern(name, p, c.f, one))[c.row] for name in names]
    basis = spanning(c.trends, 1e-6)
    if len(c.value) < TO_SPARE * basis.shape[1]:
        basis = np.zeros((len(c.value), 0))
    low = np.array([LEAST**2 if n in WHITE or n in AXES else 0.0 for n in names] + [0.0] * c.visits)
    visit = Term("visit", c.f[c.row], common=True, column=1)
    share, weight = Noise((0.0, 0.0), tail=tail), np.ones(len(c.value))
    # Where each term alone would put the middle half of the contrasts, in equal parts.
    t = np.array([_middle(c.value, x) for x in slopes] + [0.0] * c.visits) / len(names)
    v, left, known = np.maximum(np.array(slopes).T @ t[: len(names)], LEAST**2), c.value, None
    for _ in range(ROUNDS):
        before, weight = weight, share.weigh(left / np.sqrt(v))
        terms = (*(Term(n, x / weight, common=False) for n, x in zip(names, slopes, strict=True)), *[visit] * c.visits)
        of = Likelihood(c.blocks, terms, np.full(len(weight), 1e-20), basis, c.value)
        t, known = maximise(of, np.maximum(t, low), low, known)
        point = of.at(t)
        v = np.array(slopes).T @ t[: len(names)] + 1e-20
        # Without what trends and visits follow: own part of the residual, at its best prediction.
        left = point.V.variance * point.Pe
        if np.abs(weight - before).max() < SETTLED:
            break
    gain = 0.0
    if c.visits:
        gain = of.at(np.append(maximise(replace(of, terms=terms[:-1]), t[:-1], low[:-1])[0], 0.0)).loss - point.loss
    noise = Noise((0.0, 0.0), tail=tail).with_variances(names, t[: len(names)])
    noise = noise.folded(np.isin(np.arange(6), p.component)) if structure == "axes" else noise
    return (
        _beyond_normal(left / np.sqrt(v), weight, tail) - point.loss,
        noise,
        float(np.sqrt(t[-1])) if c.visits else 0.0,
        float(gain),
    )


def _middle(value: Array, slope: Array) -> float:
    """Variance by which a pattern alone would make the middle half of contrasts as wide as it is."""
    mine = slope > 0.0
    return robust_sd(value[mine] / np.sqrt(slope[mine])) ** 2


def _beyond_normal(y: Array, weight: Array, tail: float) -> float:
    """What a distribution of residuals y (N,), in standard deviations, adds to the log likelihood of a normal one.

    That one has variances over ``weight`` (N,). For independent residuals the sum is the distribution's own.
    """
    normal = 0.5 * (np.log(weight) - weight * y**2 - np.log(2.0 * np.pi))
    if tail:
        norm = gammaln(0.5 * (tail + 1.0)) - gammaln(0.5 * tail) - 0.5 * np.log((tail + 1.0) * np.pi)
        return float(np.sum(norm - 0.5 * (tail + 1.0) * np.log1p(y**2 / (tail + 1.0)) - normal))
    good = -0.5 * (y**2 + np.log(2.0 * np.pi))
    # Slipped digits are farther out than any normal distribution: Cauchy's. One wrong reading is in several contrasts.
    mixed = [
        np.logaddexp(np.log1p(-share) + good, np.log(share / (np.pi * width)) - np.log1p((y / width) ** 2))
        for share in (OUTLIERS, 3.0 * OUTLIERS, 6.0 * OUTLIERS)
        for width in (0.4 * WIDER, WIDER)
    ]
    return max(float(np.sum(one - normal)) for one in mixed)
