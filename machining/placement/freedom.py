"""Which postures of a base position are free: every angle gamma, and in each run of cuts every branch.

A posture keeps one angle gamma over the whole path and one branch over each run; between runs, at rapid moves, the
branch may change. What stops a position is what stops the posture that comes nearest to being allowed.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import numpy as np

from machining.placement.between import STOPS, Between, Stopped
from machining.placement.problem import Problem
from machining.placement.sweeping import Sites, blocked, distances
from robots import Reason
from robots.arrays import Array, Integers

# What stops a posture, the farthest from being allowed first.
CAUSES = (*STOPS, "between", "")
# Why a position cannot be taken, in words.
STOPPED_BY = {
    "reach": "out of reach",
    "limit": "beyond a joint limit",
    "collision": "collision",
    "singularity": "too near a singularity",
    "between": "a move between cuts",
}
_REACH, _LIMIT, _SINGULAR, _COLLISION, _BETWEEN, _FREE = range(6)
_OF_WORD = {word: rank for rank, word in enumerate(CAUSES)}


@dataclass(frozen=True, eq=False)
class Runs:
    """The postures of p positions and g angles, run by run (r runs, m points).

    ``start`` (r,): places in the sweep's rows where runs start. ``state`` (p, g, b, r): 0 where some point of the run
    is out of reach, 1 where joints are beyond limits, 2 where all points can be taken. ``worth`` (p, g, b, r): merit of
    that branch over that run, -inf where it cannot be taken.
    """

    start: Integers
    state: Integers
    worth: Array

    @property
    def nearest(self) -> Integers:
        """State (p, g) of each angle: of the run that lacks most, with the branch that lacks least."""
        return np.asarray(self.state.max(axis=2).min(axis=2))

    def best(self) -> Integers:
        """Branch (p, g, r) of most worth in each run."""
        return np.asarray(self.worth.argmax(axis=2))


@dataclass(frozen=True, eq=False)
class Freedom:
    """What one position comes to.

    ``why``: "" where a posture is free, else what stops the nearest, of :data:`CAUSES`. ``angle``: column of the
    sweep's angles, -1 where there is none; ``branches`` (r,) of the free posture, or of the one that was stopped;
    ``merit`` of the free one, -inf where none is. ``row``: place in the sweep's rows where the nearest is stopped by a
    collision or a singularity, else -1; ``between``: where a move between the cuts stops it.
    """

    why: str
    angle: int
    branches: Integers
    merit: float
    row: int
    between: Stopped | None = None


def run_starts(problem: Problem, rows: Integers) -> Integers:
    """Places (r,) in ``rows`` where runs of cuts start: behind each rapid move that lies between two of them."""
    if problem.free is None:
        return np.zeros(1, dtype=np.int64)
    run = np.concatenate([[0], np.cumsum(problem.free)])[rows]
    return np.flatnonzero(np.diff(run, prepend=-1)).astype(np.int64)


def runs_of(problem: Problem, sites: Sites) -> Runs:
    """Postures run by run; where moves between cuts have to keep the branch, they and their cuts are one run."""
    start = run_starts(problem, sites.rows)
    if problem.links is not None:
        start = np.flatnonzero(np.diff(problem.links.cut_run[sites.rows], prepend=-1)).astype(np.int64)
    code = np.where(sites.valid, 2, np.where(sites.reason == Reason.LIMITS, 1, 0)).astype(np.int8)
    state = np.minimum.reduceat(code, start, axis=3)
    worth = np.full(state.shape, -np.inf)
    share, ends = problem.share_of(sites.rows), [*start[1:], len(sites.rows)]
    for r, (a, b) in enumerate(zip(start, ends, strict=True)):
        some = state[..., r] == 2
        if some.any():
            part = share[a:b] / share[a:b].sum()
            worth[..., r][some] = problem.goal.merit(sites.value[..., a:b][some], part, problem.path.n)
    return Runs(start, state, worth)


def values_with(sites: Sites, runs: Runs, site: int, angle: int, branches: Integers) -> Array:
    """Values (m,) of a position's posture with a branch in each run."""
    branch = np.repeat(branches, np.diff([*runs.start, len(sites.rows)]))
    return np.asarray(sites.value[site, angle, branch, np.arange(len(sites.rows))])


def best_merits(problem: Problem, sites: Sites, runs: Runs | None = None) -> Array:
    """Merit (p, g) of each angle with the best branch in each run, -inf where some point does not allow it.

    What is in the way is not looked at: :func:`freedom` does.
    """
    runs = runs or runs_of(problem, sites)
    out = np.full(runs.worth.shape[:2], -np.inf)
    whole = np.nonzero(np.isfinite(runs.worth.max(axis=2)).all(axis=2))
    if len(whole[0]):
        branch = np.repeat(runs.best()[whole], np.diff([*runs.start, len(sites.rows)]), axis=1)
        value = np.take_along_axis(sites.value[whole], branch[:, None], axis=1)[:, 0]
        out[whole] = problem.goal.merit(value, problem.share_of(sites.rows), problem.path.n)
    return out


