"""What each surviving hypothesis predicts for set-ups that have not been measured: mean and covariance of readings.

A hypothesis is linear with normal priors (:mod:`doe.diagnosis.evidence`), so the present readings leave it a normal
posterior of springs, model errors and amplitudes, and new readings are normal too. Numbers that cannot be negative
are cut off at their limit one by one, by their first two moments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, softmax

from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.fits import fit_all
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Options, Ranking, log_priors
from doe.diagnosis.known import base_of
from doe.diagnosis.proposals.discrimination import Predictions
from doe.diagnosis.ranking import rank
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting, errors_of
from doe.diagnosis.signatures import shapes, signature
from doe.diagnosis.twins import PLAUSIBLE
from doe.diagnosis.unknowns import discrepancies
from doe.diagnosis.weighing import extended
from doe.estimation.blocks import Covariance
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from doe.planning.protocol import Protocol
from fem.statics.loads import LoadedPoses
from robots.arrays import Array

# A law's shapes: at most so many stand for a hypothesis, each with at least this share of its probability.
SHAPES, LEAST_SHARE = 3, 0.1
# Hypotheses of a diagnosis that are looked at for more than their best shape.
LEADING = 6
# Rivals are the fewest hypotheses that together hold this share: what is named from 80 % on may still be wrong.
SURVIVING = 0.99
# Fewer families of rivals than these are no question.
FEWEST = 2
# Hidden candidates that weigh less than this are none.
UNLIKELY = 1e-4
# A twin that is still open weighs at least this.
LEAST = 1e-3
# When new readings are taken, on the clock of those so far, which ends at 1.
LATER = 1.3


@dataclass(frozen=True)
class Question:
    """What is open: the setting and the ranking it is open in, and the rivals' weights, by code, which sum to 1.

    ``hidden``: rivals that the present readings cannot see; each weighs what it did beforehand. ``name``: of each code
    what an answer is called, so that an answer within it is as good: its family, or the code itself where the question
    is which of a family.
    """

    setting: Setting
    ranking: Ranking
    weight: dict[str, float]
    hidden: tuple[str, ...]
    name: dict[str, str]


def open_twins(d: Diagnosis, twins: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Of each effect named, the rivals that these readings do not rule out; those without any are left out.

    ``twins``: codes that would give the same readings as each effect. Open is one that was thought at least a hundredth
    as probable where the effect itself stood best, and one that is in the 95 % set there.
    """
    out = {}
    for found in d.effects:
        best = look_of(d, found.code)
        here, credible = {h.code: h.probability for h in best.hypotheses}, best.credible()
        own = here.get(found.code, 0.0)
        taken = {NONE, UNKNOWN, *(f.code for f in d.effects)}
        some = [
            code
            for code, p in here.items()
            if code not in taken and (code in credible or (code in twins.get(found.code, ()) and p > PLAUSIBLE * own))
        ]
        if own > 0.0 and some:
            out[found.code] = tuple(some)
    return out


def look_of(d: Diagnosis, code: str) -> Ranking:
    """The look in which a code stood best."""
    return max(d.rankings, key=lambda r: max((h.probability for h in r.hypotheses if h.code == code), default=0.0))


def question_of(s: Setting, d: Diagnosis, still_open: Mapping[str, Sequence[str]] | None = None) -> Question:
    """The ranking that the verdict rests on while its name is open, else the one of what comes after that name.

    ``still_open``: rivals of effects that were named (:func:`open_twins`): which of them it is comes first.
    """
    if d.verdict == "named" and still_open:
        return _twins_question(d, still_open)
    found = len(d.found)
    k = min(d.look, len(d.rankings) - 1)
    families = {family_of(s, code) for code in d.rankings[k].credible()}
    if d.verdict != "ambiguous" and len(families) < FEWEST and found == k + 1 < len(d.rankings):
        k += 1
    start = s
    if 0 < k <= found:
        after = d.after.setting
        start = after.moved(after.springs, after.accepted[: len(s.accepted) + k])
    return _question(start, d.rankings[k])


