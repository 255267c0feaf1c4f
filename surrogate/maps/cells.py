"""Cells between neighbouring reached points of a layout: hexahedra, quads or lines, formed block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

import numpy as np

from robots.arrays import Array, Bools, Integers
from robots.errors import InputError
from surrogate.maps.columns import row_blocks
from surrogate.maps.data import Layout

VTK_VERTEX = 1
# Corners of a cell as index steps (fastest axis first), in VTK's order, and VTK's number of the kind, by dimension.
_QUAD = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
_CORNERS = {
    0: np.zeros((1, 0), dtype=np.int64),
    1: np.array([[0], [1]]),
    2: _QUAD,
    3: np.array([[i, j, k] for k in (0, 1) for i, j in _QUAD]),
}
_HEXAHEDRON = 12
_KINDS = {0: VTK_VERTEX, 1: 3, 2: 9, 3: _HEXAHEDRON}
# Most axes that span one cell; those before them in a sweep of joints are layers.
_MOST_AXES = 3


@dataclass(frozen=True, eq=False)
class CellGrid:
    """The cells of a map with all corners reached, and the reached points outside of them.

    Parameters
    ----------
    layout : n points
    axes : numbers of the axes along which neighbours are connected, fastest first
    closed : of these, whether the last value is a neighbour of the first
    first : (n,) whether a cell starts at the point (has there its corner of lowest index)
    loose : (n,) whether the point is reached and in no cell
    """

    layout: Layout
    axes: tuple[int, ...]
    closed: tuple[bool, ...]
    first: Bools
    loose: Bools

    @property
    def kind(self) -> int:
        """VTK's number of the kind of cell: 12 hexahedra, 9 quads, 3 lines, 1 vertices."""
        return _KINDS[len(self.axes)]

    @property
    def corners(self) -> int:
        """Corners of a cell."""
        return len(_CORNERS[len(self.axes)])

    def blocks(self, points: Array) -> Iterator[Integers]:
        """Cells (m, corners) block by block, as numbers of points of the layout, hexahedra turned right-handed."""
        strides = np.cumprod((1, *self.layout.shape[:0:-1]))[::-1]
        for rows in row_blocks(self.layout.n):
            start = np.flatnonzero(self.first[rows]) + rows.start
            cells = np.repeat(start[:, None], self.corners, axis=1)
            for column, (axis, closed) in enumerate(zip(self.axes, self.closed, strict=True)):
                jump = np.full(len(start), strides[axis])
                if closed:
                    count = self.layout.shape[axis]
                    jump[start // strides[axis] % count == count - 1] -= count * strides[axis]
                cells += jump[:, None] * _CORNERS[len(self.axes)][:, column]
            yield self._turned(cells, points) if self.kind == _HEXAHEDRON else cells

    def _turned(self, cells: Integers, points: Array) -> Integers:
        """Hexahedra with upper and lower face exchanged where they are left-handed."""
        if self.layout.kind == "joints":  # how a sweep is bent into space differs from place to place
            left = _volumes(cells, points) < 0.0
        else:  # x, y, z and r, phi, z are right-handed as long as they rise
            ends = (self.layout.axes[axis].values[[0, -1]] for axis in self.axes)
            left = np.full(len(cells), prod(last - first for first, last in ends) < 0.0)
        return np.where(left[:, None], np.roll(cells, 4, axis=1), cells) if left.any() else cells


def cell_grid(layout: Layout, reached: Bools) -> CellGrid:
    """Which cells a layout has.

    Axes of one value are left out: a box of one layer has quads. In a sweep of joints at most the last three axes
    span cells; there are none between layers. A cylinder is closed over a full turn. Needs a few bytes a point.

    Raises
    ------
    InputError
        A layout of space has more than three axes.
    """
    if len(layout.axes) > _MOST_AXES and layout.kind != "joints":
        raise InputError(f"map layout {layout.kind}", code="S011", value=f"{len(layout.axes)} axes", allowed="1 to 3")
    spanning = range(max(layout.layers, len(layout.axes) - _MOST_AXES), len(layout.axes))
    axes = tuple(a for a in reversed(spanning) if layout.shape[a] > 1)
    closed = tuple(layout.kind == "cylinder" and layout.axes[axis].full_turn for axis in axes)
    first = np.array(reached, dtype=np.bool_).reshape(layout.shape)
    if not axes:  # a single point, or layers of single points
        return CellGrid(layout, (), (), np.zeros(layout.n, dtype=np.bool_), first.ravel())
    for axis, turn in zip(axes, closed, strict=True):
        first &= np.roll(first, -1, axis)
        if not turn:
            np.moveaxis(first, axis, 0)[-1] = False
    used = first.copy()
    for axis in axes:
        used |= np.roll(used, 1, axis)
    return CellGrid(layout, axes, closed, first.ravel(), np.asarray(reached) & ~used.ravel())


def _volumes(cells: Integers, points: Array) -> Array:
    """Signed volumes (m,) that the mean edges of hexahedra span, times 64."""
    corner = np.asarray(points[cells.ravel()], dtype=np.float64).reshape(-1, 8, 3)
    along = corner[:, [1, 2, 5, 6]].sum(1) - corner[:, [0, 3, 4, 7]].sum(1)
    across = corner[:, [2, 3, 6, 7]].sum(1) - corner[:, [0, 1, 4, 5]].sum(1)
    up = corner[:, 4:].sum(1) - corner[:, :4].sum(1)
    return np.asarray(np.einsum("ij,ij->i", np.cross(along, across), up))
