"""The whole chain on arms that nobody prepared: a URDF of four axes, and the bundled FANUC without a scheme."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import pyvista as pv
from cli_runs import Command
from small_robot import STIFFNESS, write_readings, write_urdf

import stiffarm as sa
from doe import bundled_campaign, bundled_data, read_measurements
from doe.tables.notes import bundled_notes
from robots import load_description
from stiffarm.commands.run import missing
from stiffarm.session.inputs import read_model
from stiffarm.session.outputs import OutputFolder

SECTIONS = (
    "What the model is missing",
    "The measurements",
    "Which calibration to trust",
    "The stiffness map",
    "Sensitivity: which spring matters",
    "The surrogate and its error",
)


def run_of(cli: Command, folder: Path, *arguments: str | Path) -> tuple[dict[str, Any], str]:
    outcome = cli("run", *arguments, "--points", "5", "--no-rehearse", "--out", folder)
    assert outcome.code == 0, outcome.err
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return results, (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit", "quick_diagnoses")
def test_a_urdf_goes_through_the_whole_chain(cli: Command, tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")
    readings = write_readings(urdf, tmp_path / "readings.csv", poses=10)
    found = sa.run(urdf, readings, points=5, rehearse=False, out=tmp_path / "o")
    results = json.loads((tmp_path / "o" / "results.json").read_text(encoding="utf-8"))
    assert results == json.loads(json.dumps(found.as_json))
    assert found.to_frame()["recommended"].sum() == 1
    page = (tmp_path / "o" / "report.html").read_text(encoding="utf-8")
    # Made without an effect: none is found, and the springs come back within a percent of 0.002 mm of noise.
    (look,) = results["diagnoses"]
    assert look["verdict"] == "none"
    springs = results["variants"]["constant, serial"]["springs"]
    for (name, k), label in zip(springs.items(), STIFFNESS, strict=True):
        assert k["k_Nm_per_rad"] == pytest.approx(STIFFNESS[label], rel=0.01), name
    places = [page.index(f"{title}</h2>") for title in SECTIONS]
    assert places == sorted(places)
    # What only the published readings have, and a model without links, is not told.
    assert "paper" not in page
    assert results["rigid_joints"] is None
    assert results["link_models"] is None
    gap = pv.read(tmp_path / "o" / "diagnosis" / "gap.vtp")
    assert {"measured_mm", "gap_before_mm", "gap_after_mm", "force_N"} <= set(gap.point_data)
    assert load_description(tmp_path / "o" / "model.toml").name == "small"
    assert cli("query", tmp_path / "o" / "surrogate.json", readings).code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit", "quick_diagnoses")
def test_what_is_missing_is_named_added_and_mapped(cli: Command, tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")

    def shoulder(q: float) -> float:
        return STIFFNESS["shoulder"] / (1.0 + 0.4 * math.cos(q - 0.5))

    readings = write_readings(urdf, tmp_path / "readings.csv", poses=24, shoulder=shoulder)
    other = write_readings(urdf, tmp_path / "other.csv", poses=6, seed=1, shoulder=shoulder)
    results, page = run_of(cli, tmp_path / "o", urdf, readings, "--holdout", other)
    (look,) = results["diagnoses"]
    names = [joint.name for joint in load_description(urdf).joint]
    assert look["effects"] == [f"angle-dependent-stiffness:{names[1]}"]
    assert look["gap"]["after"]["holdout_rms_mm"] < 0.5 * look["gap"]["before"]["holdout_rms_mm"]
    assert look["cost_of_leaving_out"]["error_mm"]["max"] > 0.0
    cost = pv.read(tmp_path / "o" / "diagnosis" / "missing_effect.vtu")
    assert cost.active_scalars_name == "error_without_effect_mm"
    assert "What leaving it out would cost" in page
    assert results["recommended"] == "diagnosed"
    # Beside the calibrations it is judged by the same readings held out.
    assert "diagnosed predicts them best" in page
    (row,) = re.findall(r"<td[^>]*>diagnosed</td>.*", page)
    after = look["gap"]["after"]["holdout_rms_mm"], look["gap"]["nested"]["after_rms_mm"]
    assert all(f">{error:.3f}</td>" in row for error in after)
    assert load_description(tmp_path / "o" / "model.toml").effect


@pytest.mark.parametrize("path", ["parallelogram", "serial"])
def test_which_load_paths_are_diagnosed(path: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = read_model("xr701", "rigid", path)
    table, scheme = read_measurements(bundled_data("xr701"), given.robot), bundled_campaign("xr701")
    assert scheme is not None
    asked: list[tuple[str, tuple[float, ...]]] = []
    monkeypatch.setattr(missing.step, "diagnose", lambda a, _, r, **__: asked.append((a.model.load_path, r.loads)))
    monkeypatch.setattr(missing, "written", lambda *_: (None, {}))
    monkeypatch.setattr(missing, "without_doubted", lambda *_: None)
    monkeypatch.setattr(missing, "headlines", lambda _: ())
    with OutputFolder(tmp_path / "o", ["stiffarm"], {}, None) as folder:
        found = missing.looks(given, table, scheme, None, 0, folder, lambda _: None)
    first = [("serial", (650.0,))] if path == "parallelogram" else []
    assert asked == [*first, (path, ())]
    assert [look.title for look in found] == ["The serial chain at 650 N"] * len(first) + ["All readings"]


@pytest.mark.slow
def test_the_serial_chain_is_looked_at_first_where_there_is_a_parallelogram(full_run: Any) -> None:
    first, last = full_run.results["diagnoses"]
    assert (first["of"], first["effects"]) == ("The serial chain at 650 N", ["load-path"])
    assert first["gap"]["after"]["left_one_pose_out_rms_mm"] < first["gap"]["before"]["left_one_pose_out_rms_mm"]
    assert last["of"] == "All readings"
    assert (full_run.folder / "diagnosis_serial" / "gap.vtp").is_file()


@pytest.mark.slow
def test_the_page_of_the_first_run_says_what_a_run_says(full_run: Any) -> None:
    """All but its errors at poses not seen, for this run's diagnosis is a shortened one: those are held below."""
    page = Path(__file__).parents[4] / "docs" / "start"

    def rows(name: str) -> list[dict[str, str]]:
        lines = (page / name).read_text(encoding="utf-8").splitlines()
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))

    (look,) = rows("first_run.csv")
    assert full_run.results["diagnoses"][0]["effects"] == [look["effect"]]
    told = {(r["rms_mm"], r["left_out_rms_mm"]) for r in rows("results.csv")}
    found = full_run.results["variants"].values()
    assert told == {(f"{v['rms_mm']:.3f}", f"{v['left_one_pose_out_rms_mm']:.3f}") for v in found}


