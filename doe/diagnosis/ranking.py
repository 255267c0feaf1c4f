"""All hypotheses about one setting, ranked: nothing missing, each effect of the catalogue, something unknown.

Evidence is averaged over the shapes of a law and over a set of plausible noises, which is the same for all hypotheses:
what one of them explains as scatter between set-ups, another may explain as an effect.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from doe.diagnosis.candidates import VAGUE, candidates_of, hidden_among, pruned
from doe.diagnosis.evidence import Base, Fitted, LeftOut, Whitened, leave_one_pose_out
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Hypothesis, Options, Ranking, log_priors
from doe.diagnosis.known import base_of, free_columns
from doe.diagnosis.scatter import NoisePrior, around, covariance, fitted_noise, plain_noises, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature
from doe.diagnosis.weighing import Row, at_noise, discrepancies, extended, rough_at, unknown_at
from doe.estimation.noise import Noise
from doe.tables.loaded import rms_mm
from robots.arrays import Array
from robots.progress import Progress, report_progress

# Set-ups may scatter this much where something unknown acts on them.
WILD = 0.08
# Candidates whose own noise joins the set.
LEADERS = 6
# Fewer readings than these hardly tell their own scatter: usual values join those that they ask for.
FEW = 80


def rank(
    s: Setting, weight: Array, options: Options = Options(), *, further: bool = False,  # noqa: B008 - frozen
    progress: Progress | None = None,
) -> Ranking:  # fmt: skip
    """Weigh all hypotheses; ``weight`` (m,): of readings, less than 1 for outliers; ``further``: not the first look."""
    base = base_of(s)
    if not options.priors:
        base = replace(base, precision=base.precision / VAGUE**2, floor=np.full(len(base.floor), -np.inf))
    candidates = candidates_of(s, priors=options.priors, further=further)
    free = free_columns(s, base)
    first = fitted_noise(s, free, weight)
    hidden, usual = hidden_among(s, base, weight, first, candidates)
    candidates = {code: some for code, some in candidates.items() if code not in hidden}
    curved = list(discrepancies(s))
    noises = _noises(s, free, weight, first, curved[0], options)
    candidates = pruned(s, base, weight, noises, candidates)
    steps = len(noises) + LEADERS
    table: list[Row] = []
    for noise in noises:
        report_progress(progress, len(table), steps)
        table.append(at_noise(s, base, weight, noise, candidates, options))
    # The noise that goes with each leader, where the base alone would call its effect scatter.
    more = [fitted_noise(s, np.hstack([free, c.columns]), weight, first) for c in _leaders(table)]
    more = [n for n in _limited(more, options) if n not in noises]
    noises += more
    table += [at_noise(s, base, weight, noise, candidates, options) for noise in more]
    report_progress(progress, len(noises), steps)
    wild = Options(options.pose_term, options.priors, options.by, options.prior_none, NoisePrior(WILD))
    smooth = [unknown_at(s, base, weight, n, curved, wild) for n in _calm_and_wild(noises, table)]
    unknown = [*smooth, *(rough_at(s, base, row, wild, options) for row in table)]
    return _ranked(s, base, weight, table, unknown, candidates, hidden, usual, options)


def _noises(s: Setting, free: Array, weight: Array, first: Noise, smooth: Array, options: Options) -> list[Noise]:
    """Noise by the base alone, and where readings may follow a smooth discrepancy, with more and less scatter."""
    out = around(first)
    calm = fitted_noise(s, np.hstack([free, _strongest(smooth, len(s.data.poses) // 3)]), weight, first)
    out += around(calm)
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


def _calm_and_wild(noises: list[Noise], table: list[Row]) -> list[Noise]:
    """Noises at which to weigh the unknown: those good for the base and for the best candidates, and calmer ones."""
    order = np.argsort([-max([row.none, *(x[0] for x in row.best.values())]) for row in table])
    chosen = [noises[i] for i in order[:4]]
    by_none = int(np.argmax([row.none for row in table]))
    return list(dict.fromkeys([*chosen, noises[by_none]]))


def _leaders(table: list[Row]) -> list[Signature]:
    best: dict[str, tuple[float, Signature]] = {}
    for row in table:
        for code, (z, _, signature, _) in row.best.items():
            if code not in best or z > best[code][0]:
                best[code] = (z, signature)
    order = sorted(best.values(), key=lambda x: -x[0])[:LEADERS]
    return [signature for _, signature in order if signature.shift is None]


def _ranked(
    s: Setting, base: Base, weight: Array, table: list[Row], unknown: list[tuple[Noise, float, Base]],
    candidates: dict[str, list[Signature]], hidden: dict[str, float], usual: dict[str, float], options: Options,
) -> Ranking:  # fmt: skip
    n = math.log(len(table))

    def line(
        code: str, z: float, bic: float, noise: Noise, wide: Base, c: Signature | None = None, fit: Fitted | None = None
    ) -> Hypothesis:
        def judged() -> tuple[LeftOut, float]:
            left = leave_one_pose_out(wide, covariance(s, noise, weight), s.data.pose)
            return left, rms_mm(left.error, s.data.component)

        return Hypothesis(code, z, -2.0 * bic, math.nan, noise, judged, c, fit, usual.get(code, math.nan))

    none = np.array([row.none for row in table])
    bic = max(row.none_bic for row in table)
    lines = [line(NONE, float(logsumexp(none)) - n, bic, table[int(np.argmax(none))].noise, base)]
    for code in candidates:
        z = np.array([row.best[code][0] for row in table])
        row = table[int(np.argmax(z))]
        _, _, signature, fit = row.best[code]
        bic = max(row.best[code][1] for row in table)
        wide = extended(s, base, signature)
        lines.append(line(code, float(logsumexp(z)) - n, bic, row.noise, wide, signature, fit))
    z = np.array([one[1] for one in unknown])
    noise, _, wide = unknown[int(np.argmax(z))]
    V = covariance(s, noise, weight)
    # Effective numbers of a penalised fit: those that the readings, not the prior, determine.
    w = Whitened(wide, V)
    numbers = float(np.trace(w.inverse @ (w.W.T @ w.W))) - len(s.free)
    bic = -0.5 * (V.log_det + w.square) - 0.5 * numbers * math.log(len(s.data))
    # Smooth and rough count half each. Where a smooth one was not worked out, at poor noises, it adds nothing.
    lines.append(line(UNKNOWN, float(logsumexp(z)) - n - math.log(2.0), bic, noise, wide))
    return Ranking(_by_probability(s, lines, options), hidden, base)


def _by_probability(s: Setting, lines: list[Hypothesis], options: Options) -> tuple[Hypothesis, ...]:
    """Hypotheses with their probabilities, most probable first."""
    prior = log_priors(s, [h.code for h in lines], options)
    total = np.array([h.worth(options.by) + prior[h.code] for h in lines])
    probability = np.exp(total - logsumexp(total))
    order = np.argsort(-probability, kind="stable")
    return tuple(replace(lines[i], probability=float(probability[i])) for i in order)
