"""Evidence of every hypothesis at one noise: nothing missing, each effect, several at once, something unknown.

Effects are weighed together, not one after the other: what two of them explain, one alone may not, and what is left of
one may be another or something that no catalogue names. From the leading effects on, every other one is weighed beside
them (a beam search over sets); what is unknown is a rival beside every set as well.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.diagnosis.doubts import bends
from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.fits import Fits, Fitted, Kept, Stack, fit_all, scaled_evidence
from doe.diagnosis.hypotheses import UNKNOWN, Options, clash
from doe.diagnosis.scatter import covariance, typical_size
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, once, shape_count
from doe.diagnosis.unknowns import Process
from doe.estimation.blocks import Covariance
from doe.estimation.noise import Noise
from robots.arrays import Array

# Effects beside which all others are weighed, and pairs beside which again.
BEAM, PAIRS = 6, 2


@dataclass(frozen=True)
class Weighed:
    """An effect at one noise: log evidence averaged over its shapes, BIC's half, its best shape and that one's fit.

    ``bent``: the best shape with the columns of what its law may be off by; ``offset``: log evidence of all shapes over
    that of the best one.
    """

    worth: float
    bic: float
    signature: Signature
    bent: Signature
    fit: Fitted | None
    offset: float


@dataclass(frozen=True)
class Row:
    """One noise: what is known of it beforehand plus each hypothesis's log evidence, by code."""

    noise: Noise
    density: float
    none: float
    none_bic: float
    best: dict[str, Weighed]

    @property
    def most(self) -> float:
        """Largest log evidence at this noise."""
        return max([self.none, *(x.worth for x in self.best.values())])


def at_noise(
    s: Setting,
    base: Base,
    weight: Array,
    noise: Noise,
    candidates: Stack,
    options: Options,
    plain: Mapping[int, Signature],
) -> Row:
    """Evidence of nothing missing and of every candidate, averaged over its shapes, with its best shape.

    ``plain``: of candidates that are bent, by identity, what they are without.
    """
    V = covariance(s, noise, weight)
    w = Whitened(base, V)
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    fits = fit_all(w, candidates)
    m, none_bic = len(s.data), -0.5 * (V.log_det + w.square)
    best: dict[str, Weighed] = {}
    for code, some in candidates.by_code.items():
        if some[0].shift is not None:
            wide = [Whitened(extended(s, base, c), V) for c in some]
            z = np.array([one.log_evidence for one in wide])
            top = int(np.argmax(z))
            bic = -0.5 * (V.log_det + wide[top].square)
            count, fit = len(some), None
        else:
            mine = candidates.place[code]
            z = fits.log_evidence[mine]
            top = int(np.argmax(z))
            numbers = len(some[0].effect.parameters)
            bic = none_bic + 0.5 * float(fits.excess[mine].max()) - 0.5 * numbers * math.log(m)
            count, fit = shape_count(some[0].effect), _own(fits[mine.start + top], some[top])
        worth = log_sum(z) - math.log(count)
        own = plain.get(id(some[top]), some[top])
        best[code] = Weighed(worth + density, bic, own, some[top], fit, worth - float(z[top]))
    return Row(noise, density, w.log_evidence + density, none_bic, best)


def _own(f: Fitted, c: Signature) -> Fitted:
    """The fit of an effect's amplitudes alone, without what its law may be off by."""
    a = len(c.effect.amplitudes)
    return replace(f, mean=f.mean[:a], covariance=f.covariance[:a, :a])


def bent(s: Setting, c: Signature, amplitude: Array) -> Signature:
    """A signature with what its law may be off by at amplitudes (a,), as further columns."""
    doubt = c.effect.law_doubt
    columns = c.columns
    own = columns @ amplitude
    if c.shift is not None or doubt == 0.0 or not own.any():
        return c
    more = doubt * own[:, None] * bends(c.effect, s.data, s.situation, s.unloading)
    k = more.shape[1]
    rows, alike = once(s, np.hstack([columns, more]))
    return replace(
        c,
        rows=rows,
        alike=alike,
        mean=np.concatenate([c.mean, np.zeros(k)]),
        sd=np.concatenate([c.sd, np.ones(k)]),
        positive=np.concatenate([c.positive, np.zeros(k, dtype=bool)]),
    )


def as_if(s: Setting, base: Base, c: Signature, V: Covariance) -> Array:
    """Change of the readings (m,) if an effect without amplitudes were there, springs as they would then be."""
    assert c.shift is not None  # noqa: S101 - asked before
    assert c.springs is not None  # noqa: S101
    n = len(s.free)
    springs = Whitened(extended(s, base, c), V).u[:n] + s.typical - s.springs
    return np.asarray(c.shift + c.springs @ springs)


def extended(s: Setting, base: Base, c: Signature) -> Base:
    """The base with an effect in it: its columns; without amplitudes other springs' columns and another prediction."""
    if c.shift is None:
        return base.beside(c.columns, c.mean, c.sd, np.where(c.positive, -c.mean, -np.inf))
    assert c.springs is not None  # noqa: S101 - goes with the shift
    n = len(s.free)
    columns = np.hstack([c.springs, base.columns[:, n:]])
    mean = s.typical - s.springs
    return replace(base, columns=columns, residual=base.residual - c.shift - (c.springs - base.columns[:, :n]) @ mean)


