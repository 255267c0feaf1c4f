"""Evidence of every hypothesis at one noise, that of the rival which no catalogue names among them.

That rival is a smooth discrepancy over pose and load, a share of the deflection: a normal process over the joint angles
that matter, with a squared-exponential kernel (Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294), written as
columns: the poses' kernel has as many directions as there are poses. It may change with the load and differ between
loading and unloading.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from doe.diagnosis.evidence import Base, Fitted, Whitened, fit_all
from doe.diagnosis.hypotheses import Options
from doe.diagnosis.scatter import covariance, typical_size
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count
from doe.estimation.blocks import Covariance
from doe.estimation.noise import Noise
from fem.compiled.compliance import deflection
from robots.arrays import Array, Bools

# Lengths over which it varies, in half ranges of the joints as read; sizes as shares of the deflection.
LENGTHS = (0.8, 1.8)
SIZES = (0.03, 0.08, 0.2)
# Shares of the size with which it changes with the load and the phase.
LOAD, PHASE = 0.7, 0.5
# Directions of the kernel weaker than this carry nothing.
NEGLIGIBLE = 1e-4


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
            wide = [Whitened(extended(s, base, c), V) for c in some]
            z = np.array([one.log_evidence for one in wide])
            top = int(np.argmax(z))
            worth = float(logsumexp(z)) - math.log(len(some))
            best[code] = (worth + density, -0.5 * (V.log_det + wide[top].square), some[top], None)
            continue
        found = [fits[id(c)] for c in some]
        z = np.array([f.log_evidence for f in found])
        top = int(np.argmax(z))
        numbers = len(some[0].effect.parameters)
        bic = plain + 0.5 * max(f.excess for f in found) - 0.5 * numbers * math.log(m)
        best[code] = (float(logsumexp(z)) - math.log(shape_count(some[0].effect)) + density, bic, some[top], found[top])
    return Row(noise, w.log_evidence + density, plain, best)


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
    s: Setting, base: Base, weight: Array, noise: Noise, smooth: Sequence[Array], options: Options
) -> tuple[Noise, float, Base]:
    """Log evidence of a discrepancy, averaged over its lengths and sizes (``smooth``), and the best one as a base."""
    V = covariance(s, noise, weight)
    out: list[tuple[float, Base]] = []
    for columns in smooth:
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


def discrepancies(s: Setting) -> Iterator[Array]:
    """Columns (m, k), standard normal each, for every length and size."""
    p = s.data
    q = np.array([p.free.at.q[p.row[p.pose == g][0]] for g in range(len(p.poses))])
    moving = np.ptp(q, axis=0) > 1e-6
    moving &= _matters(s)
    x = q[:, moving]
    x = (x - x.mean(axis=0)) / np.maximum(0.5 * np.ptp(x, axis=0), 1e-9)
    factors = _load_factors(s)
    for length in LENGTHS:
        distance = np.sum((x[:, None] - x[None]) ** 2, axis=2)
        values, vectors = np.linalg.eigh(np.exp(-0.5 * distance / length**2))
        kept = values > NEGLIGIBLE * values.max(initial=1.0)
        poses = vectors[:, kept] * np.sqrt(values[kept])
        for size in SIZES:
            yield np.hstack([size * f[:, None] * poses[p.pose] for f in factors])


def _matters(s: Setting) -> Bools:
    """Joints (dof,) whose angle changes any reading."""
    at, out = s.data.free.at, []
    for k in range(at.q.shape[1]):
        q = at.q.copy()
        q[:, k] += 0.05
        d = deflection(s.arm, q, at.wrench, at.point)[s.data.row, s.data.component]
        out.append(bool(np.max(np.abs(d - s.prediction)) > 1e-6 * np.max(np.abs(s.prediction), initial=1e-300)))
    return np.array(out)


def _load_factors(s: Setting) -> list[Array]:
    """Size of the deflection (m,), alone and times load and phase, for each component."""
    p = s.data
    size = _size_of_pose(s)
    force = np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1)
    spread = float(np.ptp(force))
    load = (force - force.mean()) / (0.5 * spread) if spread > 1e-9 else np.zeros(len(force))
    out = []
    for component in np.unique(p.component):
        mine = np.where(p.component == component, size, 0.0)
        out.append(mine)
        if spread > 1e-9:
            out.append(LOAD * load * mine)
        if s.history.is_known:
            out.append(PHASE * np.where(s.unloading[p.row], 1.0, -1.0) * mine)
    return out


def _size_of_pose(s: Setting) -> Array:
    """Length of the predicted displacement (m,), of the kind that was read."""
    p = s.data
    square = np.zeros((len(p.free.at), 2))
    np.add.at(square, (p.row, (p.component >= 3).astype(int)), s.prediction**2)
    return np.asarray(np.sqrt(square)[p.row, (p.component >= 3).astype(int)])
