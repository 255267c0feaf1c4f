"""Which pose stands at a Cartesian point of a map: at a fixed orientation, at the best gamma, or at the extreme of all.

All rules look at every branch of the inverse kinematics that keeps the joint limits; collisions are not looked at.
What is best is said by a merit, one number a pose, large is good.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy.spatial import cKDTree

from robots import (
    InputError,
    Robot,
    forward_kinematics,
    require_one_of,
    singularity_distance,
    tool_position,
    why_no_closed_form,
)
from robots.arrays import Array, finite
from robots.frames import unit_vector
from robots.inverse.axis_lines import axis_lines
from robots.inverse.singularities import NEAR_SINGULAR
from surrogate.maps.candidates import (
    Arm,
    Chosen,
    Merit,
    Peaks,
    best_of_sample,
    best_of_starts,
    climbed,
    refined_gamma,
    shared,
    within_length,
)
from surrogate.maps.orientation import spread_rotations, tool_rotations
from surrogate.maps.self_motion import NEARLY_THERE, THERE, brought_back

# Orientations nearer to each other than this many spacings of the sample lie on one peak, but not beyond WIDEST rad.
APART = 2.0
WIDEST = 1.2
# Beside a sample of orientations: random poses, and how many of them climb.
RANDOM, OTHER_STARTS = 12, 2
# Of a map of many points each tries one in so many of the axes; fewer points than FEW try all, from MORE starts.
SHARES, FEW, MORE = 4, 256, 4
# Neighbours that a point is given poses of; peaks that are kept meanwhile and how often, where joint 6 is free, and
# where it is not and there are more peaks; rounds of the climbs between.
NEIGHBOURS = 6
FREE_KEPT, FREE_TURNS, KEPT, TURNS = 2, 4, 3, 6
FIRST_CLIMB, SHORT_CLIMB, LAST_CLIMB = 3, 2, 30
# Relative change by which a merit counts as independent of joint 6.
SAME = 1e-9


class PoseRule(Protocol):
    """A rule that chooses a pose for each point."""

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Poses at points (m, 3) m, base frame; ``generator`` as of :func:`robots.inverse_kinematics`."""
        ...


