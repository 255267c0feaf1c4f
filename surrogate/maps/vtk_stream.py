"""Maps as VTK XML files (.vti, .vtu, .vtp), written block by block: ten million points need no memory.

VTK's own writers can write a data set piece by piece into one file, but the pieces of an unstructured grid or of
polygonal data share no points: those between two pieces stand twice, and surfaces and contours end there.

All files have: the arrays of ``map_columns`` with the unit in the name and as VTK's UNITS_LABEL, the first field as the
active scalars; as field data the strings of the metadata, ``units`` and ``labels`` ('array = unit'), and
``<array>_categories`` for arrays that number names. Points are in mm in the base frame. Data are raw, so plain XML
tools do not read the files; those of VTK do (ParaView, pyvista).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from robots.arrays import Array
from robots.constants import M_TO_MM
from robots.errors import InputError
from surrogate.maps.cells import VTK_VERTEX, CellGrid, cell_grid
from surrogate.maps.columns import REACHED_ARRAY, Column, free_name, map_columns, points_mm, row_blocks
from surrogate.maps.data import MapData
from surrogate.maps.vtk_appended import AppendedFile, DataArray, Section
from surrogate.maps.whole_file import whole_file

_POINT = np.dtype("<f8")
_FLAG = np.dtype("u1")
# Of a step: how far an axis of an image may be from equal steps, and the points from the axes (rounded decimals).
_STEP_TOLERANCE = 1e-3


def write_vti(data: MapData, path: Path, *, single: bool = False) -> None:
    """Write a slice or box with equal steps as image data, NaN where the robot does not reach.

    A slice is an image of one layer in its plane. The array ``reached`` (0 or 1) is there to threshold with.

    Parameters
    ----------
    single : floating-point arrays with 4 bytes instead of 8 a number

    Raises
    ------
    InputError
        The layout is no slice or box, an axis has no equal rising steps, the points are not those of the axes, an
        array name is used twice, or the file cannot be written (see ``whole_file``).
    """
    origin, spacing, counts = _image_grid(data)
    extent = " ".join(f"0 {count - 1}" for count in counts)
    columns = map_columns(data)
    arrays = _arrays(columns, data.layout.n, single)
    reached = DataArray(REACHED_ARRAY, _FLAG, data.layout.n)
    shape = {"WholeExtent": extent, "Origin": _numbers(origin), "Spacing": _numbers(spacing)}
    sections = [Section("PointData", (*arrays, reached), _active(columns)), Section("CellData")]
    texts = _texts(data, columns)
    with (
        whole_file(path, ".vti") as temporary,
        AppendedFile(temporary, "ImageData", shape, {"Extent": extent}, texts, sections) as file,
    ):
        for rows in row_blocks(data.layout.n):
            for column, array in zip(columns, arrays, strict=True):
                file.write(array, rows.start, column.read(rows))
            file.write(reached, rows.start, data.reached[rows])


def write_vtu(data: MapData, path: Path, *, single: bool = False) -> None:
    """Write the reached points with cells between neighbours: hexahedra, quads or lines; points in none as vertices.

    See ``cell_grid`` for which cells there are. ``single`` as in ``write_vti``.

    Raises
    ------
    InputError
        An array name is used twice, the layout has too many axes, or the file cannot be written.
    """
    grid = cell_grid(data.layout, data.reached)
    n, cells, loose = (int(np.count_nonzero(a)) for a in (data.reached, grid.first, grid.loose))
    entries = cells * grid.corners + loose
    index = _index_type(entries)
    connectivity = DataArray("connectivity", index, entries)
    offsets = DataArray("offsets", index, cells + loose)
    kinds = DataArray("types", _FLAG, cells + loose)

    def write_cells(file: AppendedFile) -> None:
        _write_connectivity(file, connectivity, grid, data)
        for rows in row_blocks(cells + loose):
            number = np.arange(rows.start, rows.stop, dtype=np.int64)
            ends = np.where(number < cells, (number + 1) * grid.corners, cells * (grid.corners - 1) + number + 1)
            file.write(offsets, rows.start, ends)
            file.write(kinds, rows.start, np.where(number < cells, grid.kind, VTK_VERTEX))

    piece = {"NumberOfPoints": str(n), "NumberOfCells": str(cells + loose)}
    section = Section("Cells", (connectivity, offsets, kinds))
    _write_reached(data, path, "UnstructuredGrid", n, piece, section, write_cells, single)


def write_vtp(data: MapData, path: Path, *, single: bool = False) -> None:
    """Write the reached points as vertices of polygonal data. ``single`` as in ``write_vti``.

    Raises
    ------
    InputError
        An array name is used twice, or the file cannot be written.
    """
    n = int(np.count_nonzero(data.reached))
    piece, section, write_vertices = _vertices(n)
    _write_reached(data, path, "PolyData", n, piece, section, write_vertices, single)


def write_points(
    path: Path, points: Array, vectors: Mapping[str, tuple[Array, str]], texts: Mapping[str, Sequence[str]]
) -> None:
    """Write points (n, 3) mm as vertices of polygonal data with vectors: name -> ((n, 3) or (n,), unit).

    ``texts``: field data, strings by name. NaN stands where a component is not known.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    n = len(points)
    piece, topology, write_vertices = _vertices(n)
    arrays = {
        DataArray(name, _POINT, n, 1 if values.ndim == 1 else values.shape[1], unit): values
        for name, (values, unit) in vectors.items()
    }
    place = DataArray("Points", _POINT, n, components=3)
    sections = [Section("PointData", tuple(arrays)), Section("CellData"), Section("Points", (place,)), topology]
    with (
        whole_file(path, ".vtp") as temporary,
        AppendedFile(temporary, "PolyData", {}, piece, texts, sections) as file,
    ):
        for array, values in {**arrays, place: points}.items():
            file.write(array, 0, values)
        write_vertices(file)


