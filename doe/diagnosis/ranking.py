"""All hypotheses about one setting, ranked: nothing missing, each effect of the catalogue, something unknown.

Evidence is averaged over the shapes of a law and over a set of plausible noises, which is the same for all hypotheses:
what one of them explains as scatter between set-ups, another may explain as an effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from doe.blocks import Covariance
from doe.diagnosis.evidence import Base, Fitted, Whitened, fit_all
from doe.diagnosis.held_out import LeftOut, extended, leave_one_pose_out
from doe.diagnosis.known import base_of, free_columns
from doe.diagnosis.scatter import (
    NoisePrior,
    around,
    covariance,
    fitted_noise,
    plain_noises,
    typical_size,
    with_setup,
)
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count, signatures
from doe.diagnosis.unknown import discrepancies
from doe.noise import Noise
from doe.readings import rms_mm
from fem.effects.base import Effect, PlacedEffect

Array = NDArray[np.float64]

NONE, UNKNOWN = "none", "unknown"
# Prior probabilities of nothing missing and of something that the catalogue does not know; the rest is shared by
# the families of effects that the readings can see, and within a family by its members.
PRIOR_NONE, PRIOR_UNKNOWN = 0.5, 0.1
# A ripple fits any scatter between poses, if its number of teeth is free: it is believed less easily.
LESS = {"gear-ripple": 0.1}
# Set-ups may scatter this much where something unknown acts on them.
WILD = 0.08
# Without priors amplitudes and springs have standard deviations larger by this.
VAGUE = 30.0
# Candidates whose own noise joins the set.
LEADERS = 6
# An effect of usual size must raise chi-square by this to be seen at all, and by this to be told by name.
SEEN, TESTABLE = 2.0, 30.0
# Fewer readings than these hardly tell their own scatter: usual values join those that they ask for.
FEW = 80
# Laws with more shapes than this keep only the best few of them at each of a few noises.
MANY, KEPT = 40, 8


@dataclass(frozen=True)
class Options:
    """How to weigh hypotheses; the parts that an ablation may leave out."""

    pose_term: bool = True
    priors: bool = True
    by: str = "evidence"
    prior_none: float = PRIOR_NONE
    noise: NoisePrior = NoisePrior()  # noqa: RUF009 - frozen


@dataclass(frozen=True)
class Hypothesis:
    """One line of the ranking.

    ``code``: of an effect, "none" or "unknown"; ``log_evidence``; ``bic``; ``probability``; ``left_out``: each pose
    predicted from the others; ``signature`` and ``fit``: the effect's best shape and its amplitudes; ``noise``: the
    noise that goes best with it; ``usual_excess``: rise of chi-square by an effect of usual size.
    """

    code: str
    log_evidence: float
    bic: float
    probability: float
    noise: Noise
    left_out: LeftOut
    lopo_rms_mm: float
    signature: Signature | None = None
    fit: Fitted | None = None
    usual_excess: float = math.nan


@dataclass(frozen=True)
class Ranking:
    """All hypotheses, most probable first; ``hidden``: codes that these readings cannot see, with their excess."""

    hypotheses: tuple[Hypothesis, ...]
    hidden: dict[str, float]
    base: Base

    def of(self, code: str) -> Hypothesis:
        """One hypothesis by its code."""
        return next(h for h in self.hypotheses if h.code == code)

    @property
    def best(self) -> Hypothesis:
        """The most probable one."""
        return self.hypotheses[0]

    def credible(self, share: float = 0.95) -> tuple[str, ...]:
        """The fewest codes that together hold a share of the probability."""
        total, out = 0.0, []
        for h in self.hypotheses:
            out.append(h.code)
            total += h.probability
            if total >= share:
                break
        return tuple(out)


def rank(s: Setting, weight: Array, options: Options = Options(), skip: Sequence[str] = ()) -> Ranking:
    """Weigh all hypotheses; ``weight`` (m,): of readings, less than 1 for outliers; ``skip``: codes left out."""
    base = base_of(s)
    if not options.priors:
        base = replace(base, precision=base.precision / VAGUE**2, floor=np.full(len(base.floor), -np.inf))
    taken = {e.effect.code for e in s.accepted} | set(skip)
    candidates: dict[str, list[Signature]] = {
        code: signatures(s, effect)
        for code, effect in s.known.items()
        if code not in taken and impossible(s, effect) is None and not _same_law(effect, s.accepted)
    }
    if not options.priors:
        candidates = {code: [_vague(c) for c in some] for code, some in candidates.items()}
    free = free_columns(s, base)
    first = fitted_noise(s, free, weight)
    hidden, usual = _hidden(s, base, weight, first, candidates)
    candidates = {code: some for code, some in candidates.items() if code not in hidden}
    noises = _noises(s, free, weight, first, options)
    candidates = _pruned(s, base, weight, noises, candidates)
    table = [_at_noise(s, base, weight, noise, candidates, options) for noise in noises]
    # The noise that goes with each leader, where the base alone would call its effect scatter.
    for _ in range(1):
        leaders = _leaders(table)
        more = [fitted_noise(s, np.hstack([free, c.columns]), weight, first) for c in leaders]
        more = [n for n in _limited(more, options) if n not in noises]
        noises += more
        table += [_at_noise(s, base, weight, noise, candidates, options) for noise in more]
    wild = Options(options.pose_term, options.priors, options.by, options.prior_none, NoisePrior(WILD))
    smooth = [_unknown_at(s, base, weight, n, wild) for n in _calm_and_wild(noises, table)]
    unknown = [*smooth, *(_rough_at(s, base, row, wild, options) for row in table)]
    return _ranked(s, base, weight, table, unknown, candidates, hidden, usual, options)


def _vague(c: Signature) -> Signature:
    """A signature of which nothing is known beforehand, not even its sign (an ablation)."""
    return replace(c, mean=0.0 * c.mean, sd=VAGUE * c.sd, positive=np.zeros_like(c.positive))


def _pruned(
    s: Setting, base: Base, weight: Array, noises: Sequence[Noise], candidates: dict[str, list[Signature]]
) -> dict[str, list[Signature]]:
    """Candidates of many shapes with those only that count for something, by a few of the noises.

    The evidence stays an average over all shapes: what is left out adds next to nothing to it.
    """
    many = [code for code, some in candidates.items() if len(some) > MANY]
    kept: dict[str, set[int]] = {code: set() for code in many}
    flat = [c for code in many for c in candidates[code]]
    for noise in (noises[0], noises[len(noises) // 2], noises[-1]) if many else ():
        fits = iter(fit_all(Whitened(base, covariance(s, noise, weight)), flat))
        for code in many:
            z = np.array([next(fits).log_evidence for _ in candidates[code]])
            kept[code] |= set(np.argsort(-z)[:KEPT].tolist())
    return {
        code: [c for i, c in enumerate(some) if code not in kept or i in kept[code]]
        for code, some in candidates.items()
    }


# Laws of one joint's torque: a second one on the same joint only corrects the first.
TORQUE_LAWS = ("hardening", "softening", "backlash")


def _same_law(effect: Effect, accepted: Sequence[PlacedEffect]) -> bool:
    kind, _, joint = effect.code.partition(":")
    others = [e.effect.code.partition(":") for e in accepted]
    return kind in TORQUE_LAWS and any(k in TORQUE_LAWS and j == joint for k, _, j in others)


def impossible(s: Setting, effect: Effect) -> str | None:
    """Why these readings can say nothing about an effect, whatever its size; None if they might."""
    kind, _, joint = effect.code.partition(":")
    if effect.needs_history and not s.history.is_known:
        return "the readings do not tell loading from unloading: give them a phase or a step"
    if kind == "drift" and not np.isfinite(s.history.clock).all():
        return "the readings do not say in which order they were taken: number them in the column step"
    if kind == "joint-compliance" and joint in s.free:
        return "the joint's spring is fitted already"
    return None


def _noises(s: Setting, free: Array, weight: Array, first: Noise, options: Options) -> list[Noise]:
    """Noise by the base alone, and where readings may follow a smooth discrepancy, with more and less scatter."""
    out = around(first)
    smooth = next(iter(discrepancies(s)))
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


@dataclass(frozen=True)
class _Row:
    """One noise: what is known of it beforehand plus each hypothesis's log evidence, by code; fits by code."""

    noise: Noise
    none: float
    none_bic: float
    best: dict[str, tuple[float, float, Signature, Fitted | None]]


