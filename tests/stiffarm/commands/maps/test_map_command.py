"""`stiffarm map` over joints and space: its files agree with the model and with each other; bad input is named."""

from __future__ import annotations

import csv
import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest
from cli_runs import ROOT, Command, run_here, tree
from small_robot import write_urdf
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLUnstructuredGridReader

from doe.certainty.parameter_uncertainty import parameter_uncertainty
from doe.certainty.propagation import propagate
from fem import build_model, compliance_budget, directional_stiffness
from machining import stiffness_index
from robots import InputError, forward_kinematics, load_description, tool_position
from stiffarm import __version__
from stiffarm.commands.maps.request import BoxRequest, CylinderRequest, MapJob, SliceRequest, evaluate
from stiffarm.session.inputs import read_model
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import REFUSED

BARE = ("--no-pictures", "--json", "--out", "out")
SMALL = ("--x", "1000:2200:400", "--z", "400:1600:400")
DOWN = np.array([0.0, 0.0, -1.0])


def table(path: Path) -> dict[str, list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def numbers(column: list[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([float(v) if v else np.nan for v in column])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A small slice of the xr701 with the stiffest pose at each point."""
    out = tmp_path_factory.mktemp("slice") / "out"
    outcome = run_here("map", "slice", "xr701", *SMALL, "--no-pictures", "--html", "--json", "--out", out)
    assert outcome.code == 0, outcome.err
    return out, outcome.json


def test_the_table_of_a_slice_is_what_the_model_says(made: tuple[Path, dict[str, Any]]) -> None:
    out, content = made
    found = table(out / "map.csv")
    model = build_model(load_description("xr701"))
    stiffness = numbers(found["stiffness_N_per_mm"])
    there = np.isfinite(stiffness)
    assert there.sum() == content["points"] < content["grid_points"] == 16 == len(there)
    q = np.radians(np.column_stack([numbers(found[name]) for name in model.robot.coordinates])[there])
    assert model.robot.reachable(q).all()
    p = np.column_stack([numbers(found[f"{name}_mm"]) for name in "xyz"])[there]
    # The table has nine digits of angles up to 270 deg: 1e-6 deg on 2.5 m.
    np.testing.assert_allclose(tool_position(model.robot, forward_kinematics(model.robot, q)) * 1e3, p, atol=1e-3)
    np.testing.assert_allclose(stiffness[there], directional_stiffness(model, q) * 1e-3, rtol=1e-6)
    k_fs = stiffness_index(model, q, np.array([0.0, 0.0, 1.0])) * 1e-3
    np.testing.assert_allclose(numbers(found["k_fs_N_per_mm"])[there], k_fs, rtol=1e-6)
    budget = compliance_budget(model, q, np.array([*DOWN, 0.0, 0.0, 0.0]))
    assert [v for v in found["softest_part"] if v] == [budget.parts[i] for i in budget.share.argmax(axis=1)]
    figures = content["quantities"]["stiffness_N_per_mm"]
    np.testing.assert_allclose(
        [figures["min"], figures["median"], figures["max"]],
        [stiffness[there].min(), np.median(stiffness[there]), stiffness[there].max()],
        rtol=1e-5,  # six digits
    )
    worst = content["quantities"]["stiffness_N_per_mm"]["least_at"]
    assert stiffness[worst["row"]] == stiffness[there].min()
    assert content["search_check"]["worst_shortfall_percent"] < 0.1


def test_the_files_of_a_slice_say_the_same(made: tuple[Path, dict[str, Any]]) -> None:
    out, content = made
    assert set(tree(out)) == {"map.vti", "map.csv", "map.json", "map.html", "report.html", "run.json"}
    assert json.loads((out / "map.json").read_text(encoding="utf-8"))["quantities"] == content["quantities"]
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(out / "map.vti"))
    reader.Update()
    image = reader.GetOutput()
    assert image.GetNumberOfPoints() == content["grid_points"]
    array = vtk_to_numpy(image.GetPointData().GetArray("stiffness_N_per_mm"))
    np.testing.assert_allclose(array, numbers(table(out / "map.csv")["stiffness_N_per_mm"]), rtol=1e-8)
    assert content["files"] == ["map.vti", "map.html", "map.csv"]
    assert "stiffness_N_per_mm" in (out / "map.html").read_text(encoding="utf-8")


def test_the_joint_sweep_has_the_arrays_it_always_had_and_more(cli: Command, tmp_path: Path) -> None:
    outcome = cli("map", "joints", "xr701", "--points", "3", "--layers", "-90,0", *BARE)
    assert outcome.code == 0, outcome.err
    assert set(tree(tmp_path / "out")) == {"stiffness_map.vtu", "map.csv", "map.json", "report.html", "run.json"}
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "out" / "stiffness_map.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    data = grid.GetPointData()
    arrays = {data.GetArrayName(i) for i in range(data.GetNumberOfArrays())}
    joints = {"q1_deg", "q2_deg", "q3real_deg", "q4_deg", "q5_deg", "q6_deg"}
    assert arrays > {"stiffness_N_per_mm", "worst_stiffness_N_per_mm", "softest_part", *joints}
    found = outcome.json
    assert grid.GetNumberOfPoints() == found["points"] < found["grid_points"] == 54
    assert sum(grid.GetCellType(i) == 12 for i in range(grid.GetNumberOfCells())) > 0


def test_load_tool_and_quantities_are_those_asked_for(cli: Command, tmp_path: Path) -> None:
    options = ("--direction", "0,1,0", "--tool", "50,0,120", "--values", "directions,stiffness", "--points", "2")
    assert cli("map", "joints", "kr60-3", *options, *BARE).code == 0
    found = table(tmp_path / "out" / "map.csv")
    assert [n for n in found if "stiffness" in n or "direction" in n] == [
        "stiffness_N_per_mm",
        "worst_direction_x",
        "worst_direction_y",
        "worst_direction_z",
    ]
    model = build_model(load_description("kr60-3"))
    k = numbers(found["stiffness_N_per_mm"])
    there = np.isfinite(k)
    q = np.radians(np.column_stack([numbers(found[name]) for name in model.robot.coordinates])[there])
    wanted = directional_stiffness(model, q, np.array([0.0, 1.0, 0.0]), np.array([0.05, 0.0, 0.12])) * 1e-3
    np.testing.assert_allclose(k[there], wanted, rtol=1e-6)


@pytest.mark.slow
def test_stiffest_best_gamma_fixed_and_softest_are_in_that_order(cli: Command, tmp_path: Path) -> None:
    k = {}
    for pose in ("stiffest", "best-gamma", "fixed", "softest"):
        options = ("--pose", pose, "--values", "stiffness", "--tool", "60,0,200,0,20,0")
        outcome = cli("map", "slice", "kr60-3", "--links", "rigid", *SMALL, *options, "--no-pictures", "--out", pose)
        assert outcome.code == 0, outcome.err
        k[pose] = numbers(table(tmp_path / pose / "map.csv")["stiffness_N_per_mm"])
    there = np.isfinite(k["fixed"])
    assert there.any()
    for better, worse in (("stiffest", "best-gamma"), ("best-gamma", "fixed"), ("fixed", "softest")):
        assert (k[better][there] >= k[worse][there] * (1.0 - 1e-8)).all()


def test_boxes_and_cylinders_of_a_default_size_hold_the_reach(cli: Command, tmp_path: Path) -> None:
    given = read_model("kr60-3", "rigid", None)
    for asked in (BoxRequest(), CylinderRequest(), SliceRequest()):
        grid, reach = asked.grid(given.robot), asked.reach(given.robot)
        axes = {axis.name: axis.values for axis in grid.axes}
        assert axes["z"][0] <= 1e3 * reach.lower[2]
        assert axes["z"][-1] >= 1e3 * reach.upper[2]
        assert max(len(v) for v in axes.values()) >= (40 if asked.kind == "slice" else 25)
        assert grid.n < 100_000
    options = ("--r", "1200:1600:400", "--z", "800", "--phi", "-90:90:90", "--pose", "fixed")
    outcome = cli("map", "cylinder", "kr60-3", *options, "--format", "vtu,vtp", *BARE)
    assert outcome.code == 0, outcome.err
    assert {"map.vtu", "map.vtp"} <= set(tree(tmp_path / "out"))
    k = numbers(table(tmp_path / "out" / "map.csv")["stiffness_N_per_mm"]).reshape(3, 2)
    assert np.isfinite(k[:, 0]).all()


@pytest.mark.slow
def test_a_work_folder_is_gone_on_with(
    cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    options = ("--points", "3", "--values", "stiffness", "--work", "work")
    assert cli("map", "joints", "kr60-3", *options, *BARE).code == 0
    first = (tmp_path / "out" / "map.csv").read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(Engine, "block", lambda *_: pytest.fail("made a second time"))
        assert cli("map", "joints", "kr60-3", *options, *BARE).code == 0
    # What has changed in between is no result: it is made again, and said.
    (block,) = (tmp_path / "work").glob("*.npz")
    content = bytearray(block.read_bytes())
    content[len(content) // 2] ^= 1
    block.write_bytes(content)
    assert cli("map", "joints", "kr60-3", *options, *BARE).code == 0
    assert "1 of 1 blocks are damaged (0); they are made again" in caplog.text
    assert (tmp_path / "out" / "map.csv").read_bytes() == first
    other = cli("map", "joints", "kr60-3", "--points", "4", "--work", "work", *BARE)
    assert other.code == 2
    assert "of another map" in other.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("slice", "--plane", "zx"), "--plane"),
        (("slice", "--y", "0:100:50"), "--y cannot be combined with --plane xz"),
        (("slice", "--at", "left"), "--at"),
        (("cylinder", "--r", "-100:100:50"), "radius"),
        (("slice", "--pose", "limp"), "--pose: got 'limp'"),
        (("slice", "--tool-axis", "0,0,1"), "--tool-axis cannot be combined with --pose stiffest"),
        (("slice", "--pose", "fixed", "--gamma", "0:90:30"), "--gamma with --pose fixed"),
        (("slice", "--pose", "best-gamma", "--gamma", "0"), "--gamma with --pose best-gamma"),
        (("slice", "--best-by", "beauty"), "--best-by"),
        (("slice", "--values", "stifness"), "--values"),
        (("joints", "--values", "uncertainty"), "does not say how sure its numbers are"),
        (("joints", "--format", "vti"), "--format vti of a map over joints"),
        (("joints", "--format", "stl"), "--format"),
        (("joints", "--direction", "0,0,0"), "--direction"),
        (("joints", "--normal", "0,0,0"), "--normal"),
        (("joints", "--surrogate", "s.json", "--html"), "--html cannot be combined with --surrogate"),
        (("slice", "--x", "0:100:33"), "a whole number of steps"),
        (("slice", "--x", "9000:9500:100", "--z", "0:500:100"), "within the reach of kr60-3"),
        (("slice", "--pose", "fixed", "--x", "9000:9500:100", "--z", "0:500:100"), "--pose stiffest"),
        (("slice", "--dask", "tcp://127.0.0.1:9", *SMALL), "does not answer"),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    cli: Command, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    outcome = cli("map", options[0], "kr60-3", "--links", "rigid", *options[1:], "--out", "out")
    assert (outcome.code, outcome.out) == (2, "")
    assert words in " ".join(outcome.err.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (("kr60-3", "--points", "3", "--out", "m"), "joints kr60-3 --points 3 --out m"),
        (("kr60-3", "--grid", "slice", "--plane", "xz", "--out", "m"), "slice kr60-3 --plane xz --out m"),
        (("my arm.toml", "--grid=box", "--out", "m"), "box 'my arm.toml' --out m"),
        (
            ("kr60-3", "--quantity", "k_fs", "--x", "0:9:3", "--out", "m"),
            "index kr60-3 --quantity k_fs --x 0:9:3 --out m",
        ),
    ],
)
def test_the_form_of_before_is_answered_with_the_new_one(cli: Command, old: tuple[str, ...], new: str) -> None:
    outcome = cli("map", *old)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"`stiffarm map {new}`" in " ".join(outcome.err.split())


def test_models_that_such_a_map_cannot_be_made_of(cli: Command, tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")
    four = cli("map", "slice", urdf, "--out", "out")
    assert four.code == 2
    assert "nothing in this model deflects" in " ".join(four.err.split())
    with pytest.raises(InputError, match=r"4 joints.*map joints"):
        SliceRequest(pose="fixed").engine(read_model(str(urdf), "rigid", None))


def test_a_calibrated_model_says_how_sure_its_stiffness_is(cli: Command, tmp_path: Path, calibrated: Path) -> None:
    outcome = cli("map", "joints", calibrated / "model.toml", "--points", "2", "--layers", "30", *BARE)
    assert outcome.code == 0, outcome.err
    found = table(tmp_path / "out" / "map.csv")
    description = load_description(calibrated / "model.toml")
    percent, model = numbers(found["uncertainty_percent"]), read_model(str(calibrated / "model.toml"), None, None).model
    there = np.isfinite(percent)
    assert there.any()
    q = np.radians(np.column_stack([numbers(found[name]) for name in model.robot.coordinates])[there])
    known = parameter_uncertainty(description)
    assert known is not None
    np.testing.assert_allclose(percent[there], 100.0 * propagate(model, known, q, DOWN).relative_sd, rtol=1e-5)


# --- what goes to a cluster ----------------------------------------------------------------------------------------


def a_job(**changed: Any) -> MapJob:
    given = read_model("kr60-3", "rigid", None)
    asked = SliceRequest(pose="fixed", x_mm=(0.0, 1500.0, 300.0), z_mm=600.0)
    return replace(MapJob.of(asked, given), **changed)


def test_a_job_survives_the_way_to_a_worker_and_keys_tell_requests_apart() -> None:
    job, given = a_job(), read_model("kr60-3", "rigid", None)
    there = pickle.loads(pickle.dumps(job))  # noqa: S301 - as Dask does
    assert there.asked.key(given) == job.asked.key(given) == job.key
    for change in ({"seed": 1}, {"normal": (0.0, 1.0, 0.0)}, {"at_load": 5.0}, {"x_mm": (0.0, 1500.0, 150.0)}):
        assert replace(job.asked, **change).key(given) != job.key
    assert job.asked.key(read_model("kr60-3", "beam", None)) != job.key


def test_a_worker_builds_the_model_and_makes_a_block() -> None:
    block = evaluate(a_job(), 0)
    k, q = np.asarray(block["stiffness_N_per_mm"]), np.asarray(block["q"])
    there = np.isfinite(k)
    assert there.any()
    model = build_model(load_description("kr60-3"), links="rigid")
    np.testing.assert_allclose(k[there], directional_stiffness(model, q[there]) * 1e-3, rtol=1e-9)


@pytest.mark.slow
def test_a_cluster_writes_the_same_files(cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = oracles.load("distributed")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    options = ("--x", "1000:2200:300", "--z", "400:1600:300", "--no-pictures")
    assert cli("map", "slice", "xr701", *options, "--out", "here").code == 0
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as made:
        outcome = cli("map", "slice", "xr701", *options, "--out", "there", "--dask", made.scheduler_address)
    assert outcome.code == 0, outcome.err
    for name in ("map.csv", "map.vti"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()


def test_a_worker_of_another_version_refuses() -> None:
    answer = evaluate(a_job(version="0.0", key="other"), 0)
    assert set(answer) == {REFUSED}
    assert f"allowed: {__version__}" in answer[REFUSED]


def test_a_map_of_more_points_than_memory_holds_is_refused_before_the_work(cli: Command, tmp_path: Path) -> None:
    ranges = ("--x", "0:1500:5", "--y", "-700:700:5", "--z", "0:1500:5")
    outcome = cli("map", "box", "kr60-3", "--links", "rigid", *ranges, "--out", "out")
    assert outcome.code == 2
    assert "points of the map: got 25458881; allowed: up to 3000000" in " ".join(outcome.err.split())
    assert not (tmp_path / "out").exists()


def test_a_map_from_a_surrogate_has_the_files_and_figures_of_all_maps(cli: Command, tmp_path: Path) -> None:
    fitted = cli("fit", "kr60-3", "--links", "rigid", "--runs", "200", "--out", "fit")
    assert fitted.code == 0, fitted.err
    options = ("--surrogate", "fit/surrogate.json", "--points", "3", "--layers", "0,60")
    outcome = cli("map", "joints", "kr60-3", "--links", "rigid", *options, *BARE)
    assert outcome.code == 0, outcome.err
    assert set(tree(tmp_path / "out")) == {"stiffness_map.vtu", "map.csv", "map.json", "report.html", "run.json"}
    found = table(tmp_path / "out" / "map.csv")
    by_surrogate, by_model = numbers(found["stiffness_N_per_mm"]), numbers(found["model_stiffness_N_per_mm"])
    there = np.isfinite(by_model)
    np.testing.assert_allclose(by_surrogate[there], by_model[there], rtol=0.1)
    figures = outcome.json["quantities"]["stiffness_N_per_mm"]
    assert figures["median"] == pytest.approx(np.median(by_surrogate[there]), rel=1e-5)
