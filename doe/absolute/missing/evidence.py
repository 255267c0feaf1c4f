"""Evidence of every candidate beside geometry, frames and targets, on the reduced triangle of the readings.

With a scatter and the base's priors given, the triangle's rows under the base's columns hold all that the base cannot
follow. A candidate's columns there, ``M`` with singular values s and what is left of the readings along its left
vectors, y, raise the log evidence by ``sum(a^2 s^2 y^2 / (1 + a^2 s^2) - ln(1 + a^2 s^2)) / 2`` for a standard
deviation a of its numbers (Bishop 2006, section 3.5). Sizes a are averaged over a grid, evenly in their logarithms;
compliances are none below zero. The scatter is each hypothesis's own, the likeliest: the readings tell it to about
``1 / sqrt(2 rows)`` whatever is missing, so its mean would add the same to all. The base is eliminated at a few
scatters; between them its numbers that the readings tell scale with the scatter, the others stay as they were.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import log_ndtr, logsumexp

from doe.absolute.chain import BLOCK, evaluate, samples
from doe.absolute.fit import Fit, given_weight
from doe.absolute.missing.candidates import Candidate, Shape
from doe.absolute.reduced import FRAME, Reduced, block_rows, frame_columns, reduce_sessions, upper
from doe.absolute.unknowns import Layout, Unknown
from robots.arrays import Array, Bools, Indices, in_blocks

UNKNOWN, NONE = "unknown", "none"
# Sizes of an effect that are tried: what it does to the readings (RMS), in the scatter that the base leaves.
SIZES = tuple(0.2 * 2.0**k for k in range(11))
# Scatters at which the base is eliminated, in that of the base alone, and factors beside each up to the next.
SCATTERS, BETWEEN = (1.0, 0.35, 0.12, 0.04), np.geomspace(0.57, 1.75, 25)
# Factors beside the best of these.
FINER = np.geomspace(0.95, 1.05, 31)
# Directions weaker than this share of what the base follows are nothing.
FOLLOWED = 1e-8
# Waves over the time along which something unknown may go.
WAVES = 5


@dataclass(frozen=True)
class Ground:
    """The readings reduced: columns of the base first, then of candidates (``place`` by unknown), then of the unknown.

    ``groups``: columns of something unknown, by what it varies with; ``readings``: rows less those of frames.
    """

    found: Fit
    reduced: Reduced
    base: tuple[Unknown, ...]
    place: Mapping[str, int]
    groups: Mapping[str, Indices]
    readings: int

    @property
    def points(self) -> int:
        """Positions read."""
        return len(self.found.data)


def ground(found: Fit, some: Sequence[Candidate]) -> Ground:
    """Reduce the readings beside an estimate, with the columns of all candidates."""
    base = found.moving.unknowns
    given = {one.name for one in found.layout.unknowns}
    new = tuple(dict.fromkeys(one for c in some for one in c.unknowns if one.name not in given))
    whole = Layout((*found.layout.unknowns, *new))
    u = np.concatenate([found.u, [one.start for one in new]])
    order = np.concatenate([found.free, np.arange(len(found.u), len(u))])
    root = np.sqrt(found.weight * given_weight(found.data, found.variances.sigma))
    sessions = []
    for s in range(len(found.frames)):
        mine = np.flatnonzero(found.data.session.number == s)
        sessions.append([partial(_rows, found, whole, u, order, root, mine[k], s) for k in in_blocks(len(mine), BLOCK)])
    smooth = _unknown(found, np.arange(1))
    groups, width = {}, len(order)
    for axis, columns in smooth.items():
        groups[axis] = np.arange(width, width + len(columns))
        width += len(columns)
    place = {one.name: len(base) + k for k, one in enumerate(new)}
    reduced = reduce_sessions(sessions, width)
    return Ground(found, reduced, base, place, groups, 3 * len(found.data) - FRAME * len(found.frames))


def _rows(found: Fit, whole: Layout, u: Array, order: Indices, root: Array, rows: Indices, session: int) -> Array:
    """Rows (3 n, ...) of a block: frame, base, candidates, the unknown, what is left."""
    data = found.data
    part = replace(data.take(rows), target=replace(data.target, number=data.target.number[rows]))
    (sample,) = samples(found.model, part, whole, found.start.nominal, u)
    P, J = evaluate(found.model, whole, sample, u)
    r = found.frames[session].inside(part.position) - P
    smooth = _unknown(found, rows).values()
    return block_rows(frame_columns(P), np.concatenate([J[order], *smooth]), r, root[rows])


def _unknown(found: Fit, rows: Indices) -> dict[str, Array]:
    """Columns (k, 3, n) m of something unknown that is smooth over the joints' angles, or over the time."""
    data, axes = found.data, np.eye(3)
    q = data.q[rows].T
    moving = np.flatnonzero(np.ptp(data.q, axis=0) > 1e-6)
    waves = np.concatenate([np.stack([np.sin(q[j]), np.cos(q[j])]) for j in moving])
    both = [
        waves[2 * a + x] * waves[2 * b + y]
        for b in range(len(moving))
        for a in range(b)
        for x in (0, 1)
        for y in (0, 1)
    ]
    out = {"pose": _along(np.concatenate([waves, both]) if both else waves, axes)}
    if len(data.time) and np.ptp(data.time) > 0.0:
        t = (data.time[rows] - data.time.min()) / np.ptp(data.time)
        out["clock"] = _along(np.stack([np.cos(np.pi * k * t) / k for k in range(1, WAVES + 1)]), axes)
    return out


