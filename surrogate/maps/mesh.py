"""Maps as VTK data sets, and the files of these (.vti, .vtu, .vtp), which ParaView opens; read back as maps.

All have the arrays of :meth:`MapData.arrays` with the unit in the name and as VTK's UNITS_LABEL, the first field as the
active scalars; as field data the strings of the metadata, ``units`` and ``labels`` ('array = unit'), and
``<array>_categories`` for arrays that number names. Points are in mm in the base frame.
"""

from __future__ import annotations

import logging
import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robots.arrays import Array, Bools, Integers
from robots.constants import M_TO_MM, MM
from robots.errors import InputError
from robots.files.written import written_whole
from surrogate.maps.data import JOINT_LABEL, REACHED_ARRAY, Axis, Field, Layout, MapData

Ending = Literal["vti", "vtu", "vtp"]
# Most axes that span one cell; those before them in a sweep of joints are layers.
MOST_AXES = 3
# Corners of a cell as steps along its axes, the fastest first, in VTK's order; by the number of axes.
_QUAD = [(0, 0), (1, 0), (1, 1), (0, 1)]
_CORNERS: Mapping[int, list[tuple[int, ...]]] = {
    1: [(0,), (1,)],
    2: [*_QUAD],
    3: [(*corner, up) for up in (0, 1) for corner in _QUAD],
}
# VTK's numbers of a vertex, a line, a quad and a hexahedron, by corners.
_KINDS = {1: 1, 2: 3, 4: 9, 8: 12}
# Of a step: how far an axis of an image may be from equal steps, and the points from the axes (rounded decimals).
_STEP_TOLERANCE = 1e-3
# What VTK writes into names as it is, and its reader then stops at; and what no text in XML may hold.
_IN_NAMES, _IN_TEXTS = re.compile(r"[<>&\"\x00-\x1f\x7f]"), re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ufffe\uffff]")


def map_mesh(data: MapData, kind: Ending) -> Any:
    """A map as a data set of pyvista.

    Parameters
    ----------
    kind : ``vti``: a slice or box with equal steps as an image, NaN where nothing is reached, with an array ``reached``
        (0 or 1) to threshold with; a slice is an image of one layer in its plane. ``vtu``: the reached points with
        cells between neighbours (:func:`grid_cells`), points in none as vertices. ``vtp``: the reached points as
        vertices.

    Raises
    ------
    InputError
        Nothing is reached, an array name is used twice, or an image of what is none.
    """
    import pyvista as pv

    data.require_reached("move the grid to where the robot reaches")
    arrays, keep = data.arrays(), np.asarray(data.reached)
    points = M_TO_MM * np.asarray(data.points, dtype=np.float64)
    if kind == "vti":
        origin, spacing, counts = _image_grid(data)
        mesh: Any = pv.ImageData(dimensions=counts, origin=origin, spacing=spacing)
        arrays, keep = arrays | {REACHED_ARRAY: Field(keep.astype(np.uint8), "", "")}, np.ones_like(keep)
    elif kind == "vtp":
        mesh = point_cloud(points[keep])
    else:
        number = np.cumsum(keep) - 1
        cells = [number[corners] for corners in grid_cells(data.layout, keep, points) if len(corners)]
        mesh = pv.UnstructuredGrid({_KINDS[corners.shape[1]]: corners for corners in cells}, points[keep])
    named = {name: f for name, f in arrays.items() if name != REACHED_ARRAY}
    texts: dict[str, Sequence[str]] = {
        "units": ["points = mm", *(f"{name} = {f.unit}" for name, f in named.items() if f.unit)],
        "labels": [f"{name} = {f.label}" for name, f in named.items()],
    }
    texts |= {f"{name}_categories": f.categories for name, f in named.items() if f.categories}
    texts |= {name + "_" * (name in texts): [text] for name, text in data.metadata.items()}
    return described(mesh, {name: (f.values[keep], f.unit) for name, f in arrays.items()}, texts)


def point_cloud(points: Array) -> Any:
    """Points (n, 3) mm as vertices of polygonal data."""
    import pyvista as pv

    mesh = pv.PolyData()
    mesh.points = points
    mesh.verts = np.column_stack([np.ones(len(points), dtype=np.int64), np.arange(len(points))]).ravel()
    return mesh