def _at_noise(
    s: Setting, base: Base, weight: Array, noise: Noise, candidates: dict[str, list[Signature]], options: Options
) -> _Row:
    V = covariance(s, noise, weight)
    w = Whitened(base, V)
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    flat = [c for some in candidates.values() for c in some if c.shift is None]
    fits = dict(zip(map(id, flat), fit_all(w, flat), strict=True))
    m, plain = len(s.data), -0.5 * (V.log_det + w.square)
    best: dict[str, tuple[float, float, Signature, Fitted | None]] = {}
    for code, some in candidates.items():
        if some[0].shift is not None:
            other = Whitened(_with_springs(s, base, some[0]), V)
            bic = -0.5 * (V.log_det + other.square)
            best[code] = (other.log_evidence + density, bic, some[0], None)
            continue
        found = [fits[id(c)] for c in some]
        z = np.array([f.log_evidence for f in found])
        top = int(np.argmax(z))
        numbers = len(some[0].effect.parameters)
        bic = plain + 0.5 * max(f.excess for f in found) - 0.5 * numbers * math.log(m)
        best[code] = (_log_sum(z) - math.log(shape_count(some[0].effect)) + density, bic, some[top], found[top])
    return _Row(noise, w.log_evidence + density, plain, best)


def _log_sum(z: Array) -> float:
    most = float(z.max())
    return most + math.log(float(np.exp(z - most).sum()))


