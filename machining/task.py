"""The machining task: a tool on the flange, a part in the cell, and the path that the tool follows on it.

The **tool axis** at a path point leads from the tip into the holder. The tool frame's z axis leads out of the holder
through the tip, so it is minus the tool axis. The angle **gamma** about the tool axis is what milling leaves free.
Right-handed about the tool axis; at gamma = 0 the tool frame's x axis is the reference direction, laid onto the plane
across the tool axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.inputs import as_frame, as_units
from machining.magnitudes import FARTHEST, FEEDS, feeds
from robots import InputError, InputErrors
from robots.arrays import Array, Integers
from robots.frames import by_frame, framed

# Turning the tool by a radian counts as much as moving by this many m when points are spread.
LEVER = 0.5
# Neighbouring points nearer than this (m, and tool axes nearer than this in rad) are one point.
REPEATED = 1e-9
# Sine of the angle between reference direction and tool axis below which gamma = 0 is not defined well.
ALONG = 1e-3
# Cosine of the angle between tool axis and reference direction above which another direction is taken by default.
NEAR = 0.966


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Path of n points in the part frame.

    ``points`` (n, 3) m; ``normals`` (n, 3) of the surface, out of the part; ``axes`` (n, 3) tool axis from the tip
    into the holder; both are made unit vectors. ``feed`` (n,) m/s of the move that ends at the point, NaN where it
    is not given; that of the first point is not used.

    Raises
    ------
    InputError
        Shapes, no point, values that are not finite, directions of length zero, a feed that is not positive.
    InputErrors
        Points that repeat the one before, tool axis and all; all of them.
    """

    points: Array
    normals: Array
    axes: Array
    feed: Array

    def __post_init__(self) -> None:
        points = np.asarray(self.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not (np.abs(points) <= FARTHEST).all():
            allowed = f"numbers (n, 3) of at most {FARTHEST:g} m, n at least 1"
            raise InputError("path points", code="P009", value=f"shape {points.shape}", allowed=allowed)
        n = len(points)
        feed = np.asarray(self.feed, dtype=np.float64)
        if feed.shape != (n,) or not feeds(feed).all():
            raise InputError("feed", code="P009", allowed=f"({n},) m/s, {FEEDS}, NaN where it is not given")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "normals", as_units("surface normal of the path", self.normals, n))
        object.__setattr__(self, "axes", as_units("tool axis of the path", self.axes, n))
        object.__setattr__(self, "feed", feed)
        turned = np.linalg.norm(np.diff(self.axes, axis=0), axis=1)
        repeated = np.flatnonzero((self.lengths < REPEATED) & (turned < REPEATED)) + 1
        if len(repeated):
            allowed, remedy = "neighbouring points at different places", "remove one of the two"
            raise InputErrors(
                "path",
                [
                    InputError(f"point {i} repeats point {i - 1}", code="P009", allowed=allowed, remedy=remedy)
                    for i in repeated
                ],
            )

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def lengths(self) -> Array:
        """Length (n - 1,) m of each segment."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @property
    def arc_length(self) -> Array:
        """Length (n,) m of the path up to each point."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    def even_rows(self, count: int) -> Integers:
        """About ``count`` points, evenly along the path, its ends among them; turns of the tool count as length."""
        if count >= self.n:
            return np.arange(self.n)
        turn = np.linalg.norm(np.diff(self.axes, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(self.lengths + LEVER * turn)])
        even = np.searchsorted(way, np.linspace(0.0, way[-1], max(2, count)))
        return np.unique(np.clip(np.concatenate([[0, self.n - 1], even]), 0, self.n - 1)).astype(np.int64)

    @property
    def times(self) -> Array:
        """Time (n - 1,) s of each segment at its feed; NaN without one, and where only the tool turns."""
        return np.where(self.lengths < REPEATED, np.nan, self.lengths / self.feed[1:])


def tool_path(
    points: ArrayLike, normals: ArrayLike, axes: ArrayLike | None = None, feed: ArrayLike | None = None
) -> ToolPath:
    """Make a :class:`ToolPath`; normals and axes may be one vector for all, feed one number (m/s) or None.

    Without ``axes`` the tool stands along the normals. Errors as :class:`ToolPath`.
    """
    p = np.asarray(points, dtype=np.float64)
    n = len(p) if p.ndim == 2 else 0
    normal = np.asarray(normals, dtype=np.float64)
    speed = np.full(n, np.nan) if feed is None else np.broadcast_to(np.asarray(feed, dtype=np.float64), (n,))
    return ToolPath(p, normal, normal if axes is None else np.asarray(axes, dtype=np.float64), speed)


