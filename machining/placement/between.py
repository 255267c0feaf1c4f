"""The moves between the cuts of a program: whether they can be driven from where the base stands for the cuts.

Where rapid moves are straight, as `stiffarm post` writes them by default, the branch may change at a tool change only;
where they are joint motion, at every one of them. Angle gamma is that of the cuts. The moves are asked for one position
and one angle at a time, and only where the cuts themselves are free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from machining.placement.file import Placement, Rapid
from machining.placement.problem import Goal, Problem
from machining.placement.sweeping import Sites, blocked, sweep_sites
from machining.posture.problem import Course
from machining.programs.posting import PostSettings, post
from machining.setup import Setup
from machining.toolpaths.conversion import GivenPath
from robots import InputError, Reason
from robots.arrays import Array, Integers

# Points and axes that agree to so many digits (m) are one target.
DIGITS = 8
# What can stop a pose, the farthest from being allowed first, in words.
STOPS = {
    "reach": "out of reach",
    "limit": "beyond a joint limit",
    "singularity": "too near a singularity",
    "collision": "a collision",
}
CAUSES = tuple(STOPS)


@dataclass(frozen=True, eq=False)
class Stopped:
    """A pose ``q`` (dof,) rad at path point ``point`` and angle ``gamma`` rad that cannot be taken.

    ``line`` of the program where it is a move between cuts, and ``why`` of :data:`STOPS`; else 0 and "".
    """

    point: int
    gamma: float
    q: Array
    line: int = 0
    why: str = ""


@dataclass(frozen=True, eq=False)
class Links:
    """The l points of a program that no cut has, and its runs of moves that keep one branch.

    ``rapid``: how rapid moves go; ``given``: the cuts; ``whole``: the placement of all moves of the
    program; ``rows`` (l,) in it; ``run`` (l,) of each; ``cut_run`` (n,): run that each point of the cuts is in;
    ``unique`` (t,): rows of different targets; ``target`` (l,): place of each row's target in them;
    ``line`` (l,) of the program with the move that ends there.
    """

    rapid: Rapid
    given: GivenPath
    whole: Problem
    rows: Integers
    run: Integers
    cut_run: Integers
    unique: Integers
    target: Integers
    line: Integers


def with_links(problem: Problem, given: GivenPath, rapid: Rapid = "linear") -> Problem:
    """The problem with the moves between the cuts of its path, where the path is of a program that has some.

    Gamma counts from the direction that the program of all moves counts it from.
    """
    if given.motions is None:
        return problem
    every = given.whole()
    # Of the moves that end at one point the first leads there.
    first = every.moves[:-1] + 1
    free = given.motions.changes[first] if rapid == "linear" else given.motions.rapid[first]
    arm = None if problem.scene is None else problem.scene.arm
    whole = replace(
        problem,
        path=every.path,
        free=free,
        tools=Setup(problem.cell, arm).tools(every),
        goal=Goal("mean"),
    )
    problem = replace(problem, reference=whole.home.reference)
    cuts = np.searchsorted(every.moves, given.moves)
    rows = np.setdiff1d(np.arange(every.path.n), cuts)
    if not len(rows):
        return problem
    run = np.concatenate([[0], np.cumsum(free)])
    tool = np.zeros(len(rows)) if whole.tools is None else whole.tools.place[rows]
    targets = np.column_stack([every.path.points[rows], every.path.axes[rows], tool]).round(DIGITS)
    _, first, target = np.unique(targets, axis=0, return_index=True, return_inverse=True)
    # In the order of the path: two that agree but for rounding shall not be neighbours.
    order = np.argsort(first)
    line, place = given.motions.line[every.moves[rows]], np.argsort(order)[target.ravel()]
    links = Links(rapid, given, whole, rows, run[rows], run[cuts], rows[first[order]], place, line)
    return replace(problem, links=links)


class Between:
    """Asks whether the moves between the cuts can be driven from position ``site`` of a sweep."""

    def __init__(self, links: Links, sites: Sites, site: int, start: Integers) -> None:
        """``start`` (r,): places in the sweep's rows where runs start."""
        self.links, self.e, self.table = links, sites.e[site], float(sites.table[site])
        self.gamma, self.runs = sites.gamma[site], links.cut_run[sites.rows[start]]
        self.known = dict[float, tuple[Array, Integers]]()
        # Angles at which a target is out of reach of all branches.
        self.lost = dict[float, Stopped]()

    def first(self, gamma: float, branches: Integers) -> tuple[int, Stopped] | None:
        """Where moves cannot be driven at an angle, with the branch (r,) of each run; None: all can.

        And the run whose branch could be another, -1 where no branch helps.
        """
        if gamma in self.lost:
            return -1, self.lost[gamma]
        links, (q, rank) = self.links, self._poses(gamma)
        for run in np.unique(links.run).tolist():
            here, cuts = np.flatnonzero(links.run == run), np.flatnonzero(self.runs == run)
            names = branches[cuts] if len(cuts) else np.arange(len(q))
            stops = [self._stop(q[b][links.target[here]], rank[b][links.target[here]], here) for b in names]
            best = max(range(len(stops)), key=lambda i: stops[i][0])
            worst, at = stops[best]
            if worst < len(STOPS):
                row, target = int(here[at]), links.target[here[at]]
                stop = Stopped(int(links.rows[row]), gamma, q[names[best], target], int(links.line[row]), CAUSES[worst])
                if rank[:, target].max() < len(STOPS):
                    self._lose(stop)
                return int(cuts[0]) if len(cuts) and gamma not in self.lost else -1, stop
        return None

    def _lose(self, stop: Stopped) -> None:
        """Where one angle does not reach a target its neighbours do not as a rule: all are asked for it."""
        there = self._sweep(np.array([stop.point]), self.gamma)
        for angle in self.gamma[~there.valid[0, :, :, 0].any(axis=1)].tolist():
            self.lost[angle] = replace(stop, gamma=angle)

    def _poses(self, gamma: float) -> tuple[Array, Integers]:
        """Poses (b, t, dof) rad of all targets, and places (b, t) in :data:`STOPS` of what stops them by themselves."""
        if gamma not in self.known:
            there = self._sweep(self.links.unique, np.array([gamma]))
            rank = np.where(there.valid, len(STOPS), np.where(there.reason == Reason.LIMITS, 1, 0))
            self.known[gamma] = there.q[0, 0], rank[0, 0]
        return self.known[gamma]

    def _sweep(self, rows: Integers, gamma: Array) -> Sites:
        return sweep_sites(self.links.whole, self.e[None], np.array([self.table]), rows, gamma)

    def _stop(self, q: Array, rank: Integers, here: Integers) -> tuple[int, int]:
        """Place in :data:`STOPS` of what stops poses (m, dof) rad of link points, past them if nothing; and where."""
        at = int(rank.argmin())
        if rank[at] == len(STOPS):
            why, pose = blocked(self.links.whole, q, self.e, self.table, self.links.rows[here])
            return (CAUSES.index(why), pose) if why else (len(STOPS), -1)
        return int(rank[at]), at


