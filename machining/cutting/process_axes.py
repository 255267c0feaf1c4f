"""Axes of the cut at each path point: feed, cross-feed, tool axis.

Right-handed: ``cross-feed = tool axis x feed``. Seen from the holder with the feed to the right, cross-feed points up:
these are the axes x, y, z of Altintas, Manufacturing Automation (2nd ed. 2012, chapter 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.task import ALONG, Task, ToolPath
from robots import InputError
from robots.arrays import Array, Bools

# Neighbouring moves that turn by more than this (rad) meet in a corner; below, the path is taken as a curve.
CORNER = np.radians(30.0)


@dataclass(frozen=True, eq=False)
class ProcessAxes:
    """``feed``, ``cross``, ``tool`` (n, 3): unit vectors in base axes; ``corner`` (n,): a corner of the path."""

    feed: Array
    cross: Array
    tool: Array
    corner: Bools

    @property
    def columns(self) -> Array:
        """The axes as columns (n, 3, 3)."""
        return np.stack([self.feed, self.cross, self.tool], axis=2)


def process_axes(task: Task) -> ProcessAxes:
    """Axes of the cut along a path.

    The feed is the path's direction, laid onto the plane across the tool axis. On a curve it is the mean of the two
    moves that meet; at a corner (:data:`CORNER`) that of the move which ends there; at the first point that of the
    move which starts there, at the last of the one which ends there.

    Raises
    ------
    InputError
        A path of one point has no feed; nor has a point where the tool plunges along its axis.
    """
    path, R = task.path, task.T_base_part[:3, :3]
    if path.n < 2:
        raise InputError(
            "feed direction of the path",
            code="K007",
            value="1 point",
            allowed="a path of 2 points or more",
            remedy="give the point before or after, or the force in base or part axes",
        )
    tangent, corner = _tangents(path)
    axis = path.axes
    feed = tangent - np.einsum("ni,ni->n", tangent, axis)[:, None] * axis
    length = np.linalg.norm(feed, axis=1)
    if (length < ALONG).any():
        raise InputError(
            f"feed direction at path point {int(np.argmax(length < ALONG))}",
            code="K007",
            value="along the tool axis",
            allowed="a move across the tool axis",
            remedy="leave plunging moves out, or give the force in base or part axes",
        )
    feed /= length[:, None]
    return ProcessAxes(feed @ R.T, np.cross(axis, feed) @ R.T, axis @ R.T, corner)


def _tangents(path: ToolPath) -> tuple[Array, Bools]:
    """Unit tangents (n, 3) in part axes, and which points are corners."""
    moves = np.diff(path.points, axis=0) / path.lengths[:, None]
    ending, starting = moves[[0, *range(len(moves))]], moves[[*range(len(moves)), -1]]
    corner = np.einsum("ni,ni->n", ending, starting) < np.cos(CORNER)
    tangent = np.where(corner[:, None], ending, ending + starting)
    return tangent / np.linalg.norm(tangent, axis=1, keepdims=True), corner


def weights(path: ToolPath) -> Array:
    """Share (n,) of the path that each point stands for (trapezoidal rule); they add up to 1."""
    if path.n == 1:
        return np.ones(1)
    half = 0.5 * path.lengths
    share = np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])
    return np.asarray(share / share.sum())
