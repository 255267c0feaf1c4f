"""The planes that a map's points lie in: plane coordinates of points and cells, and how the plane is seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robots.arrays import Array, Indices
from surrogate.maps.data import Layout, MapData

# Values along an axis that a picture can show; of more, every k-th is drawn.
MOST_VALUES: Final = 600
_UNIT: Final = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


@dataclass(frozen=True, eq=False)
class Plane:
    """One plane of a map, drawn in two plane coordinates in mm.

    Parameters
    ----------
    rows : (a, b) numbers of the map's points in it
    centres : (a, b) and (a, b), mm: across and up of the points
    corners : (a + 1, b + 1) twice, mm: those of the cells around the points
    labels : of the axes
    right, up : (3,) unit vectors of the plane coordinates in the base frame
    where : the plane in words, as in 'y = 0 mm'
    at : where along the axis that it cuts, in that axis' unit
    closed : the first index runs all the way round, so that its last row borders on its first
    """

    rows: Indices
    centres: tuple[Array, Array]
    corners: tuple[Array, Array]
    labels: tuple[str, str]
    right: Array
    up: Array
    where: str
    at: float = 0.0
    closed: bool = False

    def flat(self, points: Array) -> Array:
        """Base frame (..., 3) to plane coordinates (..., 2), in the unit of the points."""
        return np.asarray(points @ np.stack([self.right, self.up], axis=1))


def planes_of(data: MapData, most: int = 9) -> list[Plane]:
    """The planes to draw: the slice itself, or up to ``most`` of a box or a cylinder that hold reached points.

    Boxes are cut across the axis with the fewest values, cylinders across phi (across z if they have one z). The planes
    are spread evenly over those that are reached anywhere. Joint sweeps have no planes.
    """
    layout = data.layout
    if layout.kind == "joints":
        return []
    grid = np.arange(layout.n).reshape(layout.shape)
    if layout.kind == "slice":
        return [_cartesian(layout, grid, 0, 1)]
    across = _across(layout)
    anywhere = np.moveaxis(np.asarray(data.reached).reshape(layout.shape), across, 0)
    some = np.flatnonzero(anywhere.reshape(len(anywhere), -1).any(axis=1))
    # Around the axis sections tend to be alike.
    most = min(most, 4) if layout.axes[across].name == "phi" else most
    if len(some) > most:
        # Not at the very ends, where hardly anything is reached.
        some = some[np.round((np.arange(most) + 0.5) / most * len(some) - 0.5).astype(int)]
    others = [i for i in range(3) if i != across]
    return [_at(layout, grid, across, int(k), others) for k in some]


def layer_of(layout: Layout, k: int) -> Plane:
    """Plane number k of a box along z; of a slice the slice itself."""
    grid = np.arange(layout.n).reshape(layout.shape)
    return _cartesian(layout, grid, 0, 1) if layout.kind == "slice" else _at(layout, grid, 0, k, [1, 2])


def _across(layout: Layout) -> int:
    """Cylinders are cut along r and z, which tells most, unless one of these has a single value."""
    if layout.kind == "cylinder":
        return 0 if layout.shape[0] == 1 else 1
    return min(range(3), key=lambda i: layout.shape[i])


def _at(layout: Layout, grid: Indices, across: int, k: int, others: list[int]) -> Plane:
    rows = np.take(grid, k, axis=across)
    axis = layout.axes[across]
    where = f"{axis.name} = {axis.values[k]:g} {axis.unit}".replace("-", "−")
    if layout.kind == "box":
        return replace(_cartesian(layout, rows, others[0], others[1], where), at=float(axis.values[k]))
    first, second = layout.axes[others[0]], layout.axes[others[1]]
    a, b = _thinned(first.values), _thinned(second.values)
    rows = rows[a][:, b]
    if axis.name == "phi":
        phi = np.radians(axis.values[k])
        right = np.array([np.cos(phi), np.sin(phi), 0.0])
        r, z = np.meshgrid(second.values[b], first.values[a])
        corners = np.meshgrid(np.maximum(edges(second.values[b]), 0.0), edges(first.values[a]))
        at = float(axis.values[k])
        return Plane(rows, (r, z), (corners[0], corners[1]), ("r (mm)", "z (mm)"), right, _UNIT["z"], where, at)
    phi, r = np.radians(first.values[a]), second.values[b]
    phi_edges, r_edges = edges(phi), np.maximum(edges(r), 0.0)
    return Plane(
        rows,
        (r * np.cos(phi)[:, None], r * np.sin(phi)[:, None]),
        (r_edges * np.cos(phi_edges)[:, None], r_edges * np.sin(phi_edges)[:, None]),
        ("x (mm)", "y (mm)"),
        _UNIT["x"],
        _UNIT["y"],
        where,
        float(axis.values[k]),
        first.full_turn and len(a) == len(first.values),
    )


def _cartesian(layout: Layout, rows: Indices, i: int, j: int, where: str | None = None) -> Plane:
    up, right = layout.axes[i], layout.axes[j]
    if where is None:
        ((normal, held),) = layout.held.items()
        where = f"{normal} = {held:.6g} mm".replace("-", "−")
    a, b = _thinned(up.values), _thinned(right.values)
    across, height = np.meshgrid(right.values[b], up.values[a])
    corners = np.meshgrid(edges(right.values[b], _step(up.values[a])), edges(up.values[a], _step(right.values[b])))
    labels = f"{right.name} (mm)", f"{up.name} (mm)"
    return Plane(
        rows[a][:, b], (across, height), (corners[0], corners[1]), labels, _UNIT[right.name], _UNIT[up.name], where
    )


def _step(values: Array) -> float:
    """Width (mm) of a cell across a line of points: that between them; of a single point that of a hand."""
    return float(np.diff(values).mean()) if len(values) > 1 else 100.0


def _thinned(values: Array) -> Indices:
    return np.arange(0, len(values), -(-len(values) // MOST_VALUES))


def edges(values: Array, width: float = 1.0) -> Array:
    """Borders (n + 1,) of cells around n ascending values; a single value gets a cell of this width."""
    if len(values) == 1:
        return np.array([values[0] - 0.5 * width, values[0] + 0.5 * width])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[1.5 * values[0] - 0.5 * values[1]], middle, [1.5 * values[-1] - 0.5 * values[-2]]])
