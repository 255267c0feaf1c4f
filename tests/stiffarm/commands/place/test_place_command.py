"""The command `place`: what it writes can be checked against the arm, and bad input is named."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import ROOT, Command, row_of, tree

import fem
from machining.cell import read_cell
from machining.placement import read_placement
from machining.programs.program import tool_in_part
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import directional_stiffness
from robots import load_description

pytestmark = pytest.mark.usefixtures("blank")

CELL = """
schema = "stiffarm-cell/1"
name = "small"
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[part]
position_mm = [1200, 200, 600]
[[linear_axis]]
name = "rail"
direction = [1, 0, 0]
limits_mm = [-800, 400]
speed_mm_s = 500
acceleration_mm_s2 = 1000
"""
LIFT = """
[[linear_axis]]
name = "lift"
direction = [0, 0, 1]
limits_mm = [-200, 200]
"""
FORCE = ("--force", "80,40,-60", "--links", "rigid", "--gamma", "-180:180:20")


@pytest.fixture
def small(tmp_path: Path) -> tuple[Path, Path]:
    """A curved path of twelve points, and a cell with a rail."""
    u = np.linspace(0.0, 1.0, 12)
    wave = 2.0 * np.pi * u
    rows = np.stack(
        [
            250 * (u - 0.5),
            60 * np.sin(wave),
            30 * np.cos(wave),
            0.3 * np.sin(wave),
            0.2 * np.cos(wave),
            1 + 0 * u,
            1500 + 0 * u,
        ],
        axis=1,
    )
    path, cell = tmp_path / "dome.csv", tmp_path / "cell.toml"
    header = "x_mm,y_mm,z_mm,nx,ny,nz,feed_mm_per_min"
    path.write_text(header + "\n" + "\n".join(",".join(f"{v:.9f}" for v in row) for row in rows) + "\n")
    cell.write_text(CELL)
    return path, cell


def test_the_table_holds_what_the_arm_gives(cli: Command, small: tuple[Path, Path], tmp_path: Path) -> None:
    path, cell_file = small
    out = tmp_path / "out"
    outcome = cli("place", "kr60-3", path, "--cell", cell_file, *FORCE, "--aim", "ksf", "--no-collisions", "--out", out)
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "placement.json").read_text(encoding="utf-8"))
    found = read_placement(out / "placement.json")
    model = fem.build_model(load_description("kr60-3"), links="rigid")
    cell = read_cell(cell_file)
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    tip = tool_in_part(model.robot, cell, found.q, found.travel, np.zeros(12), cell.tool.T_flange_tool)[:, :3, 3]
    # Angles and travels have ten digits, on two metres.
    np.testing.assert_allclose(tip, table[:, :3] * 1e-3, atol=1e-8)
    C = translational(model, found.q, cell.tool.T_flange_tool[:3, 3])
    k = directional_stiffness(C, np.array([80.0, 40.0, -60.0])) * 1e-3
    with (out / "placement.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    np.testing.assert_allclose([float(row["stiffness_N_per_mm"]) for row in rows], k, rtol=6e-6)
    np.testing.assert_allclose([float(row["e1_mm"]) for row in rows], found.travel[:, 0] * 1e3, rtol=1e-8)
    best = row_of(content["placements"], placement="recommended")
    expected = content["alpha_mm2_per_N2"] * (k**2).sum() + content["beta_mm4_per_N4"] * k.mean() ** 4
    # Weights and results are written with six digits.
    assert best["K_sf"] == pytest.approx(expected, rel=2e-5)
    assert best["mean_stiffness_N_per_mm"] == pytest.approx(k.mean(), rel=6e-6)
    with (out / "positions.csv").open(encoding="utf-8") as stream:
        places = list(csv.DictReader(stream))
    assert len(places) == 121
    # Each position has a worth, or what stops it and where.
    for place in places:
        taken = place["gamma_deg"] != ""
        assert taken == (place["worst_stiffness_N_per_mm"] != "") == (place["stopped_by"] == "")
        assert taken == (place["nearest_posture"] == "")
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Collisions were not checked" in page
    assert 'src="http' not in page
    assert {p.name for p in out.glob("*.png")} == {"positions.png", "along.png", "axes.png", "joints.png"}


@pytest.mark.slow
def test_the_table_of_positions_names_what_stops_each(cli: Command, small: tuple[Path, Path], tmp_path: Path) -> None:
    path, cell = small
    cell.write_text(CELL.replace("[-800, 400]", "[-3000, 1100]"))
    out = tmp_path / "out"
    outcome = cli("place", "kr60-3", path, "--cell", cell, *FORCE, "--out", out)
    assert outcome.code == 0, outcome.err
    with (out / "positions.csv").open(encoding="utf-8") as stream:
        places = list(csv.DictReader(stream))
    assert all((row["stopped_by"] == "") == (row["gamma_deg"] != "") for row in places)
    assert "out of reach" in places[0]["nearest_posture"]
    stopped = [row for row in places if row["stopped_by"]]
    assert 20 < len(stopped) < 110
    assert all(row["nearest_posture"] for row in stopped)
    # With the base under the part the arm is in its own way.
    near = [row["nearest_posture"] for row in places if row["stopped_by"] == "collision"]
    assert all(" too near at point " in words for words in near)


@pytest.mark.slow
def test_moving_with_collisions_and_two_axes(cli: Command, small: tuple[Path, Path], tmp_path: Path) -> None:
    path, cell = small
    cell.write_text(CELL + LIFT)
    out = tmp_path / "out"
    outcome = cli("place", "kr60-3", path, "--cell", cell, *FORCE, "--mode", "moving", "--aim", "mean", "--out", out)
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "placement.json").read_text(encoding="utf-8"))
    assert content["linear_axes"] == ["rail", "lift"]
    best, still = (row_of(content["placements"], placement=p) for p in ("recommended", "best position at rest"))
    key = "mean_stiffness_N_per_mm"
    assert best[key] >= still[key] * (1.0 - 1e-6)


def test_json_alone_writes_nothing(cli: Command, small: tuple[Path, Path], tmp_path: Path) -> None:
    path, cell = small
    before = tree(tmp_path)
    outcome = cli(
        "place",
        "kr60-3",
        path,
        "--cell",
        cell,
        *FORCE,
        "--aim",
        "worst",
        "--json",
        "--range",
        "rail=-300:-100",
        "--no-collisions",
    )
    assert outcome.code == 0, outcome.err
    assert outcome.json["aim"] == "worst"
    low, high = row_of(outcome.json["placements"], placement="recommended")["axes_mm"]["rail"]
    assert -300.0 <= low == high <= -100.0
    assert tree(tmp_path) == before


def test_rapid_moves_of_a_program_are_where_the_base_may_move(
    cli: Command, small: tuple[Path, Path], tmp_path: Path
) -> None:
    lines = [
        "G21 G90 G17 G94",
        "G0 X-100 Y0 Z50",
        "G1 Z0 F1500",
        "G1 X0",
        "G1 X20 Y10",
        "G0 Z50",
        "G0 X100 Y0",
        "G1 Z0 F1500",
        "G1 X110",
        "G1 X130 Y10",
        "G0 Z50",
        "M30",
    ]
    path = tmp_path / "part.nc"
    path.write_text("\n".join(lines) + "\n")
    outcome = cli(
        "place",
        "kr60-3",
        path,
        "--cell",
        small[1],
        *FORCE,
        "--mode",
        "steps:2",
        "--cost",
        "0",
        "--json",
        "--no-collisions",
        "--jump",
        "90",
    )
    assert outcome.code == 0, outcome.err
    assert outcome.json["source_moves"] > outcome.json["path_points"]
    # Two cuts of three points each: where the tool plunges nothing is judged.
    assert outcome.json["path_points"] == 6
    assert outcome.json["pieces_start_at_point"] in ([0], [0, 3])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--aim", "best"), "--aim"),
        (("--mode", "steps"), "--mode"),
        (("--mode", "steps:1"), "steps of the base"),
        (("--force-axes", "tool"), "--force-axes"),
        (("--range", "rail"), "--range"),
        (("--range", "slide=0:1"), "linear axis of cell small"),
        (("--range", "rail=100:0"), "range of axis rail"),
        (("--alpha", "1"), "both or none"),
        (("--alpha", "-1", "--beta", "1"), "weight alpha of K_sf"),
        (("--table", "a"), "--table"),
        (("--table", "0:90"), "this cell has no turntable"),
        (("--mode", "steps:2"), "the path has no rapid move"),
        (("--range", "rail=-800:-795"), "out of reach"),
    ],
)
def test_bad_input_is_named(
    cli: Command, small: tuple[Path, Path], tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    path, cell = small
    if "out of reach" in words:
        cell.write_text(CELL.replace("1200, 200, 600", "3200, 200, 600"))
    outcome = cli(
        "place", "kr60-3", path, "--cell", cell, *FORCE, *arguments, "--no-collisions", "--out", tmp_path / "n"
    )
    assert outcome.code == 2, outcome.err
    assert words in " ".join(outcome.err.split())
    assert not (tmp_path / "n").exists()


def test_a_cell_without_axes_says_what_to_do(cli: Command, small: tuple[Path, Path]) -> None:
    path, cell = small
    cell.write_text(CELL[: CELL.index("[[linear_axis]]")])
    outcome = cli("place", "kr60-3", path, "--cell", cell, *FORCE)
    assert outcome.code == 2
    assert "describe the rail in the cell file: [[linear_axis]]" in " ".join(outcome.err.split())


@pytest.mark.slow
def test_the_place_of_the_bundled_wing_can_be_written_and_verified(cli: Command, tmp_path: Path) -> None:
    """With the default aim the best place for the cuts does not reach a retract; the one recommended does."""
    wing, twists, out = ROOT / "docs" / "examples" / "tx200_wing", tmp_path / "twists", tmp_path / "out"
    assert cli("identify", "tx200", "--synthetic", "--out", twists).code == 0
    common = (twists / "model.toml", wing / "wing.cls", "--cell", wing / "cell.toml")
    outcome = cli("place", *common, "--force", "0,60,-80", "--force-axes", "process", "--out", out)
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "placement.json").read_text(encoding="utf-8"))
    assert (content["between_cuts_undriven"], content["rapid_moves"]) == (None, "linear")
    with (out / "positions.csv").open(encoding="utf-8") as stream:
        stopped = [row for row in csv.DictReader(stream) if row["stopped_by"] == "a move between cuts"]
    assert stopped
    assert all("line " in row["nearest_posture"] for row in stopped)
    program = tmp_path / "program"
    written = cli("post", *common, "--placement", out / "placement.json", "--format", "json", "--out", program)
    assert written.code == 0, written.err
    verified = cli("verify", twists / "model.toml", program / "json" / "wing.json", "--cell", wing / "cell.toml")
    assert verified.code == 0, verified.err
