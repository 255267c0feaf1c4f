"""Which pose stands at a Cartesian point of a map: at a fixed orientation, at the best gamma, or at the extreme of all.

All rules look at every branch of the inverse kinematics that keeps the joint limits; collisions are not looked at.
What is best is said by a merit, one number a pose, large is good.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from robots import InputError, Robot, forward_kinematics, tool_position, why_no_closed_form
from robots.arrays import Array
from robots.inverse.axis_lines import axis_lines
from surrogate.maps.candidates import Arm, Chosen, best_of_sample, best_of_starts, refined, refined_gamma
from surrogate.maps.orientation import spread_rotations, tool_rotations, unit_vector

# Orientations nearer to each other than this many spacings of the sample lie on one peak.
APART = 2.0
# Beside a sample of orientations: random poses, as a share of its axes, and how many of them climb.
SHARE_OF_RANDOM, OTHER_STARTS = 4, 4
# First step (rad) of a climb that does not start from a sample of orientations.
JOINT_STEP = 0.3
# Relative change by which a merit counts as independent of joint 6.
SAME = 1e-9


class PoseRule(Protocol):
    """A rule that chooses a pose for each point."""

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Poses at points (m, 3) m, base frame; ``generator`` as of :func:`robots.inverse_kinematics`."""
        ...


@dataclass(frozen=True, eq=False)
class FixedOrientation:
    """One tool axis (3,) from the tip into the holder, base axes, and one gamma rad; the best branch of them."""

    tool_axis: Array
    gamma: float = 0.0

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Best branch at each point; see :class:`PoseRule`."""
        return BestGamma(self.tool_axis, np.array([self.gamma]), refine=False).choose(arm, points, generator)


@dataclass(frozen=True, eq=False)
class BestGamma:
    """One tool axis (3,); the best of the angles ``gammas`` (g,) rad and, with ``refine``, of those between them."""

    tool_axis: Array
    gammas: Array
    refine: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "tool_axis", unit_vector(self.tool_axis, "tool axis"))
        g = np.asarray(self.gammas, dtype=np.float64)
        if g.ndim != 1 or not len(g) or not np.isfinite(g).all():
            raise InputError("angles gamma", value=f"shape {g.shape}", allowed="finite angles (g,) rad, one or more")
        object.__setattr__(self, "gammas", g)

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

    ``axes`` tool axes spread over the sphere, each with ``gammas`` angles about it (one where joint 6 is free), are
    tried; the best ``starts`` of them climb by self-motions of the arm (:mod:`surrogate.maps.self_motion`). What is
    found is a peak to some 1e-5 of its merit. That it is the highest peak is not certain: one that is narrower than
    the sample's spacing (``sqrt(4 pi / axes)``, 14 deg for 200 axes) can be missed. Against a sample four times as
    dense, at 150 random points each of an XR701, a KR 60 (with rigid links too) and a TX200, one extreme of 1200 fell
    short by more than 0.1 %, by 1 %. :func:`shortfall` measures it anywhere.

    Arms whose inverse kinematics is no closed form, and those with other than six joints, start from ``axes`` random
    poses instead, each brought to the point.
    """

    which: Literal["stiffest", "softest"] = "stiffest"
    axes: int = 200
    gammas: int = 4
    starts: int = 16

    def __post_init__(self) -> None:
        if self.which not in ("stiffest", "softest"):
            raise InputError("extreme pose", value=self.which, allowed="stiffest, softest")
        if self.axes < 8 or self.gammas < 1 or self.starts < 1:
            raise InputError(
                "sample of orientations",
                value=f"{self.axes} axes, {self.gammas} angles, {self.starts} starts",
                allowed="8 axes or more, 1 angle or more, 1 start or more",
            )

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Extreme pose at each point; see :class:`PoseRule`."""
        sign = 1.0 if self.which == "stiffest" else -1.0
        if why_no_closed_form(arm.robot) is not None:
            return refined(arm, best_of_starts(arm, points, sign, self.starts, self.axes), sign, JOINT_STEP).chosen()
        gammas = 1 if arm.last_is_free else self.gammas
        spacing = float(np.sqrt(4.0 * np.pi / self.axes))
        R = spread_rotations(self.axes, gammas)
        sample = best_of_sample(arm, points, R, sign, self.starts, APART * spacing, generator)
        # Islands of few orientations, say with the arm bent over backwards, are found from elsewhere.
        there = np.flatnonzero(np.isfinite(sample.merit).any(axis=1))
        other = best_of_starts(arm, points[there], sign, OTHER_STARTS, self.axes // SHARE_OF_RANDOM)
        return refined(arm, sample.joined(other, there), sign, spacing).chosen()


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
            value=f"{robot.dof} joints",
            allowed="six joints or more: with fewer the tool's orientation at a point cannot be chosen",
            remedy="let it be free (--pose stiffest or softest), or make the map over the joints (--grid joints)",
        )
    why = why_no_closed_form(robot)
    return None if why is None else f"poses are searched for, some may have been missed: {why}"


def shortfall(
    rule: Extreme, arm: Arm, points: Array, generator: np.random.Generator | None = None, *, denser: int = 4
) -> Array:
    """By what share the merit of a rule falls short of one with a ``denser`` sample, (m,); NaN where unreached.

    0 where the rule found as good a pose or a better one.
    """
    dense = Extreme(rule.which, rule.axes * denser, rule.gammas, 2 * rule.starts)
    values = []
    for each in (rule, dense):
        q = each.choose(arm, points, generator).q
        value = np.full(len(q), np.nan)
        reached = np.isfinite(q).all(axis=1)
        value[reached] = arm.merit(q[reached])
        values.append(value)
    with np.errstate(invalid="ignore"):
        ratio = values[1] / values[0] if rule.which == "stiffest" else values[0] / values[1]
    return np.asarray(np.maximum(ratio - 1.0, 0.0))
