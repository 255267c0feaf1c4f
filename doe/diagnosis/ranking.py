"""All hypotheses about one setting, ranked: nothing missing, each effect of the catalogue, something unknown.

Evidence is averaged over the shapes of a law and over a set of plausible noises, which is the same for all hypotheses:
what one of them explains as scatter between set-ups, another may explain as an effect. An effect's probability is that
of being the main one of all that is missing, alone or with others beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import logsumexp

from doe.diagnosis.candidates import VAGUE, Tried, candidates_of, hidden_among, tried
from doe.diagnosis.coarsening import coarsened
from doe.diagnosis.evidence import Base, LeftOut, Whitened, leave_one_pose_out
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Hypothesis, Options, Ranking, log_priors
from doe.diagnosis.known import base_of, free_columns
from doe.diagnosis.scatter import (
    NoisePrior,
    around,
    covariance,
    fitted_noise,
    own_doubt,
    plain_noises,
    with_setup,
)
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature
from doe.diagnosis.unknowns import Process, processes
from doe.diagnosis.weighing import Row, Weighed, at_noise, extended, log_sum, rough_at, sets_at, unknown_at
from doe.estimation.noise import Noise
from doe.tables.loaded import rms_mm
from robots.arrays import Array
from robots.progress import Progress, report_progress

# Set-ups may scatter this much where something unknown acts on them.
WILD = 0.08
# Candidates whose own noise joins the set.
LEADERS = 8
# Fewer readings than these hardly tell their own scatter: usual values join those that they ask for.
FEW = 80
# Noises at which sets are weighed, and the unknown.
SETS, UNKNOWNS = 4, 4
# Pairs whose own noise joins the set.
LEADING_PAIRS = 3
# Probability beforehand that something is missing beside an effect: another one, something unknown.
ANOTHER, LEFT = 0.25, 0.1
# Chance of another effect of the same kind over that of one of another kind.
ALIKE = 0.1


@dataclass(frozen=True)
class _Ground:
    """What a ranking works on: the setting with its base, weights, candidates with shapes that count, processes."""

    s: Setting
    base: Base
    weight: Array
    options: Options
    free: Array
    found: Tried
    unknown: list[Process]

    def row(self, noise: Noise, *, every: bool) -> Row:
        """All hypotheses at one noise; ``every``: also effects that are far behind."""
        some = self.found.stack if every else self.found.near
        return at_noise(self.s, self.base, self.weight, noise, some, self.options, self.found.plain)

    def noise_beside(self, some: Iterable[Signature], start: Noise) -> Noise:
        """The noise where the readings may follow some signatures."""
        return fitted_noise(self.s, np.hstack([self.free, *(c.columns for c in some)]), self.weight, start)


def rank(
    s: Setting,
    weight: Array,
    options: Options = Options(),  # noqa: B008 - frozen
    *,
    further: bool = False,
    progress: Progress | None = None,
) -> Ranking:
    """Weigh all hypotheses; ``weight`` (m,): of readings, less than 1 for outliers; ``further``: not the first look."""
    base = base_of(s)
    if not options.priors:
        base = replace(base, precision=base.precision / VAGUE**2, floor=np.full(len(base.floor), -np.inf))
    candidates = candidates_of(s, priors=options.priors, further=further)
    free = free_columns(s, base)
    first = fitted_noise(s, free, weight)
    hidden, usual = hidden_among(s, base, weight, first, candidates)
    candidates = {code: some for code, some in candidates.items() if code not in hidden}
    unknown = processes(s)
    noises = _noises(s, free, weight, first, unknown[0].columns, options)
    few = [noises[k] for k in (0, len(noises) // 2, -1)]
    found = tried(s, base, weight, few, candidates)
    g = _Ground(s, base, weight, options, free, found, unknown)
    # Sets and the unknown take about as long again as all noises.
    steps = 2 * (len(noises) + LEADERS)
    table: list[Row] = []
    for noise in noises:
        report_progress(progress, len(table), steps)
        table.append(g.row(noise, every=noise in few))
    # The noise that goes with each leader, where the base alone would call its effect scatter.
    more = [g.noise_beside([x.signature], first) for x in _leaders(table)]
    table += [g.row(noise, every=False) for noise in _limited(more, options) if noise not in noises]
    report_progress(progress, len(table), steps)
    prior = log_priors(s, [NONE, UNKNOWN, *found.candidates], options)
    table += _rows_of_pairs(g, table, prior, first)
    return _ranked(g, table, hidden, usual, prior)


def _rows_of_pairs(g: _Ground, table: Sequence[Row], prior: Mapping[str, float], first: Noise) -> list[Row]:
    """Rows at the noises that go with the leading pairs, where each effect alone would call the other one scatter."""
    if not g.found.candidates:
        return []
    row = max(table, key=lambda row: row.most)
    sets = sets_at(g.s, g.base, g.weight, row, g.found.stack, prior, ())
    pairs = [key for key in sets.best if len(key) == 2]
    pairs.sort(key=lambda key: -(sets.worth[key] + _set_prior(key, prior)))
    noises = [g.noise_beside([c for c in sets.best[key] if c.shift is None], first) for key in pairs[:LEADING_PAIRS]]
    known = {row.noise for row in table}
    return [g.row(noise, every=False) for noise in _limited(noises, g.options) if noise not in known]


def _noises(s: Setting, free: Array, weight: Array, first: Noise, smooth: Array, options: Options) -> list[Noise]:
    """Noise by the base alone, and where readings may follow a smooth discrepancy, with more and less scatter."""
    by = own_doubt(s)
    out = around(first, by)
    calm = fitted_noise(s, np.hstack([free, _strongest(smooth, len(s.data.poses) // 3)]), weight, first)
    out += around(calm, by)
    out += [with_setup(calm, share) for share in (0.005, 0.01, 0.02, 0.03)]
    if len(s.data) < FEW:
        out += plain_noises(s)
    return _limited(out, options)


def _limited(noises: list[Noise], options: Options) -> list[Noise]:
    if options.pose_term:
        return list(dict.fromkeys(noises))
    return list(dict.fromkeys(replace(n, pose=(0.0, 0.0), pose_share=0.0) for n in noises))


def _strongest(X: Array, count: int) -> Array:
    """The strongest ``count`` directions of columns."""
    U, sv, _ = np.linalg.svd(X, full_matrices=False)
    return np.asarray(U[:, :count] * sv[:count])


def _leaders(table: Sequence[Row]) -> list[Weighed]:
    best: dict[str, Weighed] = {}
    for row in table:
        for code, one in row.best.items():
            if code not in best or one.worth > best[code].worth:
                best[code] = one
    # By the best shape: of many, an average says little before the noise goes with it.
    order = sorted(best.values(), key=lambda x: x.offset - x.worth)[:LEADERS]
    return [one for one in order if one.signature.shift is None]


def _unknown(g: _Ground, table: Sequence[Row]) -> tuple[list[tuple[Noise, Array]], list[float]]:
    """Log evidence of every process at the noises that go with it, and of set-ups that scatter too much at all."""
    o = g.options
    wild = Options(o.pose_term, o.priors, o.by, o.prior_none, NoisePrior(WILD))
    order = sorted(table, key=lambda row: -row.most)[:UNKNOWNS]
    chosen = [row.noise for row in (*order, max(table, key=lambda row: row.none))]
    smooth = [unknown_at(g.s, g.base, g.weight, n, g.unknown, wild) for n in dict.fromkeys(chosen)]
    return smooth, [rough_at(g.s, row, wild, o) for row in table]


def _axis_priors(some: Sequence[Process]) -> Array:
    """Log prior (k,) of processes: half of it along pose, the rest shared by the other axes."""
    axes = list(dict.fromkeys(x.axis for x in some))
    share = {axis: 0.5 / max(len(axes) - 1, 1) for axis in axes} | {"pose": 0.5 if len(axes) > 1 else 1.0}
    count = {axis: sum(x.axis == axis for x in some) for axis in axes}
    return np.log([share[x.axis] / count[x.axis] for x in some])


def _ranked(
    g: _Ground, table: list[Row], hidden: dict[str, float], usual: dict[str, float], prior: Mapping[str, float]
) -> Ranking:
    s, options = g.s, g.options
    codes = list(g.found.candidates)
    smooth, rough = _unknown(g, table)
    among = _axis_priors(g.unknown)
    by_process = logsumexp(np.array([z for _, z in smooth]), axis=0) - math.log(len(table)) + among
    count = len(table)
    alone = {frozenset[str](): _mean([row.none for row in table], count)}
    # Effects far behind were not worked out everywhere: elsewhere they add nothing.
    of = {code: [row for row in table if code in row.best] for code in codes}
    alone |= {frozenset({code}): _mean([row.best[code].worth for row in rows], count) for code, rows in of.items()}
    # Smooth and rough count half each. Where a smooth one was not worked out, at poor noises, it adds nothing.
    alone[frozenset({UNKNOWN})] = float(np.logaddexp(logsumexp(by_process), _mean(rough, count))) - math.log(2.0)
    every = coarsened(alone | (_several(g, table, prior, by_process) if codes else {}), s.known)
    worth = {code: every[frozenset({code} - {NONE})] for code in (NONE, *codes, UNKNOWN)} | _main_of(every, prior)

    row = max(table, key=lambda row: row.none)
    bic = max(row.none_bic for row in table)
    lines = [Hypothesis(NONE, worth[NONE], -2.0 * bic, math.nan, row.noise, _judged(g, lambda: g.base, row.noise))]
    for code in codes:
        row = max(of[code], key=lambda row: row.best[code].worth)
        one = row.best[code]
        bic = max(row.best[code].bic for row in of[code])
        wide = partial(extended, s, g.base, one.bent)
        lines.append(
            Hypothesis(
                code,
                worth[code],
                -2.0 * bic,
                math.nan,
                row.noise,
                _judged(g, wide, row.noise),
                one.signature,
                one.fit,
                usual.get(code, math.nan),
            )
        )
    lines.append(_line_of_unknown(g, smooth, by_process, worth[UNKNOWN]))
    sets = {key: value + _set_prior(key, prior) for key, value in every.items()}
    return Ranking(_by_probability(lines, prior, options), hidden, g.base, _most_probable(sets))


def _judged(g: _Ground, wide: Callable[[], Base], noise: Noise) -> Callable[[], tuple[LeftOut, float]]:
    """How well a hypothesis predicts poses left out; ``wide``: the base with it, which is large, made when asked."""

    def judge() -> tuple[LeftOut, float]:
        left = leave_one_pose_out(wide(), covariance(g.s, noise, g.weight), g.s.data.pose)
        return left, rms_mm(left.error, g.s.data.component)

    return judge


def _line_of_unknown(g: _Ground, smooth: list[tuple[Noise, Array]], by_process: Array, worth: float) -> Hypothesis:
    top = int(np.argmax(by_process))
    noise = max(smooth, key=lambda one: float(one[1][top]))[0]
    wide = partial(g.base.beside, g.unknown[top].columns)
    V = covariance(g.s, noise, g.weight)
    # Effective numbers of a penalised fit: those that the readings, not the prior, determine.
    w = Whitened(wide(), V)
    numbers = float(np.trace(w.inverse @ (w.W.T @ w.W))) - len(g.s.free)
    bic = -0.5 * (V.log_det + w.square) - 0.5 * numbers * math.log(len(g.s.data))
    return Hypothesis(UNKNOWN, worth, -2.0 * bic, math.nan, noise, _judged(g, wide, noise), axis=g.unknown[top].axis)


def _mean(z: Sequence[float], count: int) -> float:
    """Log of the mean of ``count`` numbers, of which those that are not nothing are given by their logarithms."""
    return log_sum(np.array(z)) - math.log(count)


def _several(
    g: _Ground, table: list[Row], prior: Mapping[str, float], by_process: Array
) -> dict[frozenset[str], float]:
    """Log evidence of sets of two or three, averaged over all noises; those at which it was not worked out add none."""
    beside = [g.unknown[k] for k in np.argsort(-by_process)[:3]]
    found: dict[frozenset[str], list[float]] = {}
    for row in sorted(table, key=lambda row: -row.most)[:SETS]:
        some = sets_at(g.s, g.base, g.weight, row, g.found.stack, prior, beside)
        for key, value in some.worth.items():
            found.setdefault(key, []).append(value)
    return {key: _mean(z, len(table)) for key, z in found.items()}


def _set_prior(key: frozenset[str], prior: Mapping[str, float]) -> float:
    """Log prior of a set: of its members, and that there is more than one."""
    if not key:
        return prior[NONE]
    effects = [code for code in key if code != UNKNOWN]
    if not effects:
        return prior[UNKNOWN]
    # Priors of all effects together make this.
    any_effect = math.log(1.0 - math.exp(prior[NONE]) - math.exp(prior[UNKNOWN]))
    total = sum(prior[code] for code in effects) - (len(effects) - 1) * (any_effect - math.log(ANOTHER))
    # Several joints with one fault are rather one fault that the catalogue does not have.
    total += (len(effects) - len({code.partition(":")[0] for code in effects})) * math.log(ALIKE)
    return total + (math.log(LEFT) if len(effects) < len(key) else 0.0)


def _main_of(sets: Mapping[frozenset[str], float], prior: Mapping[str, float]) -> dict[str, float]:
    """Log evidence of each hypothesis as the main one of all that is missing, over its prior."""

    def main(key: frozenset[str]) -> str:
        return max(key, key=lambda code: sets[frozenset({code})] + prior[code]) if key else NONE

    total: dict[str, list[float]] = {}
    for key, value in sets.items():
        total.setdefault(main(key), []).append(value + _set_prior(key, prior))
    return {code: log_sum(np.array(z)) - prior.get(code, 0.0) for code, z in total.items()}


def _most_probable(sets: Mapping[frozenset[str], float], count: int = 20) -> tuple[tuple[frozenset[str], float], ...]:
    """The sets with the largest probabilities."""
    total = log_sum(np.array(list(sets.values())))
    order = sorted(sets, key=lambda key: -sets[key])[:count]
    return tuple((key, math.exp(sets[key] - total)) for key in order)


def _by_probability(lines: list[Hypothesis], prior: Mapping[str, float], options: Options) -> tuple[Hypothesis, ...]:
    """Hypotheses with their probabilities, most probable first."""
    total = np.array([h.worth(options.by) + prior[h.code] for h in lines])
    probability = np.exp(total - logsumexp(total))
    order = np.argsort(-probability, kind="stable")
    return tuple(replace(lines[i], probability=float(probability[i])) for i in order)