def _as_if(s: Setting, base: Base, c: Signature, V: Covariance) -> Array:
    """Change of the readings (m,) if an effect without amplitudes were there, springs as they would then be."""
    assert c.shift is not None  # noqa: S101 - asked before
    assert c.springs is not None  # noqa: S101
    n = len(s.free)
    springs = Whitened(_with_springs(s, base, c), V).u[:n] + s.typical - s.springs
    return np.asarray(c.shift + c.springs @ springs)


def _with_springs(s: Setting, base: Base, c: Signature) -> Base:
    """The base with other springs' columns and another prediction (an effect without amplitudes)."""
    assert c.shift is not None  # noqa: S101 - asked before
    assert c.springs is not None  # noqa: S101
    n = len(s.free)
    columns = base.columns.copy()
    columns[:, :n] = c.springs
    mean = s.typical - s.springs
    residual = base.residual - c.shift - (c.springs - base.columns[:, :n]) @ mean
    return Base(columns, residual, base.precision, base.floor)


def _unknown_at(s: Setting, base: Base, weight: Array, noise: Noise, options: Options) -> tuple[Noise, float, Base]:
    """Log evidence of a discrepancy, averaged over its lengths and sizes, and the best one as a base."""
    V = covariance(s, noise, weight)
    out: list[tuple[float, Base]] = []
    for columns in discrepancies(s):
        k = columns.shape[1]
        wide = Base(
            np.hstack([base.columns, columns]), base.residual, np.concatenate([base.precision, np.ones(k)]),
            np.concatenate([base.floor, np.full(k, -np.inf)]),
        )  # fmt: skip
        out.append((Whitened(wide, V).log_evidence, wide))
    z = np.array([one[0] for one in out])
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    return noise, float(logsumexp(z) - math.log(len(z))) + density, out[int(np.argmax(z))][1]


def _rough_at(s: Setting, base: Base, row: _Row, wild: Options, options: Options) -> tuple[Noise, float, Base]:
    """Log evidence of set-ups that scatter more than set-ups do: something unknown, however rough over the poses."""
    size = typical_size(s)
    change = wild.noise.log_density(row.noise, size) - options.noise.log_density(row.noise, size)
    return row.noise, row.none + (change if options.priors else 0.0), base


def _calm_and_wild(noises: list[Noise], table: list[_Row]) -> list[Noise]:
    """Noises at which to weigh the unknown: those good for the base and for the best candidates, and calmer ones."""
    order = np.argsort([-max([row.none, *(x[0] for x in row.best.values())]) for row in table])
    chosen = [noises[i] for i in order[:4]]
    by_none = int(np.argmax([row.none for row in table]))
    return list(dict.fromkeys([*chosen, noises[by_none]]))


def _leaders(table: list[_Row]) -> list[Signature]:
    best: dict[str, tuple[float, Signature]] = {}
    for row in table:
        for code, (z, _, signature, _) in row.best.items():
            if code not in best or z > best[code][0]:
                best[code] = (z, signature)
    order = sorted(best.values(), key=lambda x: -x[0])[:LEADERS]
    return [signature for _, signature in order if signature.shift is None]


