"""`map index`: files read back, figures against the library, the workpiece, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from cli_runs import Command, Outcome, run_here, tree
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import VTK_HEXAHEDRON, VTK_QUAD
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

import fem
import robots
from machining import Objective, Task, stiffness_index, tool_path
from machining.stiffness.distribution import best_gamma, distribution
from machining.stiffness.grid import in_box
from robots import InputError
from stiffarm.commands.maps.index.request import REGION, IndexMapRequest
from stiffarm.request import FRAME
from stiffarm.session.task_options import parse_range, values_of
from surrogate.maps.blocks import Engine
from surrogate.maps.layouts import own_points, plane_or_box

GRID = ("--x", "-300:600:150", "--y", "600:1200:150", "--z", "486")
TOOL = ("--tool", "200,0,80,0,90,0")
QUICK = ("--links", "rigid", "--no-pictures", "--json")


def a_map(cli: Command, *options: str, quantity: str = "k_fs") -> Outcome:
    return cli("map", "index", "kr60-3", "--quantity", quantity, *options, "--out", "out")


def read(file: Path) -> tuple[Any, dict[str, np.ndarray[Any, Any]], dict[str, str]]:
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    reader.Update()
    grid = reader.GetOutput()
    data, fields = grid.GetPointData(), grid.GetFieldData()
    arrays = {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}
    texts = {fields.GetArrayName(i): fields.GetAbstractArray(i).GetValue(0) for i in range(fields.GetNumberOfArrays())}
    return grid, arrays, texts


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """A map with pictures, a part frame and a workpiece, and what went to stdout."""
    out = tmp_path_factory.mktemp("map") / "out"
    outcome = run_here(
        "map",
        "index",
        "kr60-3",
        *GRID,
        *TOOL,
        "--part",
        "0,0,100,0,0,10",
        "--gamma",
        "-180:180:60",
        "--workpiece",
        "x=-150:150,y=750:900",
        "--show",
        "0,180",
        "--links",
        "rigid",
        "--json",
        "--out",
        str(out),
    )
    assert outcome.code == 0, outcome.err
    return out, outcome.json


def test_all_figures_are_those_of_the_library(made: tuple[Path, Any]) -> None:
    out, content = made
    model = fem.build_model(robots.load_description("kr60-3"), links="rigid")
    tool, part = FRAME.of("200,0,80,0,90,0", "--tool"), FRAME.of("0,0,100,0,0,10", "--part")
    grid = plane_or_box(np.arange(-300.0, 610.0, 150.0), np.arange(600.0, 1210.0, 150.0), 486.0, part)
    # The part is turned about base z: its normal is base z.
    gamma = np.radians(np.arange(-180.0, 180.0, 60.0))
    found = distribution(model, Task(tool_path(own_points(grid), [0.0, 0.0, 1.0]), tool, part), Objective(), gamma)
    table = pd.read_csv(out / "index_map.csv")
    values = table.filter(regex="^k_fs_N_per_mm_gamma").to_numpy()
    # Nine digits are written.
    np.testing.assert_allclose(values, 1e-3 * found.value, rtol=1e-8)
    np.testing.assert_allclose(table["best_k_fs_N_per_mm"], 1e-3 * found.steady_at_points().value, rtol=1e-8)
    places = own_points(grid) @ part[:3, :3].T + part[:3, 3]
    np.testing.assert_allclose(table[["x_mm", "y_mm", "z_mm"]], 1e3 * places, atol=1e-5)
    statistics = pd.read_csv(out / "gamma_statistics.csv")
    np.testing.assert_allclose(statistics["gamma_deg"], np.arange(-180.0, 180.0, 60.0))
    for over in ("reached", "common"):
        s = found.statistics(over)  # type: ignore[arg-type]
        np.testing.assert_allclose(statistics[f"{over}_mean_k_fs_N_per_mm"], 1e-3 * s.mean, rtol=1e-8)
        column = statistics[f"{over}_standard_deviation_k_fs_N_per_mm"]
        np.testing.assert_allclose(column, 1e-3 * s.standard_deviation, rtol=1e-8)
    inside = in_box(grid, [-0.15, 0.75, -np.inf], [0.15, 0.9, np.inf])
    choice = best_gamma(found, inside)
    assert content["best_gamma"]["gamma_deg"] == pytest.approx(np.degrees(choice.gamma))
    assert content["best_gamma"]["value"] == pytest.approx(1e-3 * choice.value, rel=1e-5)
    assert content["workpiece_points"] == inside.sum() == table["workpiece"].sum() == 6
    # Something is out of reach, or the empty cells are not tested.
    assert 0.5 < found.reached.mean() < 1.0


def test_the_grid_is_readable_by_plain_vtk(made: tuple[Path, Any]) -> None:
    out, content = made
    grid, arrays, texts = read(out / "index_map.vtu")
    table = pd.read_csv(out / "index_map.csv")
    points = vtk_to_numpy(grid.GetPoints().GetData())
    np.testing.assert_allclose(points, table[["x_mm", "y_mm", "z_mm"]], atol=1e-4)
    assert grid.GetNumberOfPoints() == content["points"] == 35
    assert (grid.GetNumberOfCells(), grid.GetCellType(0)) == (24, VTK_QUAD)
    # Asked for 0 and 180 deg; 180 is the angle -180 of the full turn.
    assert set(arrays) == {
        "best_k_fs_N_per_mm",
        "best_gamma_deg",
        "k_fs_N_per_mm_gamma_-180_deg",
        "k_fs_N_per_mm_gamma_0_deg",
        "share_of_gamma",
        "workpiece",
        "jacobian_smallest_singular_value",
        "near_singular",
        *(f"q{i}_deg" for i in range(1, 7)),
    }
    for name in ("best_k_fs_N_per_mm", "best_gamma_deg", "k_fs_N_per_mm_gamma_0_deg"):
        np.testing.assert_allclose(arrays[name], table[name], rtol=1e-8)
    values = table.filter(regex="^k_fs_N_per_mm_gamma").to_numpy()
    np.testing.assert_allclose(arrays["share_of_gamma"], np.isfinite(values).mean(axis=1))
    # Both: the whole of the first cell lies within the grid's first row and column.
    corners = [grid.GetCell(0).GetPointId(i) for i in range(4)]
    np.testing.assert_allclose(np.ptp(points[corners, :2], axis=0).max(), 150.0, rtol=0.3)
    assert texts["robot"] == "kr60-3"
    assert texts["tool_on_flange"] == "200, 0, 80 mm; 0, 90, 0 deg"
    assert texts["part_in_base"] == "0, 0, 100 mm; 0, 0, 10 deg"
    assert texts["normal"] == texts["tool_axis"] == "0 0 1"
    assert "points = mm" in texts["units"]
    assert "collisions" in texts["not_checked"]
    assert len(texts["model_hash"]) == 64


def test_the_folder_has_every_file_that_is_named(made: tuple[Path, Any]) -> None:
    out, content = made
    pictures = {"index_map.png", "gamma_statistics.png", "report.html"}
    tables = {"index_map.csv", "gamma_statistics.csv", "trade_off.csv"}
    assert content["files"] == ["index_map.vtu", "index_map.csv"]
    assert set(tree(out)) == {"index_map.vtu", "index_map.json", "run.json"} | tables | pictures
    assert json.loads((out / "index_map.json").read_text(encoding="utf-8")) == content
    assert content["schema"] == "stiffarm-index-map/2"
    assert (content["quantity"], content["unit"]) == ("k_fs", "N/mm")


def test_a_box_has_hexahedra_and_a_number_has_no_unit(cli: Command, tmp_path: Path) -> None:
    box = ("--x", "900:1100:100", "--y", "-100:100:200", "--z", "400:600:100")
    outcome = a_map(cli, *box, *TOOL, "--gamma", "20", *QUICK, quantity="isotropy")
    assert (outcome.code, outcome.json["unit"], outcome.json["counts"]) == (0, "1", [3, 2, 3])
    grid, arrays, _ = read(tmp_path / "out" / "index_map.vtu")
    assert (grid.GetNumberOfCells(), grid.GetCellType(0)) == (4, VTK_HEXAHEDRON)
    np.testing.assert_array_equal(arrays["best_isotropy"], arrays["isotropy_gamma_20_deg"])
    # Right-handed cells: volumes are positive.
    assert "index_map.png" not in tree(tmp_path / "out")


@pytest.mark.usefixtures("blank")
def test_the_files_are_those_of_all_maps(cli: Command, tmp_path: Path) -> None:
    """Formats, the page to pick in, and a work folder that a second run goes on from; the pose is the best gamma's."""
    grid = ("--x", "900:1100:100", "--y", "-100:100:100", "--z", "600", *TOOL, "--gamma", "-180:180:60")
    more = ("--format", "vti,vtp", "--html", "--work", "work")
    outcome = a_map(cli, *grid, *more, "--links", "rigid", "--no-pictures", "--json")
    assert outcome.code == 0, outcome.err
    made = tree(tmp_path / "out")
    assert {"index_map.vti", "index_map.vtp", "map.html"} <= set(made)
    assert "index_map.vtu" not in made
    table = pd.read_csv(tmp_path / "out" / "index_map.csv")
    model = fem.build_model(robots.load_description("kr60-3"), links="rigid")
    q = np.radians(table.filter(regex="^q").to_numpy())
    tool = FRAME.of("200,0,80,0,90,0", "--tool")
    k = stiffness_index(model, q, [0.0, 0.0, 1.0], tool[:3, 3])
    np.testing.assert_allclose(1e-3 * k, table["best_k_fs_N_per_mm"], rtol=1e-7)
    tips = robots.tool_position(model.robot, robots.forward_kinematics(model.robot, q), tool[:3, 3])
    np.testing.assert_allclose(1e3 * tips, table[["x_mm", "y_mm", "z_mm"]], atol=1e-4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Engine, "block", lambda *_: pytest.fail("made a second time"))
        again = cli("map", "index", "kr60-3", *grid, *more, "--links", "rigid", "--no-pictures", "--out", "again")
    assert again.code == 0, again.err
    same = (tmp_path / folder / "index_map.csv" for folder in ("out", "again"))
    assert len({file.read_bytes() for file in same}) == 1


