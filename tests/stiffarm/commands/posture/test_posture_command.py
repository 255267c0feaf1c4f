"""The command `posture`: what it writes is the best drivable course, and says what was not looked at."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, row_of, tree

import fem
from machining import stiffness_index
from machining.cell import arm_of, clearance, read_cell, scene_of
from robots import forward_kinematics, load_description
from stiffarm.request import FRAME

TOOL, PART = "200,0,80,0,90,0", "1200,200,600"
SPEED = "128,102,128,260,245,322"


def posture_along(path: Path) -> tuple[str | Path, ...]:
    """The command, gamma counted from y: angles about 0 are within reach."""
    return ("posture", "kr60-3", path, "--reference", "0,1,0")


@pytest.fixture
def dome(tmp_path: Path) -> Path:
    """A curved path of twelve points with a feed."""
    u = np.linspace(0.0, 1.0, 12)
    wave = 2.0 * np.pi * u
    rows = np.stack(
        [
            150 * (u - 0.5),
            60 * np.sin(wave),
            30 * np.cos(wave),
            0.3 * np.sin(wave),
            0.2 * np.cos(wave),
            1 + 0 * u,
            3000 + 0 * u,
        ],
        axis=1,
    )
    file = tmp_path / "dome.csv"
    header = "x_mm,y_mm,z_mm,nx,ny,nz,feed_mm_per_min"
    file.write_text(header + "\n" + "\n".join(",".join(f"{v:.9f}" for v in row) for row in rows) + "\n")
    return file


@pytest.mark.slow
def test_the_table_holds_a_course_that_can_be_driven(cli: Command, dome: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    outcome = cli(
        *posture_along(dome),
        "--links",
        "rigid",
        "--tool",
        TOOL,
        "--part",
        PART,
        "--speed",
        SPEED,
        "--gamma",
        "-180:180:10",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    with (out / "posture.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    content = json.loads((out / "posture.json").read_text(encoding="utf-8"))
    model = fem.build_model(load_description("kr60-3"), links="rigid")
    q = np.radians([[float(row[name]) for name in model.robot.coordinates] for row in rows])
    table = np.loadtxt(dome, delimiter=",", skiprows=1)
    T = FRAME.of(TOOL, "--tool")
    frames = forward_kinematics(model.robot, q)
    tip = frames.p_flange + frames.R_flange @ T[:3, 3]
    # Angles are written with ten digits: 1e-7 deg on two metres.
    np.testing.assert_allclose(tip, table[:, :3] * 1e-3 + [1.2, 0.2, 0.6], atol=1e-8)
    axis = -frames.R_flange @ T[:3, 2]
    unit = table[:, 3:6] / np.linalg.norm(table[:, 3:6], axis=1, keepdims=True)
    np.testing.assert_allclose(axis, unit, atol=1e-8)
    k = stiffness_index(model, q, table[:, 3:6], T[:3, 3]) * 1e-3
    np.testing.assert_allclose([float(row["k_fs_N_per_mm"]) for row in rows], k, rtol=2e-6)
    best, before = (row_of(content["courses"], course=name) for name in ("recommended", "as programmed"))
    assert best["mean_k_fs_N_per_mm"] == pytest.approx(k.mean(), rel=2e-6)
    assert best["mean_k_fs_N_per_mm"] >= before["mean_k_fs_N_per_mm"]
    length = np.linalg.norm(np.diff(table[:, :3], axis=0), axis=1)
    speed = np.abs(np.diff(np.degrees(q), axis=0)) / (length / 50.0)[:, None]
    assert (speed <= np.array([float(v) for v in SPEED.split(",")]) * 1.001).all()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Collisions were not checked" not in page
    assert 'src="http' not in page


def test_json_alone_writes_nothing(cli: Command, dome: Path, tmp_path: Path) -> None:
    before = tree(tmp_path)
    outcome = cli(
        *posture_along(dome),
        "--links",
        "rigid",
        "--tool",
        TOOL,
        "--part",
        PART,
        "--json",
        "--gamma",
        "-30:30:10",
        "--aim",
        "worst",
    )
    assert outcome.code == 0, outcome.err
    assert outcome.json["aim"] == "worst"
    assert outcome.json["gamma_grid"] == {"from_deg": -30.0, "to_deg": 30.0, "count": 7}
    assert tree(tmp_path) == before


def test_one_gamma_is_kept(cli: Command, dome: Path) -> None:
    outcome = cli(
        *posture_along(dome),
        "--links",
        "rigid",
        "--tool",
        TOOL,
        "--part",
        PART,
        "--json",
        "--gamma",
        "20",
        "--before",
        "20",
    )
    assert outcome.code == 0, outcome.err
    best, before = (row_of(outcome.json["courses"], course=name) for name in ("recommended", "as programmed"))
    np.testing.assert_allclose([best["gamma_from_deg"], best["gamma_to_deg"]], 20.0, atol=1e-3)
    key = "mean_k_fs_N_per_mm"
    assert best[key] == pytest.approx(before[key], rel=1e-4)


def test_a_program_that_cannot_be_driven_is_said_to_be_so(cli: Command, dome: Path) -> None:
    outcome = cli(
        *posture_along(dome), "--links", "rigid", "--tool", TOOL, "--part", "2000,200,500", "--json", "--before", "180"
    )
    assert outcome.code == 0, outcome.err
    assert "cannot be reached" in outcome.json["not_found"]["as programmed"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--part", "9000,0,0"), "cannot be reached"),
        (("--tool", "0,0,5000"), "cannot be reached"),
        (("--quantity", "kfs"), "--quantity"),
        (("--quantity", "displacement"), "--quantity displacement needs a force"),
        (("--aim", "best"), "--aim"),
        (("--speed", "1,2"), "--speed"),
        (("--speed", "0"), "--speed"),
        (("--force", "1,2"), "--force"),
        (("--force", "1,2,3", "--force-axes", "world"), "--force-axes"),
        (("--cell", "none.toml"), "cell file"),
    ],
)
def test_bad_input_is_named(cli: Command, dome: Path, tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    outcome = cli(*posture_along(dome), *arguments, "--out", tmp_path / "none")
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("row", "words"),
    [("0,0,0,0,0,1", "the point of the row before once more"), ("5,0,0,0,0,0", "normal of length zero")],
)
def test_bad_paths_are_named_by_row(cli: Command, tmp_path: Path, row: str, words: str) -> None:
    path = tmp_path / "path.csv"
    path.write_text(f"x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n{row}\n")
    outcome = cli("posture", "kr60-3", path)
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")
    assert "row 3" in outcome.err


CELL = """
schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[[tool.body]]
name = "spindle"
shape = { kind = "cylinder", diameter_mm = 60, length_mm = 120 }
position_mm = [180, 0, 80]
rpy_deg = [0, -90, 0]
[part]
position_mm = [1200, 200, 600]
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
safety_mm = 10
[[fixture]]
name = "post"
shape = { kind = "box", size_mm = [40, 40, 400] }
position_mm = [1240, 20, 500]
"""
MILLING = """
schema = "stiffarm-milling/1"
[mill]
diameter_mm = 10
teeth = 4
helix_deg = 30
[cut]
kind = "slot"
axial_depth_mm = 1
spindle_rpm = 9000
[material]
published = "al7075-t6"
[tool]
stickout_mm = 40
diameter_mm = 8
"""


@pytest.mark.slow
def test_a_post_beside_the_part_is_kept_clear_of(cli: Command, dome: Path, tmp_path: Path) -> None:
    """The cell's tool, part, speeds and obstacles are taken; without the post the course is another one."""
    cell, free = tmp_path / "cell.toml", tmp_path / "free.toml"
    cell.write_text(CELL)
    free.write_text(CELL[: CELL.index("[[fixture]]")])
    scene = scene_of(read_cell(cell), arm_of("kr60-3"))
    least = []
    for file in (cell, free):
        out = tmp_path / file.stem
        outcome = cli(*posture_along(dome), "--links", "rigid", "--cell", file, "--gamma", "-180:180:20", "--out", out)
        assert outcome.code == 0, outcome.err
        with (out / "posture.csv").open(encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        q = np.radians([[float(row[name]) for name in scene.arm.robot.coordinates] for row in rows])
        least.append(clearance(scene, q).distance.min())
        assert "peak speed" in (out / "report.html").read_text(encoding="utf-8")
    assert least[0] >= 0.01 - 1e-9
    assert least[1] < 0.01


@pytest.mark.slow
def test_a_milling_file_predicts_the_error_before_and_after(cli: Command, dome: Path, tmp_path: Path) -> None:
    milling = tmp_path / "milling.toml"
    milling.write_text(MILLING)
    out = tmp_path / "out"
    outcome = cli(
        *posture_along(dome),
        "--links",
        "rigid",
        "--tool",
        TOOL,
        "--part",
        PART,
        "--milling",
        milling,
        "--gamma",
        "-180:180:20",
        "--quantity",
        "normal displacement",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "posture.json").read_text(encoding="utf-8"))
    assert content["surface_error_against"] == "as programmed"
    best, before = (row_of(content["surface_error"], course=name) for name in ("recommended", "as programmed"))
    low, high = best["rms_interval95_um"]
    assert low < best["rms_um"] < high
    assert best["rms_um"] <= before["rms_um"]
    with (out / "posture.csv").open(encoding="utf-8") as stream:
        row = next(csv.DictReader(stream))
    assert float(row["error_sd_um"]) > 0.0
    # The table's quantity leaves the tool's own bending out, which along the tool axis is none.
    assert abs(float(row["error_um"])) == pytest.approx(float(row["normal_displacement_um"]), rel=1e-4)
    assert {p.stem for p in out.glob("*.png")} == {"axes_map", "joints", "milling_error"}
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Predicted displacement along the surface normal under the cutting force" in page
    assert "standard deviation 15 %" in page


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("teeth = 4", "teeth = 0"), "teeth"),
        (("spindle_rpm = 9000", ""), "one of them"),
        (('kind = "slot"', 'kind = "down"'), "radial_depth_mm is missing"),
        (("axial_depth_mm = 1", "axial_depth_mm = -1"), "axial_depth_mm"),
        (('published = "al7075-t6"', 'published = "cheese"'), "cheese"),
        (('published = "al7075-t6"', "tc_N_per_mm2 = 700"), "complete it"),
        (("stiffarm-milling/1", "stiffarm-milling/9"), "stiffarm-milling/1"),
        (("[mill]", "[mill"), "TOML"),
    ],
)
def test_bad_milling_files_are_named(
    cli: Command, dome: Path, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    milling = tmp_path / "milling.toml"
    milling.write_text(MILLING.replace(*change))
    outcome = cli(*posture_along(dome), "--tool", TOOL, "--part", PART, "--milling", milling)
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")


def test_frames_given_twice_are_refused(cli: Command, dome: Path, tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text(CELL)
    outcome = cli(*posture_along(dome), "--cell", cell, "--tool", TOOL)
    assert outcome.code == 2
    assert "--tool with --cell" in outcome.err