def _twins_question(d: Diagnosis, still_open: Mapping[str, Sequence[str]]) -> Question:
    """Which of one effect and its rivals it is, all else that was found in the model; asked of the least sure one."""
    code = min(still_open, key=lambda c: next(f.probability for f in d.effects if f.code == c))
    after = d.after.setting
    s = after.moved(after.springs, [e for e in after.accepted if e.effect.code != code])
    r = rank(s, d.weight, further=len(s.accepted) > len(d.start.accepted))
    # As probable as was said when the name was given.
    ranked = {h.code: h.probability for h in look_of(d, code).hypotheses}
    some = [h.code for h in r.hypotheses if h.code in (code, *still_open[code])]
    total = sum(ranked[c] for c in some)
    # Numerically nothing is still a twin: its readings would look the same.
    weight = {c: max(ranked[c], LEAST * total) for c in some}
    total = sum(weight.values())
    return Question(s, r, {c: w / total for c, w in weight.items()}, (), {c: c for c in some})


def family_of(s: Setting, code: str) -> str:
    """Family of a hypothesis: "none" and "unknown" are families of their own."""
    return s.known[code].family if code in s.known else code


def _question(s: Setting, r: Ranking) -> Question:
    kept = list(r.credible(SURVIVING))
    for h in r.hypotheses[len(kept) :]:
        # Twins of one family are no question that a reading could answer: there is always something else beside them.
        if len({family_of(s, code) for code in kept}) < FEWEST:
            kept.append(h.code)
    if r.best.code == UNKNOWN:
        # What it may be like is asked of the effects that come nearest.
        kept += [h.code for h in r.hypotheses if h.code not in (NONE, *kept)][: max(LEADING - len(kept), 0)]
    # A gross error of the table is no matter of further readings.
    hidden = tuple(code for code in r.hidden if not s.known[code].gross)
    prior = log_priors(s, [*(h.code for h in r.hypotheses), *hidden], Options())
    # What cannot be seen is as likely as nothing missing, relative to what each was beforehand.
    log = {code: r.of(code).log_evidence + prior[code] for code in kept}
    log |= {code: r.of(NONE).log_evidence + prior[code] for code in hidden}
    weight = softmax(np.array(list(log.values())))
    some = dict(zip(log, weight.tolist(), strict=True))
    # What is hidden, and hardly likely beside what is seen, is no question.
    hidden = tuple(code for code in hidden if some[code] >= UNLIKELY)
    some = {code: w for code, w in some.items() if code in hidden or code in kept}
    total = sum(some.values())
    some = {code: w / total for code, w in some.items()}
    # Where all that is likely is of one family, which of it is the question.
    one = len({family_of(s, code) for code in r.credible()}) == 1
    return Question(s, r, some, hidden, {code: code if one else family_of(s, code) for code in some})


