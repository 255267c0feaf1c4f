"""Readings that were not used: where they should be, how sure that is, and how far off they are.

A position's variance has two parts: its own scatter, of which Student's distribution with the tail found gives the
95 % limit, and what is open about variables and frame, ``J V J^T`` with the frame following the variables. Joint error
curves are open where no angle was read, so intervals there are as wide as curves are high.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from doe.absolute.chain import BLOCK, evaluate, samples
from doe.absolute.fit import Fit, bounded_mode, fit, given_weight
from doe.absolute.readings import AbsoluteReadings, Payload
from doe.absolute.reduced import FRAME, Own, block_rows, frame_columns, reduce_sessions, triangle
from doe.absolute.shrinkage import posterior
from doe.absolute.start import started
from doe.certainty.folds import folds_of, pose_numbers
from doe.certainty.predictive import UPPER, Coverage
from robots import InputError
from robots.arrays import Array, Bools, Indices, Integers, in_blocks
from robots.constants import NORMAL_95
from robots.progress import Progress, report_progress

# Fewer poses than this are left out one by one.
FEW = 40


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


def folds(data: AbsoluteReadings, k: int, seed: int = 0) -> Integers:
    """Which of k parts (n,) each reading is left out with: poses as a whole, few of them one by one."""
    return folds_of(pose_numbers(data.q), k, seed, FEW)


def sessions_left_out(found: Fit, k: int, seed: int = 0, *, robust: bool = True) -> Predicted | None:
    """Readings of whole sessions predicted by the others, with nothing but their frames (and own targets) fitted.

    What an arm is worth where tracker or base were moved: the sessions' frames take no part of its errors with them.
    None where there is one session, or one without which the rest tells too little.
    """
    data, still = found.data, set(range(len(found.u))) - set(found.free.tolist())
    part = folds_of(data.session.number, k, seed)
    held = {found.layout.unknowns[i].name: float(found.u[i]) for i in still}
    out = Predicted(np.zeros((len(data), 3)), np.zeros((len(data), 3)))
    for number in range(int(part.max()) + 1):
        rest, gone = data.take(part != number), part == number
        layout = found.layout.with_targets(rest)
        values = np.array([held.get(one.name, np.nan) for one in layout.unknowns])
        try:
            begin = replace(started(found.model.robot, rest, seed), rail=found.start.rail)
            there = fit(found.model, rest, layout, begin, held=values, robust=robust, variances=found.variances)
            one = carried_over(there, data.take(gone), robust=robust)[0]
        except InputError:
            return None
        out.error[gone], out.half95[gone] = one.error, one.half95
    return out


def left_out(found: Fit, part: Integers, progress: Progress | None = None) -> Predicted:
    """Readings predicted by the others, part by part; ``part`` (n,): numbers from 0.

    Steps are taken from the estimate with its derivatives (the model is all but linear within its own scatter);
    variances and weights are those of all readings.
    """
    data, count = found.data, int(part.max()) + 1
    triangles = _by_part(found, part)
    first = np.array([one.start for one in found.moving.unknowns])
    sd, sigma = found.variances.sds(found.moving.unknowns), found.variances.sigma
    error, half = np.full((2, len(data), 3), np.nan)
    for k in range(count):
        others = [[(lambda t=t: t) for j, t in enumerate(mine) if j != k] for mine in triangles]
        reduced = reduce_sessions(others, len(found.free))
        open_, _ = posterior(reduced, found.u[found.free], first, sd, sigma)
        step = bounded_mode(open_, found.u[found.free], found.moving)
        for s, own in enumerate(reduced.own):
            for rows, F, J, r in _blocks(found, data, np.flatnonzero((data.session.number == s) & (part == k)), s):
                J = J[found.free]
                error[rows] = (r - np.tensordot(step, J, 1) - np.tensordot(own.step(step), F, 1)).T
                half[rows] = _half(F, J, own, found.widening * open_.half, found).T
        report_progress(progress, k + 1, count)
    return Predicted(error, half)


def _by_part(found: Fit, part: Integers) -> list[list[Array]]:
    """By session and part: the triangle of its readings."""
    data, weight = found.data, found.weight * given_weight(found.data, found.variances.sigma)
    width = FRAME + len(found.free) + 1
    out = []
    for s in range(len(found.frames)):
        out.append([np.zeros((0, width)) for _ in range(int(part.max()) + 1)])
        for k, _ in enumerate(out[-1]):
            for rows, F, J, r in _blocks(found, data, np.flatnonzero((data.session.number == s) & (part == k)), s):
                out[-1][k] = triangle(out[-1][k], block_rows(F, J[found.free], r, np.sqrt(weight[rows])))
    return out


def _blocks(
    found: Fit, data: AbsoluteReadings, rows: Indices, session: int
) -> Iterator[tuple[Indices, Array, Array, Array]]:
    """Blocks of readings of one session: which, columns of the frame (6, 3, b) and of all variables (p, 3, b).

    Residuals (3, b) last. Targets and payloads are numbered as in ``found``.
    """
    for some in in_blocks(len(rows), BLOCK):
        mine = rows[some]
        part = replace(data.take(mine), target=replace(data.target, number=data.target.number[mine]))
        (sample,) = samples(found.model, part, found.layout, found.start.nominal, found.u)
        P, J = evaluate(found.model, found.layout, sample, found.u)
        yield mine, frame_columns(P), J, found.frames[session].inside(part.position) - P


def _half(F: Array, J: Array, own: Own, half: Array, found: Fit) -> Array:
    """Half widths (3, b) of 95 % intervals of readings that took no part; J (f, 3, b) of the free variables."""
    moving = J + np.tensordot(own.follows, F, (0, 0))
    model = np.sum(np.tensordot(half, moving, (0, 0)) ** 2, axis=0)
    frame = np.linalg.lstsq(own.R.T, F.reshape(FRAME, -1), rcond=1e-12)[0].reshape(F.shape)
    return _limit(model + found.variances.sigma**2 * np.sum(frame**2, axis=0), found)


def _limit(model: Array, found: Fit) -> Array:
    """Half widths of intervals where this variance is what is open about the model."""
    quantile = NORMAL_95 if np.isinf(found.tail) else float(stdtrit(found.tail, UPPER))
    return np.asarray(np.sqrt((quantile * found.variances.sigma) ** 2 + NORMAL_95**2 * model))


def carried_over(found: Fit, data: AbsoluteReadings, *, robust: bool = True) -> tuple[Predicted, Fit]:
    """Other readings by the arm as found: frames of sessions and targets that it has not seen are fitted, no more.

    A session that it knows keeps its frame, a target its place; of a target that is new in a session that is known the
    frame is fitted with it.
    """
    data = _payloads_as(found.data.payloads, data)
    sessions, targets = found.data.session.names, found.data.target.names
    known = np.array([name in targets for name in data.target.names])[data.target.number]
    seen = np.array([sessions.index(name) if name in sessions else -1 for name in data.session.names])
    session = np.where(known, seen[data.session.number], -1)
    number = np.array([targets.index(name) if name in targets else 0 for name in data.target.names], dtype=np.int64)
    at = replace(data, target=replace(found.data.target, number=number[data.target.number]))
    error, half = np.full((2, len(data), 3), np.nan)
    for s, own in enumerate(found.reduced.own):
        for rows, F, J, r in _blocks(found, at, np.flatnonzero(session == s), s):
            error[rows] = r.T
            half[rows] = _half(F, J[found.free], own, found.half, found).T
    new = np.flatnonzero(session < 0)
    if not len(new):
        return Predicted(error, half), found
    there = _placed(found, data.take(new), robust)
    error[new] = there.residual
    half[new] = _half_placed(found, there)
    return Predicted(error, half), there


def _payloads_as(first: tuple[Payload, ...], data: AbsoluteReadings) -> AbsoluteReadings:
    """Readings whose payloads are numbered as ``first``, with their own behind."""
    every, number = list(first), []
    for one in data.payloads:
        same = [k for k, p in enumerate(every) if p.kg == one.kg and np.array_equal(p.centre, one.centre)]
        number.append(same[0] if same else len(every))
        every += [] if same else [one]
    return replace(data, payloads=tuple(every), payload=np.array(number, dtype=np.int64)[data.payload])


def _placed(found: Fit, data: AbsoluteReadings, robust: bool) -> Fit:
    """Frames and new targets of readings, with the arm held as found; another session's clock is another one."""
    data = replace(data, time=np.zeros(0))
    layout = found.layout.with_targets(data)
    values = {one.name: float(v) for one, v in zip(found.layout.unknowns, found.u, strict=True)}
    held = np.array([values.get(one.name, np.nan) for one in layout.unknowns])
    begin = replace(started(found.model.robot, data), rail=found.start.rail, temperature=found.start.temperature)
    return fit(found.model, data, layout, begin, held=held, robust=robust)


