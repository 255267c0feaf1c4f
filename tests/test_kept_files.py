"""Files that released versions wrote are opened, and what is in them is what it was (tests/kept/README.md)."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import pyvista

import stiffarm as sa
from machining.cell import read_cell
from robots.files.reading import read_text

KEPT = Path(__file__).parent / "kept" / "v0.1.0"
POSE = {"q2_deg": 5.0, "q3real_deg": 77.5, "q4_deg": 20.0, "q5_deg": -30.0}
# The answers of 0.1.0 to six digits.
SIX_DIGITS = 1e-5


@pytest.mark.parametrize(("file", "stiffness"), [("calibrated/model.toml", 343.129), ("effects.toml", 277.893)])
def test_models_open_and_simulate_the_same(file: str, stiffness: float) -> None:
    found = sa.simulate(sa.load(KEPT / file), pose=POSE, load={"fz_N": -650})
    assert found["stiffness_N_per_mm"] == pytest.approx(stiffness, rel=SIX_DIGITS)


def test_a_model_of_positions_opens_and_simulates_the_same() -> None:
    found = sa.simulate(sa.load(KEPT / "positions" / "model.toml"), pose={"q2_deg": -60}, load={"fz_N": -50})
    assert found["dz"] * 1e3 == pytest.approx(-0.0602638, rel=SIX_DIGITS)
    assert json.loads(read_text(KEPT / "positions" / "controller.json", "file"))


@pytest.mark.parametrize(
    ("name", "value"), [("polynomial", 430.0623545), ("factored", 345.4394729), ("without_backlash", 367.0462728)]
)
def test_surrogates_open_and_answer_the_same(name: str, value: float) -> None:
    learned = sa.load_surrogate(KEPT / "surrogates" / f"{name}.json")
    pose = {n: v for n, v in POSE.items() if n in learned.learned.inputs}
    answer = learned.query(pose)
    assert answer.values[0] == pytest.approx(value, rel=1e-9)
    assert learned.learned.at_load is None
    # What 0.1.0 left out of a surrogate stands in its file, and is said.
    assert any("backlash:j3" in one for one in learned.remarks) == (name == "without_backlash")


def test_maps_open_and_compare(tmp_path: Path) -> None:
    grid = pyvista.read(KEPT / "map_joints" / "stiffness_map.vtu")
    with (KEPT / "map_joints" / "map.csv").open(encoding="utf-8") as file:
        known = [float(row["stiffness_N_per_mm"]) for row in csv.DictReader(file) if row["stiffness_N_per_mm"]]
    assert np.nanmedian(grid.point_data["stiffness_N_per_mm"]) == pytest.approx(np.median(known), rel=SIX_DIGITS)
    box = pyvista.read(KEPT / "map_box" / "map.vti")
    assert box.dimensions == (3, 1, 3)
    assert np.isfinite(box.point_data["stiffness_N_per_mm"]).any()
    shutil.copytree(KEPT / "map_joints", tmp_path / "again")
    assert sa.compare(KEPT / "map_joints", tmp_path / "again") is not None


def test_results_compare_with_a_copy(tmp_path: Path) -> None:
    shutil.copytree(KEPT / "calibrated", tmp_path / "again")
    assert sa.compare(KEPT / "calibrated", tmp_path / "again") is not None


def test_a_cell_and_what_it_was_used_for_open() -> None:
    cell = read_cell(KEPT / "posture" / "cell.toml")
    assert cell.tool.T_flange_tool.shape == (4, 4)
    found = json.loads(read_text(KEPT / "posture" / "posture.json", "file"))
    with (KEPT / "posture" / "posture.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == found["points"]


def test_a_mapping_reads_the_next_file_of_its_layout() -> None:
    sheet = Path(__file__).parents[1] / "docs" / "examples" / "readings" / "dial_gauge.xlsx"
    found = sa.convert_readings(sheet, arm=sa.load("kr60-3"), mapping=KEPT / "dial_gauge.mapping.toml")
    assert len(found.to_frame()) > 0