def with_candidates(s: Setting, loaded: LoadedPoses, protocol: Protocol) -> Setting:
    """The setting with new set-ups behind its own readings, read as zero.

    ``loaded``: (N l) loaded poses, set-ups slowest. The m readings of the setting come first; (N l c) follow, in the
    order set-up, force, component.
    """
    p, h = s.data, s.history
    forces, c = len(protocol.course), np.array(protocol.components, dtype=np.int64)
    n = len(loaded) // forces
    at = LoadedPoses(*(np.concatenate([getattr(p.free.at, f), getattr(loaded, f)]) for f in ("q", "wrench", "point")))
    new = len(loaded) * len(c)
    # A gauge with a given uncertainty keeps it.
    sigma = float(np.median(p.sigma)) if np.isfinite(p.sigma).all() else np.nan
    data = Problem(
        replace(p.free, at=at, history=None),
        np.concatenate([p.value, np.zeros(new)]),
        np.concatenate([p.row, len(p.free.at) + np.repeat(np.arange(len(loaded)), len(c))]),
        np.concatenate([p.component, np.tile(c, len(loaded))]),
        np.concatenate([p.pose, len(p.poses) + np.repeat(np.arange(n), forces * len(c))]),
        (*p.poses, *(f"new {k}" for k in range(n))),
        np.concatenate([p.replicate, int(p.replicate.max()) + 1 + np.arange(new)]),
        np.concatenate([p.sigma, np.full(new, sigma)]),
        None if p.when is None else p.when.followed(np.repeat(np.arange(n), forces * len(c))),
        p.apart,
    )
    # New readings come after all others; how long after is not known yet.
    later = LATER if np.isfinite(h.clock).all() and len(h.clock) else np.nan
    history = h.followed(n, forces, later)
    joint = replace(s, data=data, history=history, errors=np.zeros((len(data), 0)))
    return replace(joint, errors=errors_of(joint))


@dataclass(frozen=True)
class _Ground:
    """What all hypotheses share: joint setting with its base, and the covariance V of the readings so far."""

    question: Question
    joint: Setting
    base: Base
    V: Covariance

    @property
    def old(self) -> int:
        """Readings so far."""
        return len(self.V.variance)


def predictions(q: Question, joint: Setting, weight: Array, protocol: Protocol) -> Predictions:
    """What the rivals predict for the new set-ups of ``joint``; ``weight`` (m,): of the readings so far.

    The noise is that of the most probable hypothesis, for all of them. "unknown" is its smooth part only: rough
    scatter between set-ups predicts nothing.
    """
    noise = q.ranking.best.noise
    V = covariance(q.setting, noise, weight)
    ground = _Ground(q, joint, base_of(joint), V)
    factors = noise_factors(joint, ground.old, noise, protocol)
    bases = _bases(ground)
    found = [foreseen(base, V, factors) for _, _, base in bases]
    share = np.array([w for _, w, _ in bases])
    return Predictions(
        tuple(code for code, _, _ in bases),
        share / share.sum(),
        np.stack([mean for mean, _ in found]),
        tuple(factor for _, factor in found),
    )


def noise_factors(joint: Setting, first: int, noise: Noise, protocol: Protocol) -> Array:
    """Lower factors (N, r, r) of the noise's covariance in each new set-up, the mean of all repeats read.

    Readings of one component in one set-up have its scatter in common, however often they are repeated; ``first``:
    number of the first new reading of ``joint``.
    """
    f, components = joint.prediction, len(protocol.components)
    r = len(protocol.course) * components
    variance = (noise.variance(joint.data, f) / protocol.repeats)[first:].reshape(-1, r)
    common = noise.common(joint.data, f)[first:].reshape(-1, r, 2)
    together = np.equal.outer(np.arange(r) % components, np.arange(r) % components)
    V = np.einsum("nik,njk->nij", common, common) * together
    V[:, np.arange(r), np.arange(r)] += variance
    return np.asarray(np.linalg.cholesky(V))


def _bases(g: _Ground) -> list[tuple[str, float, Base]]:
    """Each rival, shape by shape: code, weight, and its columns with priors on the joint readings."""
    out: list[tuple[str, float, Base]] = []
    leading = sorted(g.question.weight, key=lambda code: -g.question.weight[code])[:LEADING]
    for code, share in g.question.weight.items():
        if code == NONE:
            out.append((code, share, g.base))
        elif code == UNKNOWN:
            out.append((code, share, _unknown(g)))
        else:
            for part, values in _shapes(g, code, code in leading):
                out.append(
                    (code, share * part, extended(g.joint, g.base, signature(g.joint, g.joint.known[code], values)))
                )
    return out


