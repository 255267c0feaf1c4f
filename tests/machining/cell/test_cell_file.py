"""Cell files: what is read, and one clear message for each fault."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses, refuses_each

from machining.cell import Cell, parse_cell, read_cell
from machining.cell.schema import CellFile
from robots import InputErrors

WHOLE = """
schema = "stiffarm-cell/1"
name = "milling cell"
allowed_contacts = [["table", "pedestal"]]

[robot]
position_mm = [0, 0, 500]
z_axis = [0, 0, 1]
x_axis = [0, 1, 1]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
joint_acceleration_deg_s2 = 400
safety_mm = 20
home_deg = [0, -90, 0, 0, 90, 0]

[tool]
position_mm = [0, 0, 450]
rpy_deg = [0, 90, 0]
[[tool.body]]
name = "spindle"
shape = { kind = "box", size_mm = [200, 200, 300] }
[[tool.body]]
name = "cutter"
cutter = true
position_mm = [0, 0, 300]
shape = { kind = "cylinder", diameter_mm = 16, length_mm = 150 }

[part]
position_mm = [1500, 0, 700]
shape = { kind = "mesh", file = "meshes/stock.stl", unit = "mm" }

[[fixture]]
name = "table"
position_mm = [1500, 0, 0]
shape = { kind = "box", size_mm = [800, 1200, 700] }

[floor]

[[linear_axis]]
name = "rail"
direction = [0, 2, 0]
limits_mm = [-1000, 3000]
speed_mm_s = 1500
compliance_um_per_N = [0.01, 0.02, 0.03]
carriage = { position_mm = [0, 0, 300], shape = { kind = "box", size_mm = [900, 900, 200] } }

[turntable]
point_mm = [1500, 0, 0]
axis = [0, 0, 1]
endless = true
speed_deg_s = 90
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((400, 300, 100)).export(tmp_path / "meshes" / "stock.stl")
    (tmp_path / "cell.toml").write_text(WHOLE, encoding="utf-8")
    return tmp_path


def test_a_whole_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Mesh files lie beside the cell file, wherever the program was started.
    monkeypatch.chdir(folder.parent)
    cell = read_cell(folder / "cell.toml")
    assert (cell.name, cell.floor, cell.safety) == ("milling cell", 0.0, 0.02)
    np.testing.assert_allclose(cell.T_world_base0[:3], [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0.5]], atol=1e-15)
    np.testing.assert_allclose(cell.tool.T_flange_tool[:3], [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0.45]], atol=1e-15)
    assert [b.name for b in cell.bodies] == ["part", "table", "carriage rail", "spindle", "cutter"]
    assert [b.name for b in cell.tool.cutter] == ["cutter"]
    cutter = cell.tool.cutter[0].solids[0].nodes
    np.testing.assert_allclose([cutter[:, 2].min(), cutter[:, 2].max()], [0.3, 0.45])
    assert cell.part is not None
    part = cell.part.solids[0].nodes
    np.testing.assert_allclose([part.min(axis=0), part.max(axis=0)], [[1.3, -0.15, 0.65], [1.7, 0.15, 0.75]])
    np.testing.assert_allclose(cell.joint_speed, np.radians([128, 102, 128, 260, 245, 322]))
    np.testing.assert_allclose(cell.joint_acceleration, np.radians(400))
    np.testing.assert_allclose(cell.home, np.radians([0, -90, 0, 0, 90, 0]))
    (rail,) = cell.linear_axes
    np.testing.assert_allclose(rail.direction, [0, 1, 0])
    np.testing.assert_allclose(rail.limits, [-1, 3])
    np.testing.assert_allclose(rail.compliance, [1e-8, 2e-8, 3e-8, 0, 0, 0])
    assert rail.speed == 1.5
    assert cell.turntable is not None
    assert cell.turntable.limits is None
    assert cell.turntable.speed == pytest.approx(np.pi / 2)
    assert cell.allowed_contacts == (("table", "pedestal"),)