@pytest.mark.slow
def test_the_page_s_errors_at_poses_not_seen_are_those_of_the_whole_diagnosis(cli: Command) -> None:
    page = Path(__file__).parents[4] / "docs" / "start" / "first_run.csv"
    (look,) = csv.DictReader(x for x in page.read_text(encoding="utf-8").splitlines() if not x.startswith("#"))
    outcome = cli("diagnose", "xr701", "--load-path", "serial", "--loads", "650", "--next", "0", "--json")
    assert outcome.code == 0, outcome.err
    gap = json.loads(outcome.out)["gap"]
    for key, value in (("before", look["before_mm"]), ("after", look["after_mm"])):
        assert f"{gap[key]['holdout_rms_mm']:.3f}" == value


@pytest.mark.slow
def test_what_the_page_says_of_swapped_pairs_is_what_a_diagnosis_says(cli: Command, tmp_path: Path) -> None:
    """Poses 3 and 4 with the readings of 39 and 40 at 375 and 650 N, and the other way round."""
    table = pd.read_csv(bundled_data("xr701"), dtype={"pose": str})
    other = table["pose"].map({"3": "39", "4": "40", "39": "3", "40": "4"})
    value = {(p, f): v for p, f, v in zip(table["pose"], table["fz_N"], table["dz_mm"], strict=True)}
    for k in np.flatnonzero(other.notna() & (table["fz_N"] < -200)):
        table.loc[k, "dz_mm"] = value[other[k], table["fz_N"][k]]
    table.to_csv(tmp_path / "swapped.csv", index=False)
    options = ("--load-path", "serial", "--loads", "650", "--folds", "0", "--next", "0", "--json")
    outcome = cli("diagnose", "xr701", "swapped.csv", *options)
    assert outcome.code == 0, outcome.err
    found = json.loads(outcome.out)
    assert found["verdict"] == "none"
    (told,) = re.findall(r"with (\d+) %", bundled_notes("xr701").doubted)
    assert round(100 * found["steps"][0]["candidates"][0]["probability"]) == int(told)


def test_a_scheme_without_stages_is_refused(cli: Command, tmp_path: Path) -> None:
    text = 'schema = "stiffarm-calibration/1"\nrobot = "kr60-3"\ntitle = "t"\n[[parameter]]\nname = "j2.stiffness"\n'
    (tmp_path / "plain.toml").write_text(text, encoding="utf-8")
    (tmp_path / "d.csv").write_text("q2_deg,q3_deg,fz_N,dz_mm\n-60,60,-500,-0.6\n-80,60,-500,-0.5\n", encoding="utf-8")
    outcome = cli("run", "kr60-3", "d.csv", "--scheme-file", "plain.toml", "--out", "o")
    assert outcome.code == 2
    assert "with stages" in outcome.err
    assert not (tmp_path / "o").exists()
