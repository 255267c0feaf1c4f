"""`calibrate` on tables of positions: the answer, its files, what has no meaning there, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_runs import ROOT, Outcome, run_here

import stiffarm as sa
from robots import load_description

UR5 = ROOT / "docs" / "examples" / "ur5"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tenth of the grid's readings, one of them with a joint turned."""
    folder = tmp_path_factory.mktemp("positions")
    head, *rows = (UR5 / "grid.csv").read_text(encoding="utf-8").splitlines()
    rows = rows[::4]
    cells = rows[5].split(",")
    cells[0] = str(float(cells[0]) + 90.0)
    rows[5] = ",".join(cells)
    (folder / "some.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> Outcome:
    outcome = run_here(
        "calibrate",
        UR5 / "ur5.toml",
        folder / "some.csv",
        "--holdout",
        UR5 / "random.csv",
        "--free",
        "geometry,springs",
        "--out",
        folder / "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    return outcome


def test_the_answer_says_how_accurate_the_arm_is_before_and_after(found: Outcome) -> None:
    c = found.json
    assert c["readings"] == 63
    assert c["before"]["rms_mm"] > 3.0 * c["left_out"]["rms_mm"]
    assert c["holdout"]["frames_fitted_anew"] == []
    assert c["holdout"]["rms_mm"] < 0.2
    assert c["holdout"]["in_interval95"]["of"] == 60


def test_the_turned_joint_is_named(found: Outcome) -> None:
    (wrong,) = found.json["wrong_readings"]
    assert wrong["line"] == 7
    assert "j1 turned by -90 deg" in wrong["cause"]


def test_no_value_is_given_for_what_is_not_identified(found: Outcome) -> None:
    by_name = {one["name"]: one for one in found.json["parameters"]}
    for one in by_name.values():
        assert (one["value"] is None) == (one["status"] != "determined"), one
    assert by_name["j4.stiffness"]["value"] is None
    assert {"j1.zero", "j1.stiffness"} <= {one["name"] for one in found.json["not_told_apart_by_any_readings"]}


def test_files_are_written(found: Outcome, folder: Path) -> None:
    out = folder / "out"
    assert json.loads((out / "positions.json").read_text(encoding="utf-8")) == found.json
    names = ("report.html", "positions.csv", "errors.csv", "accuracy.png", "run.json", "model.toml")
    for name in (*names, "calibrated.urdf", "controller.json", "regions.csv", "regions.png"):
        assert (out / name).is_file(), name
    assert len((out / "errors.csv").read_text(encoding="utf-8").splitlines()) == 64


def test_regions_of_the_workspace_are_told(found: Outcome, folder: Path) -> None:
    regions = found.json["regions"]
    assert sum(r["readings"] for r in regions) == 62  # all but the wrong one
    assert {"before_rms_mm", "after_rms_mm", "left_out_rms_mm", "x_low_mm", "z_high_mm", "verdict"} <= set(regions[0])
    rows = (folder / "out" / "regions.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == len(regions) + 1


def test_corrections_say_what_has_no_place(found: Outcome, folder: Path) -> None:
    back = found.json["corrections"]
    model = load_description(folder / "out" / "model.toml")
    assert model.positions is not None
    assert model.positions.rms_mm == pytest.approx(back["model_rms_mm"], rel=1e-4)
    assert back["found_without_place_in_the_model"] == []
    silent = {f["name"] for f in found.json["parameters"] if f["name"].endswith("stiffness") and f["value"] is None}
    assert set(back["springs_without_value"]) == silent
    (one,) = back["controllers"]
    zeros = {z["axis"]: z["really_beyond_shown_deg"] for z in one["joint_zeros"]}
    told = {f["name"]: f["value"] for f in found.json["parameters"]}
    # Zeros that the readings do not tell have no figure; the first one's and the last one's are twins of frames.
    assert [zeros["q1_deg"], zeros["q6_deg"]] == [None, None]
    for joint in ("j2", "j3", "j5"):
        assert (zeros[f"q{joint[1]}_deg"] is None) == (told[f"{joint}.zero"] is None)
    assert one["robot_frame"] == "the model's base frame"
    assert json.loads((folder / "out" / "controller.json").read_text(encoding="utf-8"))["controllers"] == [one]


@pytest.mark.slow
def test_the_calibrated_model_is_where_the_next_calibration_starts(found: Outcome, folder: Path) -> None:
    again = run_here("calibrate", folder / "out" / "model.toml", UR5 / "random.csv", "--free", "zeros", "--json")
    assert again.code == 0, again.err
    assert again.json["before"]["rms_mm"] < 0.12


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--scheme", "global"], "--scheme"),
        (["--loads", "100"], "--loads"),
        (["--free", "j1.wobble"], "j1.wobble"),
        (["--free", "payload,rail,j7.zero"], "j7.zero"),
    ],
)
def test_what_has_no_meaning_for_positions_is_refused(folder: Path, more: list[str], words: str) -> None:
    outcome = run_here("calibrate", UR5 / "ur5.toml", folder / "some.csv", *more)
    assert outcome.code == 2
    assert words in outcome.err


def test_tables_of_two_kinds_are_refused(folder: Path) -> None:
    (folder / "loads.csv").write_text("q1_deg,fz_N,dz_mm\n1,-100,-0.1\n", encoding="utf-8")
    outcome = run_here("calibrate", UR5 / "ur5.toml", folder / "some.csv", folder / "loads.csv")
    assert outcome.code == 2
    assert "loads.csv" in outcome.err


def test_a_held_out_table_without_positions_is_refused(folder: Path) -> None:
    (folder / "kept.csv").write_text("q1_deg,fz_N,dz_mm\n1,-100,-0.1\n", encoding="utf-8")
    outcome = run_here("calibrate", UR5 / "ur5.toml", folder / "some.csv", "--holdout", folder / "kept.csv")
    assert outcome.code == 2
    assert "x_mm" in outcome.err


def test_the_python_face_gives_the_same_answer(found: Outcome, folder: Path) -> None:
    arm = sa.load(UR5 / "ur5.toml")
    there = sa.calibrate(arm, folder / "some.csv", free=["geometry", "springs"], holdout=UR5 / "random.csv")
    assert there.left_out_rms_mm == pytest.approx(found.json["left_out"]["rms_mm"], rel=1e-5)  # JSON has six digits
    assert there.holdout_rms_mm == pytest.approx(found.json["holdout"]["rms_mm"], rel=1e-5)  # JSON has six digits
    assert there["j4.stiffness"].value is None
    assert len(there.to_frame()) == len(found.json["parameters"])
    assert there.interval("j4.stiffness")[1] == np.inf or np.isnan(there.interval("j4.stiffness")[1])
    with pytest.raises(sa.InputError, match="curves"):
        there.to_frame("curves")
    with pytest.raises(AttributeError, match=r"stiffarm\.calibrate"):
        sa.calibrate_positions  # type: ignore[attr-defined]  # noqa: B018
