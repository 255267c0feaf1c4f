"""The best base position: a coarse grid of positions, its best basins refined by pattern search.

Angle gamma and branch need no search of their own: at every position all of them are looked at, and the best angle is
refined there. So a position has one merit, which changes smoothly until a limit is met. Where no position of the
grid reaches the whole path, what is lacking is made smaller first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from machining.placement.following import Found, follow, merit_of
from machining.placement.freedom import Runs, best_merits, freedom, runs_of, values_with
from machining.placement.problem import Problem
from machining.placement.sweeping import (
    Shortfall,
    Sites,
    lacks,
    shortfalls,
    sweep_sites,
    unreachable,
    with_more_angles,
)
from machining.posture.points import GammaRange
from machining.stiffness.criterion import Criterion
from machining.toolpaths.path_error import PathError
from robots import InputError
from robots.arrays import Array, Integers
from robots.progress import Progress, report_progress

# Points of the path that positions are compared on: on the coarse grid, and while refining.
COARSE_ROWS, FINE_ROWS = 24, 60
# Positions of the coarse grid by the number of coordinates.
COARSE = {1: 25, 2: 90, 3: 200, 4: 400}
# Basins that are refined.
BASINS = 4
# Refinement ends at steps of this size: m, and rad of a turntable.
TOLERANCE = 1e-3
# All basins are refined to this share of the grid's step, half of them to steps so much larger than the last ones, the
# best one to the end.
EARLY, ROUGH = 0.2, 8.0
# Rounds in which gamma is refined at a position, and the angles looked at in each; the last are (2 / AROUND)^ROUNDS of
# a cell of the grid apart.
FINER, AROUND = 2, 8
# A turntable's radian counts as much as this many m when the grid is spread.
TABLE_LEVER = 1.0
# Rounds in which points that turned out to be out of reach join those that are looked at.
ROUNDS = 5


@dataclass(frozen=True, eq=False)
class Stopped:
    """A pose ``q`` (dof,) rad at path point ``point`` and angle ``gamma`` rad that collides or is singular."""

    point: int
    gamma: float
    q: Array


@dataclass(frozen=True, eq=False)
class Look:
    """One position looked at: coordinates x (d,), merit (-inf: none), its angle, or why it has none.

    ``why``: of :data:`machining.placement.freedom.CAUSES`. ``values`` (m,): stiffness N/m or surface error m at the
    points looked at, None where there is no merit. ``shortfall``: what it lacks where it is out of reach or beyond
    joint limits, as far as that is asked for; ``stopped``: where it is stopped by something else.
    """

    x: Array
    merit: float
    gamma: float
    why: str
    shortfall: Shortfall | None = None
    values: Array | None = None
    stopped: Stopped | None = None

    @property
    def rank(self) -> tuple[bool, float]:
        """Larger is better; of positions that cannot be taken, that which lacks less."""
        possible = np.isfinite(self.merit)
        return bool(possible), self.merit if possible else -(self.shortfall.lack if self.shortfall else 0.0)


@dataclass(frozen=True, eq=False)
class Survey:
    """Looks at a grid of positions, in the order of :meth:`machining.placement.space.Space.grid` with ``counts``.

    ``problem``: with weights of K_sf. ``angles``: how many angles gamma a barred position was looked at with at least;
    0: it is a coarse survey, not :func:`machining.placement.confirming.confirmed`.
    """

    problem: Problem
    grid: tuple[Look, ...]
    counts: tuple[int, ...]
    angles: int = 0


class Looker:
    """Looks at positions, counts them, and says so."""

    def __init__(
        self, problem: Problem, progress: Progress | None = None, total: int = 1, *, lacking: bool = True
    ) -> None:
        """``lacking``: work out what positions out of reach lack; without it they are left at that."""
        self.problem, self.progress, self.total, self.lacking = problem, progress, total, lacking
        self.count = 0

    def at(self, x: Array, rows: Integers) -> list[Look]:
        """Look at positions x (p, d)."""
        e, table = self.problem.space.sites(x)
        return self.of(x, sweep_sites(self.problem, e, table, rows, self.problem.angles))

    def of(self, x: Array, sites: Sites) -> list[Look]:
        """What a sweep of positions x (p, d) comes to, gamma refined; each counts as looked at once."""
        self.count += len(x)
        if self.progress is not None:
            self.progress(min(self.count, self.total), self.total)
        sites = _with_finer_gamma(self.problem, sites, self.lacking)
        looks, best = self._looks(x, sites)
        # Gamma was refined about the best of all postures; where those are in the way, about the best that is free.
        lesser = [i for i, look in enumerate(looks) if np.isfinite(look.merit) and look.merit < best[i].max()]
        if lesser and isinstance(self.problem.gamma, GammaRange):
            freed = self._refined_again(x[lesser], sites.at_positions(np.array(lesser)), [looks[i] for i in lesser])
            for i, look in zip(lesser, freed, strict=True):
                looks[i] = look
        lost = [i for i, look in enumerate(looks) if look.why in ("reach", "limit")]
        if lost and self.lacking:
            short = shortfalls(self.problem, sites.at_positions(np.array(lost)))
            for i, lacking in zip(lost, short, strict=True):
                looks[i] = replace(looks[i], shortfall=lacking)
        return looks

    def _looks(self, x: Array, sites: Sites) -> tuple[list[Look], Array]:
        """Looks, and merits (p, g) of the angles whatever is in the way."""
        runs = runs_of(self.problem, sites)
        merit = best_merits(self.problem, sites, runs)
        return [look_of(self.problem, at, sites, i, runs, merit[i]) for i, at in enumerate(x)], merit

    def _refined_again(self, x: Array, sites: Sites, looks: list[Look]) -> list[Look]:
        """The same positions with gamma refined about the free postures that were found."""
        assert isinstance(self.problem.gamma, GammaRange)  # noqa: S101 - else there is nothing to refine
        half = self.problem.gamma.cell
        for _ in range(FINER):
            # The angles before were looked at already.
            more = _around(self.problem, sites, np.array([look.gamma for look in looks]), half)
            looks = [
                max(pair, key=lambda look: look.merit) for pair in zip(looks, self._looks(x, more)[0], strict=True)
            ]
            half *= 2.0 / AROUND
        return looks


def look_of(problem: Problem, x: Array, sites: Sites, site: int, runs: Runs, merit: Array) -> Look:
    """What one position of a sweep comes to; ``merit`` (g,) of its angles, see :func:`machining.placement.freedom`."""
    found = freedom(problem, sites, site, runs, merit)
    gamma = np.nan if found.angle < 0 else float(sites.gamma[site, found.angle])
    if not found.why:
        values = values_with(sites, runs, site, found.angle, found.branches)
        return Look(x, found.merit, gamma, "", values=values)
    if found.row < 0:
        return Look(x, -np.inf, np.nan, found.why)
    run = int(np.searchsorted(runs.start, found.row, side="right")) - 1
    stopped = Stopped(int(sites.rows[found.row]), gamma, sites.q[site, found.angle, found.branches[run], found.row])
    return Look(x, -np.inf, np.nan, found.why, stopped=stopped)


def _with_finer_gamma(problem: Problem, sites: Sites, lacking: bool) -> Sites:
    """The sweep, and finer angles about each position's best, or about that which lacks least."""
    if not isinstance(problem.gamma, GammaRange):
        return sites
    half, p = problem.gamma.cell, np.arange(len(sites.e))
    if not lacking and not np.isfinite(best_merits(problem, sites)).any():
        return sites
    for _ in range(FINER):
        merit = best_merits(problem, sites)
        lost = ~np.isfinite(merit).any(axis=1)
        if lost.any() and lacking:
            merit[lost] = -lacks(problem, sites.at_positions(np.flatnonzero(lost)))[0].max(axis=3).min(axis=2)
        sites = with_more_angles(sites, _around(problem, sites, sites.gamma[p, merit.argmax(axis=1)], half))
        half *= 2.0 / AROUND
    return sites


