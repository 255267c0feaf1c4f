import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from map_file_cases import ODD_METADATA, arrays_of, box, cylinder, finished, with_junk
from refusals import refuses

from surrogate.maps.data import Axis, Field, Layout, MapData
from surrogate.maps.mesh import read_map, write_map

ENDINGS = [".vti", ".vtu", ".vtp"]
# Between map and file stand one factor (m to mm, rad to deg, share to percent): round-off.
ROUND_OFF = 1e-15


def read(path):
    """A data set as plain VTK reads it, without a word of complaint."""
    from vtkmodules import vtkIOXML

    kind = {".vti": "ImageData", ".vtu": "UnstructuredGrid", ".vtp": "PolyData"}[path.suffix]
    reader = getattr(vtkIOXML, f"vtkXML{kind}Reader")()
    complaints = []
    reader.AddObserver("ErrorEvent", lambda *_: complaints.append("error"))
    reader.AddObserver("WarningEvent", lambda *_: complaints.append("warning"))
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    assert complaints == []
    return reader.GetOutput()


def point_arrays(grid):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = grid.GetPointData()
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def texts(grid):
    data = grid.GetFieldData()
    arrays = [data.GetAbstractArray(i) for i in range(data.GetNumberOfArrays())]
    return {a.GetName(): [a.GetValue(k) for k in range(a.GetNumberOfValues())] for a in arrays}


def with_holes(layout, seed=1):
    return np.random.default_rng(seed).uniform(size=layout.n) < 0.9


def volumes(path):
    """Sizes of the cells (mm, mm^2 or mm^3), after VTK."""
    import pyvista as pv

    mesh = pv.read(path)
    sizes = mesh.compute_cell_sizes(length=True, area=True, volume=True)
    return mesh.celltypes, sizes["Length"] + sizes["Area"] + sizes["Volume"]


@pytest.mark.parametrize("suffix", ENDINGS)
def test_plain_vtk_reads_every_array_unit_and_text(tmp_path, suffix):
    layout = box()
    data = finished(layout, with_holes(layout), {"robot": "xr701", "load": "-Z"})
    write_map(data, tmp_path / f"map{suffix}")
    grid = read(tmp_path / f"map{suffix}")
    keep = np.ones(layout.n, dtype=bool) if suffix == ".vti" else data.reached
    points = np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())])
    np.testing.assert_allclose(points, data.points[keep] * 1e3, rtol=ROUND_OFF, atol=1e-12)
    found, expected = point_arrays(grid), arrays_of(data)
    assert list(found) == [*expected, *(["reached"] if suffix == ".vti" else [])]
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values[keep], rtol=2 * ROUND_OFF, err_msg=name)
    assert found["softest_part"].dtype == np.int32
    if suffix == ".vti":
        np.testing.assert_array_equal(found["reached"], data.reached)
    assert grid.GetPointData().GetScalars().GetName() == "stiffness_N_per_mm"

    from vtkmodules.vtkCommonCore import vtkDataArray

    units = {n: grid.GetPointData().GetArray(n).GetInformation().Get(vtkDataArray.UNITS_LABEL()) for n in expected}
    assert units["stiffness_N_per_mm"] == "N/mm"
    assert units["q2_deg"] == "deg"
    assert units["share_of_base_percent"] == "percent"
    assert units["isotropy"] is None
    said = texts(grid)
    assert said["softest_part_categories"] == ["link 2", "größte <&>", "base"]
    assert said["units"][:2] == ["points = mm", "stiffness_N_per_mm = N/mm"]
    assert "isotropy = isotropy" in said["labels"]
    assert (said["robot"], said["load"]) == (["xr701"], ["-Z"])


def test_image_of_a_box_stands_where_its_points_are(tmp_path):
    write_map(finished(box()), tmp_path / "map.vti")
    image = read(tmp_path / "map.vti")
    assert image.GetExtent() == (0, 4, 0, 2, 0, 3)
    assert image.GetOrigin() == (-100.0, 50.0, 20.0)
    assert image.GetSpacing() == (10.0, 20.0, 30.0)


