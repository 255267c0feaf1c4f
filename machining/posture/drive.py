"""What makes a course of postures one that a robot can drive: joint steps, limits, singularities, clearance.

All costs are pure numbers on one scale: 1 is the mean over the path of what each point's best posture is worth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.posture.courses import Links
from machining.task import ToolPath
from robots import InputError, Robot, require_at_least, singularity_distance
from robots.arrays import Array, Bools, Integers, in_blocks
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

# The unit of motion where neither speed nor jump bounds a joint's step.
FREE_STEP = np.radians(20.0)
# Poses whose frames are made at once: with more of them memory would grow with the path.
BLOCK = 4_096


@dataclass(frozen=True, eq=False)
class Drive:
    """Limits that are kept, and costs that are weighed against the objective.

    A soft cost is ``weight * max(0, 1 - distance / zone)^2`` at each point. Weights and zones of 0 switch it off.

    Attributes
    ----------
    speed : rad/s, one or (dof,), that no joint exceeds between points with a feed; None: not looked at
    jump : rad that no joint exceeds from point to point, feed or not. Between two points the controller moves as it
        likes; what happens there is not looked at, so points must be near enough for their steps to be small
    gamma_step : rad that gamma changes by at most from point to point, counted the short way; 0: a fixed gamma
    motion : weight of ``mean over joints of (step / allowed step)^2`` at each segment
    limit, limit_zone, limit_least : weight, zone and hard limit of the distance (rad) from the nearest joint limit
    singular, singular_zone, singular_least : the same for the distance of :func:`singular_distance`
    clearance, clearance_zone, clearance_least : the same for the distance (m) that ``clearance_of`` gives
    clearance_of : (k, dof) rad -> (k,) m, free space around the arm; None: not looked at. Angles a full turn apart
        count as the same
    clearance_at : the same, told the path points as well: (k, dof) rad, (k,) -> (k,) m, where the base moves along the
        path
    nearest_of : (k, dof) rad -> words: which bodies are in the way in these poses; None: not known
    turn_gain : where the tool axis is constant, gamma is constant too unless turning it along the path makes the
        objective better by more than this share; 0: it is turned for any gain

    Raises
    ------
    InputError
        Negative or not finite figures; steps of zero.
    """

    speed: ArrayLike | None = None
    jump: float = float(np.radians(20.0))
    gamma_step: float = np.inf
    motion: float = 0.3
    limit: float = 0.05
    limit_zone: float = float(np.radians(10.0))
    limit_least: float = 0.0
    singular: float = 0.05
    singular_zone: float = 0.15
    singular_least: float = 1e-3
    clearance: float = 0.1
    clearance_zone: float = 0.05
    clearance_least: float = 0.0
    clearance_of: Callable[[Array], Array] | None = None
    clearance_at: Callable[[Array, Integers], Array] | None = None
    nearest_of: Callable[[Array], str] | None = None
    turn_gain: float = 0.0

    def __post_init__(self) -> None:
        for name in ("motion", "limit", "singular", "clearance"):
            for figure in (name,) if name == "motion" else (name, f"{name}_zone", f"{name}_least"):
                require_at_least(f"path cost {figure}", getattr(self, figure), 0.0, code="G004")
        require_at_least("gain of turning gamma", self.turn_gain, 0.0, code="G004")
        if not self.jump > 0.0:
            raise InputError("jump", code="G004", value=self.jump, allowed="more than 0 rad")
        if not self.gamma_step >= 0.0:
            raise InputError("gamma_step", code="G004", value=self.gamma_step, allowed="0 rad or more")
        if self.speed is not None and not (np.asarray(self.speed, dtype=np.float64) > 0.0).all():
            raise InputError("joint speeds", code="G004", value=self.speed, allowed="more than 0 rad/s")

    def speeds(self, robot: Robot) -> Array:
        """Joint speeds (dof,) rad/s, inf where there is no limit.

        Raises
        ------
        InputError
            Another number of them than joints.
        """
        speed = np.asarray(np.inf if self.speed is None else self.speed, dtype=np.float64)
        if speed.shape not in ((), (robot.dof,)):
            raise InputError(
                "joint speeds", code="G004", value=f"shape {speed.shape}", allowed=f"one, or {robot.dof} in rad/s"
            )
        return np.broadcast_to(speed, (robot.dof,))

    def links(self, robot: Robot, path: ToolPath, free: Bools | None = None) -> Links:
        """Allowed steps of a path's segments and the costs of motion; ``free`` (n - 1,): segments without bounds."""
        if free is not None and free.shape != (path.n - 1,):
            raise InputError("free segments", code="G004", value=f"shape {free.shape}", allowed=f"({path.n - 1},)")
        times = np.where(np.isnan(path.times), np.inf, path.times)
        step = np.minimum(self.speeds(robot) * times[:, None], self.jump)
        unit = np.where(np.isfinite(step), step, FREE_STEP)
        return Links(
            step if free is None else np.where(free[:, None], np.inf, step), self.gamma_step, unit, self.motion
        )

    def near_singular(self, robot: Robot, q: Array) -> tuple[Array, Bools]:
        """Cost (k,) of being near a singularity, and whether the pose is allowed."""
        if self.singular * self.singular_zone == 0.0 and self.singular_least == 0.0:
            return np.zeros(len(q)), np.ones(len(q), dtype=np.bool_)
        distance = singular_distance(robot, q)
        return _soft(distance, self.singular, self.singular_zone), np.asarray(distance >= self.singular_least)

    def near_limits(self, robot: Robot, q: Array) -> tuple[Array, Bools]:
        """Cost (k,) of being near a joint limit, and whether the pose is allowed."""
        distance = limit_distance(robot, q)
        # A pose on a limit is inside to the tolerance of `reachable`, which has been asked before.
        return _soft(distance, self.limit, self.limit_zone), np.asarray(
            (distance >= self.limit_least) | (self.limit_least == 0.0)
        )

    def near_things(self, q: Array, point: Integers | None = None) -> tuple[Array, Bools]:
        """Cost (k,) of small clearance, and whether the pose is allowed; ``point`` (k,): the path points of the poses.

        Raises
        ------
        InputError
            The callback gives another shape, or NaN.
        """
        if len(q) and self.clearance_at is not None and point is not None:
            distance = np.asarray(self.clearance_at(q, point), dtype=np.float64)
        elif len(q) and self.clearance_of is not None:
            distance = np.asarray(self.clearance_of(q), dtype=np.float64)
        else:
            return np.zeros(len(q)), np.ones(len(q), dtype=np.bool_)
        if distance.shape != (len(q),) or np.isnan(distance).any():
            raise InputError(
                "clearance callback",
                code="G004",
                value=f"shape {distance.shape}",
                allowed=f"({len(q)},) m for {len(q)} poses",
            )
        cost = _soft(distance, self.clearance, self.clearance_zone)
        return cost, np.asarray(distance >= self.clearance_least)


