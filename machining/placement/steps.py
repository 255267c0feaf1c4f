"""A few positions of the base along a path: where to cut the path, and where to stand for each piece.

Dynamic programming over cuts x positions x angles x branches, exact on the grid it is given; then each piece's position
is refined by itself. The mean and the error are sums over points. K_sf is not: it is a convex function, rising in both,
of sum k^2 and of mean k. The best of a finite set by such a function is the best by the sum of one and some positive
multiple (``slope``) of the other, so slopes are tried until no new placement comes up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from machining.placement.problem import Problem
from machining.placement.search import grid_with, with_weights
from machining.placement.sweeping import Sites, check_reached, in_the_way, sweep_sites
from machining.posture.courses import summed
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.progress import Progress, report_progress

# Points of the path that the programme runs over, and positions of its grid by the number of coordinates.
ROWS = 120
POSITIONS = {1: 41, 2: 110, 3: 200, 4: 300}
# Angles gamma of the programme at most.
ANGLES = 24
# Joints whose range (rad) is wider than this may be a turn on; others are at an end of their range there.
WIDE = 1.5 * 2.0 * np.pi
# Searches after poses turned out to collide.
TRIALS = 200
# Slopes of K_sf's second term that are tried at most, see :func:`best_by_slopes`.
SLOPES = 12


@dataclass(frozen=True, eq=False)
class Pieces:
    """A cut path: ``start`` (s,) places in ``rows`` where pieces start, and the ``state`` (s,) each is driven in."""

    start: tuple[int, ...]
    state: tuple[int, ...]

    def of_rows(self, m: int) -> Integers:
        """State (m,) at each point."""
        length = np.diff([*self.start, m])
        return np.repeat(np.array(self.state, dtype=np.int64), length)


@dataclass(frozen=True, eq=False)
class Table:
    """States of the programme.

    ``gain`` (s, m) of each at each point, -inf where it cannot be; ``go`` (s, m - 1): whether a state can be driven on
    to the next point; ``cut`` (m - 1,): where the base may be moved.
    """

    gain: Array
    go: Bools
    cut: Bools


def best_pieces(table: Table, most: int, *, worst: bool = False) -> list[Pieces | None]:
    """Best way with exactly 1, 2, ... ``most`` pieces: the largest sum of gains, or the highest least gain.

    None where there is none. Exact for the states there are; ties go to the later cut.
    """
    s, m = table.gain.shape
    value = np.full((most, s), -np.inf)
    value[0] = table.gain[:, 0]
    # Where each piece of each state's best way started: the state before it, -1 if it just goes on.
    came = np.full((m, most, s), -1, dtype=np.int64)
    for i in range(1, m):
        on = np.where(table.go[:, i - 1], value, -np.inf)
        if table.cut[i - 1]:
            best = value[:-1].argmax(axis=1)
            fresh = np.take_along_axis(value[:-1], best[:, None], axis=1)
            take = fresh > on[1:]
            on[1:] = np.where(take, fresh, on[1:])
            came[i, 1:] = np.where(take, best[:, None], -1)
        value = np.minimum(on, table.gain[:, i]) if worst else on + table.gain[:, i]
    return [_traced(value[j], came, j) for j in range(most)]


def _traced(value: Array, came: Integers, pieces: int) -> Pieces | None:
    state = int(np.argmax(value))
    if not np.isfinite(value[state]):
        return None
    start, states = [], [state]
    j = pieces
    for i in range(len(came) - 1, 0, -1):
        source = int(came[i, j, state])
        if source >= 0:
            start.append(i)
            states.append(source)
            state, j = source, j - 1
    return Pieces((0, *start[::-1]), tuple(states[::-1]))


def best_by_slopes(
    solve: Callable[[float], list[Pieces | None]],
    merit: Callable[[Pieces], float],
    mean: Callable[[Pieces], float],
    slope: Callable[[float], float],
    most: int,
) -> list[Pieces | None]:
    """Best of each number of pieces by a convex merit whose second part rises with the mean.

    ``solve(slope)`` gives the best by sums. At the best the slope is that of the merit itself at its mean, which lies
    between the means of the best by the first part alone and by the mean alone; from both ends the slope is taken over
    until nothing changes, then between neighbours that differ.
    """
    best: list[Pieces | None] = [None] * most
    tried: set[float] = set()
    todo = [0.0]
    high = 0.0
    while todo and len(tried) < SLOPES:
        a = todo.pop(0)
        if any(abs(a - b) <= 1e-6 * max(a, b) for b in tried):
            continue
        tried.add(a)
        for j, pieces in enumerate(solve(a)):
            if pieces is None:
                continue
            old = best[j]
            if old is None or merit(pieces) > merit(old):
                best[j] = pieces
            todo.append(slope(mean(pieces)))
            high = max(high, todo[-1])
        if len(tried) == 1:
            todo.append(4.0 * high)
    return best


@dataclass(frozen=True, eq=False)
class Cut:
    """A path in pieces: ``first`` (s,) path point of each, coordinates ``x`` (s, d), ``gamma`` (s,) rad."""

    first: Integers
    x: Array
    gamma: Array
    evaluations: int


def find_steps(
    problem: Problem,
    most: int,
    *,
    anywhere: bool = False,
    cost: float = 0.01,
    also: Array | None = None,
    progress: Progress | None = None,
) -> list[Cut]:
    """Positions of at most ``most`` pieces, the best first by merit less cost, on a grid.

    Parameters
    ----------
    anywhere : the base may be moved between any two points; else at free segments (rapid moves) only
    cost : share of the merit that each move of the base must bring at least
    also : further positions (p, d) of the grid: the best position at rest

    Raises
    ------
    InputError
        No place to cut, or no such placement.
    """
    rows = _rows(problem, anywhere)
    x, angles = grid_with(problem, POSITIONS[min(problem.space.d, 4)], ANGLES, also, None)
    sites = sweep_sites(problem, *problem.space.sites(x), rows, angles)
    problem = with_weights(problem, sites)
    found = _solved(problem, sites, rows, most, anywhere, progress)
    share = problem.share_of(rows)
    ranked = []
    for j, pieces in enumerate(found):
        if pieces is None:
            continue
        merit = _merit(problem, sites, share, pieces)
        net = merit - j * cost * abs(merit)
        ranked.append((net, -j, pieces))
    if not ranked:
        check_reached(problem, sites, " in pieces")
        raise InputError(
            f"the path in {most} pieces",
            code="G006",
            value="no positions take all pieces",
            allowed="limits, steps, clearance kept in each",
            remedy="allow more pieces, allow cuts anywhere, or widen the ranges",
        )
    out = []
    for _, _, pieces in sorted(ranked, key=lambda r: r[:2], reverse=True):
        p, g, _ = np.unravel_index(list(pieces.state), sites.valid.shape[:3])
        out.append(Cut(rows[list(pieces.start)], x[p], sites.gamma[p, g], len(x)))
    return out


def check_cuts(problem: Problem, anywhere: bool) -> None:
    """Raise InputError where the base may be moved nowhere along the path."""
    if not anywhere and (problem.free is None or not problem.free.any()):
        raise InputError(
            "base moved in steps",
            code="G006",
            value="the path has no rapid move",
            allowed="moves of the base at rapid moves, while the tool is out of the cut",
            remedy="allow them anywhere (the tool is taken off the part there), or give a path with rapid moves",
        )


def _rows(problem: Problem, anywhere: bool) -> Integers:
    rows = problem.sure_rows(ROWS)
    check_cuts(problem, anywhere)
    if anywhere or problem.free is None:
        return rows
    at = np.flatnonzero(problem.free)
    return np.union1d(rows, np.concatenate([at, at + 1])).astype(np.int64)


def _solved(
    problem: Problem, sites: Sites, rows: Integers, most: int, anywhere: bool, progress: Progress | None
) -> list[Pieces | None]:
    """Best pieces without singularities and collisions: poses that turn out to be in the way are taken out."""
    p, g, b, m = sites.valid.shape
    valid = sites.valid.reshape(-1, m).copy()
    value = np.where(sites.valid, sites.value, 1.0).reshape(-1, m)
    q = sites.q.reshape(p * g * b, m, -1)
    go, cut = _go(problem, q, valid, rows), _cuts(problem, rows, anywhere)
    share, n, worst = problem.share_of(rows), problem.path.n, problem.goal.aim == "worst"
    checked: set[int] = set()
    for trial in range(TRIALS):
        report_progress(progress, min(trial, 9), 10)

        def by(slope: float) -> list[Pieces | None]:
            gain = problem.goal.gains(value, n, slope) * (1.0 if worst else share)
            return best_pieces(Table(np.where(valid, gain, -np.inf), go, cut), most, worst=worst)

        if problem.goal.aim == "ksf":
            best = best_by_slopes(
                by,
                lambda pieces: _merit(problem, sites, share, pieces),
                lambda pieces: float(value[pieces.of_rows(m), np.arange(m)] @ share),
                problem.goal.weights_of_ksf.slope,
                most,
            )
        else:
            best = by(0.0)
        fresh = {state for pieces in best if pieces is not None for state in pieces.state} - checked
        checked |= fresh
        # All of them, not only up to the first: each is looked at once.
        taken = [_take_out(problem, sites, state, q, valid) for state in sorted(fresh)]
        if not any(taken):
            return best
    return [None] * most


def _take_out(problem: Problem, sites: Sites, state: int, q: Array, valid: Bools) -> bool:
    """Mark the poses of a state that come too near to something; whether there were any."""
    site = state // (sites.valid.shape[1] * sites.valid.shape[2])
    at = np.flatnonzero(valid[state])
    e, table = sites.e[site], float(sites.table[site])
    if not in_the_way(problem, q[state, at], e, table, sites.rows[at]):
        return False
    bad = np.array([bool(in_the_way(problem, q[state, i : i + 1], e, table, sites.rows[i : i + 1])) for i in at])
    valid[state, at[bad]] = False
    return True


def _go(problem: Problem, q: Array, valid: Bools, rows: Integers) -> Bools:
    """Whether joints can follow from each of some points to the next; wide ranges allow for a whole turn."""
    step = problem.drive.links(problem.model.robot, problem.path, problem.free).step
    allowed = summed(step, rows)
    wide = np.ptp(problem.model.robot.limits, axis=1) >= WIDE
    go = np.zeros((len(q), len(rows) - 1), dtype=np.bool_)
    for i in range(len(rows) - 1):
        some = np.flatnonzero(valid[:, i] & valid[:, i + 1])
        turn = q[some, i + 1] - q[some, i]
        turn -= wide * 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        go[some, i] = (np.abs(turn) <= allowed[i] * (1.0 + 1e-9)).all(axis=1)
    return go


def _cuts(problem: Problem, rows: Integers, anywhere: bool) -> Bools:
    if anywhere:
        return np.ones(len(rows) - 1, dtype=np.bool_)
    assert problem.free is not None  # noqa: S101 - _rows has seen to it
    return np.asarray(problem.free[rows[:-1]] & (np.diff(rows) == 1))


def _merit(problem: Problem, sites: Sites, share: Array, pieces: Pieces) -> float:
    m = sites.valid.shape[3]
    value = sites.value.reshape(-1, m)[pieces.of_rows(m), np.arange(m)]
    return float(problem.goal.merit(value, share, problem.path.n))