def test_the_shortest_file() -> None:
    cell = parse_cell('schema = "stiffarm-cell/1"', "x", Path())
    assert isinstance(cell, Cell)
    assert cell.floor is None
    assert cell.bodies == ()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("limits_mm = [-1000, 3000]", "limits_mm = [3000, -1000]", r"linear_axis.rail.limits_mm: must be a pair"),
        ("direction = [0, 2, 0]", "direction = [0, 0, 0]", r"linear_axis.rail.direction: .*length zero"),
        ('unit = "mm"', 'unit = "inch"', r"part.shape.mesh.unit: .*'mm' or 'm'.*got 'inch'"),
        (', unit = "mm"', "", r"part.shape.mesh.unit: this key is missing"),
        ("stock.stl", "none.stl", r"mesh file of part not found: got 'meshes/none.stl'"),
        ("safety_mm = 20", "safety_mm = -20", r"robot.safety_mm: .*got -20"),
        ("safety_mm = 20", "safty_mm = 20", r"robot.safty_mm: unknown key"),
        ("safety_mm = 20", "safety_mm = '20'", r"robot.safety_mm: .*number"),
        ("safety_mm = 20", "safety_mm = nan", r"robot.safety_mm: .*finite"),
        ("rpy_deg = [0, 90, 0]", "z_axis = [0, 0, 1]", r"tool: z_axis and x_axis go together"),
        ("x_axis = [0, 1, 1]", "x_axis = [0, 0, 1]", r"robot: z_axis and x_axis must be directions"),
        ("x_axis = [0, 1, 1]", "x_axis = [0, 1, 1]\nrpy_deg = [0, 0, 0]", r"robot: give rpy_deg, or z_axis and x_axis"),
        ("endless = true", "endless = false", r"turntable: give exactly one of limits_deg and endless"),
        ("endless = true", "limits_deg = [10, 10]", r"turntable.limits_deg: must be a pair"),
        ('name = "table"', 'name = "spindle"', r"name in the cell: got 'spindle'"),
        (
            "diameter_mm = 16",
            "diameter_mm = 0",
            r"tool.body.cutter.shape.cylinder.diameter_mm: .*greater than or equal to 0.001",
        ),
        ('kind = "cylinder"', 'kind = "cone"', r"tool.body.cutter.shape: .*'cone'"),
        ("joint_acceleration_deg_s2 = 400", "joint_acceleration_deg_s2 = -4", r"robot.joint_acceleration_deg_s2"),
        ("joint_acceleration_deg_s2 = 400", "joint_acceleration_deg_s2 = []", r"_s2: must be one number, or one for"),
        ("cell/1", "cell/9", r"schema: .*stiffarm-cell/1"),
        ("[floor]", "[robot]", r"is not valid TOML.*twice"),
        ("[turntable]", "[turntable", r"is not valid TOML"),
    ],
)
def test_one_message_for_each_fault(folder: Path, old: str, new: str, words: str) -> None:
    assert WHOLE.count(old) == 1
    (folder / "cell.toml").write_text(WHOLE.replace(old, new), encoding="utf-8")
    caught = refuses("F005 F011 K001 K002", words, read_cell, folder / "cell.toml")
    assert not isinstance(caught, InputErrors)


def test_all_faults_at_once(folder: Path) -> None:
    text = WHOLE.replace("direction = [0, 2, 0]", "direction = [0, 0, 0]").replace("safety_mm = 20", "safety_mm = -1")
    (folder / "cell.toml").write_text(text, encoding="utf-8")
    refuses_each("F011", r"2 problem\(s\)", read_cell, folder / "cell.toml")


def test_an_open_mesh_and_no_file(folder: Path) -> None:
    block = trimesh.creation.box((1, 1, 1))
    trimesh.Trimesh(block.vertices, block.faces[2:]).export(folder / "meshes" / "stock.stl")
    refuses("L003", r"surface of stock.stl is not closed", read_cell, folder / "cell.toml")
    refuses("F001", r"cell file .* cannot be read", read_cell, folder / "other.toml")


# ------------------------------------------------------------
# The page of the cell file names every key that the file can have

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "cell_file.md"
# Where the controller's outputs stand.
COMMANDS = Path(__file__).parents[3] / "docs" / "how-to" / "operations.md"


def test_every_key_is_on_the_page() -> None:
    schema = CellFile.model_json_schema(by_alias=True)
    text = PAGE.read_text(encoding="utf-8")
    said = set(re.findall(r"[a-zA-Z_0-9]+", text))
    outputs = COMMANDS.read_text(encoding="utf-8")
    for name, table in {"CellFile": schema, **schema["$defs"]}.items():
        for key in table.get("properties", ()):
            assert key in said or (name == "CommandsTable" and key in outputs), f"{name}: {key}"
