import numpy as np
import pytest

from robots import InputError
from surrogate.maps.vtk_files import StiffnessMap, grid_cells, read_vtu, write_vtu


def small_map(**changes):
    fields = {
        "positions": np.array([[1.0, 0.0, 2.0], [1.5, -0.25, 0.5], [2.0, 0.1, -0.3]]),
        "stiffness": np.array([2.5e5, 4.0e5, 9.9e5]),
        "joints": {"q2_deg": np.array([-35.0, 5.0, 45.0]), "q3real_deg": np.array([40.0, 77.5, 115.0])},
        "scalars": {"deflection_mm": np.array([2.6, 1.6, 0.66])},
        "metadata": {"robot": "xr701", "load direction": "-Z", "note": "größer ≥ 1 <&>"},
    }
    return StiffnessMap(**{**fields, **changes})


def test_vtu_round_trip_keeps_values_names_units_and_metadata(tmp_path):
    path = tmp_path / "map.vtu"
    original = small_map()
    write_vtu(original, path)
    back = read_vtu(path)
    # Only the factor 1e3 stands between map and file: round-off.
    np.testing.assert_allclose(back.points_mm, [[1000, 0, 2000], [1500, -250, 500], [2000, 100, -300]], rtol=1e-15)
    assert set(back.point_arrays) == {"stiffness_N_per_mm", "q2_deg", "q3real_deg", "deflection_mm"}
    np.testing.assert_allclose(back.point_arrays["stiffness_N_per_mm"], [250.0, 400.0, 990.0], rtol=1e-15)
    np.testing.assert_array_equal(back.point_arrays["q3real_deg"], [40.0, 77.5, 115.0])
    np.testing.assert_array_equal(back.point_arrays["deflection_mm"], [2.6, 1.6, 0.66])
    assert back.metadata == original.metadata
    assert back.cells is None


def test_plain_vtk_finds_a_vertex_for_each_point_and_active_stiffness(tmp_path):
    from vtkmodules.vtkCommonDataModel import VTK_VERTEX
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    write_vtu(small_map(), tmp_path / "map.vtu")
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "map.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    assert [grid.GetCellType(i) for i in range(grid.GetNumberOfCells())] == [VTK_VERTEX] * 3
    assert grid.GetPointData().GetScalars().GetName() == "stiffness_N_per_mm"


def grid_map(keep):
    """A 3 x 2 x 2 box of points 1 x 2 x 3 m apart, only those kept."""
    index = np.stack(np.meshgrid(range(3), range(2), range(2), indexing="ij"), axis=-1).reshape(-1, 3)
    positions = index[keep] * [1.0, 2.0, 3.0]
    return StiffnessMap(positions, 1e5 + np.arange(keep.sum()), cells=grid_cells((3, 2, 2), keep))


def test_grid_cells_by_hand():
    # Point (i, j, k) has number 4 i + 2 j + k.
    full = grid_cells((3, 2, 2), np.ones(12, dtype=bool))
    np.testing.assert_array_equal(full, [[0, 4, 6, 2, 1, 5, 7, 3], [4, 8, 10, 6, 5, 9, 11, 7]])
    keep = np.ones((3, 2, 2), dtype=bool)
    keep[0, 0, 1] = False  # number 1: the first cell goes, later points move down by one
    np.testing.assert_array_equal(grid_cells((3, 2, 2), keep), [[3, 7, 9, 5, 4, 8, 10, 6]])
    np.testing.assert_array_equal(grid_cells((2, 3), np.ones(6, dtype=bool)), [[0, 3, 4, 1], [1, 4, 5, 2]])
    assert grid_cells((1, 2, 2), np.ones(4, dtype=bool)).shape == (0, 8)


def test_hexahedra_have_the_volume_of_the_grid_in_vtk(tmp_path):
    import pyvista as pv

    keep = np.ones(12, dtype=bool)
    path = tmp_path / "grid.vtu"
    write_vtu(grid_map(keep), path)
    # Two cells of 1 x 2 x 3 m in mm^3; a wrong corner order gives another, or a negative, volume.
    sizes = pv.read(path).compute_cell_sizes()["Volume"]
    np.testing.assert_allclose(sizes, [6e9, 6e9], rtol=1e-12)


def test_points_outside_the_cells_stay_visible(tmp_path):
    keep = np.ones(12, dtype=bool)
    keep[1] = False
    written = grid_map(keep)
    write_vtu(written, tmp_path / "grid.vtu")
    back = read_vtu(tmp_path / "grid.vtu")
    np.testing.assert_array_equal(back.cells, written.cells)
    assert len(back.points_mm) == 11

    import pyvista as pv

    # One hexahedron with 8 of the 11 points, three vertices.
    assert sorted(pv.read(tmp_path / "grid.vtu").celltypes) == [1, 1, 1, 12]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stiffness": np.array([1e5, np.nan, 1e5])}, "stiffness, pose 1"),
        ({"stiffness": np.array([1e5, -1.0, 1e5])}, "stiffness, pose 1"),
        ({"positions": np.array([[0, 0, 0], [0, 0, 0], [0, np.inf, 0]])}, "positions, pose 2"),
        ({"stiffness": np.array([1e5, 1e5])}, r"allowed: \(3,\)"),
        ({"joints": {"q2": np.zeros(3)}}, "_deg"),
        ({"scalars": {"q2_deg": np.zeros(3)}}, "used twice"),
        ({"scalars": {"stiffness_N_per_mm": np.zeros(3)}}, "used twice"),
        ({"cells": np.array([[0, 1, 2, 3]])}, "0 to 2"),
        ({"cells": np.array([[0, 1, 2]])}, r"\(m, 8\)"),
    ],
)
def test_bad_maps_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        small_map(**changes)


def test_bad_grids_are_refused():
    with pytest.raises(InputError, match="12 booleans"):
        grid_cells((3, 2, 2), np.ones(11, dtype=bool))
    with pytest.raises(InputError, match="12 booleans"):
        grid_cells((3, 2, 2), np.ones(12))
    with pytest.raises(InputError, match="two or three"):
        grid_cells((12,), np.ones(12, dtype=bool))


def test_files_are_written_whole_or_not_at_all(tmp_path):
    with pytest.raises(InputError, match=r"\.vtu"):
        write_vtu(small_map(), tmp_path / "map.vtk")
    with pytest.raises(InputError, match="existing folder"):
        write_vtu(small_map(), tmp_path / "nowhere" / "map.vtu")
    write_vtu(small_map(), tmp_path / "map.vtu")
    assert [p.name for p in tmp_path.iterdir()] == ["map.vtu"]


def test_a_missing_or_foreign_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"missing\.vtu"):
        read_vtu(tmp_path / "missing.vtu")
    (tmp_path / "text.vtu").write_text("no XML at all")
    with pytest.raises(InputError, match=r"text\.vtu"):
        read_vtu(tmp_path / "text.vtu")
