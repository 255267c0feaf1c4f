"""Where an arm must not be, and its load must not hang: below the floor, in its own base, in fixtures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots import Robot, forward_kinematics, tool_position
from robots.arrays import Array, Bools
from robots.kinematics import BodyFrames

# Between two joints the arm is looked at in so many points.
ALONG = 5
# Weights and the hook that they hang from take so much room below the point that is loaded, m.
HANG = 0.3


@dataclass(frozen=True)
class Zone:
    """Where the arm must not be: below ``floor`` (m, base z; None: no floor) and inside ``boxes`` (b, 2, 3) m.

    ``own`` (m): how far wrist and tool (from the last but one joint on) keep from the line base - joint 2 - joint 3;
    arms of fewer than five joints are not tested for it. All is tested on the line through the joints to the tool,
    in points: keep boxes larger than the links are thick. No collision check: cables, fixtures and the shape of the
    casings are not known here.
    """

    floor: float | None = None
    boxes: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = ()
    own: float = 0.0

    def free(self, robot: Robot, q: Array) -> Bools:
        """Which poses q (n, dof) keep clear of it (n,)."""
        frames = forward_kinematics(robot, q)
        joints = [*np.moveaxis(frames.p[:, 1:], 1, 0), frames.p_flange, tool_position(robot, frames)]
        points = _between(np.stack(joints, axis=1))
        # The joints before the arm leaves the base stand where they stand.
        moving = points[:, ALONG:] if robot.dof > 1 else points
        out = self._above(moving) & self._outside(points)
        end = points[:, -2 * ALONG :] if robot.dof < 6 else points[:, -3 * ALONG :]
        return np.asarray(out & self._off_own(frames, end))

    def hangs_free(self, robot: Robot, q: Array, point: Array | None = None, room: float = HANG) -> Bools:
        """Where (n,) a load hung from the arm in poses q (n, dof) has ``room`` (m) below it, clear of all this.

        ``point``: (3,) m in the flange frame; None: the tool point.
        """
        frames = forward_kinematics(robot, q)
        top = tool_position(robot, frames, point)
        points = _between(np.stack([top, top - [0.0, 0.0, room]], axis=1))
        return np.asarray(self._above(points) & self._outside(points) & self._off_own(frames, points))

    def _above(self, points: Array) -> Bools:
        """Whether points (n, m, 3) are above the floor (n,)."""
        if self.floor is None:
            return np.ones(len(points), dtype=np.bool_)
        return np.asarray((points[:, :, 2] >= self.floor).all(axis=1))

    def _outside(self, points: Array) -> Bools:
        """Whether points (n, m, 3) are outside of all boxes (n,)."""
        out = np.ones(len(points), dtype=np.bool_)
        for low, high in self.boxes:
            out &= ~np.any(np.all((points >= np.array(low)) & (points <= np.array(high)), axis=2), axis=1)
        return out

    def _off_own(self, frames: BodyFrames, points: Array) -> Bools:
        """Whether points (n, m, 3) keep off base and upper arm (n,)."""
        out = np.ones(len(points), dtype=np.bool_)
        if self.own > 0.0 and frames.p.shape[1] > 5:
            for k in range(3):
                out &= (_distance(points, frames.p[:, k], frames.p[:, k + 1]) >= self.own).all(axis=1)
        return out


def _between(line: Array) -> Array:
    """Points (n, m, 3) along a line through points (n, k, 3)."""
    share = np.linspace(0.0, 1.0, ALONG)[:, None]
    return np.asarray((line[:, :-1, None] * (1.0 - share) + line[:, 1:, None] * share).reshape(len(line), -1, 3))


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Distance (n, m) of points (n, m, 3) from the segments start (n, 3) to end (n, 3)."""
    way = (end - start)[:, None]
    off = points - start[:, None]
    length = np.maximum(np.sum(way**2, axis=2), 1e-30)
    share = np.clip(np.sum(off * way, axis=2) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - share[..., None] * way, axis=2))