def _shapes(g: _Ground, code: str, leads: bool) -> list[tuple[float, Array]]:
    """Values that stand for a law, with their shares: the best shapes, or some of all where none is better."""
    every = list(shapes(g.joint.known[code]))
    if code in g.question.hidden:
        some = every if len(every) <= SHAPES else [every[k] for k in np.linspace(0, len(every) - 1, SHAPES).astype(int)]
        return [(1.0 / len(some), values) for values in some]
    best = g.question.ranking.of(code).signature
    if not leads or len(every) == 1 or best is None or best.shift is not None:
        return [(1.0, every[0] if best is None else best.values)]
    s = g.question.setting
    w = Whitened(base_of(s), g.V)
    found = fit_all(w, [signature(s, s.known[code], values) for values in every])
    share = softmax(found.log_evidence)
    order = np.argsort(-share)[:SHAPES]
    top = [k for place, k in enumerate(order) if place == 0 or share[k] >= LEAST_SHARE]
    total = float(share[top].sum())
    return [(float(share[k]) / total, every[k]) for k in top]


def _unknown(g: _Ground) -> Base:
    """The base with the smooth discrepancy whose length and size suit the present readings best."""
    scaled = g.base.columns[: g.old] / np.sqrt(g.base.precision)
    A, r = g.V.whiten(scaled), g.V.whiten(g.base.residual[: g.old, None])[:, 0]
    best, chosen = -np.inf, None
    for X in discrepancies(g.joint):
        B = g.V.whiten(X[: g.old])
        L = np.linalg.cholesky(np.eye(g.old) + A @ A.T + B @ B.T)
        z = solve_triangular(L, r, lower=True)
        value = -0.5 * float(z @ z) - float(np.log(np.diag(L)).sum())
        if value > best:
            best, chosen = value, X
    assert chosen is not None  # noqa: S101 - there are always some lengths and sizes
    return g.base.beside(chosen)


def foreseen(base: Base, V: Covariance, noise: Array) -> tuple[Array, Array]:
    """Mean (N, r) and factor (N, r, b) of new readings, in units of their noise.

    ``base``: of m + N r readings, the last N r of them new and read as zero; ``V``: covariance of the m so far;
    ``noise`` (N, r, r): lower factors of the new ones' covariance, experiment by experiment.
    """
    m, size = len(V.variance), noise.shape[1]
    sd = 1.0 / np.sqrt(base.precision)
    Z = base.columns * sd
    W, r = V.whiten(Z[:m]), V.whiten(base.residual[:m, None])[:, 0]
    P = np.linalg.inv(np.eye(len(sd)) + W.T @ W)
    u, P = truncated(P @ (W.T @ r), 0.5 * (P + P.T), base.floor / sd)
    mean = (Z[m:] @ u - base.residual[m:]).reshape(-1, size, 1)
    values, vectors = np.linalg.eigh(P)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    factor = (Z[m:] @ root).reshape(-1, size, len(sd))
    both = np.linalg.solve(noise, np.concatenate([mean, factor], axis=2))
    return both[:, :, 0], both[:, :, 1:]


def truncated(mean: Array, covariance: Array, floor: Array) -> tuple[Array, Array]:
    """Mean (b,) and covariance (b, b) of normal numbers cut off below ``floor`` (b,), one after the other.

    For one limit exact in the first two moments; several are taken in turn, each on what the last one left.
    """
    u, P = mean.copy(), covariance.copy()
    for k in np.flatnonzero(np.isfinite(floor)):
        sd = float(np.sqrt(P[k, k]))
        a = (float(floor[k]) - float(u[k])) / sd
        if a < -6.0:
            continue
        hazard = float(np.exp(-0.5 * a * a - 0.5 * np.log(2.0 * np.pi) - log_ndtr(-a)))
        left = max(1.0 + a * hazard - hazard**2, 1e-6)
        c = P[:, k] / sd
        u = u + c * hazard
        P = P - np.outer(c, c) * (1.0 - left)
    return u, P
