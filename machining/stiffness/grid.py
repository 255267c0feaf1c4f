"""Regular grids of tool points in the part frame, the tasks they make, and regions of them for a workpiece."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from machining.task import Task, tool_path
from robots import InputError
from robots.arrays import Array, Bools

# Smallest step (m) of a grid: nothing in a cell is known to a micrometre.
SMALLEST = 1e-6
# Points of a grid at most; a plane of 1400 x 1400.
MOST = 2_000_000
# Cosine between directions that count as perpendicular, and share by which steps of one axis may differ.
SQUARE = 1e-6
# Share of a step by which a point on the rim of a region may lie outside: rounding.
RIM = 1e-9


@dataclass(frozen=True, eq=False)
class Grid:
    """Regular grid in a plane or in space, part frame.

    ``origin`` (3,) m; ``steps`` (k, 3) m from one point to the next along each axis, perpendicular to each other,
    k 2 or 3; ``counts`` (k,) points along each axis, 2 or more.

    Raises
    ------
    InputError
        Shapes, steps that are not finite, too small or not perpendicular, too few or too many points.
    """

    origin: Array
    steps: Array
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        origin, steps = np.asarray(self.origin, dtype=np.float64), np.asarray(self.steps, dtype=np.float64)
        counts = tuple(int(c) for c in self.counts)
        if origin.shape != (3,) or steps.shape != (len(counts), 3) or len(counts) not in (2, 3):
            raise InputError(
                "grid",
                value=f"origin {origin.shape}, steps {steps.shape}, {len(counts)} counts",
                allowed="origin (3,), steps (k, 3), k counts, k 2 (a plane) or 3 (a box)",
            )
        if not (np.isfinite(origin).all() and np.isfinite(steps).all()):
            raise InputError("grid", allowed="finite numbers")
        length = np.linalg.norm(steps, axis=1)
        if length.min() < SMALLEST:
            raise InputError("step of the grid", value=float(length.min()), allowed=f"{SMALLEST:g} m or more")
        unit = steps / length[:, None]
        if np.abs(unit @ unit.T - np.eye(len(unit))).max() > SQUARE:
            raise InputError("directions of the grid", value=unit.tolist(), allowed="perpendicular to each other")
        if min(counts) < 2 or prod(counts) > MOST:
            raise InputError(
                "points of the grid",
                value=" x ".join(map(str, counts)),
                allowed=f"2 or more each way, {MOST} in all",
                remedy="change the range or the step",
            )
        object.__setattr__(self, "origin", origin)
        object.__setattr__(self, "steps", steps)
        object.__setattr__(self, "counts", counts)

    @property
    def n(self) -> int:
        """Number of points."""
        return prod(self.counts)

    @property
    def points(self) -> Array:
        """Points (n, 3) m, the last axis runs fastest: values (n,) reshape to ``counts``."""
        number = np.indices(self.counts).reshape(len(self.counts), -1)
        return np.asarray(self.origin + number.T @ self.steps)

    def numbers_of(self, points: ArrayLike) -> Array:
        """Where points (k, 3) m lie, counted in steps along each axis, (k, axes)."""
        away = np.asarray(points, dtype=np.float64) - self.origin
        return np.asarray(away @ self.steps.T / (self.steps**2).sum(axis=1))


def plane_grid(
    origin: ArrayLike, along: ArrayLike, across: ArrayLike, step: ArrayLike, counts: tuple[int, int]
) -> Grid:
    """Grid in the plane through ``origin`` (3,) m; directions of any length, ``step`` m, one or two.

    Errors as :class:`Grid`.
    """
    directions = np.stack([np.asarray(along, dtype=np.float64), np.asarray(across, dtype=np.float64)])
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    if not (length > 0.0).all():
        raise InputError("directions of the grid", value=directions.tolist(), allowed="length more than 0")
    size = np.broadcast_to(np.asarray(step, dtype=np.float64), (2,))
    return Grid(np.asarray(origin, dtype=np.float64), directions / length * size[:, None], counts)


def box_grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Grid:
    """Grid along the part's axes from evenly spaced values (m) on each; one of them may be a single number: a plane.

    Raises
    ------
    InputError
        Values that are not evenly spaced and ascending, more than one axis with a single value; else as :class:`Grid`.
    """
    axes = [np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (x, y, z)]
    steps, counts = [], []
    for name, values, unit in zip("xyz", axes, np.eye(3), strict=True):
        if values.ndim != 1 or not np.isfinite(values).all() or len(values) == 0:
            raise InputError(f"{name} of the grid", value=f"shape {values.shape}", allowed="finite numbers (m)")
        if len(values) == 1:
            continue
        gap = np.diff(values)
        if not (gap > 0.0).all() or np.ptp(gap) > SQUARE * gap.mean():
            raise InputError(f"{name} of the grid", allowed="ascending, evenly spaced")
        steps.append(unit * (values[-1] - values[0]) / len(gap))
        counts.append(len(values))
    if len(counts) < 2:
        raise InputError(
            "grid",
            value=" x ".join(str(len(values)) for values in axes),
            allowed="two or more values on at least two of x, y, z",
            remedy="give a range with a step, as in -600:600:25",
        )
    return Grid(np.array([values[0] for values in axes]), np.array(steps), tuple(counts))


def grid_task(
    grid: Grid,
    T_flange_tool: Array,
    T_base_part: Array | None = None,
    *,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    axis: ArrayLike | None = None,
    reference: Array | None = None,
) -> Task:
    """The task of bringing the tool to every point of a grid; it is no path, the order of the points means nothing.

    ``normal`` and tool ``axis`` (3,) in the part frame, the axis along the normal if not given. Else as
    :class:`machining.task.Task`, errors too.
    """
    path = tool_path(grid.points, normal, axis)
    return Task(path, T_flange_tool, np.eye(4) if T_base_part is None else T_base_part, reference)


def in_box(grid: Grid, lower: ArrayLike, upper: ArrayLike) -> Bools:
    """Points (n,) of a grid in a box along the part's axes, rim included; m, infinite ends leave a side open.

    Raises
    ------
    InputError
        Ends that do not ascend, or no point of the grid inside.
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    if low.shape != (3,) or high.shape != (3,) or not (low <= high).all():
        raise InputError("box of the workpiece", value=f"{low} to {high}", allowed="lower (3,) up to upper (3,), m")
    rim = RIM * np.linalg.norm(grid.steps, axis=1).max()
    p = grid.points
    return _some(np.asarray(((p >= low - rim) & (p <= high + rim)).all(axis=1)), "box")