def unknown_at(
    s: Setting, base: Base, weight: Array, noise: Noise, some: Sequence[Process], options: Options
) -> tuple[Noise, Array]:
    """Log evidence (k,) of every process at a noise."""
    w = Whitened(base, covariance(s, noise, weight))
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    out = np.zeros(len(some))
    for unit in {id(x.unit): x.unit for x in some}.values():
        mine = [k for k, x in enumerate(some) if x.unit is unit]
        out[mine] = scaled_evidence(w, unit.rows, unit.alike, [some[k].size for k in mine])
    return noise, out + density


def rough_at(s: Setting, row: Row, wild: Options, options: Options) -> float:
    """Log evidence of set-ups that scatter more than set-ups do: something unknown, however rough over the poses."""
    size = typical_size(s)
    change = wild.noise.log_density(row.noise, size) - options.noise.log_density(row.noise, size)
    return row.none + (change if options.priors else 0.0)


@dataclass(frozen=True)
class Sets:
    """Log evidence of sets of effects at one noise, and the best shapes of those that are in several."""

    worth: dict[frozenset[str], float]
    best: dict[frozenset[str], list[Signature]]


def sets_at(
    s: Setting,
    base: Base,
    weight: Array,
    row: Row,
    bent_candidates: Stack,
    log_prior: Mapping[str, float],
    unknown: Sequence[Process],
) -> Sets:
    """Log evidence of pairs and triples of effects, and of effects beside something unknown, at one noise.

    Beside the leading effects at their best shapes all others are weighed in all their shapes, then beside the leading
    pairs. All are weighed beside each process of ``unknown`` as well.
    """
    kept = Kept(Whitened(base, covariance(s, row.noise, weight)), bent_candidates)
    out: dict[frozenset[str], float] = {}
    chosen: dict[frozenset[str], list[tuple[str, Signature, float]]] = {}
    leaders = sorted(row.best, key=lambda code: -(row.best[code].worth + log_prior[code]))[:BEAM]
    beam = [[(code, row.best[code].bent, row.best[code].offset)] for code in leaders]
    besides: dict[str, list[float]] = {}
    for x in unknown:
        fits = kept.fit(Whitened(base.beside(x.columns), kept.w.V, kept.w))
        for code in bent_candidates.place:
            besides.setdefault(code, []).append(_over_shapes(fits, bent_candidates, code)[0])
    for code, z in besides.items():
        out[frozenset({code, UNKNOWN})] = log_sum(np.array(z)) - math.log(len(z)) + row.density
    for _ in range(2):
        for members in beam:
            _beside(s, row, members, kept, out, chosen)
        pairs = [key for key in chosen if UNKNOWN not in key]
        pairs.sort(key=lambda key: -(out[key] + sum(log_prior[code] for code in key)))
        beam = [chosen[key] for key in pairs[:PAIRS]]
        if not beam or len(beam[0]) > 2:
            break
    return Sets(out, {key: [c for _, c, _ in members] for key, members in chosen.items()})


def _beside(
    s: Setting,
    row: Row,
    members: list[tuple[str, Signature, float]],
    kept: Kept,
    out: dict[frozenset[str], float],
    chosen: dict[frozenset[str], list[tuple[str, Signature, float]]],
) -> None:
    """Weigh everything beside some effects, into ``out`` (log evidence) and ``chosen`` (the best shapes)."""
    taken, offset, wide = {code for code, _, _ in members}, 0.0, kept.w.base
    # One without amplitudes changes the springs' own columns: it goes first.
    for _, c, more in sorted(members, key=lambda x: x[1].shift is None):
        wide, offset = extended(s, wide, c), offset + more
    grown = all(c.shift is None for _, c, _ in members)
    fits = kept.fit(Whitened(wide, kept.w.V, kept.w if grown else None))
    given = offset + row.density
    for code, place in kept.stack.place.items():
        first = kept.stack.flat[place.start]
        if code in taken or any(clash(first.effect, other.effect) for _, other, _ in members):
            continue
        worth, top, most = _over_shapes(fits, kept.stack, code)
        key = frozenset({*taken, code})
        if _larger(out, key, worth + given):
            chosen[key] = [*members, (code, kept.stack.flat[place.start + top], worth - most)]


def _over_shapes(fits: Fits, stack: Stack, code: str) -> tuple[float, int, float]:
    """Log evidence averaged over all shapes of a law; which of those given is the best, and that one's."""
    place = stack.place[code]
    z = fits.log_evidence[place]
    top = int(np.argmax(z))
    return log_sum(z) - math.log(shape_count(stack.flat[place.start].effect)), top, float(z[top])


def log_sum(z: Array) -> float:
    """Logarithm of the sum of numbers given by their logarithms."""
    top = float(z.max())
    return top + math.log(float(np.exp(z - top).sum())) if math.isfinite(top) else top


def _larger(out: dict[frozenset[str], float], key: frozenset[str], value: float) -> bool:
    if value <= out.get(key, -np.inf):
        return False
    out[key] = value
    return True