def _along(shapes: Array, axes: Array) -> Array:
    """Columns (3 k, 3, n) of shapes (k, n) along each axis."""
    return np.asarray((axes[None, :, :, None] * shapes[:, None, None, :]).reshape(-1, 3, shapes.shape[1]))


@dataclass(frozen=True)
class Weighed:
    """A candidate: log evidence over that of nothing, its best shape with the standard deviation of its numbers.

    ``acts`` m: RMS that it has of the readings there, beside the base.
    """

    gain: float
    shape: Shape
    size: float
    acts: float


@dataclass(frozen=True)
class Weighing:
    """All of them: log evidence of nothing, of each candidate by code, and of something unknown by what it varies with.

    ``scatter`` m: that goes best with nothing.
    """

    of: Mapping[str, Weighed]
    unknown: Mapping[str, float]
    scatter: float

    def gain(self, code: str) -> float:
        """Log evidence over that of nothing."""
        if code == NONE:
            return 0.0
        if code == UNKNOWN:
            return float(logsumexp(list(self.unknown.values())) - np.log(len(self.unknown)))
        return self.of[code].gain


def weigh(g: Ground, some: Sequence[Candidate]) -> Weighing:
    """Evidence of all candidates, averaged over scatters, shapes and sizes."""
    at = [_At.of(g, g.found.variances.sigma * x) for x in SCATTERS]
    none = _best(at, [_Columns.nothing()] * len(at), np.ones(1))
    nearest = min(at, key=lambda one: abs(np.log(one.sigma / none.sigma)))
    of = {c.code: one for c in some if (one := _weighed(g, c, at, nearest, none)) is not None}
    unknown = {}
    for axis, columns in g.groups.items():
        found = _of_columns(at, nearest, none, columns, np.ones(len(columns)), g.points)
        unknown[axis] = -np.inf if found is None else found.log_evidence - none.log_evidence
    return Weighing(of, unknown, none.sigma)


def _weighed(g: Ground, c: Candidate, at: Sequence[_At], nearest: _At, none: _Found) -> Weighed | None:
    """A candidate's evidence; None where no reading moves with it that the base could not follow."""
    found = []
    for shape in c.shapes:
        if not all(one.name in g.place for one, _ in shape):
            continue
        columns, scale = np.array([g.place[one.name] for one, _ in shape]), np.array([x for _, x in shape])
        positive = np.array([one.low == 0.0 for one, _ in shape])
        one = _of_columns(at, nearest, none, columns, scale, g.points, positive)
        if one is not None:
            found.append((one, shape))
    if not found:
        return None
    z = np.array([one.log_evidence for one, _ in found])
    best, shape = found[int(np.argmax(z))]
    gain = float(logsumexp(z)) - np.log(len(c.shapes)) - none.log_evidence
    return Weighed(float(gain), shape, best.size, best.acts)


@dataclass(frozen=True)
class _At:
    """One scatter ``sigma`` m: log evidence of nothing, and the rows under the base's (whitened), what is left last.

    ``square``: weighted sum of squares that the base leaves; ``free``: rows less the base's numbers that they tell.
    """

    sigma: float
    log_evidence: float
    tail: Array
    base: int
    square: float
    free: float

    @staticmethod
    def of(g: Ground, sigma: float) -> _At:
        """The base eliminated with its priors at one scatter."""
        found, b = g.found, len(g.base)
        sd, start = found.variances.sds(g.base), np.array([one.start for one in g.base])
        known, u = np.flatnonzero(np.isfinite(sd)), found.u[found.free]
        width = g.reduced.R.shape[1]
        prior = np.zeros((len(known), width + 1))
        prior[np.arange(len(known)), known] = 1.0 / sd[known]
        prior[:, -1] = (start - u)[known] / sd[known]
        rows = np.column_stack([g.reduced.R, g.reduced.z]) / sigma
        T = upper(np.vstack([rows, prior]))
        tail, root = T[b:, b:], T[:b, :b]
        square = g.reduced.rest / sigma**2 + float(np.sum(tail[:, -1] ** 2))
        told = float(np.sum(np.linalg.solve(root.T, rows[:, :b].T) ** 2)) if b else 0.0
        value = -g.readings * np.log(sigma) - float(np.log(np.abs(np.diag(root))).sum())
        value += -float(np.log(sd[known]).sum()) - 0.5 * square
        return _At(sigma, float(value), tail, b, square, g.readings - told)

    def none(self, factor: Array) -> Array:
        """Log evidence (f,) of nothing at scatters that are larger by factors (f,)."""
        return np.asarray(self.log_evidence - self.free * np.log(factor) - 0.5 * self.square * (factor**-2.0 - 1.0))