def _half_placed(found: Fit, there: Fit) -> Array:
    """Half widths (n, 3) of readings whose frames were fitted with the arm as ``found``.

    What frames and new targets take up of the arm's own doubt is no error of the prediction.
    """
    place = {one.name: k for k, one in enumerate(found.moving.unknowns)}
    old = np.array([place.get(one.name, -1) for one in there.layout.unknowns])
    half, out = found.half[old[old >= 0]], np.zeros((len(there.data), 3))
    for s in range(len(there.frames)):
        mine = np.flatnonzero(there.data.session.number == s)
        taken, moving = np.zeros((0, FRAME + len(there.free))), np.zeros((FRAME + len(there.free), half.shape[1]))
        for _, F, J, _ in _blocks(there, there.data, mine, s):
            taken = triangle(taken, _flat(F, J[there.free]))
        up = np.linalg.pinv(taken, rcond=1e-10)
        # Q^T M with Q = A R^+, A the frame's and targets' columns: never all rows at once.
        for _, F, J, _ in _blocks(there, there.data, mine, s):
            moving += (_flat(F, J[there.free]) @ up).T @ (_flat(J[old >= 0]) @ half)
        for rows, F, J, _ in _blocks(there, there.data, mine, s):
            left = _flat(J[old >= 0]) @ half - (_flat(F, J[there.free]) @ up) @ moving
            out[rows] = _limit(np.sum(left**2, axis=1), found).reshape(3, -1).T
    return out


def _flat(*columns: Array) -> Array:
    """Rows (3 b, c) of columns (c, 3, b)."""
    stacked = np.concatenate(columns)
    return np.asarray(stacked.reshape(len(stacked), stacked.shape[1] * stacked.shape[2]).T)
