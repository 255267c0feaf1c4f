"""The arrays of a map as files hold them: one named column each, in the unit of its name, read block by block."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, in_blocks
from robots.constants import M_TO_MM
from robots.errors import InputError
from surrogate.maps.data import Field, MapData

# Rows in memory at a time: one megabyte a column.
ROWS_A_BLOCK = 1 << 17
# What the label of a joint coordinate begins with.
JOINT_LABEL = "joint coordinate"
NO_CATEGORY = -1
# The writers' own array: whether there is a pose.
REACHED_ARRAY = "reached"


@dataclass(frozen=True, eq=False)
class Column:
    """One array over all points.

    Parameters
    ----------
    name, unit, label : as in ``Field``; the name has the unit in it
    categories : names of 0, 1, ...; the column then holds whole numbers, -1 where there is none
    read : rows -> values (n_rows,), float64 with NaN where not reached, or int32 for categories
    """

    name: str
    unit: str
    label: str
    categories: tuple[str, ...]
    read: Callable[[slice], Array | NDArray[np.int32]]

    def dtype(self, single: bool) -> np.dtype[np.generic]:
        """Type in a file, little-endian; ``single`` halves the floating-point ones."""
        if self.categories:
            return np.dtype("<i4")
        return np.dtype("<f4" if single else "<f8")


def row_blocks(n: int, rows: int | None = None) -> Iterator[slice]:
    """Consecutive slices that cover 0 to n, of ``rows`` (by default ROWS_A_BLOCK) each."""
    return in_blocks(n, rows or ROWS_A_BLOCK)


def map_columns(data: MapData) -> tuple[Column, ...]:
    """All columns of a map but its points: the fields, the shares of the parts in percent, the joint angles in deg.

    Raises
    ------
    InputError
        Two columns have one name, or one is named ``reached``, an array of the writers' own.
    """
    columns = [_of_field(data, name, field) for name, field in data.fields.items()]
    if data.shares is not None:
        columns += [_of_share(data, data.shares, i, part) for i, part in enumerate(data.parts)]
    columns += [_of_joint(data, i, name) for i, name in enumerate(data.coordinates)]
    names = [REACHED_ARRAY, *(column.name for column in columns)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError("map array name used twice", code="S011", value=", ".join(twice))
    return tuple(columns)


def points_mm(data: MapData, rows: slice) -> Array:
    """Points (n_rows, 3) in mm."""
    return np.asarray(data.points[rows], dtype=np.float64) * M_TO_MM


def valid_text(text: object) -> str:
    """The text with what neither XML nor netCDF can hold (control characters, lone surrogates) replaced by U+FFFD."""
    known = str(text).encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c in "\t\n\r" or (c >= " " and c not in "\x7f\ufffe\uffff") else "\ufffd" for c in known)


def free_name(name: str, taken: Container[str]) -> str:
    """The name, with underscores added as long as it is taken."""
    while name in taken:
        name += "_"
    return name


def _of_field(data: MapData, name: str, field: Field) -> Column:
    def numbers(rows: slice) -> Array:
        return _where_reached(data, rows, field.values[rows])

    def categories(rows: slice) -> NDArray[np.int32]:
        values = numbers(rows)
        return np.where(np.isnan(values), NO_CATEGORY, values).astype(np.int32)

    return Column(name, field.unit, field.label, field.categories, categories if field.categories else numbers)


def _of_share(data: MapData, shares: Array, index: int, part: str) -> Column:
    def percent(rows: slice) -> Array:
        return _where_reached(data, rows, shares[rows, index]) * 100.0

    name = f"share_of_{'_'.join(part.split())}_percent"
    return Column(name, "percent", f"share of {part} in the compliance", (), percent)


def _of_joint(data: MapData, index: int, name: str) -> Column:
    def degrees(rows: slice) -> Array:
        return np.degrees(_where_reached(data, rows, data.q[rows, index]))

    return Column(name, "deg", f"{JOINT_LABEL} {name.removesuffix('_deg')}", (), degrees)


def _where_reached(data: MapData, rows: slice, values: Array) -> Array:
    return np.where(data.reached[rows], values, np.nan)