def in_polygon(grid: Grid, corners: ArrayLike) -> Bools:
    """Points (n,) of a grid in a polygon, rim included.

    ``corners`` (k, 3) m in the part frame, in turn, k at least 3. They are laid onto the grid's first two axes; along
    the third, if there is one, the region goes through all layers. Where the rim crosses itself the even-odd rule
    says what is inside.

    Raises
    ------
    InputError
        Shape, a corner that is not finite, or no point of the grid inside.
    """
    at = np.asarray(corners, dtype=np.float64)
    if at.ndim != 2 or at.shape[1] != 3 or len(at) < 3 or not np.isfinite(at).all():
        raise InputError("polygon of the workpiece", value=f"shape {at.shape}", allowed="finite corners (k, 3), k >= 3")
    a = grid.numbers_of(at)[:, :2]
    layer = np.indices(grid.counts[:2]).reshape(2, -1).T.astype(np.float64)
    inside = np.zeros(len(layer), dtype=np.bool_)
    rim = inside.copy()
    for p, r in zip(a, np.roll(a, -1, axis=0), strict=True):
        # A ray along the first axis: it crosses the sides that have one end above it and one not above.
        crosses = (p[1] > layer[:, 1]) != (r[1] > layer[:, 1])
        if crosses.any():
            meets = p[0] + (layer[:, 1] - p[1]) / (r[1] - p[1] or np.inf) * (r[0] - p[0])
            inside ^= crosses & (layer[:, 0] < meets)
        side = r - p
        share = np.clip((layer - p) @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
        rim |= np.linalg.norm(layer - p - share[:, None] * side, axis=1) <= RIM
    return _some(np.repeat(inside | rim, prod(grid.counts[2:])), "polygon")


def nearest_to(grid: Grid, points: ArrayLike) -> Bools:
    """Points (n,) of a grid that are the nearest to points (k, 3) m of the workpiece, part frame.

    Raises
    ------
    InputError
        Shape, or a point more than half a step off the grid.
    """
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or len(p) == 0 or not np.isfinite(p).all():
        raise InputError("points of the workpiece", value=f"shape {p.shape}", allowed="finite, (k, 3) m, k at least 1")
    number = np.round(grid.numbers_of(p)).astype(np.int64)
    near = np.clip(number, 0, np.array(grid.counts) - 1)
    off = np.linalg.norm(grid.origin + near @ grid.steps - p, axis=1)
    far = off > 0.5 * np.linalg.norm(np.linalg.norm(grid.steps, axis=1)) * (1.0 + RIM)
    if far.any():
        first = int(np.argmax(far))
        raise InputError(
            f"workpiece point {first}",
            value=f"{1e3 * off[first]:.4g} mm from the grid",
            allowed="at most half a cell",
            remedy="make the grid cover the workpiece",
        )
    found = np.zeros(grid.counts, dtype=np.bool_)
    found[tuple(near.T)] = True
    return found.ravel()


def _some(inside: Bools, what: str) -> Bools:
    if not inside.any():
        raise InputError(
            f"{what} of the workpiece", value="no point of the grid inside", remedy="make it larger, or the step finer"
        )
    return inside