def test_an_image_has_no_turned_part(cli: Command) -> None:
    outcome = a_map(cli, *GRID, "--part", "0,0,100,0,0,10", "--format", "vti", *QUICK)
    assert outcome.code == 2
    assert "--format vti" in outcome.err


def test_normal_and_axis_are_in_base_axes(cli: Command) -> None:
    """A part turned over by 90 deg about x, its grid turned back: the same points, and the same normal in base axes."""
    plain = ("--x", "900:1100:100", "--y", "-100:100:100", "--z", "600")
    turned = ("--part", "0,0,0,90,0,0", "--x", "900:1100:100", "--y", "600", "--z", "-100:100:100")
    best = []
    for options in (plain, turned):
        tilted = ("--normal", "0.1,0,1", "--tool-axis", "0,0.2,1", "--gamma", "-180:180:10")
        outcome = a_map(cli, *options, *TOOL, *tilted, *QUICK)
        assert outcome.code == 0, outcome.err
        best.append(outcome.json["best_of_each_point"])
        assert outcome.json["normal"] == "0.1 0 1"
    # Gamma counts from the part's x axis, which is base x in both.
    assert best[0] == best[1]


def test_displacements_need_a_force_and_are_small_where_good(cli: Command) -> None:
    refused = a_map(cli, *GRID, *TOOL, *QUICK, quantity="displacement")
    assert refused.code == 2
    assert "force" in refused.err
    options = ("--force", "0,0,-200", "--gamma", "0:90:90", "--aim", "worst", "--partly")
    made = a_map(cli, *GRID, *TOOL, *options, *QUICK, quantity="displacement")
    largest = {one["gamma_deg"]: one["reached_largest_displacement_um"] for one in made.json["gamma_statistics"]}
    best = made.json["best_gamma"]
    assert min(largest.values()) == largest[best["gamma_deg"]] == pytest.approx(best["value"], rel=1e-5)
    assert made.json["unit"] == "um"