def _hidden(
    s: Setting, base: Base, weight: Array, noise: Noise, candidates: dict[str, list[Signature]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Codes whose effect of usual size would not be seen, with its excess; and the excess of all codes.

    Judged without scatter between set-ups beyond what is usual: the base's own may be the effect itself.
    """
    common = min(noise.pose_share, 0.01)
    w = Whitened(base, covariance(s, with_setup(noise, common), weight))
    hidden, usual = {}, {}
    for code, some in candidates.items():
        found = []
        for c in some:
            if c.shift is not None:
                WX = w.V.whiten(_as_if(s, base, c, w.V)[:, None])
                found.append(float(w.schur(WX, WX)[0, 0]))
                continue
            WX = w.V.whiten(c.columns)
            size = np.sqrt(c.mean**2 + c.sd**2)
            found.append(float(np.mean(np.diag(w.schur(WX, WX)) * size**2) * (len(size) if c.positive.all() else 1.0)))
        usual[code] = float(np.median(found))
        if max(found) < SEEN:
            hidden[code] = max(found)
    return hidden, usual


def _ranked(
    s: Setting, base: Base, weight: Array, table: list[_Row], unknown: list[tuple[Noise, float, Base]],
    candidates: dict[str, list[Signature]], hidden: dict[str, float], usual: dict[str, float], options: Options,
) -> Ranking:  # fmt: skip
    n = math.log(len(table))
    lines: list[tuple[str, float, float, Noise, Base, Signature | None, Fitted | None]] = []
    at = int(np.argmax([row.none for row in table]))
    none_bic = max(row.none_bic for row in table)
    lines.append((NONE, float(logsumexp([row.none for row in table])) - n, none_bic, table[at].noise, base, None, None))
    for code in candidates:
        z = np.array([row.best[code][0] for row in table])
        row = table[int(np.argmax(z))]
        _, _, signature, fit = row.best[code]
        wide = _with_springs(s, base, signature) if signature.shift is not None else extended(base, signature)
        bic = max(row.best[code][1] for row in table)
        lines.append((code, float(logsumexp(z)) - n, bic, row.noise, wide, signature, fit))
    z = np.array([one[1] for one in unknown])
    noise, _, wide = unknown[int(np.argmax(z))]
    V = covariance(s, noise, weight)
    # Effective numbers of a penalised fit: those that the readings, not the prior, determine.
    w = Whitened(wide, V)
    numbers = float(np.trace(w.inverse @ (w.W.T @ w.W))) - len(s.free)
    unknown_bic = -0.5 * (V.log_det + w.square) - 0.5 * numbers * math.log(len(s.data))
    # Smooth and rough count half each. Where a smooth one was not worked out, at poor noises, it adds nothing.
    lines.append((UNKNOWN, float(logsumexp(z)) - n - math.log(2.0), unknown_bic, noise, wide, None, None))
    return _with_probabilities(s, base, weight, lines, hidden, usual, options)


def _with_probabilities(
    s: Setting, base: Base, weight: Array,
    lines: list[tuple[str, float, float, Noise, Base, Signature | None, Fitted | None]],
    hidden: dict[str, float], usual: dict[str, float], options: Options,
) -> Ranking:  # fmt: skip
    prior = log_priors(s, [line[0] for line in lines], options)
    left = {line[0]: leave_one_pose_out(line[4], covariance(s, line[3], weight), s.data.pose) for line in lines}
    if options.by == "bic":
        score = np.array([line[2] for line in lines])
    elif options.by == "left-out":
        score = np.array([float(left[line[0]].log_density.sum()) for line in lines])
    else:
        score = np.array([line[1] for line in lines])
    total = score + np.array([prior[line[0]] for line in lines])
    probability = np.exp(total - logsumexp(total))
    order = np.argsort(-probability, kind="stable")
    out = []
    for i in order:
        code, z, bic, noise, _, signature, fit = lines[i]
        rms = rms_mm(left[code].error, s.data.component)
        out.append(Hypothesis(code, z, -2.0 * bic, float(probability[i]), noise, left[code], rms, signature, fit,
                              usual.get(code, math.nan)))  # fmt: skip
    return Ranking(tuple(out), hidden, base)


def log_priors(s: Setting, codes: Sequence[str], options: Options) -> dict[str, float]:
    """Log prior probability of each hypothesis."""
    families: dict[str, list[str]] = {}
    for code in codes:
        if code not in (NONE, UNKNOWN):
            families.setdefault(s.known[code].family, []).append(code)
    rest = 1.0 - options.prior_none - PRIOR_UNKNOWN
    out = {NONE: math.log(options.prior_none), UNKNOWN: math.log(PRIOR_UNKNOWN)}
    for members in families.values():
        for code in members:
            out[code] = math.log(LESS.get(s.known[code].family, 1.0) * rest / len(families) / len(members))
    return out