def placement_of(
    problem: Problem, given: GivenPath, e: Array, table: float, course: Course, rapid: Rapid = "linear"
) -> Placement:
    """What other programs read (:func:`machining.placement.read_placement`) of travels e (n, k) m and a course."""
    return Placement(
        robot=problem.model.robot.name,
        cell=problem.cell.name,
        axes=tuple(axis.name for axis in problem.cell.linear_axes),
        travel=e,
        table=table,
        gamma=course.gamma,
        joints=problem.model.robot.coordinates,
        q=course.q,
        moves=given.moves,
        count=given.count,
        rapid=rapid,
    )


def undriven(problem: Problem, e: Array, table: float, course: Course, rapid: Rapid | None = None) -> InputError | None:
    """Why the whole program cannot be driven with travels e (n, k) m and a course of its cuts; None if it can.

    ``rapid``: how rapid moves go; None: as the problem's links have it.
    """
    if problem.links is None or problem.links.given.motions is None:
        return None
    given, motions = problem.links.given, problem.links.given.motions
    placement = placement_of(problem, given, e, table, course, rapid or problem.links.rapid)
    settings = PostSettings(**placement.at_every_move(motions.rapid), drive=replace(problem.drive, clearance_at=None))
    try:
        post(problem.model, problem.cell, motions, settings)
    except InputError as error:
        return error
    return None