@pytest.mark.parametrize(("tool", "count"), [("0,0,250", 1), ("0,100,250", 0)])
def test_a_tool_on_the_flange_axis_makes_gamma_meaningless_and_that_is_said(
    cli: Command, tool: str, count: int
) -> None:
    outcome = a_map(cli, *GRID, "--tool", tool, "--gamma", "-180:180:60", *QUICK)
    assert len(outcome.json.get("remarks", [])) == count


def test_without_json_the_table_is_on_stderr(cli: Command) -> None:
    whole = ("--workpiece", "x=-10000:10000,y=-10000:10000")
    outcome = a_map(cli, *GRID, *TOOL, *whole, "--gamma", "-180:0:15", "--links", "rigid", "--no-pictures")
    assert (outcome.code, outcome.out) == (0, "")
    assert "No single gamma is best: region of 35 points: no gamma reaches all of it" in outcome.err.replace("\n", " ")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--x", "9000:9100:50", "--y", "0:100:50", "--z", "0"), "no point of the grid can be reached at any gamma"),
        (
            ("--x", "0:4000:1000", "--y", "1000:1500:500", "--z", "486", *TOOL, "--workpiece", "x=3000:4000"),
            "no point of the workpiece can be reached",
        ),
        ((*GRID, "--gamma", "10:10:5"), "--gamma"),
        ((*GRID, "--gamma", "20:10:5"), "--gamma"),
        ((*GRID, "--gamma", "a:b:c"), "--gamma"),
        ((*GRID, "--normal", "0,0,0"), "--normal"),
        ((*GRID, "--tool-axis", "0,0,0"), "--tool-axis"),
        ((*GRID, "--tool", "1,2"), "--tool"),
        ((*GRID, "--show", "7"), "--show"),
        ((*GRID, "--show", "x"), "--show"),
        ((*GRID, "--aim", "best"), "--aim"),
        ((*GRID, "--workpiece", "q=1:2"), "--workpiece"),
        ((*GRID, "--workpiece", "x=2:1"), "--workpiece"),
        ((*GRID, "--workpiece", "0,0;1,1"), "polygon"),
        ((*GRID, "--workpiece", "x=10:20"), "no point of the grid inside"),
        (GRID[:4], "Missing option '--z'"),
        (("--x", "0:100:30", *GRID[2:]), "a whole number of steps"),
        (("--x", "0:nan:30", *GRID[2:]), "--x"),
        (("--x", "0:100:0", *GRID[2:]), "--x"),
        (("--x", "0:1:1e-9", *GRID[2:]), "--x"),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    cli: Command, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    outcome = a_map(cli, *options, "--links", "rigid")
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")
    assert not (tmp_path / "out").exists()


