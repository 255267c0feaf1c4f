"""Maps as netCDF-4 files after the CF conventions, written block by block; xarray opens them as a data set.

Dimensions are the layout's axes ('x_mm', 'phi_deg', 'q2_deg'); each column of ``map_columns`` is a variable over all of
them with ``units`` and ``long_name``, those that number names with ``flag_values`` and ``flag_meanings`` (-1: 'none';
the names as they are in ``categories``). Points that the axes do not say (x and y of a cylinder, all of a joint sweep,
the plane of a slice) are auxiliary coordinates. Source: CF conventions 1.11, sections 3 and 5, cfconventions.org.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from robots.constants import M_TO_MM
from robots.lazily import optional
from surrogate.maps.columns import (
    NO_CATEGORY,
    REACHED_ARRAY,
    ROWS_A_BLOCK,
    Column,
    free_name,
    map_columns,
    points_mm,
    row_blocks,
    valid_text,
)
from surrogate.maps.data import Axis, MapData
from surrogate.maps.whole_file import claim_disk, whole_file

_COORDINATE = np.dtype("<f8")
_FLAG = np.dtype("i1")
# Heads of variables and their attributes, some kilobytes each.
_OVERHEAD_BYTES = 1 << 20
_CF_UNITS = {"deg": "degree", "": "1"}


def write_netcdf(data: MapData, path: Path, *, single: bool = False) -> None:
    """Write a map as netCDF-4 (.nc), NaN where the robot does not reach; not compressed.

    Names keep letters, digits and underscores, others become underscores; of two that are then the same, one gets an
    underscore more. A joint coordinate that is an axis is no variable besides. ``reached`` (0 or 1) says where there
    is a pose.

    Parameters
    ----------
    single : floating-point variables with 4 bytes instead of 8 a number; coordinates keep 8

    Raises
    ------
    InputError
        h5netcdf or h5py is not installed, an array name is used twice, or the file cannot be written (see
        ``whole_file``).
    """
    optional("h5py", "netCDF files", "netcdf")
    library = optional("h5netcdf", "netCDF files", "netcdf")
    axes = [_axis_name(axis) for axis in data.layout.axes]
    points = {name: i for i, name in enumerate(("x_mm", "y_mm", "z_mm")) if name not in axes}
    columns: dict[str, Column] = {}
    for column in map_columns(data):
        if column.name not in axes:
            columns[free_name(_plain(column.name), [*columns, *axes, *points, REACHED_ARRAY])] = column
    attributes = {"Conventions": "CF-1.11", "layout": data.layout.kind}
    for name, text in data.metadata.items():
        attributes[free_name(_plain(name), attributes)] = valid_text(text)
    with whole_file(path, ".nc") as temporary:
        with temporary.open("wb") as stream:  # HDF5 may crash where it finds a full disk in mid-write
            claim_disk(stream, _bytes_at_most(data, columns, points, attributes, single))
        try:
            with library.File(temporary, "w") as file:
                file.attrs.update(attributes)
                file.dimensions = dict(zip(axes, data.layout.shape, strict=True))
                variables = _define(file, data, axes, columns, points, single)
                _fill(variables, data, columns, points)
        except RuntimeError as error:  # how HDF5 reports most failures, a full disk on closing among them
            raise OSError(str(error)) from error


def _define(
    file: Any, data: MapData, axes: list[str], columns: Mapping[str, Column], points: Mapping[str, int], single: bool
) -> dict[str, Any]:
    """Coordinates with their values, and the variables that are still to be filled."""
    for name, axis in zip(axes, data.layout.axes, strict=True):
        attributes = {"units": _cf_units(axis.unit), "long_name": axis.name.removesuffix(f"_{axis.unit}")}
        if axis.name in ("x", "y", "z"):
            attributes["axis"] = axis.name.upper()
        _variable(file, name, (name,), _COORDINATE, attributes)[...] = axis.values
    variables: dict[str, Any] = {}
    for name, number in points.items():
        about = {"units": "mm", "long_name": f"tool point {name[0]}, base frame"}
        if data.layout.kind == "slice":
            _variable(file, name, (), _COORDINATE, about)[...] = float(data.points[0, number]) * M_TO_MM
        else:
            variables[name] = _variable(file, name, axes, _COORDINATE, about)
    auxiliary = {"coordinates": " ".join(points)} if points else {}
    for name, column in columns.items():
        kind = _flags(column.categories) if column.categories else {"units": _cf_units(column.unit)}
        words = {"long_name": valid_text(column.label or column.name)}
        variables[name] = _variable(file, name, axes, column.dtype(single), words | kind | auxiliary)
    flags = {"flag_values": np.array([0, 1], _FLAG), "flag_meanings": "not_reached reached"}
    words = {"long_name": "pose found"}
    variables[REACHED_ARRAY] = _variable(file, REACHED_ARRAY, axes, _FLAG, words | flags | auxiliary)
    return variables


def _fill(
    variables: Mapping[str, Any], data: MapData, columns: Mapping[str, Column], points: Mapping[str, int]
) -> None:
    for rows, region, shape in _regions(data.layout.shape):
        for name, column in columns.items():
            variables[name][region] = column.read(rows).reshape(shape)
        variables[REACHED_ARRAY][region] = np.asarray(data.reached[rows], dtype=_FLAG).reshape(shape)
        block = points_mm(data, rows)
        for name in set(points) & set(variables):
            variables[name][region] = block[:, points[name]].reshape(shape)


def _variable(file: Any, name: str, axes: Sequence[str], kind: np.dtype[Any], attributes: Mapping[str, object]) -> Any:
    variable = file.create_variable(name, tuple(axes), kind)
    variable.attrs.update(attributes)
    return variable


def _regions(shape: tuple[int, ...]) -> Iterator[tuple[slice, tuple[slice, ...], tuple[int, ...]]]:
    """Rows in C order, at most a block each, that are a box of indices: rows, the box, its shape."""
    inner = [prod(shape[k + 1 :]) for k in range(len(shape))]
    split = next(k for k, size in enumerate(inner) if size <= ROWS_A_BLOCK)
    for outer in np.ndindex(shape[:split]):
        first = sum(i * size for i, size in zip(outer, inner, strict=False))
        for part in row_blocks(shape[split], ROWS_A_BLOCK // inner[split]):
            rows = slice(first + part.start * inner[split], first + part.stop * inner[split])
            box = (*(slice(i, i + 1) for i in outer), part, *(slice(0, size) for size in shape[split + 1 :]))
            yield rows, box, tuple(s.stop - s.start for s in box)


def _bytes_at_most(
    data: MapData, columns: Mapping[str, Column], points: Mapping[str, int], texts: Mapping[str, str], single: bool
) -> int:
    a_row = sum(column.dtype(single).itemsize for column in columns.values()) + _COORDINATE.itemsize * len(points) + 1
    words = sum(len(text.encode()) for text in texts.values())
    return data.layout.n * a_row + sum(axis.values.nbytes for axis in data.layout.axes) + 2 * words + _OVERHEAD_BYTES


def _axis_name(axis: Axis) -> str:
    return _plain(axis.name if axis.name.endswith(f"_{axis.unit}") else f"{axis.name}_{axis.unit}")


def _flags(categories: Sequence[str]) -> dict[str, Any]:
    """Attributes of a variable that numbers names. A meaning is one word (letters, digits, _ - . + @)."""
    words = [re.sub(r"[^A-Za-z0-9_.+@-]+", "_", name) or "_" for name in categories]
    return {
        "flag_values": np.arange(NO_CATEGORY, len(categories), dtype="<i4"),
        "flag_meanings": " ".join(["none", *words]),
        "categories": [valid_text(name) for name in categories],
    }


def _cf_units(unit: str) -> str:
    return _CF_UNITS.get(unit, valid_text(unit))


def _plain(name: str) -> str:
    """The name after CF's rule: letters (here of any alphabet), digits and underscores, a letter first."""
    plain = re.sub(r"\W", "_", valid_text(name))
    return plain if plain[:1].isalpha() else f"n{plain}"
