"""`calibrate --scheme global`: any robot and numbers, what is told and what not, resuming, hold-out, bad input."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, run_here, tree
from small_robot import STIFFNESS

from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from tests.stiffarm.made_estimates import made_spring

SPRINGS = ",".join(f"{name}.stiffness" for name in STIFFNESS)


@pytest.fixture(scope="module")
def found(small: Path) -> Path:
    """The folder of a calibration of that robot."""
    out = small / "out"
    outcome = run_here(
        "calibrate",
        small / "small.urdf",
        small / "readings.csv",
        "--holdout",
        small / "others.csv",
        "--bootstrap",
        "20",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    return out


def _results(folder: Path) -> dict:  # type: ignore[type-arg]
    return json.loads((folder / "calibration.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


# --- a robot of one's own ----------------------------------------------------------------------------------


def test_a_urdf_and_a_table_give_back_the_springs_that_made_them(found: Path) -> None:
    numbers = {n["name"]: n for n in _results(found)["parameters"]}
    for name, truth in STIFFNESS.items():
        one = numbers[f"{name}.stiffness"]
        low, high = one["value_interval95"]
        # Noise of 2 um on deflections of some 0.1 mm; the gauge's 10 um make the intervals wider than the errors.
        assert one["value"] == pytest.approx(truth, rel=0.02)
        assert low < truth < high
        assert one["status"] == "determined"


def test_poses_held_out_are_predicted_to_the_noise(found: Path) -> None:
    held = _results(found)["holdout"]
    assert held["readings"] == 4 * 2 * 2 * 2 * 3
    assert held["not_predicted"] == {}
    # 2 um of noise, and springs known to 2 %.
    assert 0.001 < held["rms_mm"] < 0.005


def test_the_written_model_predicts_as_the_calibration_did(cli: Command, small: Path, found: Path) -> None:
    simulated = cli("simulate", found / "model.toml", small / "readings.csv", "--json").json
    assert simulated["rms_mm"] == pytest.approx(_results(found)["rms_mm"], rel=1e-4)


def test_the_report_stands_by_itself(found: Path) -> None:
    page = (found / "report.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href)="(?!data:image/png;base64,|#|[\w-][\w./-]*")', page) == []
    pictures = {p.stem for p in found.rglob("*.png")}
    assert {"stiffness_at_the_tool", "intervals", "residuals", "checks", "predictions"} <= pictures
    assert page.count("<img") == len(pictures)
    assert "Determined, with both limits: waist.stiffness, shoulder.stiffness" in page
    assert "No reading stands out" in page


def test_the_bootstrap_agrees_with_the_estimate_and_repeats(cli: Command, small: Path, found: Path) -> None:
    results = _results(found)
    for n, drawn in zip(results["parameters"], results["bootstrap"], strict=True):
        assert n["name"] == drawn["name"]
        assert drawn["low95"] <= drawn["median"] <= drawn["high95"]
        assert drawn["median"] == pytest.approx(n["value"], rel=0.03)
    again = cli("calibrate", small / "small.urdf", small / "readings.csv", "--bootstrap", "20", "--json").json
    assert again["bootstrap"] == results["bootstrap"]


@pytest.mark.slow
def test_sensitivity_and_plan_take_the_same_files(cli: Command, small: Path, tmp_path: Path) -> None:
    files = (small / "small.urdf", small / "readings.csv")
    assert cli("sensitivity", *files, "--method", "derivative", "--out", "sensitivity").code == 0
    planned = cli("plan", *files, "--poses", "2", "--candidates", "60", "--out", "plan")
    assert planned.code == 0, planned.err
    assert (tmp_path / "plan" / "measurement_sheet.csv").is_file()


# --- what is not told --------------------------------------------------------------------------------------


def test_on_the_published_readings_no_doubtful_spring_has_a_number(calibrated: Path) -> None:
    result = _results(calibrated)
    numbers = {n["name"]: n for n in result["parameters"]}
    assert (numbers["j5.stiffness"]["value"], numbers["j5.stiffness"]["bound"]) == (None, "rigid")
    assert numbers["j4.stiffness"]["status"] == "one-sided"
    with (calibrated / "calibration.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert (rows["j5.stiffness"]["value"], rows["j5.stiffness"]["status"]) == ("", "at bound")
    page = (calibrated / "report.html").read_text(encoding="utf-8")
    # The bound stands for no stiffness, however it is written.
    assert not re.search(r"1e\+?09|\b1000\b|1,000,000,000|1e\+03", re.sub(r'src="[^"]*"', "", page))
    assert "rigid fits best" in page
    assert "Determined, with both limits: j2.stiffness, j3.stiffness." in page
    assert "Only a limit to one side: j4.stiffness" in page
    assert result["left_one_pose_out_rms_mm"] == pytest.approx(0.074, abs=5e-4)


@pytest.mark.slow
def test_springs_that_are_read_as_one_are_said_to_trade_off(cli: Command, small: Path) -> None:
    free = "waist.stiffness,base.rz,elbow.stiffness"
    outcome = cli("calibrate", small / "small.urdf", small / "readings.csv", "--free", free, "--json")
    stage = outcome.json["stages"][0]
    numbers = {n["name"]: n for n in outcome.json["parameters"]}
    assert [numbers[n]["status"] for n in ("waist.stiffness", "base.rz")] == ["not identified"] * 2
    assert [numbers[n]["value"] for n in ("waist.stiffness", "base.rz")] == [None] * 2
    (trade,) = stage["trade_offs"]
    assert set(trade["names"]) == {"waist.stiffness", "base.rz"}
    assert "only the sum of their compliances" in trade["words"]
    assert outcome.json["springs"]["elbow"]["k_Nm_per_rad"] > 0.0


def test_a_pose_that_the_calibration_cannot_tell_is_not_predicted(cli: Command, small: Path) -> None:
    lines = _lines(small / "readings.csv")
    kept = [lines[0], *(line for line in lines[1:] if float(line.split(",")[7]) != 0.0)]
    (small / "down.csv").write_text("\n".join(kept) + "\n", encoding="utf-8")
    # Vertical loads do not turn the waist, sideways ones do.
    outcome = cli(
        "calibrate",
        small / "small.urdf",
        small / "down.csv",
        "--free",
        SPRINGS,
        "--holdout",
        small / "others.csv",
        "--json",
    )
    held = outcome.json["holdout"]
    assert all("waist.stiffness" in reason for reason in held["not_predicted"].values())
    assert len(held["not_predicted"]) == 4
    assert all(pose["rms_mm"] is None for pose in outcome.json["held_out"])


def test_intervals_without_a_value_show_none() -> None:
    rigid = made_spring("j5", 1e9, (4e5, np.inf), "at bound")
    (ax,) = intervals_figure({"": [rigid]}).axes
    texts = " ".join(t.get_text() for t in ax.texts)
    assert "at its bound" in texts
    assert "1e+03" not in texts
    assert "1000" not in texts
    assert not [line for line in ax.lines if line.get_marker() == "o"]


# --- noise and outliers ------------------------------------------------------------------------------------


def test_an_outlier_is_named_by_its_line_and_does_little(cli: Command, small: Path, found: Path) -> None:
    lines = _lines(small / "readings.csv")
    cells = lines[20].split(",")
    cells[10] = f"{float(cells[10]) + 0.5:.5f}"
    lines[20] = ",".join(cells)
    (small / "outlier.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    arguments = ("calibrate", small / "small.urdf", small / "outlier.csv", "--json")
    robust = cli(*arguments).json
    assert [(o["line"], o["component"]) for o in robust["outliers"]] == [("21", "dz_mm")]
    clean = {n["name"]: n for n in _results(found)["parameters"]}
    trusting = cli(*arguments, "--no-robust").json
    moved = {}
    for name, numbers in (("robust", robust["parameters"]), ("trusting", trusting["parameters"])):
        moved[name] = max(abs(np.log(n["value"] / clean[n["name"]]["value"])) for n in numbers)
    assert moved["robust"] < 0.02 < moved["trusting"]


def test_scatter_between_set_ups_is_found_and_leaving_it_out_is_said_to_be_too_narrow(
    cli: Command, small: Path
) -> None:
    lines = _lines(small / "readings.csv")
    rng = np.random.default_rng(0)
    scatter: dict[str, float] = {}
    for i, line in enumerate(lines[1:], start=1):
        cells = line.split(",")
        shift = scatter.setdefault(cells[0], 1.0 + 0.1 * rng.normal())
        cells[8:11] = [f"{float(c) * shift:.5f}" for c in cells[8:11]]
        lines[i] = ",".join(cells)
    (small / "setups.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    stage = cli("calibrate", small / "small.urdf", small / "setups.csv", "--json").json["stages"][0]
    # Eight set-ups with 10 %: the estimate of that has an error of a quarter.
    assert stage["noise"]["set_up_share"] == pytest.approx(0.1, abs=0.06)
    assert re.search(r"intervals would wrongly be [\d.]+ times narrower", stage["noise_in_words"])


# --- campaigns ---------------------------------------------------------------------------------------------

HEAD = 'schema = "stiffarm-calibration/1"\nrobot = "small"\ntitle = "one after the other"\n'
STAGES = HEAD + "".join(
    f'[[parameter]]\nname = "{n}.stiffness"\n[[stage]]\nname = "{n}"\nparameters = ["{n}.stiffness"]\n'
    for n in ("shoulder", "elbow")
)


@pytest.mark.slow
def test_stages_are_resumed_and_give_the_same_again(
    cli: Command, small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STIFFARM_CACHE", str(tmp_path / "kept"))
    (small / "stages.toml").write_text(STAGES, encoding="utf-8")
    arguments = ("calibrate", small / "small.urdf", small / "others.csv", "--campaign", small / "stages.toml")
    first, second = cli(*arguments, "--json"), cli(*arguments, "--json")
    assert "resumed" not in first.err
    assert "resumed: stage shoulder from" in second.err
    assert "resumed: stage elbow from" in second.err
    a, b = first.json, second.json
    for stage in (*a["stages"], *b["stages"]):
        del stage["resumed"]
    assert a == b
    assert [s["name"] for s in a["stages"]] == ["shoulder", "elbow"]
    # Every pose is predicted by both stages run again without it.
    assert all(p["left_out_error"] is not None for p in a["poses"])


# --- bad input ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("few", ("1 reading(s) cannot determine 3 parameters", "measure more poses")),
        ("angles", ("the label stands for other joint angles before", "correct the angles")),
        ("values", ("contradicts that of row 2", "column repeat")),
        ("no load", ("1 problem(s)", "the load is zero in every component, here and in every row", "remove the row")),
        ("load's sign", ("64 of 64 readings move against the load", "check the sign")),
        ("metres", ("these look like deflections in metres", "stiffness at the tool", "--confirm-units")),
        ("micrometres", ("deflections in micrometres", "stiffness at the tool", "--confirm-units")),
    ],
)
def test_bad_tables(cli: Command, small: Path, tmp_path: Path, change: str, words: tuple[str, ...]) -> None:
    head, *rows = [line.split(",") for line in _lines(small / "readings.csv")]
    if change == "few":
        rows = [[*row[:8], "", "", *row[10:]] for row in rows[:1]]
    if change == "angles":
        rows[-1][0] = rows[0][0]
    if change == "values":
        rows[1][11] = rows[0][11]
        rows[1][10] = "-5"
    for row in rows:
        if change == "no load":
            row[5:8] = ["0", "0", "0"]
        if change == "load's sign":
            row[5:8] = [str(-float(c)) for c in row[5:8]]
        if change in ("metres", "micrometres"):
            factor = 1e-3 if change == "metres" else 1e3
            row[8:11] = [str(float(c) * factor) for c in row[8:11]]
    table = tmp_path / "bad.csv"
    table.write_text("\n".join(",".join(row) for row in (head, *rows)) + "\n", encoding="utf-8")
    _refused(cli, tmp_path, words, small / "small.urdf", table, "--free", SPRINGS)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--free", "j9.stiffness"), ("'j9.stiffness'", "waist")),
        (("--free", "waist.stiffness,waist.rz"), ("waist.rz", "twice")),
        (("--free", SPRINGS, "--joints", "waist"), ("--joints and --free: one of them",)),
        (("--campaign", "FILE"), ("stage 'elbow'", "hip.stiffness")),
        (("--campaign", "OTHER"), ("calibration file is for robot", "'kr60-3'")),
        (("--campaign", "JOINT"), ("'hip.stiffness'", "waist")),
        (("--campaign", "nowhere.toml"), ("--campaign", "check the path")),
        (("--holdout", "nowhere.csv"), ("--holdout", "check the path")),
        (("--holdout", "SAME"), ("poses that are in", "S0-0, S0-1", "remove them")),
        (("--bootstrap", "-1"), ("--bootstrap",)),
        (("--free", "waist.stiffness", "--spacing", "log"), ("--spacing: no option of --scheme global",)),
    ],
)
def test_bad_options(
    cli: Command, small: Path, tmp_path: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    texts = {
        "FILE": STAGES.replace('parameters = ["elbow.stiffness"]', 'parameters = ["elbow.stiffness", "hip.stiffness"]'),
        "OTHER": STAGES.replace('"small"', '"kr60-3"'),
        "JOINT": STAGES.replace("elbow.stiffness", "hip.stiffness"),
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    files = {name: str(tmp_path / f"{name}.toml") for name in texts} | {"SAME": str(small / "readings.csv")}
    _refused(cli, tmp_path, words, small / "small.urdf", small / "readings.csv", *(files.get(o, o) for o in options))


def _refused(cli: Command, folder: Path, words: tuple[str, ...], *arguments: str | Path) -> None:
    before = tree(folder)
    outcome = cli("calibrate", *arguments, "--out", "out")
    assert (outcome.code, outcome.out) == (2, ""), outcome.err
    # The parser breaks its own messages into lines.
    said = " ".join(outcome.err.split())
    for text in words:
        assert text in said, outcome.err
    assert len([line for line in outcome.err.splitlines() if line.startswith("stiffarm: ")]) <= 1
    assert tree(folder) == before, "something was written"