@dataclass(frozen=True, eq=False)
class BestGamma:
    """One tool axis (3,) from the tip into the holder, base axes, and the best of the angles ``gammas`` (g,) rad.

    With ``refine`` also of those between them; with one angle the orientation is fixed, and the best branch is taken.
    """

    tool_axis: Array
    gammas: Array
    refine: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_axis", unit_vector(self.tool_axis, "tool axis"))
        object.__setattr__(self, "gammas", finite("angles gamma", self.gammas, ("g",), "rad"))

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Best gamma and branch at each point; see :class:`PoseRule`."""
        # Where joint 6 is free so is gamma, but the angle asked for is what the user gets.
        arm = Arm(arm.robot, arm.T_flange_tool, arm.merit)
        best = best_of_sample(arm, points, tool_rotations(self.tool_axis, self.gammas), 1.0, 1, 0.0, generator)
        if self.refine and len(self.gammas) > 1:
            best = refined_gamma(arm, points, self.tool_axis, self.gammas, best, generator)
        return best.chosen()


@dataclass(frozen=True, eq=False)
class Extreme:
    """The stiffest or softest of all poses at each point: any orientation, any branch.

    Of ``axes`` tool axes spread over the sphere, each with ``gammas`` angles about it (one where joint 6 is free), each
    point is given a share, its neighbours others; the best ``starts`` of these and some random poses climb by
    self-motions of the arm (:mod:`surrogate.maps.self_motion`). Then points give the poses that they found to their
    neighbours, where these are brought to the neighbour's point and climb on, some rounds over: good poses change
    little from point to point, so a peak found at one point is found at all points around it. Few points are searched
    more thoroughly, because they have few neighbours or far ones.

    What is found is a peak to some 1e-5 of its merit. That it is the highest peak is not certain: one that is narrow
    can be missed. Over slices of some 1200 points (XR701, KR 60, TX200) one extreme in a hundred fell short by more
    than 1e-4 of what some search found, one of 2800 by more than 1 %; of arms whose tool point lies beside the axis of
    joint 6 one in twenty, one in a hundred by more than 1 %. :func:`shortfall` measures it anywhere.

    Arms whose inverse kinematics is no closed form, and those with other than six joints, start from ``axes`` random
    poses instead, each brought to the point.
    """

    which: Literal["stiffest", "softest"] = "stiffest"
    axes: int = 64
    gammas: int = 3
    starts: int = 3

    def __post_init__(self) -> None:
        require_one_of("extreme pose", self.which, ("stiffest", "softest"), code="B003")
        if self.axes < 8 or self.gammas < 1 or self.starts < 1:
            raise InputError(
                "sample of orientations",
                code="B003",
                value=f"{self.axes} axes, {self.gammas} angles, {self.starts} starts",
                allowed="8 axes or more, 1 angle or more, 1 start or more",
            )

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Extreme pose at each point; see :class:`PoseRule`."""
        sign = 1.0 if self.which == "stiffest" else -1.0
        closed = why_no_closed_form(arm.robot) is None
        out = Chosen(np.full((len(points), arm.robot.dof), np.nan), np.full(len(points), closed))
        near = np.flatnonzero(within_length(arm, points))
        if len(near):
            few = len(near) < FEW
            step = float(np.sqrt(4.0 * np.pi / (self.axes if few or not closed else self.axes / SHARES)))
            start = self._sample if closed else self._random
            peaks = self._spread(arm, points[near], start(arm, points[near], sign, few, generator), sign, step)
            out.q[near], out.sure[near] = _exactly(arm, points[near], peaks.chosen().q), peaks.sure
        return out

    def _sample(self, arm: Arm, points: Array, sign: float, few: bool, generator: np.random.Generator | None) -> Peaks:
        """The best sampled orientations of each point, and of random poses where there are any."""
        shares, more = (1, MORE) if few else (SHARES, 1)
        R = spread_rotations(self.axes, 1 if arm.last_is_free else self.gammas).reshape(self.axes, -1, 3, 3)
        apart = min(APART * float(np.sqrt(4.0 * np.pi * shares / self.axes)), WIDEST)
        dof, starts = arm.robot.dof, more * self.starts
        out = Peaks(
            np.full((len(points), starts, dof), np.nan),
            np.full((len(points), starts), -np.inf),
            np.zeros(len(points), dtype=np.bool_),
        )
        for k in range(shares):
            some = slice(k, None, shares)
            found = best_of_sample(arm, points[some], R[some].reshape(-1, 3, 3), sign, starts, apart, generator)
            out.q[some], out.merit[some], out.sure[some] = found.q, found.merit, found.sure
        # Islands of few orientations, say with the arm bent over backwards, are found from elsewhere.
        there = np.flatnonzero(np.isfinite(out.merit).any(axis=1))
        return out.joined(best_of_starts(arm, points[there], sign, more * OTHER_STARTS, more * RANDOM), there)

    def _random(self, arm: Arm, points: Array, sign: float, few: bool, generator: np.random.Generator | None) -> Peaks:
        return best_of_starts(arm, points, sign, (MORE if few else 1) * self.starts, (MORE if few else 1) * self.axes)

    def _spread(self, arm: Arm, points: Array, peaks: Peaks, sign: float, step: float) -> Peaks:
        """Peaks improved at each point and given to its neighbours, by turns."""
        neighbours = cKDTree(points).query(points, min(NEIGHBOURS + 1, len(points)))[1].reshape(len(points), -1)[:, 1:]
        kept, turns = (FREE_KEPT, FREE_TURNS) if arm.last_is_free else (KEPT, TURNS)
        kept *= 1 if len(points) >= FEW else MORE
        peaks = climbed(arm, peaks, sign, step, FIRST_CLIMB).best(kept)
        for _ in range(turns):
            step *= 0.5
            peaks = shared(arm, points, peaks, neighbours, sign).best(kept)
            peaks = climbed(arm, peaks, sign, step, SHORT_CLIMB)
        for last, near in ((0.5 * step, NEARLY_THERE), (step, THERE)):
            peaks = climbed(arm, peaks.best(1), sign, last, LAST_CLIMB, near)
            peaks = shared(arm, points, peaks, neighbours, sign) if near > THERE else peaks
        return peaks