def described(mesh: Any, arrays: Mapping[str, tuple[Array, str]], texts: Mapping[str, Sequence[str]]) -> Any:
    """A data set with arrays at its points, (values, unit) by name, the first active, and texts as field data."""
    from vtkmodules.vtkCommonCore import vtkDataArray, vtkStringArray

    for name, (values, unit) in arrays.items():
        mesh.point_data.set_array(np.ascontiguousarray(values), plain := _IN_NAMES.sub("_", name))
        if unit:
            mesh.GetPointData().GetArray(plain).GetInformation().Set(vtkDataArray.UNITS_LABEL(), unit)
    if arrays:
        mesh.GetPointData().SetActiveScalars(_IN_NAMES.sub("_", next(iter(arrays))))
    for name, lines in texts.items():
        strings = vtkStringArray()
        strings.SetName(_IN_NAMES.sub("_", name))
        for line in lines:
            strings.InsertNextValue(_IN_TEXTS.sub("\ufffd", line.encode("utf-8", "replace").decode()))
        mesh.GetFieldData().AddArray(strings)
    return mesh


def grid_cells(layout: Layout, reached: Bools, points: Array | None = None) -> tuple[Integers, Integers]:
    """Cells (m, corners) between neighbours that are all reached, and the reached points (k, 1) in none of them.

    Hexahedra, quads or lines: axes of one value are left out, so a box of one layer has quads. In a sweep of joints at
    most the last three axes span cells; there are none between layers. A cylinder is closed over a full turn. With
    ``points`` (n, 3) hexahedra are turned right-handed: how a sweep is bent into space differs from place to place.

    Raises
    ------
    InputError
        A layout of space has more than three axes.
    """
    if len(layout.axes) > MOST_AXES and layout.kind != "joints":
        raise InputError(f"map layout {layout.kind}", code="S011", value=f"{len(layout.axes)} axes", allowed="1 to 3")
    spanning = range(max(layout.layers, len(layout.axes) - MOST_AXES), len(layout.axes))
    axes = [axis for axis in reversed(spanning) if layout.shape[axis] > 1]
    number, used = np.arange(layout.n).reshape(layout.shape), np.zeros(layout.n, dtype=np.bool_)
    cells = np.zeros((0, 2), dtype=np.int64)
    if axes:
        corners = []
        for steps in _CORNERS[len(axes)]:
            corner = np.roll(number, [-step for step in steps], axes)
            for axis in axes:
                if not (layout.kind == "cylinder" and layout.axes[axis].full_turn):
                    corner = corner.take(range(layout.shape[axis] - 1), axis)
            corners.append(corner.ravel())
        cells = np.column_stack(corners)
        cells = cells[reached[cells].all(axis=1)]
    if points is not None and cells.shape[1] == len(_CORNERS[3]):
        cells = _right_handed(cells, points)
    used[cells] = True
    return cells, np.flatnonzero(reached & ~used)[:, None]


def _right_handed(cells: Integers, points: Array) -> Integers:
    """Hexahedra with upper and lower face exchanged where their mean edges span a volume below 0."""
    corner = points[cells]
    along = corner[:, [1, 2, 5, 6]].sum(1) - corner[:, [0, 3, 4, 7]].sum(1)
    across = corner[:, [2, 3, 6, 7]].sum(1) - corner[:, [0, 1, 4, 5]].sum(1)
    up = corner[:, 4:].sum(1) - corner[:, :4].sum(1)
    left = np.einsum("ij,ij->i", np.cross(along, across), up) < 0.0
    return np.where(left[:, None], np.roll(cells, 4, axis=1), cells)


def _image_grid(data: MapData) -> tuple[Array, Array, tuple[int, int, int]]:
    """Origin and spacing in mm and counts of an image, each x, y, z."""
    layout = data.layout
    names = [axis.name for axis in layout.axes]
    wanted = {"slice": 2, "box": 3}
    if len(names) != wanted.get(layout.kind) or names != [name for name in "zyx" if name in names]:
        raise InputError(
            "map as .vti",
            code="B004",
            value=f"{layout.kind} of {', '.join(names)}",
            allowed="a slice or box",
            remedy="write .vtu",
        )
    origin, spacing, counts = np.asarray(data.points[0]) * M_TO_MM, np.ones(3), [1, 1, 1]
    for axis in layout.axes:
        column, values = "xyz".index(axis.name), np.asarray(axis.values, dtype=np.float64)
        counts[column] = len(values)
        if len(values) > 1:
            step = (values[-1] - values[0]) / (len(values) - 1)
            even = values[0] + step * np.arange(len(values))
            if axis.unit != "mm" or not step > 0.0 or np.abs(values - even).max() > _STEP_TOLERANCE * step:
                raise InputError(
                    f"map as .vti: axis {axis.name}",
                    code="B004",
                    allowed="equal rising steps in mm",
                    remedy="write .vtu",
                )
            spacing[column] = step
        origin[column] = values[0]
    corner = origin + spacing * (np.array(counts) - 1)
    ends = np.asarray(data.points[[0, -1]]) * M_TO_MM
    if not (np.abs(ends - [origin, corner]) <= _STEP_TOLERANCE * spacing).all():
        raise InputError("map as .vti", code="B004", value="points that are not those of the axes", remedy="write .vtu")
    return origin, spacing, (counts[0], counts[1], counts[2])


