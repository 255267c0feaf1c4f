"""Regions of a regular grid of tool points on a part: where the workpiece is."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError
from robots.arrays import Bools
from surrogate.maps.data import Layout
from surrogate.maps.layouts import own_points

# Share of a step by which a point on the rim of a region may lie outside: rounding.
RIM = 1e-9


def in_box(grid: Layout, lower: ArrayLike, upper: ArrayLike) -> Bools:
    """Points (n,) of a grid in a box along its axes, rim included; m, infinite ends leave a side open.

    Raises
    ------
    InputError
        Ends that do not ascend, or no point of the grid inside.
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    if low.shape != (3,) or high.shape != (3,) or not (low <= high).all():
        raise InputError(
            "box of the workpiece", code="S011", value=f"{low} to {high}", allowed="lower (3,) up to upper (3,), m"
        )
    p = own_points(grid)
    rim = RIM * max(float(np.ptp(axis.values)) for axis in grid.axes) * 1e-3
    return _some(np.asarray(((p >= low - rim) & (p <= high + rim)).all(axis=1)), "box")


def in_polygon(grid: Layout, corners_mm: ArrayLike) -> Bools:
    """Points (n,) of a grid in a polygon, rim included.

    ``corners_mm`` (k, 2) in turn, k at least 3, along the grid's first two axes of x, y and z; along the third, if
    there is one, the region goes through all layers. Where the rim crosses itself the even-odd rule says what is in.

    Raises
    ------
    InputError
        Shape, a corner that is not finite, or no point of the grid inside.
    """
    at = np.asarray(corners_mm, dtype=np.float64)
    if at.ndim != 2 or at.shape[1] != 2 or len(at) < 3 or not np.isfinite(at).all():
        raise InputError(
            "polygon of the workpiece", code="S011", value=f"shape {at.shape}", allowed="finite corners (k, 2), k >= 3"
        )
    # The axes of a layout are z, y, x: its fastest is the first of the polygon's.
    slow, fast = grid.axes[-2:]
    scale = np.array([np.ptp(fast.values) / (len(fast.values) - 1), np.ptp(slow.values) / (len(slow.values) - 1)])
    start = np.array([fast.values[0], slow.values[0]])
    a = (at - start) / scale
    v, u = (index.ravel().astype(np.float64) for index in np.indices(grid.shape[-2:]))
    layer = np.column_stack([u, v])
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
    return _some(np.tile(inside | rim, prod(grid.shape[:-2])), "polygon")


def _some(inside: Bools, what: str) -> Bools:
    if not inside.any():
        raise InputError(
            f"{what} of the workpiece",
            code="S011",
            value="no point of the grid inside",
            remedy="make it larger, or the step finer",
        )
    return inside