@dataclass(frozen=True)
class _Columns:
    """A candidate's columns at one scatter: singular values ``s`` (k,), what is left along them, right vectors.

    ``positive``: which of the numbers are none below zero.
    """

    s: Array
    y: Array
    Vt: Array
    positive: Bools

    @staticmethod
    def nothing() -> _Columns:
        """No column."""
        return _Columns(np.zeros(0), np.zeros(0), np.zeros((0, 0)), np.zeros(0, dtype=np.bool_))

    @staticmethod
    def of(one: _At, columns: Indices, scale: Array, positive: Bools | None) -> _Columns:
        """Of columns that are larger by ``scale``."""
        # The rows are a triangle: further ones hold nothing of these columns.
        rows = int(columns.max()) - one.base + 1
        U, s, Vt = np.linalg.svd(one.tail[:rows, columns - one.base] * scale, full_matrices=False)
        none = np.zeros(len(columns), dtype=np.bool_)
        return _Columns(s, U.T @ one.tail[:rows, -1], Vt, none if positive is None else positive)

    def gains(self, sizes: Array, factor: Array) -> tuple[Array, Array]:
        """Log evidence (s, f) over that of nothing by sizes (s,) and scatters larger by factors (f,).

        Also the sum of squares that the columns follow, in the scatter.
        """
        grown = (sizes[:, None, None] / factor[None, :, None] * self.s) ** 2
        left = (self.y / factor[:, None]) ** 2
        share = grown / (1.0 + grown)
        gains = 0.5 * (np.sum(share * left, axis=2) - np.log1p(grown).sum(axis=2))
        if self.positive.any():
            gains = gains + self._above(sizes, factor, grown)
        return gains, np.sum(share**2 * left, axis=2)

    def _above(self, sizes: Array, factor: Array, grown: Array) -> Array:
        """Log of the share of posterior over prior above zero (s, f); marginals only."""
        by_y = (sizes[:, None, None] / factor[None, :, None]) ** 2 * self.s * self.y / (1.0 + grown)
        rest = np.maximum(1.0 - np.sum(self.Vt**2, axis=0), 0.0)
        variance = sizes[:, None, None] ** 2 * ((1.0 / (1.0 + grown)) @ self.Vt**2 + rest)
        z = log_ndtr(by_y @ self.Vt / np.sqrt(variance)) + np.log(2.0)
        return np.asarray(np.sum(np.where(self.positive, z, 0.0), axis=2))


@dataclass(frozen=True)
class _Found:
    """Log evidence at the likeliest scatter ``sigma`` m, the best size, and what it does there (m, RMS)."""

    log_evidence: float
    sigma: float
    size: float
    acts: float


def _best(at: Sequence[_At], every: Sequence[_Columns], sizes: Array, points: int = 1) -> _Found:
    """The likeliest scatter, of the mean over sizes (s,)."""
    top, where, middle = -np.inf, 0, 1.0
    for k, (one, columns) in enumerate(zip(at, every, strict=True)):
        z = logsumexp(columns.gains(sizes, BETWEEN)[0], axis=0) + one.none(BETWEEN)
        if z.max() > top:
            top, where, middle = float(z.max()), k, float(BETWEEN[int(np.argmax(z))])
    factor = middle * FINER
    gains, squares = every[where].gains(sizes, factor)
    z = logsumexp(gains, axis=0) + at[where].none(factor)
    f = int(np.argmax(z))
    i = int(np.argmax(gains[:, f]))
    sigma = at[where].sigma * float(factor[f])
    return _Found(
        float(z[f]) - float(np.log(len(sizes))), sigma, float(sizes[i]), sigma * float(np.sqrt(squares[i, f] / points))
    )


def _of_columns(
    at: Sequence[_At],
    nearest: _At,
    none: _Found,
    columns: Indices,
    scale: Array,
    points: int,
    positive: Bools | None = None,
) -> _Found | None:
    """The evidence with some columns; None where the base follows them."""
    every = [_Columns.of(one, columns, scale, positive) for one in at]
    s = every[at.index(nearest)].s
    reach = nearest.sigma * float(np.linalg.norm(s)) / np.sqrt(points)
    if reach <= FOLLOWED:
        return None
    return _best(at, every, none.sigma * np.array(SIZES) / reach, points)