def write_map(data: MapData, path: Path) -> None:
    """Write a map in the format that the file's name ends in. Errors as :func:`map_mesh` and :func:`save_mesh`."""
    for kind in ("vti", "vtu", "vtp"):
        if path.suffix == f".{kind}":
            return save_mesh(map_mesh(data, kind), path)
    raise InputError("map file", code="B004", value=str(path), allowed="a name that ends in .vti, .vtu or .vtp")


def save_mesh(mesh: Any, path: Path) -> None:
    """Write a data set as VTK XML, its arrays appended and compressed; the file is there whole or not at all.

    Raises
    ------
    InputError
        The folder does not exist or cannot be written, or the system refuses while the file is written (a full disk).
    """
    from vtkmodules.vtkIOXML import vtkXMLDataSetWriter

    if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError(
            "folder of the file", code="F008", value=str(path.parent), allowed="an existing folder one may write to"
        )
    try:
        with written_whole(path) as draft, _quiet():
            writer = vtkXMLDataSetWriter()
            writer.SetInputData(mesh)
            writer.SetFileName(str(draft))
            writer.SetDataModeToAppended()
            writer.EncodeAppendedDataOff()
            writer.SetHeaderTypeToUInt64()
            writer.SetCompressorTypeToLZ4()
            if writer.Write() != 1 or writer.GetErrorCode() != 0:
                draft.unlink(missing_ok=True)  # which is then missing where it is to be settled
    except OSError as error:
        raise InputError(
            f"file {path} could not be written ({error.strerror or error})",
            code="F008",
            remedy="check the free space of the disk and what stands under this name",
        ) from error


def read_map(path: Path) -> MapData:
    """The map in a file of :func:`write_map`, of this or an earlier version; how its points lie is not in it.

    Raises
    ------
    InputError
        The file cannot be read, or is no map of ours.
    """
    import pyvista

    try:
        with _quiet():
            mesh = pyvista.read(path)
    except Exception as error:  # VTK raises what it likes on spoilt files
        raise InputError(f"map {path} cannot be read ({error})", code="A012", remedy="make the map again") from error
    words = {key: [str(v) for v in mesh.field_data[key]] for key in mesh.field_data.keys()}  # noqa: SIM118 - no mapping
    if "units" not in words or "robot" not in words or not mesh.n_points:
        raise InputError(
            f"{path} is no map of stiffarm", code="A012", allowed="the .vtu, .vti or .vtp of `stiffarm map`"
        )
    units, labels = (
        dict(one.split(" = ", 1) for one in words.pop(key, []) if " = " in one) for key in ("units", "labels")
    )
    arrays = {key: np.asarray(mesh.point_data[key], dtype=np.float64) for key in mesh.point_data.keys()}  # noqa: SIM118
    reached = arrays.pop(REACHED_ARRAY, np.ones(mesh.n_points)) > 0.5
    joints = [key for key in arrays if labels.get(key, "").startswith(JOINT_LABEL)]
    q = np.radians([arrays.pop(key) for key in joints]).reshape(len(joints), mesh.n_points).T
    return MapData(
        layout=Layout("points", (Axis("point", "", np.arange(mesh.n_points)),)),
        points=MM * np.asarray(mesh.points, dtype=np.float64),
        q=q,
        reached=reached,
        coordinates=tuple(joints),
        fields={
            key: Field(values, units.get(key, ""), labels.get(key, key), tuple(words.pop(f"{key}_categories", ())))
            for key, values in arrays.items()
            if values.ndim == 1
        },
        metadata={key: lines[0] for key, lines in words.items() if lines},
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Nothing of what VTK complains of on three ways: it shows in what it gives."""
    import pyvista

    logging.disable(logging.ERROR)
    try:
        with warnings.catch_warnings(), pyvista.vtk_verbosity("off"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(logging.NOTSET)
