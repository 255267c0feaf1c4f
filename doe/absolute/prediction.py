"""Readings that were not used: where they should be, how sure that is, and how far off they are.

A position's variance has two parts: its own scatter, of which Student's distribution with the tail found gives the
95 % limit, and what is open about variables and frame, ``J V J^T`` with the frame following the variables. Joint error
curves are open where no angle was read, so intervals there are as wide as curves are high.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from doe.absolute.chain import evaluate, samples
from doe.absolute.fit import Fit, bounded_mode, fit, given_weight
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.reduced import block_rows, frame_columns, reduce_sessions, triangle
from doe.absolute.shrinkage import posterior
from doe.absolute.start import Start, started
from doe.certainty.predictive import UPPER, Coverage
from robots.arrays import Array, Bools, Integers
from robots.constants import NORMAL_95
from robots.progress import Progress, report_progress


@dataclass(frozen=True)
class Predicted:
    """n readings that were not used: ``error`` (n, 3) m, read minus predicted, and ``half95`` (n, 3) m of intervals.

    Both in the arm's axes.
    """

    error: Array
    half95: Array

    @property
    def distance(self) -> Array:
        """Distances (n,) m between read and predicted positions."""
        return np.asarray(np.linalg.norm(self.error, axis=1))

    @property
    def rms_m(self) -> float:
        """RMS of the distances."""
        return float(np.sqrt(np.mean(self.distance**2)))

    def take(self, rows: Bools) -> Predicted:
        """Some of them."""
        return Predicted(self.error[rows], self.half95[rows])

    @property
    def coverage(self) -> Coverage:
        """Coordinates that lie in their intervals."""
        return Coverage.of(self.error.reshape(-1), self.half95.reshape(-1))


def folds(n: int, k: int, seed: int = 0) -> Integers:
    """Which of k parts (n,) each reading is left out with."""
    out = np.empty(n, dtype=np.int64)
    out[np.random.default_rng(seed).permutation(n)] = np.arange(n) % k
    return out


def left_out(found: Fit, part: Integers, progress: Progress | None = None) -> Predicted:
    """Readings predicted by the others, part by part; ``part`` (n,): numbers from 0.

    Steps are taken from the estimate with its derivatives (the model is all but linear within its own scatter);
    variances and weights are those of all readings.
    """
    data, count = found.data, int(part.max()) + 1
    rows, triangles = _by_part(found, part)
    first = np.array([one.start for one in found.moving.unknowns])
    sd, sigma = found.variances.sds(found.moving.unknowns), found.variances.sigma
    error, half = np.full((2, len(data), 3), np.nan)
    for k in range(count):
        others = [[(lambda t=t: t) for j, t in enumerate(mine) if j != k] for mine in triangles]
        reduced = reduce_sessions(others, len(found.free))
        open_, _ = posterior(reduced, found.u[found.free], first, sd, sigma)
        step = bounded_mode(open_, found.u[found.free], found.moving)
        for s, own in enumerate(reduced.own):
            F, J, r, mine = rows[s][k]
            if not len(mine):
                continue
            error[mine] = (r - np.einsum("p...,p->...", J, step) - np.einsum("f...,f->...", F, own.step(step))).T
            half[mine] = _half(F, J, own.R, own.follows, open_.half, found).T
        report_progress(progress, k + 1, count)
    return Predicted(error, half)


Rows = tuple[Array, Array, Array, Integers]


def _by_part(found: Fit, part: Integers) -> tuple[list[list[Rows]], list[list[Array]]]:
    """By session and part: columns and residuals of its readings, and their triangle."""
    data, weight = found.data, found.weight * given_weight(found.data, found.variances.sigma)
    rows: list[list[Rows]] = []
    triangles: list[list[Array]] = []
    for s, frame in enumerate(found.frames):
        rows.append([])
        triangles.append([])
        for k in range(int(part.max()) + 1):
            mine = np.flatnonzero((data.session.number == s) & (part == k))
            F, J, r = _columns(found, data, mine, frame.inside(data.position[mine]))
            rows[-1].append((F, J, r, mine.astype(np.int64)))
            triangles[-1].append(triangle(block_rows(F, J, r, np.sqrt(weight[mine]))))
    return rows, triangles


def _columns(found: Fit, data: AbsoluteReadings, mine: Integers, inside: Array) -> tuple[Array, Array, Array]:
    """Columns of the frame (6, 3, n) and of the free variables (f, 3, n), and residuals (3, n)."""
    part = replace(data.take(mine), target=replace(data.target, number=data.target.number[mine]))
    made = [evaluate(found.model, found.layout, s, found.u) for s in
            samples(found.model, part, found.layout, found.start.nominal, found.u)]  # fmt: skip
    if not made:
        return np.zeros((6, 3, 0)), np.zeros((len(found.free), 3, 0)), np.zeros((3, 0))
    P = np.concatenate([p for p, _ in made], axis=1)
    return frame_columns(P), np.concatenate([j[found.free] for _, j in made], axis=2), inside - P


def _half(F: Array, J: Array, R: Array, follows: Array, half: Array, found: Fit) -> Array:
    """Half widths (3, n) of 95 % intervals of readings that took no part."""
    moving = J + np.einsum("fp,fan->pan", follows, F)
    model = np.sum(np.einsum("pq,pan->qan", half, moving) ** 2, axis=0)
    sigma = found.variances.sigma
    frame = sigma * np.linalg.lstsq(R.T, F.reshape(len(F), -1), rcond=1e-12)[0].reshape(F.shape)
    model = model + np.sum(frame**2, axis=0)
    quantile = NORMAL_95 if np.isinf(found.tail) else float(stdtrit(found.tail, UPPER))
    return np.asarray(np.sqrt((quantile * sigma) ** 2 + NORMAL_95**2 * model))


def carried_over(found: Fit, data: AbsoluteReadings, *, robust: bool = True) -> tuple[Predicted, Fit]:
    """Other readings by the arm as found: frames of sessions and targets that it has not seen are fitted, no more.

    A session that it knows keeps its frame, a target its place.
    """
    known = {name: k for k, name in enumerate(found.data.session.names)}
    seen = np.array([known.get(name, -1) for name in data.session.names])[data.session.number]
    error, half = np.full((2, len(data), 3), np.nan)
    for rows in (np.flatnonzero(seen == k) for k in known.values()):
        if len(rows):
            at = _as_known(found, data.take(rows))
            s = int(seen[rows[0]])
            own = found.reduced.own[s]
            F, J, r = _columns(found, at, np.arange(len(rows)), found.frames[s].inside(at.position))
            error[rows] = r.T
            half[rows] = _half(F, J, own.R, own.follows, found.half, found).T
    new = np.flatnonzero(seen < 0)
    there = found
    if len(new):
        predicted, there = _placed(found, data.take(new), robust)
        error[new], half[new] = predicted.error, predicted.half95
    return Predicted(error, half), there


def _as_known(found: Fit, data: AbsoluteReadings) -> AbsoluteReadings:
    """Readings with targets numbered as the fit numbers them."""
    names = found.data.target.names
    number = np.array([names.index(name) for name in data.target.names], dtype=np.int64)
    return replace(data, target=replace(found.data.target, number=number[data.target.number]))


def _placed(found: Fit, data: AbsoluteReadings, robust: bool) -> tuple[Predicted, Fit]:
    layout = found.layout.with_targets(data)
    values = {one.name: float(v) for one, v in zip(found.layout.unknowns, found.u, strict=True)}
    held = np.array([values.get(one.name, np.nan) for one in layout.unknowns])
    begin: Start = started(found.model.robot, data)
    there = fit(found.model, data, layout, begin, held=held, robust=robust)
    # What the frames and new targets take up of the arm's own doubt is no error of the prediction.
    place = {one.name: k for k, one in enumerate(found.moving.unknowns)}
    error, half = np.zeros((2, len(data), 3))
    for s, frame in enumerate(there.frames):
        mine = np.flatnonzero(data.session.number == s)
        part = replace(there, free=np.arange(len(layout)))
        F, J, r = _columns(part, data, mine, frame.inside(data.position[mine]))
        old = np.array([place.get(one.name, -1) for one in layout.unknowns])
        own = np.concatenate([F, J[np.isnan(held)]])
        Q = np.linalg.qr(own.reshape(len(own), -1).T)[0]
        moving = J[old >= 0].reshape(int((old >= 0).sum()), r.size).T
        moving = (moving - Q @ (Q.T @ moving)) @ found.half[old[old >= 0]]
        quantile = NORMAL_95 if np.isinf(found.tail) else float(stdtrit(found.tail, UPPER))
        variance = NORMAL_95**2 * np.sum(moving**2, axis=1) + (quantile * found.variances.sigma) ** 2
        half[mine] = np.sqrt(variance).reshape(3, -1).T
        error[mine] = r.T
    return Predicted(error, half), there
