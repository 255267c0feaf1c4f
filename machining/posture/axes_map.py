"""Axes map of a path: what each angle gamma about the tool axis is worth at each path point, and where it is barred.

The chart that CAM systems for robots show: path across, gamma up. Here its colour is the best branch's value of an
objective. A course of postures is a line through it; the map does not say which cells a robot can drive between.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

import fem
from machining.posture.drive import Drive, singular_distance
from machining.posture.points import Sweep
from machining.stiffness.objective import Objective
from machining.sweep_parts import sweep_parts
from machining.task import Task
from robots import Reason, Robot
from robots.arrays import Array, Bools, Integers
from robots.inverse.turns import every_turn
from robots.progress import Progress

Codes = NDArray[np.int8]


class Zone(IntEnum):
    """What a cell of the map is; of several branches, what the one nearest to being allowed is."""

    OPEN = 0
    UNREACHABLE = 1
    LIMITS = 2
    SINGULAR = 3
    COLLISION = 4

    @property
    def words(self) -> str:
        """For legends and files."""
        return _WORDS[self]


_WORDS = {
    Zone.OPEN: "open",
    Zone.UNREACHABLE: "out of reach",
    Zone.LIMITS: "joint limits",
    Zone.SINGULAR: "near a singularity",
    Zone.COLLISION: "collision",
}

# How near a branch is to being allowed, worst first. A pose in the soft zone of a singularity can be driven, only at
# a cost; so it counts as nearer than one that collides.
_GONE, _LIMITS, _SINGULAR, _COLLISION, _SOFT, _OPEN = range(6)
_ZONE_OF = np.array(
    [Zone.UNREACHABLE, Zone.LIMITS, Zone.SINGULAR, Zone.COLLISION, Zone.SINGULAR, Zone.OPEN], dtype=np.int8
)


@dataclass(frozen=True, eq=False)
class AxesMap:
    """Map of n path points and m angles.

    Attributes
    ----------
    length : (n,) m along the path
    gamma : (m,) rad
    zone : (n, m) :class:`Zone`
    value : (n, m) of the objective: the best open branch; where none is open but one can be driven in the soft zone of
        a singularity, the best of those; else NaN
    branch : (n, m) that branch, into ``names``; -1 where the value is NaN
    q : (n, m, dof) rad of that branch, or of one that is barred for the zone's reason; NaN where there is none. None
        unless it was asked for
    sure : the inverse kinematics found all solutions
    """

    objective: Objective
    length: Array
    gamma: Array
    zone: Codes
    value: Array
    branch: Integers
    names: tuple[str, ...]
    sure: bool
    q: Array | None = None

    def share(self, zone: Zone) -> float:
        """Share of the cells that are of a zone."""
        return float((self.zone == zone).mean())


def axes_map(
    model: fem.ArmModel,
    task: Task,
    objective: Objective | None = None,
    drive: Drive | None = None,
    gamma: ArrayLike | None = None,
    *,
    generator: np.random.Generator | None = None,
    progress: Progress | None = None,
    postures: bool = False,
) -> AxesMap:
    """Make the map for angles gamma (m,) rad, default a full turn in 5 deg.

    A branch is barred where a joint is beyond its limits or nearer to them than the drive's ``limit_least``; where it
    is nearer to a singularity than ``singular_zone`` (``singular_least`` if that zone is switched off); and where its
    clearance is below ``clearance_least``, if the drive has a ``clearance_of``. A cell is open if any branch is.

    ``postures``: keep the joints of every cell. Parts of the path are worked on in turn, so only the result grows with
    n x m. Errors as
    :func:`machining.sweep_parts.sweep_parts` and :meth:`machining.posture.drive.Drive.near_things`.
    """
    objective, drive = objective or Objective(), drive or Drive()
    angle = np.radians(np.arange(-180.0, 180.0, 5.0)) if gamma is None else np.asarray(gamma, dtype=np.float64)
    shape = task.path.n, angle.size
    zone, branch = np.zeros(shape, dtype=np.int8), np.full(shape, -1, dtype=np.int64)
    value, sure = np.full(shape, np.nan), True
    joints = np.full((*shape, model.robot.dof), np.nan) if postures else None
    names: tuple[str, ...] = ()
    for rows, _, sweep in sweep_parts(model, task, objective, angle, generator=generator, progress=progress):
        rank = _ranks(model.robot, drive, sweep, rows.start)
        nearest = rank.max(axis=2)
        zone[rows] = _ZONE_OF[nearest]
        usable = (rank == nearest[..., None]) & (rank >= _SOFT)
        merit = np.where(usable, sweep.merit, -np.inf)
        best = merit.argmax(axis=2)
        has = usable.any(axis=2)
        branch[rows] = np.where(has, best, -1)
        chosen = np.take_along_axis(sweep.value, best[..., None], axis=2)[..., 0]
        value[rows] = np.where(has, chosen, np.nan)
        if joints is not None:
            # Of barred branches the first that has joints at all.
            known = (rank == nearest[..., None]) & np.isfinite(sweep.q).all(axis=-1)
            one = np.where(has, best, known.argmax(axis=2))
            some = np.take_along_axis(sweep.q, one[..., None, None], axis=2)[:, :, 0]
            joints[rows] = np.where((has | known.any(axis=2))[..., None], some, np.nan)
        names, sure = max(names, sweep.names, key=len), sure and bool(sweep.sure.all())
    return AxesMap(objective, task.path.arc_length, angle, zone, value, branch, names, sure, joints)


def _ranks(robot: Robot, drive: Drive, sweep: Sweep, first: int) -> Integers:
    """How near to being allowed each branch is, (n, m, b); ``first``: number of the sweep's first path point."""
    rank = np.where(sweep.reason == Reason.LIMITS, _LIMITS, _GONE)
    found = np.nonzero(sweep.valid)
    q = sweep.q[found]
    distance = singular_distance(robot, q)
    soft = drive.singular_zone if drive.singular > 0.0 else 0.0
    state = np.where(distance < max(soft, drive.singular_least), _SOFT, _OPEN)
    state[distance < drive.singular_least] = _SINGULAR
    state[~_off_limits(robot, drive, q)] = _LIMITS
    # Clearance costs most: it is asked only where it matters.
    ask = np.flatnonzero(state >= _SOFT)
    _, clear = drive.near_things(q[ask], first + found[0][ask])
    hit = ask[~clear]
    state[hit] = np.where(state[hit] == _SOFT, _SINGULAR, _COLLISION)
    rank[found] = state
    return np.asarray(rank)


def _off_limits(robot: Robot, drive: Drive, q: Array) -> Bools:
    """Whether some turn of each pose (k, dof) keeps the drive's distance from the limits; they are kept already."""
    if drive.limit_least == 0.0:
        return np.ones(len(q), dtype=np.bool_)
    turned = every_turn(robot, q)
    _, allowed = drive.near_limits(robot, turned.q)
    return np.asarray(np.bincount(turned.target[allowed], minlength=len(q)) > 0)