def _around(problem: Problem, sites: Sites, centre: Array, half: float) -> Sites:
    """Angles about one (p,) rad of each position of a sweep, ``half`` rad to either side."""
    assert isinstance(problem.gamma, GammaRange)  # noqa: S101 - else there is nothing to refine
    # Between the angles that are there already.
    offsets = half * (np.arange(AROUND) + 0.5 - 0.5 * AROUND) * 2.0 / AROUND
    gamma = problem.gamma.inside(centre[:, None] + offsets)
    return sweep_sites(problem, sites.e, sites.table, sites.rows, gamma)


def survey(problem: Problem, counts: tuple[int, ...] | None = None) -> Survey:
    """Look at a coarse grid of positions, or one of ``counts``. Errors as :func:`machining.sweep_gamma`."""
    counts = counts or coarse_counts(problem)
    x = problem.space.grid(counts)
    rows = problem.sure_rows(COARSE_ROWS)
    sites = sweep_sites(problem, *problem.space.sites(x), rows, problem.angles)
    problem = with_weights(problem, sites)
    return Survey(problem, tuple(Looker(problem).of(x, sites)), counts)


def find_fixed(problem: Problem, surveyed: Survey | None = None, progress: Progress | None = None) -> Found:
    """Best position of the base for the whole path; ``surveyed``: the coarse grid, if it is there already.

    Raises
    ------
    InputError
        No position reaches the path (it says by how much), or none can be driven without jumps and collisions.
    """
    surveyed = surveyed or survey(problem)
    problem = surveyed.problem
    looker = Looker(problem, progress, len(surveyed.grid) + BASINS * 20 * problem.space.d)
    looker.count = len(surveyed.grid)
    step = (problem.space.upper - problem.space.lower) / (np.array(surveyed.counts) - 1)
    starts = _basins(list(surveyed.grid), surveyed.counts)
    basins = [refined(looker, start, step, float(step.max()) * EARLY) for start in starts]
    # The better half goes on: a narrow peak between grid points is seen only now.
    basins = sorted(basins, key=lambda look: look.rank, reverse=True)
    late = [
        refined(looker, look, 2.0 * EARLY * step, TOLERANCE * ROUGH, known=True) for look in basins[: (BASINS + 1) // 2]
    ]
    basins = sorted(late, key=lambda look: look.rank, reverse=True) + basins[(BASINS + 1) // 2 :]
    found = _driven(looker, basins)
    report_progress(progress, looker.total, looker.total)
    return found


def find_staying(problem: Problem, e: Array, table: float) -> Found:
    """The best angle gamma with the base where it stands, at travels e (k,) m and the turntable at ``table`` rad.

    Raises
    ------
    InputError
        An axis that the search holds elsewhere; no angle reaches the path from there, or none can be driven.
    """
    x = problem.space.coordinates(e, table)
    there, angle = problem.space.sites(x[None])
    if np.abs(there[0] - e).max(initial=0.0) > 1e-9 or abs(float(angle[0]) - table) > 1e-9:
        raise InputError(
            "present place of the base", code="G006", value="an axis that is held elsewhere", remedy="widen its range"
        )
    looker, rows = Looker(problem), problem.sure_rows(FINE_ROWS)
    for _ in range(ROUNDS):
        look = looker.at(x[None], rows)[0]
        if not look.rank[0]:
            break
        try:
            course = follow(problem, e, table, look.gamma)
        except PathError as fault:
            if fault.point in rows:
                raise
            rows = np.union1d(rows, [fault.point])
            continue
        return Found(problem, x, look.gamma, course, merit_of(problem, course), looker.count)
    raise _no_position(problem, [look])


def with_weights(problem: Problem, sites: Sites) -> Problem:
    """The problem with weights of K_sf, if it needs some: comparable at the largest mean stiffness of a sweep."""
    if problem.goal.aim != "ksf" or problem.goal.criterion is not None:
        return problem
    whole = sites.valid.all(axis=3)
    share = problem.share_of(sites.rows)
    if whole.any():
        stiffness = float((sites.value[whole] @ share).max())
    elif sites.valid.any():
        stiffness = float(np.nanmedian(sites.value))
    else:
        stiffness = 1e6
    # Two digits: weights that a person can write down.
    rounded = float(f"{stiffness:.1e}")
    return replace(problem, goal=replace(problem.goal, criterion=Criterion.comparable(rounded, problem.path.n)))


def coarse_counts(problem: Problem, most: int | None = None) -> tuple[int, ...]:
    """Positions of the coarse grid along each coordinate: steps about as long in all of them."""
    space = problem.space
    most = most or COARSE[min(space.d, 4)]
    size = space.upper - space.lower
    if space.turns:
        size = np.append(size[:-1], size[-1] * TABLE_LEVER)
    step = float(size.max()) / (most - 1)
    while True:
        counts = np.maximum(3, np.floor(size / step + 1e-9).astype(int) + 1)
        if counts.prod() <= max(most, 3**space.d):
            return tuple(int(c) for c in counts)
        step *= 1.05


def grid_with(problem: Problem, most: int, angles: int, also: Array | None, gamma: float | None) -> tuple[Array, Array]:
    """Positions (p, d) and angles gamma (g,) rad of a grid of at most so many, and a known best of both with them."""
    x = problem.space.grid(coarse_counts(problem, most))
    some = problem.angles[:: -(-len(problem.angles) // angles)]
    return x if also is None else np.vstack([x, also]), some if gamma is None else np.append(some, gamma)


def _basins(grid: list[Look], counts: tuple[int, ...]) -> list[Look]:
    """Best positions of the grid that no neighbour along an axis is better than."""
    order = sorted(range(len(grid)), key=lambda i: grid[i].rank, reverse=True)
    place = np.empty(len(grid), dtype=np.int64)
    place[order] = np.arange(len(grid))
    rank = np.pad(place.reshape(counts), 1, constant_values=len(grid))
    inner = (slice(1, -1),) * len(counts)
    peak = np.ones(counts, dtype=np.bool_)
    for axis in range(len(counts)):
        for way in (1, -1):
            peak &= rank[inner] < np.roll(rank, way, axis=axis)[inner]
    return [grid[i] for i in order if peak.ravel()[i]][:BASINS]


def refined(
    looker: Looker,
    start: Look,
    step: Array,
    tolerance: float = TOLERANCE,
    rows: Integers | None = None,
    *,
    known: bool = False,
) -> Look:
    """Pattern search about a position: neighbours along the axes, then along diagonals, then half the step.

    It starts with half of ``step`` (d,). ``known``: the start was looked at with these rows already.
    """
    problem = looker.problem
    rows = problem.sure_rows(FINE_ROWS) if rows is None else rows
    best = start if known else looker.at(start.x[None], rows)[0]
    h, seen = 0.5 * step, {_key(best.x)}
    axes = np.vstack([np.eye(problem.space.d), -np.eye(problem.space.d)])
    diagonals = np.array(list(product((-1.0, 1.0), repeat=problem.space.d)))
    while (h > tolerance).any():
        trials = [axes] if problem.space.d == 1 else [axes, diagonals]
        for directions in trials:
            x = np.unique(problem.space.inside(best.x + directions * h), axis=0)
            x = x[[_key(a) not in seen for a in x]]
            seen |= {_key(a) for a in x}
            looks = looker.at(x, rows) if len(x) else []
            better = max(looks, key=lambda look: look.rank, default=best)
            if better.rank > best.rank:
                best = better
                break
        else:
            # No neighbour is better; a step that helped is tried again at the same size.
            h = 0.5 * h
    return best


def _key(x: Array) -> tuple[float, ...]:
    return tuple(x.round(9).tolist())


def _driven(looker: Looker, basins: list[Look]) -> Found:
    """The best basin that can be driven over all points of the path."""
    problem = looker.problem
    possible = [look for look in basins if look.rank[0]]
    if not possible:
        raise _no_position(problem, basins)
    error: InputError | None = None
    for look in possible:
        rows, best, known = problem.sure_rows(FINE_ROWS), look, True
        for _ in range(ROUNDS):
            first = np.full(problem.space.d, 1.1 * ROUGH * TOLERANCE)
            best = refined(looker, best, first, TOLERANCE, rows, known=known)
            e, table = problem.space.sites(best.x[None])
            try:
                course = follow(problem, e[0], float(table[0]), best.gamma)
            except PathError as fault:
                error = error or fault
                if fault.point in rows:
                    break
                # Between the points that were looked at there is one that this position does not reach.
                rows, known = np.union1d(rows, [fault.point]), False
                best = refined(looker, best, np.full(problem.space.d, 64.0 * TOLERANCE), TOLERANCE * ROUGH, rows)
                if not best.rank[0]:
                    break
                continue
            return Found(problem, best.x, best.gamma, course, merit_of(problem, course), looker.count)
    assert error is not None  # noqa: S101 - some basin could be taken, and each was followed
    raise error


def _no_position(problem: Problem, basins: list[Look]) -> InputError:
    nearest = max(basins, key=lambda look: look.rank)
    if nearest.shortfall is not None:
        return unreachable(problem, nearest.x, nearest.shortfall)
    return InputError(
        "no base position can take the whole path",
        code="G001",
        value=f"nearest at {problem.space.words(nearest.x)}, where there is a {nearest.why} on the way",
        allowed=f"{problem.clearance * 1e3:g} mm of clearance and no singularity",
        remedy="widen the ranges of the axes or of gamma, or move what is in the way",
    )
