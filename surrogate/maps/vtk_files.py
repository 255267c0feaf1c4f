"""Stiffness maps and their VTK files (.vtu), readable by ParaView, pyvista and plain VTK."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError
from robots.arrays import Array, Integers
from robots.constants import M_TO_MM, N_PER_M_TO_N_PER_MM
from robots.files.written import written_whole

STIFFNESS_ARRAY = "stiffness_N_per_mm"

# Corners of a cell as index steps, in VTK's order of corners.
_QUAD = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
_HEXAHEDRON = np.array([[i, j, k] for k in (0, 1) for i, j in _QUAD])


@dataclass(frozen=True)
class StiffnessMap:
    """Structural stiffness over tool positions, one entry a pose, n poses.

    Parameters
    ----------
    positions : (n, 3) m, the tool point in the base frame
    stiffness : (n,) N/m, greater than zero
    joints : joint coordinate -> (n,) deg, named with its unit (``q2_deg``)
    scalars : further figures -> (n,), the unit in the name (``deflection_mm``)
    metadata : what the map is of: robot, model hash, load direction, surrogate or model, version
    cells : (m, 8) hexahedra or (m, 4) quads as rows of point numbers, VTK's corner order, or None

    Raises
    ------
    InputError
        Shapes disagree, a value is not finite, a stiffness is not positive, a name is used twice or a
        cell names a point that is not there. A pose that cannot be taken is left out, not set to NaN.
    """

    positions: Array
    stiffness: Array
    joints: Mapping[str, Array] = field(default_factory=dict)
    scalars: Mapping[str, Array] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    cells: Integers | None = None

    def __post_init__(self) -> None:
        positions = np.asarray(self.positions, dtype=np.float64)
        if positions.ndim != 2 or positions.shape[1] != 3 or len(positions) == 0:
            raise InputError("map positions", value=f"shape {positions.shape}", allowed="(n, 3) in m, n >= 1")
        _require_finite("positions", positions)
        n = len(positions)
        stiffness = _column("stiffness", self.stiffness, n)
        if not (stiffness > 0.0).all():
            row = int(np.flatnonzero(~(stiffness > 0.0))[0])
            raise InputError(f"map stiffness, pose {row}", value=stiffness[row], allowed="> 0 N/m")
        for name in self.joints:
            if not name.endswith("_deg"):
                raise InputError("map joint coordinate", value=name, allowed="a name that ends in _deg")
        names = [STIFFNESS_ARRAY, *self.joints, *self.scalars]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError("map array name used twice", value=", ".join(twice))
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "stiffness", stiffness)
        object.__setattr__(self, "joints", {k: _column(k, v, n) for k, v in self.joints.items()})
        object.__setattr__(self, "scalars", {k: _column(k, v, n) for k, v in self.scalars.items()})
        object.__setattr__(self, "metadata", {str(k): str(v) for k, v in self.metadata.items()})
        if self.cells is not None:
            object.__setattr__(self, "cells", _checked_cells(self.cells, n))

    @property
    def point_arrays(self) -> dict[str, Array]:
        """All point arrays as they stand in the file: the stiffness in N/mm, joints, scalars."""
        return {STIFFNESS_ARRAY: self.stiffness * N_PER_M_TO_N_PER_MM, **self.joints, **self.scalars}


@dataclass(frozen=True)
class VtuContents:
    """What a .vtu file holds: points (n, 3) mm, named point arrays, metadata, cells or None."""

    points_mm: Array
    point_arrays: dict[str, Array]
    metadata: dict[str, str]
    cells: Integers | None


def grid_cells(shape: Sequence[int], keep: ArrayLike) -> Integers:
    """Cells of a structured index grid, without those that have a corner not kept.

    Parameters
    ----------
    shape : (a, b, c) for hexahedra, (a, b) for quads: points along each index, last index fastest
    keep : bool, a*b*c values (flat or of that shape): which points exist

    Returns
    -------
    (m, 8) or (m, 4) numbers of the *kept* points, counted in the flat order of the grid, in VTK's
    corner order. Cells are right-handed where the index directions are.

    Raises
    ------
    InputError
        The shape is not two or three positive counts, or ``keep`` does not fit it.
    """
    counts = tuple(int(s) for s in shape)
    if len(counts) not in (2, 3) or min(counts) < 1:
        raise InputError("grid shape", value=str(tuple(shape)), allowed="two or three counts of 1 or more")
    kept = np.asarray(keep)
    if kept.dtype != np.bool_ or kept.size != np.prod(counts):
        raise InputError(
            "grid mask", value=f"{kept.size} values of {kept.dtype}", allowed=f"{np.prod(counts)} booleans"
        )
    number = np.where(kept.ravel(), np.cumsum(kept.ravel()) - 1, -1).reshape(counts)
    first = np.stack(np.meshgrid(*[np.arange(c - 1) for c in counts], indexing="ij"), axis=-1)
    corners = first.reshape(-1, 1, len(counts)) + (_QUAD if len(counts) == 2 else _HEXAHEDRON)
    cells = number[tuple(np.moveaxis(corners, -1, 0))]
    return np.asarray(cells[(cells >= 0).all(axis=1)], dtype=np.int64)


def write_vtu(stiffness_map: StiffnessMap, path: Path) -> None:
    """Write a map as an XML unstructured grid: points in mm, arrays by name, metadata as field data.

    Points that no cell uses get a vertex cell, so that every pose is seen in a viewer. Binary,
    compressed; whole or not at all.

    Raises
    ------
    InputError
        The name does not end in .vtu, or the folder does not exist or cannot be written.
    """
    from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

    grid = vtkUnstructuredGrid()
    points = vtkPoints()
    points.SetData(_numpy_support().numpy_to_vtk(stiffness_map.positions * M_TO_MM, deep=True))
    grid.SetPoints(points)
    types, cells = _vtk_cells(stiffness_map)
    grid.SetCells(types, cells)
    for name, values in stiffness_map.point_arrays.items():
        array = _numpy_support().numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    grid.GetPointData().SetActiveScalars(STIFFNESS_ARRAY)
    for name, text in stiffness_map.metadata.items():
        strings = vtkStringArray()
        strings.SetName(name)
        strings.InsertNextValue(text)
        grid.GetFieldData().AddArray(strings)
    write_grid(grid, path)


def write_grid(grid: Any, path: Path) -> None:
    """Write a ``vtkUnstructuredGrid`` as a .vtu file: binary, compressed, whole or not at all.

    Raises
    ------
    InputError
        The name does not end in .vtu, or the folder does not exist or cannot be written.
    """
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    _require_vtu(path)
    if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError("map folder", value=str(path.parent), allowed="an existing folder one may write to")
    with written_whole(path) as draft:
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetFileName(str(draft))
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToZLib()
        if writer.Write() != 1 or writer.GetErrorCode() != 0:
            raise InputError(f"map file {path} could not be written", remedy="check the free space of the disk")


def read_vtu(path: Path) -> VtuContents:
    """Read a .vtu file with plain VTK.

    Raises
    ------
    InputError
        The file is missing, is no .vtu file, or mixes quads and hexahedra.
    """
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    _require_vtu(path)
    reader = vtkXMLUnstructuredGridReader()
    if not path.is_file() or not reader.CanReadFile(str(path)):
        raise InputError("map file", value=str(path), allowed="an existing VTK unstructured grid (.vtu)")
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    if reader.GetErrorCode() != 0 or grid.GetPoints() is None:
        raise InputError("map file is damaged", value=str(path), remedy="write the map again")
    to_numpy = _numpy_support().vtk_to_numpy
    point_data, field_data = grid.GetPointData(), grid.GetFieldData()
    arrays = [point_data.GetArray(i) for i in range(point_data.GetNumberOfArrays())]
    texts = [field_data.GetAbstractArray(i) for i in range(field_data.GetNumberOfArrays())]
    return VtuContents(
        points_mm=np.array(to_numpy(grid.GetPoints().GetData()), dtype=np.float64),
        point_arrays={a.GetName(): np.array(to_numpy(a), dtype=np.float64) for a in arrays},
        metadata={t.GetName(): t.GetValue(0) for t in texts if t.IsA("vtkStringArray")},
        cells=_numpy_cells(grid, path),
    )


def _numpy_support() -> Any:
    return importlib.import_module("vtkmodules.util.numpy_support")  # has no type hints


def _vtk_cells(stiffness_map: StiffnessMap) -> tuple[Any, Any]:
    """VTK cell types and cell array: the map's cells, then a vertex for each point outside them."""
    from vtkmodules.vtkCommonDataModel import VTK_HEXAHEDRON, VTK_QUAD, VTK_VERTEX, vtkCellArray

    n = len(stiffness_map.positions)
    cells = np.empty((0, 8), dtype=np.int64) if stiffness_map.cells is None else stiffness_map.cells
    loose = np.setdiff1d(np.arange(n), cells)
    m, corners = cells.shape
    connectivity = np.concatenate([cells.ravel(), loose]).astype(np.int64)
    offsets = np.concatenate([np.arange(m + 1) * corners, m * corners + 1 + np.arange(len(loose))])
    kinds = np.full(m + len(loose), VTK_VERTEX, dtype=np.uint8)
    kinds[:m] = VTK_QUAD if corners == 4 else VTK_HEXAHEDRON
    array = vtkCellArray()
    array.SetData(
        _numpy_support().numpy_to_vtkIdTypeArray(offsets.astype(np.int64), deep=True),
        _numpy_support().numpy_to_vtkIdTypeArray(connectivity, deep=True),
    )
    return _numpy_support().numpy_to_vtk(kinds, deep=True), array


