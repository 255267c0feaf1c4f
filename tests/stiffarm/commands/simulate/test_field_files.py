"""The deformed arm as a .vtu: read back with plain VTK, compared with the fields it was made from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

from fem import ArmFields, arm_fields, build_model
from robots import InputError, load_description
from stiffarm.commands.simulate.command import SimulateRequest
from stiffarm.commands.simulate.field_files import (
    FieldGrid,
    automatic_scale,
    field_grid,
    round_scale,
    write_field,
)

W = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def fields() -> Iterator[ArmFields]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshes.casings.AROUND", 12)
        patch.setattr("meshes.casings.AROUND_WITH_OPENINGS", 12)
        model = build_model(load_description("xr701"), "shell").with_springs({"j2": 5e5, "j3": 5e5})
        yield arm_fields(model, np.radians([20.0, 5.0, 77.5, 0.0, -40.0, 0.0]), W)


@pytest.fixture(scope="module")
def grid(fields: ArmFields) -> FieldGrid:
    return field_grid(fields)


def read(path: Path) -> SimpleNamespace:
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    found = reader.GetOutput()

    def arrays(data: object) -> dict[str, object]:
        out = {}
        for i in range(data.GetNumberOfArrays()):  # type: ignore[attr-defined]
            array = data.GetAbstractArray(i)  # type: ignore[attr-defined]
            text = array.IsA("vtkStringArray")
            values = [array.GetValue(k) for k in range(array.GetNumberOfValues())] if text else vtk_to_numpy(array)
            out[array.GetName()] = values
        return out

    return SimpleNamespace(
        points=vtk_to_numpy(found.GetPoints().GetData()),
        cells=found.GetNumberOfCells(),
        kinds=[found.GetCellType(i) for i in range(found.GetNumberOfCells())],
        corners=[
            [found.GetCell(i).GetPointId(k) for k in range(found.GetCell(i).GetNumberOfPoints())]
            for i in range(0, found.GetNumberOfCells(), 97)
        ],
        point=arrays(found.GetPointData()),
        cell=arrays(found.GetCellData()),
        field=arrays(found.GetFieldData()),
    )


def test_arrays_and_units_are_those_of_the_fields(fields: ArmFields, grid: FieldGrid, tmp_path: Path) -> None:
    path = tmp_path / "field.vtu"
    write_field(grid, 200.0, path, springs=fields.springs, metadata={"load": "fz_N=-650"})
    assert [p.name for p in tmp_path.iterdir()] == ["field.vtu"]
    seen = read(path)
    assert seen.point.keys() == {"displacement_mm", "rotation_mrad", "undeformed_mm"}
    assert seen.cell.keys() == {
        "von_mises_MPa",
        "von_mises_front_MPa",
        "von_mises_back_MPa",
        "strain_energy_mJ",
        "energy_density_J_per_m3",
        "thickness_mm",
        "part",
    }
    assert seen.field["load"] == ["fz_N=-650"]
    assert seen.field["scale_factor"] == [200.0]
    assert "mm" in seen.field["units"][0]
    # Each link's numbers stand where its part id says; units by factor alone, so round-off.
    names = seen.field["part_names"]
    assert names == [link.name for link in fields.links]
    for number, link in enumerate(fields.links):
        mine = seen.cell["part"] == number
        np.testing.assert_allclose(seen.cell["strain_energy_mJ"][mine], 1e3 * link.energy, rtol=1e-14)
        np.testing.assert_allclose(seen.cell["thickness_mm"][mine], 1e3 * link.mesh.thickness, rtol=1e-14)
        np.testing.assert_allclose(seen.cell["von_mises_front_MPa"][mine], 1e-6 * link.von_mises[:, 0], rtol=1e-14)
        np.testing.assert_allclose(seen.cell["von_mises_MPa"][mine], 1e-6 * link.von_mises.max(axis=1), rtol=1e-14)
    together = np.concatenate([link.positions for link in fields.links])
    np.testing.assert_allclose(seen.point["undeformed_mm"], 1e3 * together, rtol=1e-14)
    motion = np.concatenate([link.displacement for link in fields.links])
    np.testing.assert_allclose(seen.point["displacement_mm"], 1e3 * motion[:, :3], rtol=1e-14)
    np.testing.assert_allclose(seen.point["rotation_mrad"], 1e3 * motion[:, 3:], rtol=1e-14)


def test_energies_add_up_to_half_the_work(fields: ArmFields, grid: FieldGrid, tmp_path: Path) -> None:
    write_field(grid, 1.0, tmp_path / "field.vtu", springs=fields.springs)
    seen = read(tmp_path / "field.vtu")
    springs = dict(zip(seen.field["spring_names"], seen.field["spring_energy_mJ"], strict=True))
    assert springs.keys() == {"j2", "j3", "bar"}
    total = seen.cell["strain_energy_mJ"].sum() + sum(springs.values())
    assert seen.field["energy_total_mJ"] == pytest.approx([total], rel=1e-12)
    # Condensed displacements against element energies: see tests/fem/statics/test_fields.py.
    assert total == pytest.approx(0.5e3 * float(W @ fields.displacement), rel=1e-9)


def test_points_are_displaced_by_the_scale(fields: ArmFields, grid: FieldGrid, tmp_path: Path) -> None:
    for scale in (1.0, 500.0):
        write_field(grid, scale, tmp_path / "field.vtu")
        seen = read(tmp_path / "field.vtu")
        moved = seen.point["undeformed_mm"] + scale * seen.point["displacement_mm"]
        np.testing.assert_allclose(seen.points, moved, rtol=0.0, atol=1e-9)  # mm; round-off of metres times 1e3
    # At the tool: the wrist's tip is the tool point of this robot, so its ring moves as the tool does on average.
    wrist = next(link for link in fields.links if link.name == "wrist")
    ring = wrist.displacement[wrist.mesh.interfaces["tip"], :3].mean(axis=0)
    np.testing.assert_allclose(ring, fields.displacement[:3], rtol=1e-9)


def test_triangles_and_quads_side_by_side(fields: ArmFields, tmp_path: Path) -> None:
    """One link cut into triangles: cells keep their order, kinds and corners."""
    link = fields.links[0]
    mesh = link.mesh
    cut = replace(
        mesh,
        triangles=np.concatenate([mesh.quads[:, [0, 1, 2]], mesh.quads[:, [0, 2, 3]]]),
        quads=np.zeros((0, 4), dtype=np.int64),
        thickness=np.tile(mesh.thickness, 2),
    )
    halved = replace(link, mesh=cut, energy=np.tile(0.5 * link.energy, 2), von_mises=np.tile(link.von_mises, (2, 1)))
    mixed = field_grid(replace(fields, links=(halved, *fields.links[1:])))
    whole = field_grid(fields)
    assert mixed.volume[: len(cut.triangles)].sum() == pytest.approx(whole.volume[: len(mesh.quads)].sum(), rel=1e-12)
    write_field(mixed, 1.0, tmp_path / "mixed.vtu")
    seen = read(tmp_path / "mixed.vtu")
    triangles = 2 * len(mesh.quads)
    assert seen.kinds == [5] * triangles + [9] * (seen.cells - triangles)
    assert [c for c in seen.corners if len(c) == 3] == cut.triangles[::97].tolist()
    corners, cell = mixed.triangles()
    assert np.bincount(cell).tolist() == [1] * triangles + [2] * (seen.cells - triangles)
    spans = np.cross(*(mixed.nodes[corners[:, k]] - mixed.nodes[corners[:, 0]] for k in (1, 2)))
    # Halves of warped quads have a little more area than the projection: measured 3e-4 at most.
    np.testing.assert_allclose(
        np.bincount(cell, 0.5 * np.linalg.norm(spans, axis=1)), mixed.volume / mixed.thickness, rtol=1e-2
    )


def test_the_scale_is_round_and_draws_some_eight_per_cent(grid: FieldGrid) -> None:
    scale = automatic_scale(grid)
    drawn = scale * np.linalg.norm(grid.displacement[:, :3], axis=1).max()
    size = np.linalg.norm(np.ptp(grid.nodes, axis=0))
    # Between neighbours 1, 2, 5 and 10 the ratio is 2.5 at most: within its square root of 8 %.
    assert 0.08 / 1.6 < drawn / size < 0.08 * 1.6
    assert f"{scale:e}"[:2] in ("1.", "2.", "5.")
    assert [round_scale(v) for v in (0.9, 1.3, 1.5, 3.0, 3.3, 8.0, 0.014, 1234.0)] == [
        1.0,
        1.0,
        2.0,
        2.0,
        5.0,
        10.0,
        0.01,
        1000.0,
    ]


def test_bad_scales_and_an_arm_that_does_not_move_are_refused(grid: FieldGrid, tmp_path: Path) -> None:
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="--scale"):
            SimulateRequest(pose={"q2_deg": 5}, field=True, scale=wrong)
    with pytest.raises(InputError, match="largest displacement"):
        automatic_scale(replace(grid, displacement=np.zeros_like(grid.displacement)))
    with pytest.raises(InputError, match=r"\.vtu"):
        write_field(grid, 1.0, tmp_path / "field.vtk")
    with pytest.raises(InputError, match="folder"):
        write_field(grid, 1.0, tmp_path / "nowhere" / "field.vtu")