class _Asked:
    """Whether a branch of a run is in the way of something: asked once, and with it its like at other angles."""

    def __init__(self, problem: Problem, sites: Sites, runs: Runs, site: int) -> None:
        self.problem, self.sites, self.runs, self.site = problem, sites, runs, site
        self.ends = [*runs.start[1:].tolist(), len(sites.rows)]
        self.known = dict[tuple[int, int, int], tuple[int, int]]()

    def first(self, angle: int, branches: Integers) -> tuple[int, int, int]:
        """The first run in which a posture is stopped, its rank and the place in the rows; -1 where it is free."""
        for run, branch in enumerate(branches):
            key = (angle, int(branch), run)
            if key not in self.known:
                self._ask(*key)
            rank, row = self.known[key]
            if rank != _FREE:
                return run, rank, row
        return -1, _FREE, -1

    def _ask(self, angle: int, branch: int, run: int) -> None:
        a, b = int(self.runs.start[run]), self.ends[run]
        q, e, table = self.sites.q[self.site, :, branch], self.sites.e[self.site], float(self.sites.table[self.site])
        why, pose = blocked(self.problem, q[angle, a:b], e, table, self.sites.rows[a:b])
        self.known[angle, branch, run] = _OF_WORD[why], a + pose if why else -1
        if not why:
            return
        # Where one angle of a branch is stopped its neighbours are as a rule, by the same point: all are asked for it.
        others = np.flatnonzero(np.isfinite(self.runs.worth[self.site, :, branch, run]))
        others = np.array([i for i in others.tolist() if (i, branch, run) not in self.known], dtype=np.int64)
        if len(others):
            there = stopped(self.problem, q[others, a + pose], e, table, int(self.sites.rows[a + pose]))
            for i, rank in zip(others, there, strict=True):
                if rank != _FREE:
                    self.known[int(i), branch, run] = int(rank), a + pose


def stopped(problem: Problem, q: Array, e: Array, table: float, point: int) -> Integers:
    """Place in :data:`CAUSES` (m,) of what stops poses q (m, dof) rad of a path point by themselves; e (k,) m."""
    clear = problem.drive.near_singular(problem.model.robot, q)[1]
    gap = distances(problem, q, np.broadcast_to(e, (len(q), len(e))), table, np.full(len(q), point))
    return np.where(clear, np.where(gap < problem.clearance, _COLLISION, _FREE), _SINGULAR)


def freedom(problem: Problem, sites: Sites, site: int, runs: Runs, merit: Array) -> Freedom:
    """The best posture of one position of a sweep that is free over all its rows, or what stops the nearest.

    All angles of the sweep and all branches are looked at, none is given up; the best come first, and where a branch
    is in the way over a run the next best takes its place. ``merit`` (g,): :func:`best_merits` of the position.
    """
    asked, worth = _Asked(problem, sites, runs, site), runs.worth[site]
    nearest = min(int(runs.nearest[site].max()), _LIMIT)
    best = Freedom(CAUSES[nearest], -1, np.full(len(runs.start), -1), -np.inf, -1)
    share, order = problem.share_of(sites.rows), np.argsort(-worth, axis=1, kind="stable")
    between = None
    if problem.links is not None:
        between = Between(problem.links, sites, site, runs.start)
    # Places of the branches in the order of each run's worth.
    todo = [(-merit[a], int(a), (0,) * len(runs.start)) for a in np.flatnonzero(np.isfinite(merit))]
    heapify(todo)
    while todo:
        loss, angle, places = heappop(todo)
        branches = order[angle, list(places), np.arange(len(places))]
        run, rank, row = asked.first(angle, branches)
        stop = None
        if rank == _FREE:
            lost = None if between is None else between.first(float(sites.gamma[site, angle]), branches)
            if lost is None:
                return Freedom("", angle, branches, -loss, -1)
            rank, (run, stop) = _BETWEEN, lost
        if rank > nearest:
            nearest, best = rank, Freedom(CAUSES[rank], angle, branches, -np.inf, row, stop)
        if run < 0:
            continue
        places = (*places[:run], places[run] + 1, *places[run + 1 :])
        if places[run] < worth.shape[1] and np.isfinite(worth[angle, order[angle, places[run], run], run]):
            branches = order[angle, list(places), np.arange(len(places))]
            value = values_with(sites, runs, site, angle, branches)
            heappush(todo, (-float(problem.goal.merit(value, share, problem.path.n)), angle, places))
    return best