@dataclass(frozen=True, eq=False)
class Task:
    """A path, where its part stands, and the tool.

    ``T_flange_tool`` (4, 4): tool frame on the flange, origin at the tip, m; (n, 4, 4) where tools are changed along
    the path. ``T_base_part`` (4, 4) m. ``reference`` (3,): direction in the part frame that gamma counts from; None: x,
    unless the tool axis comes within some 15 deg of it anywhere on the path, then y, then z. ``shift`` (n, 3) m, base
    axes: how far the part is moved from ``T_base_part`` at each point, for a robot on linear axes; None: it stands
    still.

    Raises
    ------
    InputError
        A frame that is not rigid, a reference direction along the tool axis of some point, or a shift of another
        shape.
    """

    path: ToolPath
    T_flange_tool: Array
    T_base_part: Array
    reference: Array | None = None
    shift: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_part", as_frame("T_base_part", self.T_base_part))
        if np.ndim(self.T_flange_tool) == 3:
            if len(self.T_flange_tool) != self.path.n:
                value, allowed = f"{len(self.T_flange_tool)} frames", f"one, or {self.path.n}: one a path point"
                raise InputError("T_flange_tool", code="P009", value=value, allowed=allowed)
            for _, T in by_frame(self.T_flange_tool, self.path.n):
                as_frame("T_flange_tool", T)
        else:
            object.__setattr__(self, "T_flange_tool", as_frame("T_flange_tool", self.T_flange_tool))
        chosen = _usual_axis(self.path.axes) if self.reference is None else self.reference
        reference = as_units("reference direction of gamma", chosen, 1)[0]
        sine = np.linalg.norm(np.cross(self.path.axes, reference), axis=1)
        if (sine < ALONG).any():
            raise InputError(
                f"reference direction of gamma at path point {int(np.argmax(sine < ALONG))}",
                code="P009",
                value=reference.tolist(),
                allowed="not along the tool axis",
                remedy="give another reference, or split the path",
            )
        object.__setattr__(self, "reference", reference)
        if self.shift is not None and (self.shift.shape != (self.path.n, 3) or not np.isfinite(self.shift).all()):
            raise InputError(
                "shift of the part", code="P009", value=f"shape {self.shift.shape}", allowed=f"({self.path.n}, 3) m"
            )

    def at(self, rows: slice | Integers, feed: Array | None = None) -> Task:
        """The same task at some of its points; gamma counts from the same direction.

        ``feed`` (k,) m/s of the moves between them; by default the points' own.
        """
        p = self.path
        path = ToolPath(p.points[rows], p.normals[rows], p.axes[rows], p.feed[rows] if feed is None else feed)
        shift = None if self.shift is None else self.shift[rows]
        return Task(path, self.tool_at(rows), self.T_base_part, self.reference, shift)

    def tool_at(self, rows: slice | Integers) -> Array:
        """Tool frames on the flange at some points: (4, 4) if all have one, else (k, 4, 4) m."""
        return self.T_flange_tool if self.T_flange_tool.ndim == 2 else self.T_flange_tool[rows]

    def tip_at(self, rows: slice | Integers) -> Array:
        """Tool points in the flange frame at some points: (3,) if all have one, else (k, 3) m."""
        return np.asarray(self.tool_at(rows)[..., :3, 3])

    @property
    def targets(self) -> Array:
        """Path points (n, 3) m in the base frame."""
        points = self.path.points @ self.T_base_part[:3, :3].T + self.T_base_part[:3, 3]
        return np.asarray(points if self.shift is None else points + self.shift)

    @property
    def axes(self) -> Array:
        """Tool axes (n, 3) in base axes."""
        return np.asarray(self.path.axes @ self.T_base_part[:3, :3].T)

    @property
    def tip(self) -> Array:
        """Tool point (3,) m in the flange frame, or (n, 3) where tools are changed."""
        return np.asarray(self.T_flange_tool[..., :3, 3])

    @property
    def normals(self) -> Array:
        """Surface normals (n, 3) in base axes."""
        return np.asarray(self.path.normals @ self.T_base_part[:3, :3].T)

    def tool_frames(self, gamma: ArrayLike) -> Array:
        """Frames (n, m, 4, 4) of the tool in the base frame for gamma (m,) or (n, m) rad.

        Raises
        ------
        InputError
            Shape, or angles that are not finite.
        """
        reference = self.T_base_part[:3, :3] @ np.asarray(self.reference)
        return tool_frames(self.targets, self.axes, reference, as_gammas(gamma, self.path.n))


def tool_frames(points: Array, axes: Array, reference: Array, gamma: Array) -> Array:
    """Frames (n, m, 4, 4) of a tool at points (n, 3) m with tool axes (n, 3), at angles gamma (n, m) rad.

    Gamma counts from ``reference`` (3,), which is along none of the axes; all in one frame.
    """
    x0 = across(axes, reference)
    x0 /= np.linalg.norm(x0, axis=1, keepdims=True)
    x = np.cos(gamma)[..., None] * x0[:, None] + np.sin(gamma)[..., None] * np.cross(axes, x0)[:, None]
    z = np.broadcast_to(-axes[:, None], x.shape)
    return framed(np.stack([x, np.cross(z, x), z], axis=-1), points[:, None])


def across(axes: Array, reference: Array) -> Array:
    """The reference direction (3,) laid onto the planes across tool axes (n, 3), not made long."""
    return np.asarray(reference - (axes @ reference)[:, None] * axes)


def as_gammas(gamma: ArrayLike, n: int) -> Array:
    """Angles (n, m) rad from (m,) or (n, m).

    Raises
    ------
    InputError
        Another shape, none at all, or angles that are not finite.
    """
    angle = np.asarray(gamma, dtype=np.float64)
    fits = (angle.ndim == 1 or (angle.ndim == 2 and len(angle) == n)) and angle.shape[-1] > 0
    if not fits or not np.isfinite(angle).all():
        raise InputError(
            "gamma", code="P009", value=f"shape {angle.shape}", allowed=f"finite, (m,) or ({n}, m) rad, m at least 1"
        )
    return np.broadcast_to(angle, (n, angle.shape[-1]))


def _usual_axis(axes: Array) -> Array:
    """X of the part, unless the tool comes near it anywhere; then y, then z: points more or less seldom change that."""
    near = np.abs(axes).max(axis=0)
    free = np.flatnonzero(near < NEAR)
    # Rounded, so that axes equally near fall to the first by name, not by the last digit.
    return np.asarray(np.eye(3)[int(free[0]) if len(free) else int(np.argmin(near.round(9)))])