def _exactly(arm: Arm, points: Array, q: Array) -> Array:
    """Poses q (m, dof), NaN where there is none, with the tool at the points to rounding."""
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    back, kept = brought_back(arm.robot, q[there], points[there], arm.T_flange_tool[:3, 3], arm.last_is_free)
    q = np.full_like(q, np.nan)
    q[there[kept]] = back[kept]
    return q


def away_from_singular(robot: Robot, point: Array, merit: Merit) -> Merit:
    """A merit, large is good, by which no pose near a singular one is chosen where a point has any other.

    Where a force passes through all axes of the arm, no joint feels it: by its stiffness such a pose beats all others,
    and the robot cannot move through it. Poses near singular ones get a merit below that of all others, the less the
    nearer they are; so a point that has none but them keeps the least singular one.

    ``point`` (3,) m: the tool point in the flange frame; ``merit``: poses (n, dof) rad -> (n,), positive.
    """

    def regular(q: Array) -> Array:
        value = np.asarray(merit(q))
        sigma = singularity_distance(robot, q, point=point).sigma_min
        return np.where((sigma < NEAR_SINGULAR) & ~np.isnan(value), sigma / NEAR_SINGULAR - 1.0, value)

    return regular


def last_joint_is_free(robot: Robot, T_flange_tool: Array, quantity: Callable[[Array], Array]) -> bool:
    """Whether the last joint moves neither the tool point nor a quantity of the pose; seen at some random poses.

    ``quantity``: poses (n, dof) rad -> (n, ...), say the compliance C_tt.
    """
    generator = np.random.default_rng(0)
    low, high = robot.limits.T
    q = generator.uniform(low, high, (256, robot.dof))
    q = q[robot.reachable(q)][:64]
    if not len(q):
        return False
    other = q.copy()
    other[:, -1] = generator.uniform(low[-1], high[-1], len(q))
    point = np.asarray(T_flange_tool)[:3, 3]
    tips = [tool_position(robot, forward_kinematics(robot, each), point) for each in (q, other)]
    if np.abs(tips[1] - tips[0]).max() > SAME * axis_lines(robot).length:
        return False
    one, two = quantity(q), quantity(other)
    size = np.abs(one).reshape(len(q), -1).max(axis=1)
    return bool((np.abs(two - one).reshape(len(q), -1).max(axis=1) <= SAME * size).all())


def check_robot(robot: Robot, *, any_orientation: bool) -> str | None:
    """Refuse robots that a Cartesian map cannot be made of; say in words what a map of this one may lack, or None.

    Raises
    ------
    InputError
        Fewer than six joints, unless ``any_orientation`` will do: the tool's cannot be chosen.
    """
    if robot.dof < 6 and not any_orientation:
        raise InputError(
            f"Cartesian map of {robot.name}",
            code="R004",
            value=f"{robot.dof} joints",
            allowed="six joints or more: with fewer the tool's orientation at a point cannot be chosen",
            remedy="let it be free (--pose stiffest or softest), or make the map over the joints (map joints)",
        )
    why = why_no_closed_form(robot)
    return None if why is None else f"poses are searched for, some may have been missed: {why}"


def shortfall(
    rule: Extreme, arm: Arm, points: Array, q: Array, generator: np.random.Generator | None = None, *, denser: int = 4
) -> Array:
    """By what share the merit of a rule's poses q (m, dof) at points (m, 3) falls short of a ``denser`` sample's, (m,).

    0 where the rule found as good a pose or a better one; NaN where it found none, or none but near a singular one.
    """
    dense = Extreme(rule.which, rule.axes * denser, rule.gammas, 2 * rule.starts)
    values = []
    for poses in (q, dense.choose(arm, points, generator).q):
        value = np.full(len(poses), np.nan)
        reached = np.isfinite(poses).all(axis=1)
        value[reached] = arm.merit(poses[reached])
        values.append(value)
    # Merits below 0 are those of poses near singular ones, where there is no other.
    values = [np.where(value > 0.0, value, np.nan) for value in values]
    with np.errstate(invalid="ignore"):
        ratio = values[1] / values[0] if rule.which == "stiffest" else values[0] / values[1]
    return np.asarray(np.maximum(ratio - 1.0, 0.0))
