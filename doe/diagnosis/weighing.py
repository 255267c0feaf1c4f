"""Evidence of every hypothesis at one noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from doe.diagnosis.evidence import Base, Fitted, Whitened, fit_all
from doe.diagnosis.hypotheses import Options
from doe.diagnosis.scatter import covariance, typical_size
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count
from doe.diagnosis.unknown import discrepancies
from doe.estimation.blocks import Covariance
from doe.estimation.noise import Noise
from robots.arrays import Array


@dataclass(frozen=True)
class Row:
    """One noise: what is known of it beforehand plus each hypothesis's log evidence, by code; fits by code."""

    noise: Noise
    none: float
    none_bic: float
    best: dict[str, tuple[float, float, Signature, Fitted | None]]


def at_noise(
    s: Setting, base: Base, weight: Array, noise: Noise, candidates: dict[str, list[Signature]], options: Options
) -> Row:
    """Evidence of nothing missing and of every candidate, averaged over its shapes, with its best shape."""
    V = covariance(s, noise, weight)
    w = Whitened(base, V)
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    flat = [c for some in candidates.values() for c in some if c.shift is None]
    fits = dict(zip(map(id, flat), fit_all(w, flat), strict=True))
    m, plain = len(s.data), -0.5 * (V.log_det + w.square)
    best: dict[str, tuple[float, float, Signature, Fitted | None]] = {}
    for code, some in candidates.items():
        if some[0].shift is not None:
            other = Whitened(extended(s, base, some[0]), V)
            bic = -0.5 * (V.log_det + other.square)
            best[code] = (other.log_evidence + density, bic, some[0], None)
            continue
        found = [fits[id(c)] for c in some]
        z = np.array([f.log_evidence for f in found])
        top = int(np.argmax(z))
        numbers = len(some[0].effect.parameters)
        bic = plain + 0.5 * max(f.excess for f in found) - 0.5 * numbers * math.log(m)
        best[code] = (_log_sum(z) - math.log(shape_count(some[0].effect)) + density, bic, some[top], found[top])
    return Row(noise, w.log_evidence + density, plain, best)


def _log_sum(z: Array) -> float:
    most = float(z.max())
    return most + math.log(float(np.exp(z - most).sum()))


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


def unknown_at(s: Setting, base: Base, weight: Array, noise: Noise, options: Options) -> tuple[Noise, float, Base]:
    """Log evidence of a discrepancy, averaged over its lengths and sizes, and the best one as a base."""
    V = covariance(s, noise, weight)
    out: list[tuple[float, Base]] = []
    for columns in discrepancies(s):
        wide = base.beside(columns)
        out.append((Whitened(wide, V).log_evidence, wide))
    z = np.array([one[0] for one in out])
    density = options.noise.log_density(noise, typical_size(s)) if options.priors else 0.0
    return noise, float(logsumexp(z) - math.log(len(z))) + density, out[int(np.argmax(z))][1]


def rough_at(s: Setting, base: Base, row: Row, wild: Options, options: Options) -> tuple[Noise, float, Base]:
    """Log evidence of set-ups that scatter more than set-ups do: something unknown, however rough over the poses."""
    size = typical_size(s)
    change = wild.noise.log_density(row.noise, size) - options.noise.log_density(row.noise, size)
    return row.noise, row.none + (change if options.priors else 0.0), base