@pytest.mark.parametrize(("plane", "counts"), [("zx", (5, 1, 4)), ("zy", (1, 3, 4)), ("yx", (5, 3, 1))])
def test_a_slice_is_one_layer_in_its_plane(tmp_path, plane, counts):
    layout = Layout("slice", tuple(axis for axis in box().axes if axis.name in plane))
    data = finished(layout, with_holes(layout))
    write_map(data, tmp_path / "map.vti")
    write_map(data, tmp_path / "map.vtu")
    image = read(tmp_path / "map.vti")
    assert image.GetDimensions() == counts
    points = np.array([image.GetPoint(i) for i in range(layout.n)])
    np.testing.assert_allclose(points, data.points * 1e3, rtol=ROUND_OFF, atol=1e-12)
    kinds, sizes = volumes(tmp_path / "map.vtu")
    steps = {"x": 10.0, "y": 20.0, "z": 30.0}
    np.testing.assert_allclose(sizes[kinds == 9], steps[plane[0]] * steps[plane[1]], rtol=1e-12)


@pytest.mark.parametrize("shape", [(4, 3, 5), (2, 2, 2), (1, 3, 5), (4, 1, 1), (1, 1, 1)])
def test_cells_join_reached_neighbours_and_no_others(tmp_path, shape):
    layout = box(*shape)
    reached = with_holes(layout)
    reached[0] = True
    data = finished(layout, reached)
    write_map(data, tmp_path / "map.vtu")
    read(tmp_path / "map.vtu")

    import pyvista as pv

    mesh = pv.read(tmp_path / "map.vtu")
    # Cells by their centres, from the mask alone: where all neighbours up to one step away are reached.
    wide = [axis for axis in range(3) if shape[axis] > 1]
    full = reached.reshape(shape)
    for axis in wide:
        ahead = np.moveaxis(full, axis, 0)
        full = np.moveaxis(ahead[:-1] & ahead[1:], 0, axis)
    half = [0.5 * step if count > 1 else 0.0 for step, count in zip((30.0, 20.0, 10.0), shape, strict=True)]
    expected = np.argwhere(full)[:, ::-1] * [10.0, 20.0, 30.0] + [-100.0, 50.0, 20.0] + half[::-1]
    kind = {3: 12, 2: 9, 1: 3, 0: 1}[len(wide)]
    centres = mesh.cell_centers().points[mesh.celltypes == kind]
    if kind != 1:
        np.testing.assert_allclose(centres, expected, rtol=1e-12)
        _, sizes = volumes(tmp_path / "map.vtu")
        steps = np.prod([(30.0, 20.0, 10.0)[axis] for axis in wide])
        np.testing.assert_allclose(sizes[mesh.celltypes == kind], steps, rtol=1e-12)
    # Every reached point is in a cell, if only in one of its own.
    assert len(np.unique(mesh.cell_connectivity)) == reached.sum() == mesh.n_points


def test_cells_of_a_sweep_are_those_of_the_map_before(tmp_path):
    axes = [Axis(name, "deg", np.linspace(-30.0, 40.0, n)) for name, n in (("q2_deg", 4), ("q3_deg", 3), ("q5_deg", 5))]
    layout = Layout("joints", tuple(axes))
    reached = with_holes(layout)
    write_map(finished(layout, reached), tmp_path / "map.vtu")
    # Cells with all corners reached, as numbers of reached points in the order of the layout.
    number = np.where(reached, np.cumsum(reached) - 1, -1).reshape(layout.shape)
    sides = [range(n - 1) for n in layout.shape]
    corners = [
        [number[tuple(np.add(first, step))] for step in np.ndindex(*[2] * len(sides))] for first in product(*sides)
    ]
    expected = [sorted(cell) for cell in corners if min(cell) >= 0]
    np.testing.assert_array_equal(np.sort(whole_cells(tmp_path / "map.vtu"), axis=1), expected)
    kinds, sizes = volumes(tmp_path / "map.vtu")
    assert (sizes[kinds == 12] > 0.0).all()


