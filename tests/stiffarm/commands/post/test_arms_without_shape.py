"""`posture`, `post` and `verify` of arms that have no shape and no springs: nothing goes below their own floor."""

from __future__ import annotations

import csv
import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from cli_runs import ROOT, run_here

TOOL = ("--tool", "100,0,80")


def benchmark() -> ModuleType:
    """The benchmark's kinematics, which share nothing with the program's."""
    spec = importlib.util.spec_from_file_location("every_arm", ROOT / "benchmarks" / "shop" / "every_arm.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def square(tmp_path: Path) -> Path:
    path = tmp_path / "square.nc"
    path.write_text("G21 G90\nG1 X0 Y0 Z0 F1000\nX200\nY200\nX0\nY0\nM30\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "part"), [("ur20", "600,-100,200"), ("ur10e", "500,-100,150"), ("gp25", "900,-100,400")]
)
def test_no_point_of_the_arm_is_below_its_own_floor(name: str, part: str, square: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run_here("post", name, square, "--part", part, *TOOL, "--format", "json,csv", "--out", out)
    assert done.code == 0, done.err
    assert "not by stiffness" in done.out + done.err
    arms = benchmark()
    model = arms.tomllib.loads((ROOT / "robots" / "data" / "library" / f"{name}.toml").read_text(encoding="utf-8"))
    with next((out / "csv").glob("*.csv")).open(encoding="utf-8") as text:
        rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    poses = np.radians([[float(row[f"q{i + 1}_deg"]) for i in range(len(model["joint"]))] for row in rows])
    elbow, low = arms.lowest(model, poses, 0.02)
    assert elbow > 0.2
    assert low > 0.0
    checked = run_here("verify", name, next((out / "json").glob("*.json")), "--part", part, *TOOL, "--json")
    assert checked.code == 0, checked.err
    assert not any("arm" in text or "floor" in text for text in checked.json["not_looked_at"])


@pytest.mark.slow
def test_a_planted_elbow_under_the_table_is_found_and_called_assumed(square: Path, tmp_path: Path) -> None:
    out = tmp_path / "free"
    frames = ("--part", "600,-100,-150", *TOOL)
    refused = run_here("post", "ur20", square, *frames, "--out", tmp_path / "refused")
    assert refused.code == 2
    assert "(assumed shape) and floor" in refused.err
    assert run_here("post", "ur20", square, *frames, "--floor", "none", "--out", out).code == 0
    found = run_here(
        "verify", "ur20", next((out / "json").glob("*.json")), *frames, "--json", "--out", tmp_path / "said"
    )
    assert found.code == 1
    assert found.json["least_distance_bodies"][1] == "floor"
    assert found.json["least_distance_bodies"][0].endswith("(assumed shape)")
    for page in ("report.html", "replay.html"):
        assert "assumed shape" in (tmp_path / "said" / page).read_text(encoding="utf-8")
    lowered = run_here("verify", "ur20", next((out / "json").glob("*.json")), *frames, "--floor", "-2000", "--json")
    assert lowered.code == 0


def test_without_any_shape_the_rest_is_checked(square: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    frames = ("--part", "600,-100,200", *TOOL)
    assert run_here("post", "ur20", square, *frames, "--out", out).code == 0
    bare = run_here("verify", "ur20", next((out / "json").glob("*.json")), *frames, "--beam-radius", "0", "--json")
    assert bare.code == 0
    assert any("Collisions of the arm" in text for text in bare.json["not_looked_at"])
    # What needs no shape is found still.
    slow = run_here(
        "verify", "ur20", next((out / "json").glob("*.json")), *frames, "--beam-radius", "0", "--singular", "0.9"
    )
    assert slow.code == 1
    assert "singular" in slow.err


def test_gamma_is_chosen_from_a_range_without_springs(square: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    frames = ("--part", "900,-100,400", *TOOL)
    done = run_here("post", "gp25", square, *frames, "--gamma", "-180:180:10", "--out", out, "--json")
    assert done.code == 0, done.err
    low, high = done.json["gamma_deg"]
    assert low == pytest.approx(high, abs=1e-9)
    assert done.json["chosen_by"] == "room"
    asked = run_here("posture", "gp25", square, *frames, "--quantity", "k_fs")
    assert asked.code == 2
    assert "M005" in asked.err


@pytest.mark.parametrize("floor", ["high", "nan", "1,2"])
def test_bad_heights_of_the_floor_are_refused(floor: str, square: Path, tmp_path: Path) -> None:
    done = run_here("post", "ur20", square, "--floor", floor, "--out", tmp_path / "out")
    assert done.code == 2
    assert "--floor" in done.err
    assert not (tmp_path / "out").exists()
