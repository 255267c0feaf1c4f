"""The Python face: names, short tables, data frames, errors that speak of arguments, and strangers' folders."""

from __future__ import annotations

import importlib.util
import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cli_runs import run_here

import stiffarm as sa
from stiffarm.result import IN_BRIEF

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def arm() -> sa.Arm:
    return sa.load("xr701")


@pytest.fixture(scope="module")
def readings(arm: sa.Arm) -> sa.Readings:
    return sa.read_readings(sa.bundled("xr701"), arm)


@pytest.fixture(scope="module")
def calibration(arm: sa.Arm, readings: sa.Readings) -> sa.Calibration:
    return sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"])


@pytest.mark.parametrize("name", sa.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(sa, name)
    assert inspect.getdoc(value)
    assert name in dir(sa)
    if inspect.isfunction(value):
        assert all(p.annotation is not inspect.Parameter.empty for p in inspect.signature(value).parameters.values())


def test_no_public_function_is_hidden_by_a_folder() -> None:
    beside = {path.stem for path in (ROOT / "stiffarm").iterdir()}
    assert beside & set(sa.__all__) == set()


def test_results_are_short_tables(readings: sa.Readings, calibration: sa.Calibration) -> None:
    for result in (readings, calibration):
        assert len(repr(result).splitlines()) <= IN_BRIEF + 3
        assert "<table" in result._repr_html_()


def test_nothing_is_printed(arm: sa.Arm, capfd: pytest.CaptureFixture[str]) -> None:
    sa.read_readings(sa.bundled("xr701"), arm)
    assert capfd.readouterr() == ("", "")


def test_a_frame_gives_the_readings_of_the_file(arm: sa.Arm, readings: sa.Readings) -> None:
    again = sa.read_readings(readings.to_frame(), arm)
    # The frame is in degrees and millimetres: there and back costs a rounding.
    np.testing.assert_allclose(again.table.q, readings.table.q, rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(again.table.displacement, readings.table.displacement, rtol=1e-15)


def test_a_fault_of_a_frame_has_its_row_and_column(arm: sa.Arm, readings: sa.Readings) -> None:
    frame = readings.to_frame().astype({"dz_mm": object})
    frame.loc[3, "dz_mm"] = "0,4"
    with pytest.raises(sa.InputError, match=r"data frame.*row 5.*dz_mm"):
        sa.read_readings(frame, arm)


def test_parameters_are_found_by_name(calibration: sa.Calibration) -> None:
    k2 = calibration["j2.stiffness"]
    assert k2.value is not None
    assert k2.interval95[0] < k2.value < k2.interval95[1]
    assert calibration.as_json["count"] == {"free": 2, "at_bound": 0, "identified": 2}
    assert list(calibration.to_frame()["name"]) == ["j2.stiffness", "j3.stiffness"]
    assert tuple(map(float, calibration.interval("j2.stiffness"))) == k2.interval95
    # The estimator's variable is the compliance.
    assert calibration.covariance.loc["j2.stiffness", "j2.stiffness"] > 0.0
    assert calibration["rms_mm"] == calibration.rms_mm < calibration.left_out_rms_mm
    with pytest.raises(sa.InputError, match=r"j2\.stiffness"):
        calibration["j9.stiffness"]


def test_the_calibrated_arm_can_be_saved_and_loaded(calibration: sa.Calibration, tmp_path: Path) -> None:
    file = calibration.arm.save(tmp_path / "calibrated.toml")
    k = sa.load(file).describe().set_index("joint")["stiffness_Nm_per_rad"]
    value = calibration["j2.stiffness"].value
    assert value is not None
    # The file keeps every digit.
    assert k["j2"] == pytest.approx(value, rel=1e-12)
    assert np.isinf(k["j4"])


def test_errors_speak_of_arguments(arm: sa.Arm, readings: sa.Readings) -> None:
    with pytest.raises(sa.InputError, match="load_path") as raised:
        sa.load("xr701", load_path="sideways")
    assert "--" not in str(raised.value)
    with pytest.raises(sa.InputError) as raised:
        sa.calibrate(arm, readings, free=["j2.stiffnes"])
    assert "--" not in str(raised.value)
    with pytest.raises(sa.InputError, match="q_deg: name: got 'q2_dg'"):
        arm.pose({"q2_dg": 3.0})


@pytest.mark.slow
def test_pictures_are_png(arm: sa.Arm, calibration: sa.Calibration, tmp_path: Path) -> None:
    for picture in (arm.plot(tmp_path / "arm.png"), calibration.plot()):
        assert picture.png.startswith(b"\x89PNG")
    assert (tmp_path / "arm.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(sa.InputError, match="ending in"):
        arm.plot(tmp_path / "arm.jpg")


@pytest.mark.slow
def test_a_surrogate_answers_frames_and_refuses_other_names(calibration: sa.Calibration, tmp_path: Path) -> None:
    s = sa.fit(calibration.arm, runs=400, basis="polynomial", degree=3)
    one = s.query(q_deg={"q2_deg": 5, "q3real_deg": 77.5})
    several = s.query(q_deg=pd.DataFrame({"q2_deg": [5.0, 6.0], "q3real_deg": [77.5, 77.5]}))
    assert one.values[0] == several.values[0]
    with pytest.raises(sa.InputError, match="pose: name"):
        s.query(q_deg={"q9_deg": 5})
    with pytest.raises(sa.InputError, match="poses: name"):
        s.query(pd.DataFrame({"q2_deg": [5.0], "q9_deg": [5.0]}))
    with pytest.raises(sa.InputError, match="poses: q2_deg"):
        s.query(pd.DataFrame({"q2_deg": [5.0, np.nan]}))
    rows = s.query([{"q2_deg": 5, "q3real_deg": 77.5}, {"q2_deg": 500}]).to_frame()
    frames = s.query(pd.DataFrame({"q3real_deg": [77.5, 0.0], "q2_deg": [5.0, 500.0]})).to_frame()
    pd.testing.assert_frame_equal(rows, frames)
    assert np.isnan(rows["stiffness_low95_N_per_mm"][1])
    assert rows["flags"][1].startswith("not answered: q2_deg = 500 deg")
    again = sa.load_surrogate(s.save(tmp_path / "surrogate.json"))
    assert again.query(q_deg={"q2_deg": 5, "q3real_deg": 77.5}).values[0] == one.values[0]
    header = s.save(tmp_path / "stiffness.h").read_text(encoding="utf-8")
    assert "int xr701_compliance_evaluate(const double q_rad[4], double out[1])" in header
    with pytest.raises(sa.InputError, match=r"\.json, \.onnx, \.h"):
        s.save(tmp_path / "surrogate.f90")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["meshes", "robots"])
@pytest.mark.parametrize("kind", ["a package", "a plain folder first on the path"])
def test_a_folder_of_our_name_gives_one_clear_message(tmp_path: Path, name: str, kind: str) -> None:
    (tmp_path / name).mkdir()
    if kind == "a package":
        (tmp_path / name / "__init__.py").touch()
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; sys.path.append({str(ROOT)!r}); import stiffarm as sa\n"
    done = subprocess.run(  # noqa: S603 - our own interpreter with our own text
        [sys.executable, "-c", code + "print(sa.load('xr701'))"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    if kind == "a package":
        assert f"ImportError: stiffarm's own package '{name}' is hidden by {tmp_path}" in done.stderr
    else:  # a package further down goes before a plain folder
        assert done.returncode == 0, done.stderr


def test_a_package_that_is_missing_asks_for_another_installation(monkeypatch: pytest.MonkeyPatch) -> None:
    """An editable installation that is older than the package: nothing hides it."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "rehearsal" else find(name))
    with pytest.raises(ImportError, match=r"'rehearsal' is missing.*install stiffarm again") as caught:
        sa.refuse_strangers()
    assert "hidden" not in str(caught.value)


def test_the_command_line_says_so_too(tmp_path: Path) -> None:
    (tmp_path / "meshes.py").touch()
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; sys.path.append({str(ROOT)!r})\n"
    code += "from stiffarm.__main__ import main; main()"
    command = [sys.executable, "-c", code, "robots"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603 - our own text
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "'meshes' is hidden by" in done.stderr


def test_a_pose_is_simulated_as_on_the_command_line(arm: sa.Arm) -> None:
    found = sa.simulate(arm, pose={"q2_deg": 5, "q3real_deg": 77.5}, load={"fz_N": -650})
    parts = found.to_frame().set_index("part")["dz_mm"]
    # Each part is rounded to six digits.
    assert parts.drop("total").sum() == pytest.approx(parts["total"], rel=1e-5)
    with pytest.raises(sa.InputError, match="load: name"):
        sa.simulate(arm, pose={"q3real_deg": 77.5}, load={"fz_n": -650})


def test_calibrated_readings_are_replayed_at_their_rms(arm: sa.Arm, readings: sa.Readings) -> None:
    of_all_loads = sa.calibrate(arm, readings, free=["j2.stiffness", "j3.stiffness"], loads=[])
    # The command prints six digits.
    assert sa.simulate(of_all_loads.arm, data=readings).as_json["rms_mm"] == pytest.approx(
        of_all_loads.rms_mm, rel=1e-5
    )


def test_a_plan_is_a_sheet_that_can_be_filled_in(arm: sa.Arm, readings: sa.Readings, tmp_path: Path) -> None:
    plan = sa.plan(arm, readings, poses=2, free=["j2.stiffness", "j3.stiffness"])
    assert len(plan.to_frame()) == 2
    assert plan.sentences
    assert "dz_mm" in plan.save(tmp_path / "sheet.csv").read_text(encoding="utf-8").splitlines()[0]


def test_indices_are_found_by_name() -> None:
    arm = sa.load("kr60-3")
    pose = {"q2_deg": -60, "q3_deg": 40, "q5_deg": 40}
    found = sa.index(arm, pose=[pose, pose], force=[200, 200, 200])
    assert found["k_fs"][0] == found["k_fs"][1] > 0
    with pytest.raises(sa.InputError, match="k_fs"):
        found["nothing"]


@pytest.mark.slow
def test_a_map_is_saved_drawn_and_framed(tmp_path: Path) -> None:
    m = sa.map_slice(sa.load("kr60-3", links="rigid"), step_mm=500, pose="best-gamma")
    assert m.to_frame().shape[0] == m.data.layout.n == len(m["stiffness_N_per_mm"])
    for ending in ("vti", "csv"):
        assert m.save(tmp_path / f"map.{ending}").stat().st_size > 0
    assert m.plot(file=tmp_path / "map.png").png.startswith(b"\x89PNG")
    assert m.mesh.point_data["stiffness_N_per_mm"].shape == (m.data.layout.n,)
    with pytest.raises(sa.InputError, match=r"\.vti"):
        m.save(tmp_path / "map.stl")


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        ([], {}),
        (["--scheme", "global"], {"scheme": "global"}),
        (["--free", "j2.stiffness,j3.stiffness"], {"free": ["j2.stiffness", "j3.stiffness"]}),
    ],
)
def test_defaults_are_those_of_the_command_line(
    arm: sa.Arm, readings: sa.Readings, options: list[str], arguments: dict[str, object]
) -> None:
    asked = run_here("calibrate", "xr701", *options, "--json")
    made = sa.calibrate(arm, readings, **arguments)  # type: ignore[arg-type]
    # Stages that one has found need not be found again by the other.
    made_json, asked_json = dict(made.as_json), asked.json
    for content in (made_json, asked_json):
        content["stages"] = [{**stage, "resumed": None} for stage in content["stages"]]
    assert made_json == asked_json
