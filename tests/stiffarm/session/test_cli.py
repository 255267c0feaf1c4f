"""The commands as a user calls them: what they answer, where it goes, and that the figures are right."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
from cli_runs import ROOT, Command, environment, run_apart, run_here, start, tree
from small_robot import write_readings, write_urdf
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

import stiffarm
from robots import ModelDescription, bundled_names, library_names, load_description
from stiffarm.cli import COMMANDS

pytestmark = pytest.mark.usefixtures("blank", "quick_fit")

LOADS_USED_N = 650.0


# --- help, version, robots ---------------------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_has_help(cli: Command, command: str) -> None:
    outcome = cli(command, "--help")
    assert outcome.code == 0
    assert f"stiffarm {command}" in outcome.out
    if command == "map":  # a command of commands
        assert all(kind in outcome.out for kind in ("joints", "slice", "box", "cylinder", "index"))
        outcome = cli(command, "slice", "--help")
    if command == "robots":
        assert all(kind in outcome.out for kind in ("show", "check"))
        outcome = cli(command, "check", "--help")
    assert "--debug" in outcome.out
    assert outcome.err == ""


def test_a_process_of_its_own_tells_the_version_on_stdout() -> None:
    outcome = run_apart("--version")
    assert (outcome.code, outcome.out.strip(), outcome.err) == (0, stiffarm.__version__, "")


def test_without_a_command_the_help_is_shown_and_the_exit_code_is_that_of_bad_input() -> None:
    outcome = run_here()
    assert outcome.code == 2
    assert all(command in outcome.out + outcome.err for command in COMMANDS)


def test_robots_lists_all_bundled_ones(cli: Command) -> None:
    shown, listed = cli("robots"), cli("robots", "--json")
    assert all(name in shown.err for name in bundled_names())
    assert tuple(r["name"] for r in listed.json["robots"]) == bundled_names()
    assert tuple(r["name"] for r in listed.json["library"]) == library_names()
    readings = {r["name"]: r["measured_readings"] for r in listed.json["robots"] if r["measured_readings"]}
    assert readings == {"fanuc-r2000ic": "fanuc_r2000ic.csv", "xr701": "xr701_gotlih.csv"}


@pytest.mark.parametrize("name", bundled_names())
def test_a_robots_json_is_its_whole_description_and_its_masses(cli: Command, name: str) -> None:
    answer = cli("robots", name, "--json").json
    assert ModelDescription.model_validate(answer["model"]) == load_description(name)
    joints = answer["joints"]
    assert [one["joint"] for one in joints] == [joint["name"] for joint in answer["model"]["joint"]]
    # Of joints without a spring it says what arms of this size have.
    assert all(one.get("class_low_Nm_per_rad", 0.0) < one.get("class_high_Nm_per_rad", 1.0) for one in joints)
    assert all(one["stiffness_Nm_per_rad"] or "class_low_Nm_per_rad" in one for one in joints)
    if "masses" not in answer:
        assert name == "fanuc-r2000ic"
        return
    masses = {one["part"]: one for one in answer["masses"]}
    whole, robot = masses.pop("all parts"), masses.pop("the robot")
    declared = [one["declared_kg"] for one in masses.values() if one["declared_kg"] is not None]
    # Six significant digits are written.
    assert whole["declared_kg"] == (pytest.approx(sum(declared), rel=1e-5) if declared else None)
    assert robot["declared_kg"] == answer["model"]["mass"]["value"]
    assert all(
        one["rest_kg"] == pytest.approx(one["declared_kg"] - one["casing_kg"], abs=1e-3)
        for one in masses.values()
        if one["rest_kg"] is not None
    )


def test_a_robot_is_shown_with_limits_and_their_sources(cli: Command) -> None:
    err = cli("robots", "xr701").err
    assert all(word in err for word in ("−35.00", "45.00"))
    assert "65.00 <= 180.0 +1 q2_deg -1 q3real_deg <= 190.0 deg (assumed)" in err
    assert "note: Geometry, sections and link masses are assumed" in err
    assert all(word in err for word in ("casing, kg", "bar", "crank", "1,450"))


# --- calibrate ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load_path", "links", "rms_mm", "half_a_digit"),
    [
        # Figures agreed on when the chain was built; they are quoted rounded, hence half of the last digit.
        ("parallelogram", "beam", 0.054, 5e-4),
        ("serial", "beam", 0.098, 5e-4),
        ("parallelogram", "rigid", 0.0503, 5e-5),
        ("serial", "rigid", 0.0964, 5e-5),
    ],
)
def test_global_calibration_reaches_its_rms(
    cli: Command, data_file: Path, load_path: str, links: str, rms_mm: float, half_a_digit: float
) -> None:
    options = ("--scheme", "global", "--load-path", load_path, "--links", links, "--json")
    outcome = cli("calibrate", "xr701", data_file, *options)
    assert outcome.code == 0
    result = outcome.json
    assert result["rms_mm"] == pytest.approx(rms_mm, abs=half_a_digit)
    assert (result["load_path"], result["links"], result["scheme"]) == (load_path, links, "global")
    assert (result["readings"], result["count"]["free"]) == (9, 4)
    residuals = [p["measured"] - p["simulated"] for p in result["poses"]]
    # Six significant digits in the file: 5e-6 mm on readings of up to 2 mm.
    assert np.sqrt(np.mean(np.square(residuals))) == pytest.approx(result["rms_mm"], abs=1e-5)
    assert "loads used: 650 N" in outcome.err
    assert "q1_deg, q6_deg" in outcome.err, "a joint column that is taken as 0 is named"


def test_no_number_is_given_for_a_spring_the_data_do_not_determine(cli: Command, data_file: Path) -> None:
    result = cli("calibrate", "xr701", data_file, "--scheme", "global", "--joints", "j1,j2,j3", "--json").json
    assert result["springs"]["j1"]["k_Nm_per_rad"] is None, "a vertical load does not turn joint 1"
    assert result["springs"]["j1"]["status"] == "not identified"
    assert result["springs"]["j3"]["k_Nm_per_rad"] > 0.0


@pytest.mark.slow
def test_staged_calibration_in_a_process_of_its_own(data_file: Path) -> None:
    outcome = run_apart("calibrate", "xr701", data_file, "--scheme", "staged", "--json")
    assert outcome.code == 0
    result = outcome.json
    assert {one["stage"] for one in result["studies"]} == {"step 1", "step 2", "step 3"}
    assert set(result["laws"]) == {"j2", "j3", "j4", "j5"}
    assert result["count"]["free"] == 12
    # Twelve parameters on nine readings must beat the four constants of the same load path.
    assert result["rms_mm"] < 0.0535
    assert result["left_one_pose_out_rms_mm"] > result["rms_mm"]
    assert "step 3, pose 75" in outcome.err


def test_calibrate_writes_model_results_and_provenance(calibrated: Path, data_file: Path) -> None:
    results = {"model.toml", "calibration.json", "calibration.csv", "poses.csv", "report.html", "run.json"}
    assert {name for name in tree(calibrated) if name != "figures" and not name.endswith(".png")} == results
    run = json.loads((calibrated / "run.json").read_text(encoding="utf-8"))
    assert run["schema"] == "stiffarm-run/1"
    assert run["inputs_sha256"]["data"] == hashlib.sha256(data_file.read_bytes()).hexdigest()
    assert len(run["inputs_sha256"]["model"]) == 64
    assert run["versions"]["numpy"] == np.__version__
    assert run["versions"]["stiffarm"] == stiffarm.__version__
    assert run["seed"] == 0
    assert run["timings_s"]["total"] >= 0.0
    calibration = load_description(calibrated / "model.toml").calibration
    assert calibration is not None
    assert calibration.data_sha256 == run["inputs_sha256"]["data"]


@pytest.mark.slow
def test_the_command_in_run_json_is_the_one_typed(tmp_path: Path, data_file: Path) -> None:
    folder = tmp_path / "out"
    typed = ("simulate", "xr701", str(data_file), "--out", str(folder))
    outcome = run_apart(*typed)
    assert (outcome.code, outcome.out) == (0, "")
    assert json.loads((folder / "run.json").read_text(encoding="utf-8"))["command"] == ["stiffarm", *typed]


def test_the_calibrated_model_loads_again_and_gives_the_same_rms(
    cli: Command, calibrated: Path, data_file: Path, tmp_path: Path
) -> None:
    lines = data_file.read_text(encoding="utf-8").splitlines()
    used = tmp_path / "used.csv"
    used.write_text("\n".join([lines[0], *(line for line in lines if ",-650," in line)]) + "\n", encoding="utf-8")
    result = cli("simulate", calibrated / "model.toml", used, "--json").json
    wanted = json.loads((calibrated / "calibration.json").read_text(encoding="utf-8"))["rms_mm"]
    assert result["rms_mm"] == pytest.approx(wanted, rel=1e-5)  # six significant digits in both files
    assert result["links"] == "beam"
    assert result["joints_without_spring"] == ["j1", "j6"]


def test_a_calibration_keeps_the_links_it_was_made_with(cli: Command, tmp_path: Path) -> None:
    cli("calibrate", "xr701", "--scheme", "global", "--links", "rigid", "--out", "out")
    assert cli("simulate", "out/model.toml", "--json").json["links"] == "rigid"
    assert cli("simulate", "out/model.toml", "--links", "beam", "--json").json["links"] == "beam"


@pytest.mark.slow
def test_a_second_calibration_into_the_folder_keeps_the_first(cli: Command, tmp_path: Path) -> None:
    cli("calibrate", "xr701", "--scheme", "global", "--out", "out")
    (tmp_path / "out" / "mine.txt").write_text("not stiffarm's", encoding="utf-8")
    first = tree(tmp_path / "out")
    # Its own output as input: the new model must not take the old one's place while that is read.
    cli("calibrate", "out/model.toml", "--scheme", "global", "--load-path", "serial", "--out", "out")
    second = tree(tmp_path / "out")
    (kept,) = (tmp_path / "out" / "previous").iterdir()
    assert tree(kept) == {name: digest for name, digest in first.items() if name != "mine.txt"}
    assert second["mine.txt"] == first["mine.txt"]
    assert second["model.toml"] != first["model.toml"]


def test_a_scheme_file_serves_the_global_calibration_too(cli: Command, tmp_path: Path) -> None:
    bundled = (ROOT / "doe" / "schemes" / "xr701.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(
        bundled.replace('global]\njoints = ["j2", "j3", "j4", "j5"]', 'global]\njoints = ["j2", "j3"]'),
        encoding="utf-8",
    )
    outcome = cli("calibrate", "xr701", "--scheme", "global", "--scheme-file", "mine.toml", "--out", "out", "--json")
    assert set(outcome.json["springs"]) == {"j2", "j3"}
    run = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert run["inputs_sha256"]["scheme_file"] == hashlib.sha256((tmp_path / "mine.toml").read_bytes()).hexdigest()


# --- simulate and sensitivity ------------------------------------------------------------------------------


def test_simulate_one_pose_splits_the_deflection_by_part(cli: Command, calibrated: Path) -> None:
    pose = "q2_deg=5,q3real_deg=77.5"
    result = cli("simulate", calibrated / "model.toml", "--pose", pose, "--load", "fz_N=-650", "--json").json
    dz = result["dz_mm"]
    parts = sum(row["dz_mm"] for row in result["by_part"] if row["part"] != "total")
    assert parts == pytest.approx(dz, rel=1e-5)  # six significant digits in each of the parts
    assert result["stiffness_N_per_mm"] == pytest.approx(-650.0 / dz, rel=1e-5)  # as above
    # Measured there: -1.88 mm; the calibrated model is off by 0.12 mm at most at any pose.
    assert dz == pytest.approx(-1.88, abs=0.12)
    twice = cli("simulate", calibrated / "model.toml", "--pose", pose, "--load", "fz_N=-1300", "--json").json
    assert twice["dz_mm"] == pytest.approx(2 * dz, rel=1e-5)  # small displacements: linear


def test_rigid_joints_leave_the_links(cli: Command, calibrated: Path) -> None:
    arguments = ("simulate", calibrated / "model.toml", "--pose", "q2_deg=5,q3real_deg=77.5", "--json")
    soft, rigid = cli(*arguments).json, cli(*arguments, "--rigid-joints").json
    assert rigid["rigid_joints"] is True
    soft_parts, rigid_parts = ({row.pop("part"): row for row in found["by_part"]} for found in (soft, rigid))
    assert {"j2", "j3"} <= set(soft_parts)
    assert not {"j2", "j3"} & set(rigid_parts)
    assert all(rigid_parts[name] == soft_parts[name] for name in rigid_parts if name != "total")
    # The first finding: measured is an order of magnitude more than the links alone give.
    assert abs(rigid["dz_mm"]) < 0.1 * abs(soft["dz_mm"])


def test_simulate_a_table(cli: Command, data_file: Path) -> None:
    outcome = cli("simulate", "xr701", data_file, "--rigid-joints", "--json")
    readings = outcome.json["readings"]
    assert len(readings) == 27
    assert readings[0].keys() == {"line", "pose", "load_N", "dz_measured_mm", "dz_simulated_mm", "difference_mm"}
    assert outcome.json["rms_mrad"] is None
    assert "joint columns missing, taken as 0: q1_deg, q6_deg" in outcome.err


def test_simulate_a_table_of_rotations(cli: Command, data_file: Path, tmp_path: Path) -> None:
    text = data_file.read_text(encoding="utf-8").replace("dz_mm", "ry_mrad")
    (tmp_path / "rotations.csv").write_text(text, encoding="utf-8")
    result = cli("simulate", "xr701", "rotations.csv", "--json").json
    assert result["rms_mm"] is None
    assert result["rms_mrad"] > 0.0
    shown = cli("simulate", "xr701", "rotations.csv")
    assert (shown.code, shown.out) == (0, "")
    assert "1.207 mrad RMS" in shown.err


def test_sensitivity_equals_the_lever_arm_formula(cli: Command) -> None:
    options = ("--links", "rigid", "--poses", "5,41,77", "--load-path", "parallelogram", "--json")
    result = cli("sensitivity", "xr701", *options).json
    # A spring k adds F lever^2 / k. Levers about joints 2 and 3 (m): upper arm 1.10, forearm 1.25 + 0.30.
    factor_mm = 650.0 * (1 / 1e5 - 1 / 1e6) * 1e3
    for row, (q2, elbow) in zip(result["effects"], [(-35, 40), (5, 77.5), (45, 115)], strict=True):
        forearm = np.radians(q2 + 180 - elbow)
        wanted = {"j2": (1.10 * np.sin(np.radians(q2))) ** 2, "j3": (1.55 * np.sin(forearm)) ** 2}
        for joint, lever_squared in wanted.items():
            # Six significant digits in the file.
            assert row[f"effect_{joint}_mm"] == pytest.approx(factor_mm * lever_squared, rel=1e-5)
    assert result["effects"][0]["ranking"].startswith("j3 > ")


def test_the_load_path_decides_what_joint_2_does(cli: Command) -> None:
    effect = {
        path: cli("sensitivity", "xr701", "--poses", "41", "--load-path", path, "--json").json["effects"][0]
        for path in ("parallelogram", "serial")
    }
    # Upper arm 5 deg from the vertical: 0.1 m lever with the parallelogram, about 1.6 m without.
    assert effect["parallelogram"]["effect_j2_mm"] < 0.01 * effect["serial"]["effect_j2_mm"]


def test_sensitivity_writes_table_and_picture(cli: Command, tmp_path: Path) -> None:
    outcome = cli("sensitivity", "xr701", "--out", "out")
    assert outcome.out == ""
    files = {"sensitivity.json", "sensitivity.csv", "sensitivity.png", "run.json", "report.html", "shares.png"}
    assert set(tree(tmp_path / "out")) == files
    assert (tmp_path / "out" / "sensitivity.png").read_bytes().startswith(b"\x89PNG")


# --- fit, query, map ---------------------------------------------------------------------------------------


def test_fit_writes_the_best_of_three_surrogates(fitted: Path) -> None:
    bases = {"polynomial", "trigonometric", "factored"}
    names = {"surrogate.json", "fit.json", *(f"surrogate_{basis}.json" for basis in bases)}
    assert {name for name in tree(fitted) if name.endswith(".json")} == {*names, "run.json"}
    errors = json.loads((fitted / "fit.json").read_text(encoding="utf-8"))
    assert {s["basis"] for s in errors["surrogates"]} == bases
    assert {"surrogate.json", "report.html"} <= set(tree(fitted)) >= set(errors["files"])
    figures = {s["basis"]: s["rms_relative_error"] for s in errors["surrogates"]}
    assert figures[errors["best"]] == min(figures.values())
    best = (fitted / f"surrogate_{errors['best']}.json").read_bytes()
    assert (fitted / "surrogate.json").read_bytes() == best
    assert json.loads((fitted / "run.json").read_text(encoding="utf-8"))["seed"] == 0


@pytest.mark.slow
def test_the_seed_decides_the_surrogate(cli: Command, tmp_path: Path) -> None:
    for name, seed in (("a", "0"), ("b", "0"), ("c", "1")):
        options = ("--runs", "300", "--basis", "polynomial", "--degree", "3", "--seed", seed)
        assert cli("fit", "kr60-3", *options, "--out", name).code == 0
    a, b, c = ((tmp_path / name / "surrogate.json").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_fit_with_some_joints_held_where_asked(cli: Command, tmp_path: Path) -> None:
    options = (
        "--inputs",
        "q2_deg,q5_deg",
        "--fixed",
        "q3real_deg=80,q4_deg=30",
        "--runs",
        "300",
        "--direction",
        "0,0,-2",
    )
    assert cli("fit", "xr701", *options, "--out", "out").code == 0
    answer = cli("query", "out/surrogate.json", "--pose", "q2_deg=5,q5_deg=10", "--json").json
    assert answer["fixed_deg"] == {"q1_deg": 0.0, "q3real_deg": 80.0, "q4_deg": 30.0, "q6_deg": 0.0}
    assert answer["load_direction"] == [0.0, 0.0, -1.0]
    pose = "q2_deg=5,q5_deg=10,q3real_deg=80,q4_deg=30"
    model = cli("simulate", "xr701", "--pose", pose, "--json").json["stiffness_N_per_mm"]
    (row,) = answer["answers"]
    # The error that the surrogate itself states; 1e-5: six significant digits in both.
    assert row["stiffness_N_per_mm"] == pytest.approx(model, rel=answer["errors"]["max_relative_error"] + 1e-5)


def test_the_nine_measured_poses_are_answered_within_the_stated_error(
    cli: Command, fitted: Path, calibrated: Path, data_file: Path
) -> None:
    outcome = cli("query", fitted / "surrogate.json", data_file, "--json", "--out", "answers")
    stated = outcome.json["errors"]["max_relative_error"]
    rows = {row["pose"]: row for row in outcome.json["answers"]}
    assert set(rows) == {"3", "4", "5", "39", "40", "41", "75", "76", "77"}
    for row in rows.values():
        pose = ",".join(f"{name}={row[name]}" for name in ("q2_deg", "q3real_deg", "q4_deg", "q5_deg"))
        model = cli("simulate", calibrated / "model.toml", "--pose", pose, "--json").json["stiffness_N_per_mm"]
        # 1e-5: six significant digits in both files.
        assert model / row["stiffness_N_per_mm"] == pytest.approx(1.0, abs=stated + 1e-5)
        assert row["inside_domain"]
        assert row["reachable"]
    # The error must be one worth stating, or the test above says nothing.
    assert stated < 0.02
    lines = Path("answers/query.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + 27
    assert "stiffness_N_per_mm" in lines[0].split(",")
    run = json.loads(Path("answers/run.json").read_text(encoding="utf-8"))
    assert set(run["inputs_sha256"]) == {"surrogate", "poses"}


def test_query_by_poses_on_the_command_line(cli: Command, fitted: Path) -> None:
    poses = ("--pose", "q2_deg=5,q3real_deg=77.5,q4_deg=0,q5_deg=0", "--pose", "q2_deg=0,q3real_deg=80")
    outcome = cli("query", fitted / "surrogate.json", *poses, "--json")
    assert [row["pose"] for row in outcome.json["answers"]] == ["1", "2"]
    assert "pose 2: q4_deg is not given and taken as 0" in outcome.err
    assert "pose 1" not in outcome.err
    shown = cli("query", fitted / "surrogate.json", *poses)
    assert shown.out == ""
    assert "N/mm" in shown.err


def test_a_table_with_other_columns_and_separators(cli: Command, fitted: Path, tmp_path: Path) -> None:
    text = "\ufeffpose;note;q3real_deg;q2_deg;q1_deg\nhome;a;80;-10;0\n\nfar;b;80;20;0\n"
    (tmp_path / "poses.csv").write_text(text, encoding="utf-8")
    outcome = cli("query", fitted / "surrogate.json", "poses.csv", "--json")
    rows = outcome.json["answers"]
    assert [(row["pose"], row["q2_deg"], row["q3real_deg"]) for row in rows] == [("home", -10, 80), ("far", 20, 80)]
    assert "columns not used: note" in outcome.err
    assert "q4_deg is missing and taken as 0" in outcome.err


def test_extrapolation_is_flagged_and_has_no_error_bar(cli: Command, fitted: Path) -> None:
    outside = ("--pose", "q2_deg=45.5,q3real_deg=80", "--json")
    refused = cli("query", fitted / "surrogate.json", *outside)
    assert (refused.code, refused.out) == (2, "")
    assert "q2_deg = 45.5 deg (allowed -35 to 45 deg)" in refused.err
    assert "--extrapolate" in refused.err
    answered = cli("query", fitted / "surrogate.json", *outside, "--extrapolate")
    (row,) = answered.json["answers"]
    assert row["inside_domain"] is False
    assert row["stiffness_N_per_mm"] > 0.0
    assert row["relative_error95"] is None
    assert row["relative_error95_surrogate"] is None
    assert row["stiffness_interval95_N_per_mm"] is None
    assert row["flags"].startswith("extrapolated: q2_deg = 45.5 deg (allowed -35 to 45 deg)")
    assert "extrapolated" in cli("query", fitted / "surrogate.json", *outside[:2], "--extrapolate").err


def test_the_map_is_readable_by_plain_vtk_with_the_documented_arrays(
    cli: Command, calibrated: Path, fitted: Path, tmp_path: Path
) -> None:
    options = ("--surrogate", fitted / "surrogate.json", "--points", "4", "--no-pictures", "--json")
    outcome = cli("map", "joints", calibrated / "model.toml", *options, "--out", "out")
    assert set(tree(tmp_path / "out")) == {"stiffness_map.vtu", "map.csv", "map.json", "report.html", "run.json"}
    assert "another model" not in outcome.err
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "out" / "stiffness_map.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    point_data = grid.GetPointData()
    arrays = {
        point_data.GetArrayName(i): vtk_to_numpy(point_data.GetArray(i)) for i in range(point_data.GetNumberOfArrays())
    }
    joints = {"q1_deg", "q2_deg", "q3real_deg", "q4_deg", "q5_deg", "q6_deg"}
    assert arrays.keys() == {"stiffness_N_per_mm", "model_stiffness_N_per_mm", *joints}
    documented = (ROOT / "docs" / "reference" / "stiffness_map.md").read_text(encoding="utf-8")
    assert "`stiffness_N_per_mm`" in documented
    assert "`model_stiffness_N_per_mm`" in documented
    assert grid.GetNumberOfPoints() == outcome.json["points"] == len(arrays["q2_deg"])
    assert grid.GetNumberOfCells() > 0
    stated = json.loads((fitted / "fit.json").read_text(encoding="utf-8"))["surrogates"][0]
    ratio = arrays["model_stiffness_N_per_mm"] / arrays["stiffness_N_per_mm"]
    # The sweep's corners are where a fit is worst; ten times the worst error seen says that it is this surrogate.
    assert np.abs(ratio - 1.0).max() < 10 * stated["max_relative_error"]
    metadata = {
        grid.GetFieldData().GetArrayName(i): grid.GetFieldData().GetAbstractArray(i).GetValue(0)
        for i in range(grid.GetFieldData().GetNumberOfArrays())
    }
    assert metadata["robot"] == "xr701"
    assert metadata["stiffness_from"] == "surrogate (factored)"
    assert metadata["links"] == "beam"


def test_a_map_from_another_models_surrogate_says_so(cli: Command, fitted: Path) -> None:
    options = ("--surrogate", fitted / "surrogate.json", "--points", "3", "--no-pictures", "--out", "out")
    outcome = cli("map", "joints", "xr701", *options)
    assert (outcome.code, outcome.out) == (0, "")
    assert "fitted to another model" in outcome.err


def test_map_layers_are_the_ones_asked_for(cli: Command) -> None:
    options = ("--points", "3", "--no-pictures", "--out", "out", "--json")
    one = cli("map", "joints", "kr60-3", "--layers", "-30", *options).json["points"]
    assert cli("map", "joints", "kr60-3", "--layers", "-30,0,30", *options).json["points"] == 3 * one


# --- where things go ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("robots",),
        ("robots", "tx200"),
        ("simulate", "xr701"),
        ("simulate", "kr60-3", "--pose", "q2_deg=-90"),
        ("sensitivity", "xr701"),
        ("calibrate", "xr701", "--scheme", "global"),
        ("calibrate", "xr701", "--scheme", "staged", "--out", "out"),
        ("fit", "xr701", "--runs", "300", "--degree", "2", "--basis", "polynomial", "--out", "out"),
        ("map", "joints", "xr701", "--points", "2", "--no-pictures", "--out", "out"),
    ],
)
def test_without_json_stdout_stays_empty(cli: Command, arguments: tuple[str, ...]) -> None:
    outcome = cli(*arguments)
    assert outcome.code == 0, outcome.err
    assert outcome.out == ""
    assert outcome.err != ""


def test_labels_from_files_are_no_markup(cli: Command, data_file: Path, hostile_model: Path, tmp_path: Path) -> None:
    lines = data_file.read_text(encoding="utf-8").splitlines()
    (tmp_path / "data.csv").write_text("\n".join([lines[0], *(f"[/b]{line}" for line in lines[1:])]), encoding="utf-8")
    outcome = cli("simulate", hostile_model, "data.csv")
    assert outcome.code == 0, outcome.err
    assert "[/b]77" in outcome.err
    # A table wraps its title anywhere.
    assert "<script>alert('x')</script>" in "".join(cli("robots", hostile_model).err.split("\n"))


@pytest.mark.slow
def test_a_reader_that_stops_early_is_no_error_of_ours(data_file: Path) -> None:
    """As in ``stiffarm ... --json | head -1``."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        process = start(("robots", "xr701", "--json"), stdout=writing)
        err = process.communicate(timeout=60)[1]
    finally:
        os.close(writing)
    assert (process.returncode, err) == (1, "")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_stdout_is_named() -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        process = start(("robots", "--json"), stdout=full)
        err = process.communicate(timeout=60)[1]
    assert process.returncode == 1
    assert "No space left on device" in err
    assert len(err.splitlines()) == 1


@pytest.mark.slow
def test_a_plain_ascii_terminal_can_show_everything(calibrated: Path) -> None:
    env = environment(PYTHONIOENCODING="ascii")
    outcome = run_apart("simulate", calibrated / "model.toml", env=env)
    assert outcome.code == 0, outcome.err
    assert "mm RMS" in outcome.err


# --- the whole chain ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_whole_chain_gives_the_same_twice(tmp_path: Path) -> None:
    """In two processes, which put sets in different orders."""
    urdf = write_urdf(tmp_path / "small.urdf")
    given = urdf, write_readings(urdf, tmp_path / "readings.csv", poses=3)
    results = []
    for name in ("a", "b"):
        outcome = run_apart("run", *given, "--out", tmp_path / name, "--points", "2", "--no-rehearse")
        assert outcome.code == 0, outcome.err
        results.append((tmp_path / name / "results.json").read_bytes())
    assert results[0] == results[1]
    for file in ("model.toml", "surrogate.json", "stiffness_map.vtu"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