def limit_distance(robot: Robot, q: Array) -> Array:
    """Distance (k,) rad of poses q (k, dof) from the nearest limit of a joint or coupling; negative beyond."""
    distance = np.full(len(q), np.inf)
    for angle, (lower, upper) in zip(q.T, robot.limits, strict=True):
        np.minimum(distance, np.minimum(angle - lower, upper - angle), out=distance)
    for c in robot.couplings:
        value = c.offset + q @ c.factors
        np.minimum(distance, np.minimum(value - c.lower, c.upper - value), out=distance)
    return distance


def singular_distance(robot: Robot, q: Array) -> Array:
    """Distance (k,) of poses q (k, dof) rad from the nearest singularity, a pure number, 0 is singular.

    Arms with a spherical wrist: least of the sines of the elbow's and the wrist's angle and of the wrist centre's
    distance from the shoulder singularity over the arm's length. Others: smallest singular value of the Jacobian at
    the flange, lengths over the arm's. The two scales are not the same.
    """
    if len(q) == 0:
        return np.zeros(0)
    # In blocks: the frames of all bodies are some 1 kB a pose.
    return np.concatenate([_singular_distance(robot, q[rows]) for rows in in_blocks(len(q), BLOCK)])


def _singular_distance(robot: Robot, q: Array) -> Array:
    if why_not_spherical(robot) is not None:
        return singularity_distance(robot, q, point=np.zeros(3)).sigma_min
    arm = spherical_wrist_arm(robot)
    shoulder, elbow, wrist = configuration(arm, robot, q)
    away = np.stack([shoulder / arm.length, np.sin(elbow), np.sin(wrist)])
    return np.asarray(np.abs(away).min(axis=0))


@dataclass(frozen=True, eq=False)
class Smoothness:
    """How a course of poses moves.

    ``largest_step`` (dof,) rad between neighbouring points; ``peak_speed`` (dof,) rad/s at the given feeds, NaN
    without; ``undrivable`` segments (numbers of their first points) on which a step is beyond speed or jump;
    ``branch_changes``; ``travel`` rad, the sum of all joint motion; ``gamma_travel`` rad; ``roughness`` rad, root
    mean square of the second difference of the joint angles from point to point; ``limit_distance`` rad and
    ``singular_distance``, the least along the path.
    """

    largest_step: Array
    peak_speed: Array
    undrivable: tuple[int, ...]
    branch_changes: int
    travel: float
    gamma_travel: float
    roughness: float
    limit_distance: float
    singular_distance: float


def smoothness(robot: Robot, path: ToolPath, links: Links, q: Array, gamma: Array, branch: Integers) -> Smoothness:
    """Report how poses q (n, dof) rad along a path move."""
    dq = np.abs(np.diff(q, axis=0))
    timed = np.isfinite(path.times)
    speed = dq[timed] / path.times[timed, None]
    beyond = np.flatnonzero((dq > links.step * (1.0 + 1e-8)).any(axis=1))
    return Smoothness(
        largest_step=dq.max(axis=0, initial=0.0),
        peak_speed=speed.max(axis=0) if timed.any() else np.full(robot.dof, np.nan),
        undrivable=tuple(int(i) for i in beyond),
        branch_changes=int((np.diff(branch) != 0).sum()),
        travel=float(dq.sum()),
        gamma_travel=float(np.abs(np.diff(np.unwrap(gamma))).sum()),
        roughness=float(np.sqrt((np.diff(q, 2, axis=0) ** 2).mean())) if len(q) > 2 else 0.0,
        limit_distance=float(limit_distance(robot, q).min()),
        singular_distance=float(singular_distance(robot, q).min()),
    )


def _soft(distance: Array, weight: float, zone: float) -> Array:
    if weight * zone == 0.0:
        return np.zeros(len(distance))
    return np.asarray(weight * np.maximum(0.0, 1.0 - np.maximum(distance, 0.0) / zone) ** 2)