def whole_cells(path):
    """Cells (m, corners) of more than one corner, as plain VTK reads them."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    cells = read(path).GetCells()
    offsets, entries = vtk_to_numpy(cells.GetOffsetsArray()), vtk_to_numpy(cells.GetConnectivityArray())
    size = np.diff(offsets)
    return entries[offsets[:-1][size > 1][:, None] + np.arange(size.max())]


@pytest.mark.parametrize(("n", "layers"), [(4, 0), (3, 1)])
def test_layers_of_a_sweep_are_not_joined(tmp_path, n, layers):
    axes = [Axis(f"q{i}_deg", "deg", 10.0 * np.arange(3)) for i in range(n)]
    layout = Layout("joints", tuple(axes), layers)
    data = finished(layout)
    data.points[:, 2] += np.arange(layout.n) // (layout.n // 3)
    write_map(data, tmp_path / "map.vtu")
    cells = whole_cells(tmp_path / "map.vtu")
    assert cells.shape == (3 * 2 ** (n - 1), 2 ** (n - 1))
    layer = cells // (layout.n // 3)
    assert (layer == layer[:, :1]).all()


@pytest.mark.parametrize(
    ("phi", "cells_around"),
    [
        (np.arange(0.0, 360.0, 30.0), 12),  # the last sector closes the turn
        (np.linspace(-180.0, 180.0, 13), 12),  # both ends given: closed already
        (np.arange(0.0, 330.0, 30.0), 10),  # one step short of it
        (-np.arange(0.0, 360.0, 30.0), 12),
        (np.arange(0.0, 360.0, 30.0) * (1.0 - 1e-9), 12),  # rounded
    ],
)
def test_a_cylinder_closes_over_a_full_turn(tmp_path, phi, cells_around):
    data = finished(cylinder(phi))
    write_map(data, tmp_path / "map.vtu")
    kinds, sizes = volumes(tmp_path / "map.vtu")
    assert list(kinds) == [12] * (2 * cells_around)
    # A sector between two radii is a trapezium: half the sine of its angle times the difference of the squares.
    area = 0.5 * np.sin(np.radians(30.0)) * (300.0**2 - 100.0**2)
    assert sizes.min() > 0.0
    np.testing.assert_allclose(sizes.sum(), cells_around * area * 50.0, rtol=1e-12)


@pytest.mark.parametrize("suffix", ENDINGS)
def test_odd_words_survive(tmp_path, suffix):
    write_map(finished(box(), metadata=ODD_METADATA), tmp_path / f"ü map{suffix}")
    said = texts(read(tmp_path / f"ü map{suffix}"))
    for name in ("robot", "note", "empty", "long"):
        assert said[name] == [ODD_METADATA[name]]
    # Names cannot hold what XML does not: VTK would write a file that it does not read.
    assert said["load direction ___'__ größe"] == ["-Z"]
    assert said["units_"] == ["a name of the writer's own"]
    assert said["control_"] == ["control \ufffd byte, lone ? surrogate"]
    import pyvista as pv

    assert pv.read(tmp_path / f"ü map{suffix}").field_data["robot"][0] == "xr701"


@pytest.mark.parametrize("suffix", ENDINGS)
def test_a_map_out_of_reach_is_refused(tmp_path, suffix):
    layout = box()
    refuses(
        "S012",
        "no pose at any of 60 points",
        write_map,
        finished(layout, np.zeros(layout.n, dtype=bool)),
        tmp_path / f"map{suffix}",
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", ENDINGS)
def test_a_file_is_read_back_as_the_map_that_it_was(tmp_path, suffix):
    layout = box()
    data = finished(layout, with_holes(layout), {"robot": "xr701", "load": "-Z"})
    write_map(data, tmp_path / f"map{suffix}")
    again = read_map(tmp_path / f"map{suffix}")
    keep = np.ones(layout.n, dtype=bool) if suffix == ".vti" else data.reached
    np.testing.assert_array_equal(again.reached, data.reached[keep])
    np.testing.assert_allclose(again.points, data.points[keep], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(again.q, data.q[keep], rtol=1e-12)
    assert again.coordinates == data.coordinates
    assert dict(again.metadata) == dict(data.metadata)
    for name, f in data.fields.items():
        found = again.fields[name]
        assert (found.unit, found.label, found.categories) == (f.unit, f.label, f.categories)
        expected = np.where(data.reached, f.values, -1.0 if f.categories else np.nan)[keep]
        np.testing.assert_allclose(found.values, expected, rtol=1e-12)


def test_what_is_no_map_of_ours_is_refused(tmp_path):
    (tmp_path / "map.vtu").write_text("<VTKFile", encoding="utf-8")
    refuses("A012", r"is no map of stiffarm|cannot be read", read_map, tmp_path / "map.vtu")
    write_map(finished(box(), metadata={}), tmp_path / "map.vti")
    refuses("A012", "is no map of stiffarm", read_map, tmp_path / "map.vti")


def test_what_stands_where_nothing_is_reached_is_not_shown(tmp_path):
    layout = box()
    data = with_junk(finished(layout, with_holes(layout)))
    write_map(data, tmp_path / "map.vti")
    found = point_arrays(read(tmp_path / "map.vti"))
    del found["reached"]
    for name, values in found.items():
        np.testing.assert_array_equal(np.isnan(values) | (values == -1), ~data.reached, err_msg=name)


def test_axes_that_fall_give_cells_of_positive_volume(tmp_path):
    for steps in [(-10.0, 20.0, 30.0), (-10.0, -20.0, 30.0), (-10.0, -20.0, -30.0)]:
        write_map(finished(box(step=steps)), tmp_path / "map.vtu")
        np.testing.assert_allclose(volumes(tmp_path / "map.vtu")[1], 6000.0, rtol=1e-12)


def test_a_map_of_points_alone(tmp_path):
    layout = box()
    full = finished(layout)
    data = MapData(layout, full.points, full.q, full.reached, full.coordinates, {})
    for suffix in ENDINGS:
        write_map(data, tmp_path / f"map{suffix}")
        assert read(tmp_path / f"map{suffix}").GetPointData().GetScalars().GetName() == "q2_deg"


@pytest.mark.parametrize("suffix", ENDINGS)
def test_bad_places_are_named(tmp_path, suffix):
    data = finished(box())
    refuses("B004", r"ends in \.vti, \.vtu or \.vtp", write_map, data, tmp_path / "map.vtk")
    refuses("F008", "existing folder", write_map, data, tmp_path / "nowhere" / f"map{suffix}")
    (tmp_path / f"taken{suffix}").mkdir()
    refuses("F008", "could not be written", write_map, data, tmp_path / f"taken{suffix}")
    assert [p.name for p in tmp_path.iterdir()] == [f"taken{suffix}"]


def test_what_is_no_image_is_refused(tmp_path):
    uneven = box()
    uneven.axes[2].values[1] += 0.1
    falling = Layout("box", tuple(Axis(a.name, a.unit, a.values[::-1].copy()) for a in box().axes))
    crossed = Layout("box", box().axes[::-1])
    for layout, words in [
        (uneven, "axis x"),
        (falling, "axis z"),
        (crossed, "x, y, z"),
        (cylinder([0, 9]), "cylinder"),
    ]:
        refuses("B004", words, write_map, finished(layout), tmp_path / "map.vti")
    shifted = finished(box())
    shifted.points[:] += 1e-3
    refuses("B004", "not those of the axes", write_map, shifted, tmp_path / "map.vti")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["q2_deg", "reached"])
def test_an_array_name_used_twice_is_refused(tmp_path, name):
    layout = box()
    full = finished(layout)
    fields = {name: Field(np.zeros(layout.n), "", "")}
    data = MapData(layout, full.points, full.q, full.reached, full.coordinates, fields)
    for suffix in ENDINGS:
        refuses("S011", f"used twice.*{name}", write_map, data, tmp_path / f"map{suffix}")


@pytest.mark.parametrize("suffix", ENDINGS)
def test_a_full_disk_leaves_the_file_before(tmp_path, suffix):
    """What a disk refuses, VTK says in its own way: a process may write no file of more than 2 kB here."""
    path, program = tmp_path / f"map{suffix}", FULL_DISK
    write_map(finished(box()), path)
    before = path.read_bytes()
    here = Path(__file__).resolve().parent
    command = [sys.executable, "-c", program, str(path)]
    paths = os.pathsep.join([str(here), str(here.parents[2])])
    run = subprocess.run(  # noqa: S603 - our own interpreter with our own program
        command, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True, check=True
    )
    assert "could not be written" in run.stdout
    assert run.stderr == ""
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


FULL_DISK = """
import resource, sys
from pathlib import Path
from map_file_cases import box, finished
from robots import InputError
from surrogate.maps.mesh import map_mesh, save_mesh
mesh = map_mesh(finished(box(), seed=3), Path(sys.argv[1]).suffix[1:])
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
try:
    save_mesh(mesh, Path(sys.argv[1]))
except InputError as error:
    print(error)
"""