def _vertices(n: int) -> tuple[dict[str, str], Section, Callable[[AppendedFile], None]]:
    """A vertex at each of n points: attributes of the piece, its section, and what writes that."""
    connectivity = DataArray("connectivity", _index_type(n), n)
    offsets = DataArray("offsets", _index_type(n), n)

    def write(file: AppendedFile) -> None:
        for rows in row_blocks(n):
            number = np.arange(rows.start, rows.stop, dtype=np.int64)
            file.write(connectivity, rows.start, number)
            file.write(offsets, rows.start, number + 1)

    piece = {"NumberOfPoints": str(n), "NumberOfVerts": str(n)}
    piece |= dict.fromkeys(("NumberOfLines", "NumberOfStrips", "NumberOfPolys"), "0")
    return piece, Section("Verts", (connectivity, offsets)), write


def _write_reached(
    data: MapData,
    path: Path,
    kind: str,
    n: int,
    piece: dict[str, str],
    topology: Section,
    write_topology: Callable[[AppendedFile], None],
    single: bool,
) -> None:
    """The n reached points with their arrays, and the cells that ``write_topology`` adds."""
    columns = map_columns(data)
    arrays = _arrays(columns, n, single)
    points = DataArray("Points", _POINT, n, components=3)
    sections = [Section("PointData", arrays, _active(columns)), Section("CellData"), Section("Points", (points,))]
    sections.append(topology)
    with (
        whole_file(path, f".vt{'u' if kind == 'UnstructuredGrid' else 'p'}") as temporary,
        AppendedFile(temporary, kind, {}, piece, _texts(data, columns), sections) as file,
    ):
        written = 0
        for rows in row_blocks(data.layout.n):
            keep = np.asarray(data.reached[rows])
            for column, array in zip(columns, arrays, strict=True):
                file.write(array, written, column.read(rows)[keep])
            written = file.write(points, written, points_mm(data, rows)[keep])
        write_topology(file)


def _write_connectivity(file: AppendedFile, array: DataArray, grid: CellGrid, data: MapData) -> None:
    """Cells, then loose points, both as numbers of reached points."""
    number = np.cumsum(data.reached, dtype=_index_type(data.layout.n)) - 1
    entry = 0
    for cells in grid.blocks(data.points):
        entry = file.write(array, entry, number[cells])
    for rows in row_blocks(data.layout.n):
        entry = file.write(array, entry, number[rows][grid.loose[rows]])


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


def _arrays(columns: Sequence[Column], n: int, single: bool) -> tuple[DataArray, ...]:
    return tuple(DataArray(c.name, c.dtype(single), n, unit=c.unit) for c in columns)


def _active(columns: Sequence[Column]) -> str | None:
    return columns[0].name if columns else None


def _texts(data: MapData, columns: Sequence[Column]) -> dict[str, Sequence[str]]:
    """Field data by name. Metadata with the name of another text get an underscore more."""
    texts: dict[str, Sequence[str]] = {
        "units": ["points = mm", *(f"{c.name} = {c.unit}" for c in columns if c.unit)],
        "labels": [f"{c.name} = {c.label}" for c in columns],
    }
    texts |= {f"{c.name}_categories": c.categories for c in columns if c.categories}
    for name, text in data.metadata.items():
        texts[free_name(name, texts)] = [text]
    return texts


def _index_type(largest: int) -> np.dtype[np.generic]:
    """Four bytes a point number as long as they do: half the file."""
    return np.dtype("<i4" if largest <= np.iinfo(np.int32).max else "<i8")


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