def _numpy_cells(grid: Any, path: Path) -> Integers | None:

    if grid.GetNumberOfCells() == 0:
        return None
    offsets = _numpy_support().vtk_to_numpy(grid.GetCells().GetOffsetsArray())
    connectivity = _numpy_support().vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    sizes = np.diff(offsets)
    corners = np.unique(sizes[sizes > 1])
    if corners.size == 0:
        return None
    if corners.size > 1:
        raise InputError("map file mixes kinds of cells", value=str(path), allowed="quads or hexahedra only")
    starts = offsets[:-1][sizes > 1]
    return np.asarray(connectivity[starts[:, None] + np.arange(corners[0])], dtype=np.int64)


def _column(name: str, values: ArrayLike, n: int) -> Array:
    column = np.asarray(values, dtype=np.float64)
    if column.shape != (n,):
        raise InputError(f"map array {name}", value=f"shape {column.shape}", allowed=f"({n},)")
    _require_finite(name, column)
    return column


def _require_finite(name: str, values: Array) -> None:
    bad = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"map array {name}, pose {row} ({int(bad.sum())} such)",
            value=str(values[row]),
            allowed="finite numbers",
            remedy="leave out poses that have no value",
        )


def _checked_cells(cells: ArrayLike, n: int) -> Integers:
    out = np.asarray(cells)
    if out.ndim != 2 or out.shape[1] not in (4, 8) or out.dtype.kind not in "iu":
        raise InputError("map cells", value=f"shape {out.shape}, {out.dtype}", allowed="(m, 8) or (m, 4) int")
    if out.size and (out.min() < 0 or out.max() >= n):
        raise InputError("map cells", value=f"{out.min()} to {out.max()}", allowed=f"point numbers 0 to {n - 1}")
    return out.astype(np.int64)


def _require_vtu(path: Path) -> None:
    if path.suffix != ".vtu":
        raise InputError("map file", value=str(path), allowed="a name that ends in .vtu")