def test_an_unknown_quantity_is_refused_with_the_known_ones(cli: Command) -> None:
    outcome = a_map(cli, *GRID, quantity="kfs")
    assert outcome.code == 2
    assert "k_fs, nspi, rayleigh" in outcome.err


# --- reading of options -----------------------------------------------------------------------------------------


def test_values_of_an_axis() -> None:
    for text, values in (
        ("-600:600:400", [-600.0, -200.0, 200.0, 600.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
        ("486", [486.0]),
    ):
        np.testing.assert_allclose(values_of(parse_range(text, "--x"), "--x"), values)


def test_a_workpiece_by_box_and_by_corners() -> None:
    def inside(text: str) -> np.ndarray[Any, Any]:
        across = (0.0, 200.0, 100.0)
        found = IndexMapRequest(x_mm=across, y_mm=500.0, z_mm=across, workpiece=REGION.read(text, "--workpiece")).inside
        assert found is not None
        return found

    box = inside("x=0:100, z=100:200")
    # Corners lie along x and z, the grid's two axes.
    np.testing.assert_array_equal(box, inside("0,100;100,100;100,200;0,200"))
    assert box.sum() == 4
    with pytest.raises(InputError, match="workpiece"):
        REGION.read("0,100;100;0,0", "--workpiece")


def test_one_gamma_is_a_fixed_one() -> None:
    plane: dict[str, Any] = {"x_mm": (0.0, 100.0, 50.0), "y_mm": (0.0, 100.0, 50.0), "z_mm": 0.0}
    np.testing.assert_allclose(IndexMapRequest(**plane, gamma_deg=-30.0).gamma, [np.radians(-30.0)])
    assert len(IndexMapRequest(**plane).gamma) == 72
