"""Where a robot's base may stand: the ranges of its linear axes, and of the turntable that carries the part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from machining.cell import Cell
from robots import InputError
from robots.arrays import Array

# Travels and angles that lie outside by less are rounded onto the limit (m, rad).
ROUNDING = 1e-9
# From SI to the units that a user reads.
SHOWN = {"mm": 1e3, "deg": float(np.degrees(1.0))}


@dataclass(frozen=True, eq=False)
class Space:
    """Base positions that are looked at; made by :func:`space_of`.

    ``free`` (d - 1 or d,): numbers of the linear axes that are searched; ``lower``, ``upper`` (d,): their ranges in m,
    the turntable's in rad last if ``turns``. ``rest`` (k,) m: where the other linear axes stand; ``table`` rad: the
    turntable where it is not searched.
    """

    cell: Cell
    free: tuple[int, ...]
    lower: Array
    upper: Array
    rest: Array
    table: float
    turns: bool

    @property
    def d(self) -> int:
        """Number of coordinates searched."""
        return len(self.lower)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates searched."""
        axes = tuple(self.cell.linear_axes[i].name for i in self.free)
        return (*axes, "turntable") if self.turns else axes

    @property
    def units(self) -> tuple[str, ...]:
        """``mm`` or ``deg`` of each coordinate."""
        return ("mm",) * len(self.free) + (("deg",) if self.turns else ())

    @property
    def shown(self) -> Array:
        """Factors (d,) from SI to :attr:`units`."""
        return np.array([SHOWN[unit] for unit in self.units])

    def sites(self, x: ArrayLike) -> tuple[Array, Array]:
        """Travels (p, k) m of all linear axes and angles (p,) rad of the turntable at coordinates x (p, d)."""
        x = np.asarray(x, dtype=np.float64)
        e = np.tile(self.rest, (len(x), 1))
        e[:, list(self.free)] = x[:, : len(self.free)]
        return e, x[:, -1].copy() if self.turns else np.full(len(x), self.table)

    def coordinates(self, e: ArrayLike, table: float = 0.0) -> Array:
        """Coordinates (d,) of travels e (k,) m and a turntable's angle."""
        x = np.asarray(e, dtype=np.float64)[list(self.free)]
        return np.append(x, table) if self.turns else x

    def inside(self, x: Array) -> Array:
        """Coordinates brought into the ranges."""
        return np.clip(x, self.lower, self.upper)

    def grid(self, counts: ArrayLike) -> Array:
        """Regular grid (p, d) over the ranges, ends included; the last coordinate runs fastest."""
        many = np.broadcast_to(np.asarray(counts, dtype=np.int64), (self.d,))
        lines = [np.linspace(a, b, n) for a, b, n in zip(self.lower, self.upper, many, strict=True)]
        return np.stack([g.ravel() for g in np.meshgrid(*lines, indexing="ij")], axis=1)

    def without_table(self, table: float) -> Space:
        """The same with the turntable at rest at an angle."""
        k = len(self.free)
        return Space(self.cell, self.free, self.lower[:k], self.upper[:k], self.rest, table, False)

    def words(self, x: Array) -> str:
        """A position as a user reads it."""
        pairs = zip(self.names, x * self.shown, self.units, strict=True)
        return ", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in pairs)


def space_of(
    cell: Cell,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    *,
    table: float | tuple[float, float] = 0.0,
) -> Space:
    """Base positions of a cell.

    Parameters
    ----------
    ranges : of linear axes by name, m; a range of length zero holds the axis there. Axes not named have their limits
    table : rad, the turntable's angle, or the range that is searched

    Raises
    ------
    InputError
        A cell without anything that moves base or part, an axis that it does not have, a range that is empty or leaves
        the axis's limits.
    """
    wanted = dict(ranges or {})
    known = [axis.name for axis in cell.linear_axes]
    unknown = sorted(set(wanted) - set(known))
    if unknown:
        raise InputError(
            f"linear axis of cell {cell.name}",
            code="G005",
            value=unknown[0],
            allowed=", ".join(known) or "none: this cell has no linear axis",
            remedy="correct the name, or add a [[linear_axis]] table to the cell file",
        )
    free, low, high = [], [], []
    rest = np.zeros(len(cell.linear_axes))
    for i, axis in enumerate(cell.linear_axes):
        what = f"range of axis {axis.name}"
        lower, upper = _within(what, "mm", axis.limits, wanted.get(axis.name, tuple(axis.limits)))
        rest[i] = lower
        if upper > lower:
            free.append(i)
            low.append(lower)
            high.append(upper)
    turns, angles = _table_range(cell, table)
    if turns:
        low.append(angles[0])
        high.append(angles[1])
    if not low:
        raise InputError(
            f"cell {cell.name}: nothing to place",
            code="G005",
            value="no linear axis with a range",
            allowed="one to three [[linear_axis]] tables, or a range of the turntable",
            remedy="describe the rail in the cell file: [[linear_axis]] with name, direction, limits_mm",
        )
    return Space(cell, tuple(free), np.array(low), np.array(high), rest, angles[0], turns)


def start_of(space: Space) -> tuple[Array, float]:
    """Travels (k,) m and angle rad where the cell's file puts the robot: 0, or mid-range where 0 is out of limits."""
    limits = np.array([axis.limits for axis in space.cell.linear_axes]).reshape(-1, 2)
    outside = (limits[:, 0] > 0.0) | (limits[:, 1] < 0.0)
    e = np.where(outside, limits.mean(axis=1), 0.0)
    turntable = space.cell.turntable
    if turntable is None:
        return e, 0.0
    if not space.turns:
        return e, space.table
    low, high = (-np.pi, np.pi) if turntable.limits is None else turntable.limits
    return e, 0.0 if low <= 0.0 <= high else float(0.5 * (low + high))


def _within(what: str, unit: str, limits: Array | None, wanted: tuple[float, float]) -> tuple[float, float]:
    """A range (m or rad) within limits, rounded onto them; ``limits`` None: without end."""
    said, (a, b) = _span(wanted, unit), wanted
    if not (np.isfinite(a) and np.isfinite(b) and a <= b):
        raise InputError(what, code="G005", value=said, allowed="from below to")
    if limits is None:
        return float(a), float(b)
    low, high = map(float, limits)
    if a < low - ROUNDING or b > high + ROUNDING:
        allowed = f"within its limits, {_span((low, high), unit)}"
        raise InputError(what, code="G005", value=said, allowed=allowed, remedy="narrow the range")
    return max(a, low), min(b, high)


def _table_range(cell: Cell, table: float | tuple[float, float]) -> tuple[bool, tuple[float, float]]:
    """Whether the turntable is searched, and its range rad."""
    turns = isinstance(table, tuple)
    a, b = table if isinstance(table, tuple) else (table, table)
    if cell.turntable is not None:
        if turns and a == b:
            raise InputError("range of the turntable", code="G005", value=_span((a, b), "deg"), allowed="from below to")
        return turns, _within("range of the turntable", "deg", cell.turntable.limits, (a, b))
    if turns or a != 0.0:
        raise InputError(
            f"turntable of cell {cell.name}",
            code="G005",
            value=_span((a, b), "deg"),
            allowed="none: this cell has no turntable",
            remedy="add a [turntable] table to the cell file",
        )
    return False, (0.0, 0.0)


def _span(pair: tuple[float, float], unit: str) -> str:
    low, high = (value * SHOWN[unit] for value in pair)
    return f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}"
