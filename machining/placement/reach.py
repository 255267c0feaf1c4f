"""How far out of reach a path is: the distance that lacks at each point, and what to say where no position does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.placement.problem import Problem
from machining.placement.sweeping import Sites, beyond_limits
from machining.toolpaths.path_error import PathError
from robots.arrays import Array, Bools
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

# A joint that is a radian beyond its limit counts as much as this many m out of reach.
LEVER = 1.0


@dataclass(frozen=True)
class Shortfall:
    """What lacks at a position: ``distance`` m of reach or ``angle`` rad of a joint, at path point ``point``."""

    distance: float
    angle: float
    point: int

    @property
    def words(self) -> str:
        """In words."""
        if np.isinf(self.distance):
            return f"point {self.point} is out of reach"
        if self.distance > 0.0:
            return f"point {self.point} is {self.distance * 1e3:.3g} mm out of reach"
        return f"point {self.point} needs a joint {np.degrees(self.angle):.3g} deg beyond its limit"


def wrist_lack(problem: Problem, sites: Sites) -> Array:
    """Distance (p, g, m) m by which the wrist centre is out of reach, 0 within; joint limits are not looked at.

    Exact for arms with a spherical wrist: from the annulus about axis 2 and the lateral offset of axis 1. For others
    inf where no posture was found.
    """
    p, g, _, m = sites.valid.shape
    robot = problem.model.robot
    if why_not_spherical(robot) is not None:
        reached: Bools = np.any(np.isfinite(sites.q).all(axis=-1), axis=2)
        return np.where(reached, 0.0, np.inf)
    arm = spherical_wrist_arm(robot)
    lack = np.zeros((p, g, m))
    for i in range(p):
        frames = problem.task_at(sites.e[i], float(sites.table[i])).at(sites.rows).tool_frames(sites.gamma[i])
        flange = frames @ np.linalg.inv(problem.cell.tool.T_flange_tool)
        centre = flange[..., :3, 3] + flange[..., :3, :3] @ arm.wrist.centre_flange
        x, y, z = np.moveaxis((centre - arm.p1) @ arm.B1, -1, 0)
        radius, across = np.hypot(x, y), (arm.along_2 - arm.cos12 * z) / arm.sin12
        shoulder = np.maximum(np.abs(across) - radius, 0.0)
        swing = 2.0 * np.arctan2(np.sqrt(np.maximum(radius - across, 0.0)), np.sqrt(np.maximum(radius + across, 0.0)))
        best = np.full(radius.shape, np.inf)
        for side in (arm.front, -arm.front):
            q1 = np.arctan2(y, x) - side * swing
            place = np.stack([np.cos(q1) * x + np.sin(q1) * y, np.cos(q1) * y - np.sin(q1) * x, z], axis=-1)
            seen = (place @ arm.R_21.T)[..., :2] - arm.t_21[:2]
            distance = np.hypot(seen[..., 0], seen[..., 1])
            ring = np.maximum(distance - arm.upper - arm.fore, abs(arm.upper - arm.fore) - distance)
            best = np.minimum(best, np.maximum(ring, 0.0) + shoulder)
        lack[i] = best.T
    return lack


def lacks(problem: Problem, sites: Sites) -> tuple[Array, Array, Array]:
    """Lack (p, g, b, m) in m, angles at :data:`LEVER`, and its two parts: distance m and angle rad.

    0 is a posture that can be taken. A posture the wrist of which is within reach, but which was not found, lacks what
    cannot be told: inf.
    """
    angle = beyond_limits(problem, sites)
    distance = np.broadcast_to(wrist_lack(problem, sites)[:, :, None], angle.shape)
    reached = np.isfinite(angle)
    apart = np.where(reached, 0.0, np.where(distance > 0.0, distance, np.inf))
    angle = np.where(reached, angle, 0.0)
    return apart + LEVER * angle + np.where(reached, 0.0, LEVER * np.pi), apart, angle


def shortfalls(problem: Problem, sites: Sites) -> tuple[Array, list[Shortfall]]:
    """Least lack (p,) over angles and branches of the worst point of the path, and where and what it is."""
    total, distance, angle = lacks(problem, sites)
    worst = total.max(axis=3)
    found = []
    for i in range(len(sites.e)):
        g, b = np.unravel_index(int(np.argmin(worst[i])), worst[i].shape)
        point = int(np.argmax(total[i, g, b]))
        found.append(Shortfall(float(distance[i, g, b, point]), float(angle[i, g, b, point]), int(sites.rows[point])))
    return worst.reshape(len(sites.e), -1).min(axis=1), found


def unreachable(problem: Problem, x: Array, lacking: Shortfall, *, pieces: str = "") -> PathError:
    """The path cannot be driven from any base position; x (d,) is the one that lacks least."""
    return PathError(
        lacking.point,
        f"no base position reaches the whole path{pieces}",
        value=f"nearest at {problem.space.words(x)}, where {lacking.words}",
        allowed="every point within reach and joint limits at one angle gamma and one branch",
        remedy="widen the ranges of the axes or of gamma, cut the path into more pieces (steps), let the axes move "
        "along the path (moving), or move the part",
    )


def check_reached(problem: Problem, sites: Sites, pieces: str) -> None:
    """Raise PathError, which is an InputError, where none of the positions reaches some point of the path."""
    lost = np.flatnonzero(~sites.valid.any(axis=(0, 1, 2)))
    if len(lost):
        lack, short = shortfalls(problem, sites.at_points(lost))
        at = int(np.argmin(lack))
        x = problem.space.coordinates(sites.e[at], float(sites.table[at]))
        raise unreachable(problem, x, short[at], pieces=pieces)
