"""`identify`: files that agree with one another, synthetic data that says so, and what is refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import run_here
from shortened import blank_pictures

from doe import write_measurements
from doe.joint_twists import read_twists, write_twists
from doe.joint_twists.substitute import reachable_poses
from doe.tables.measurements import Measurements
from fem import build_model, deflection
from robots import load_description, load_robot


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a synthetic campaign."""
    folder = tmp_path_factory.mktemp("identify") / "out"
    with blank_pictures():
        outcome = run_here("identify", "tx200", "--synthetic", "--seed", "3", "--out", folder, "--law", "fourier-1")
    assert outcome.code == 0, outcome.err
    return folder


@pytest.fixture(scope="module")
def content(made_up: Path) -> Any:
    return json.loads((made_up / "identify.json").read_text())


def test_everything_is_written(made_up: Path) -> None:
    tables = ("identify", "stiffness_map", "hysteresis", "cross_terms", "flange_errors", "noise")
    pictures = ("compliances", "gears_alone", "hysteresis", "stiffness_map", "stiffness_over_angle")
    assert {p.name for p in made_up.iterdir()} == {
        "report.html",
        "model.toml",
        "identify.json",
        "run.json",
        "synthetic_joint_twists.csv",
        "synthetic_truth.json",
        *(f"{name}.csv" for name in tables),
        *(f"{name}.png" for name in pictures),
    }


def test_synthetic_data_says_so_everywhere(made_up: Path, content: Any) -> None:
    run = json.loads((made_up / "run.json").read_text())
    assert run["outputs_sha256"]["synthetic_joint_twists.csv"] == content["data_sha256"]
    assert run["seed"] == 3
    assert content["synthetic"] is True
    assert json.loads((made_up / "synthetic_truth.json").read_text())["synthetic"] is True
    assert "synthetic" in (made_up / "model.toml").read_text()
    report = (made_up / "report.html").read_text()
    assert "synthetic data" in report
    assert report.count("not measured") >= 1
    rows = list(csv.DictReader((made_up / "identify.csv").open()))
    assert {row["data"] for row in rows} == {"synthetic"}
    rows = list(csv.DictReader((made_up / "synthetic_joint_twists.csv").open()))
    assert {row["origin"] for row in rows} == {"synthetic"}


def test_intervals_hold_most_of_the_truth(made_up: Path, content: Any) -> None:
    """The truth is read here for the first time: what identified never saw it."""
    springs = json.loads((made_up / "synthetic_truth.json").read_text())["springs"]
    laws = {(f"j{one['joint']}", one["row"]): one["ln_k"] for one in springs}
    assert len(laws) == 36
    held = []
    for one in content["stiffnesses"]:
        c, q, (low, high) = laws[one["joint"], one["row"]], np.radians(one["angle_deg"]), one["stiffness_interval95"]
        k = np.exp(c[0] + c[1] * np.cos(q) + c[2] * np.sin(q))
        held.append(low <= k and (high is None or k <= high))
    # One campaign: 36 laws with three numbers each, a standard error of some 2 %; four of them.
    assert np.mean(held) > 0.87


def test_the_model_file_is_an_ordinary_one(made_up: Path, tmp_path: Path) -> None:
    model = load_description(made_up / "model.toml")
    assert model.calibration is not None
    assert model.calibration.links == "rigid"
    assert all(joint.stiffness is not None for joint in model.joint)
    outcome = run_here("robots", made_up / "model.toml")
    assert outcome.code == 0, outcome.err


@pytest.mark.slow
def test_the_same_table_gives_the_same_model(made_up: Path, content: Any, tmp_path: Path) -> None:
    table = made_up / "synthetic_joint_twists.csv"
    outcome = run_here("identify", "tx200", table, "--law", "fourier-1", "--json", "--seed", "3")
    assert outcome.code == 0, outcome.err
    assert outcome.json["stiffnesses"] == content["stiffnesses"]
    assert outcome.json["synthetic"] is True


@pytest.mark.slow
def test_two_tables_are_one_campaign(made_up: Path, content: Any, tmp_path: Path) -> None:
    robot = load_robot("tx200")
    data = read_twists(made_up / "synthetic_joint_twists.csv", robot)
    first = data.joint < 3
    for mask, name in ((first, "a.csv"), (~first, "b.csv")):
        write_twists(data.select(mask), tmp_path / name, robot)
    outcome = run_here("identify", "tx200", tmp_path / "a.csv", tmp_path / "b.csv", "--law", "fourier-1", "--json")
    assert outcome.code == 0, outcome.err
    for one, both in zip(content["laws"], outcome.json["laws"], strict=True):
        np.testing.assert_allclose(both["ln_k_coefficients"], one["ln_k_coefficients"], atol=1e-9)


def held_out(path: Path, model: Path) -> None:
    """Flange deflections of the identified model itself, in poses that it has not seen."""
    arm = build_model(load_description(model), "rigid")
    q = reachable_poses(arm, 3, np.random.default_rng(5))
    wrench = np.zeros((3, 6))
    wrench[:, :3] = [[0.0, 0.0, -600.0], [425.0, 425.0, 0.0], [0.0, 600.0, 0.0]]
    nan = np.full(3, np.nan)
    m = Measurements(
        "held out",
        "0" * 64,
        q,
        wrench,
        deflection(arm, q, wrench),
        np.full((3, 3), np.nan),
        nan,
        ("A", "B", "C"),
        (None,) * 3,
        (None,) * 3,
        nan,
        (2, 3, 4),
        {},
        (),
    )
    write_measurements(m, path, arm.robot)


@pytest.mark.slow
def test_flange_deflections_judge_the_prediction(made_up: Path, tmp_path: Path) -> None:
    held_out(tmp_path / "flange.csv", made_up / "model.toml")
    table = made_up / "synthetic_joint_twists.csv"
    outcome = run_here("identify", "tx200", table, "--law", "constant", "--holdout", tmp_path / "flange.csv", "--json")
    assert outcome.code == 0, outcome.err
    found = outcome.json["held_out"]
    assert [row["pose"] for row in found] == ["A", "B", "C"]
    # Constants here against laws about the axes there: 12 % swing.
    assert max(abs(row["error_percent"]) for row in found) < 15.0
    assert found[1]["force_N"] == pytest.approx(425.0 * np.sqrt(2.0))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("tx200",), "TABLE: got 'none'"),
        (("tx200", "nothing.csv"), "TABLE: got 'nothing.csv'; allowed: an existing .csv or .xlsx"),
        (("tx200", "a.csv", "--synthetic"), "--synthetic and TABLE"),
        (("tx200", "a.csv", "--links", "beam"), "--links: got 'beam'; allowed: rigid"),
        (("tx200", "a.csv", "--law", "cubic"), "--law: got 'cubic'; allowed: constant, fourier-1, fourier-2, table"),
        (("tx200", "a.csv", "--branches", "both"), "--branches: got 'both'; allowed: mean, loading"),
        (("tx200", "a.csv", "--flange", "up"), "--flange: got 'up'; allowed: base, forward, down"),
        (("tx200", "a.csv", "--window", "1,2,3"), "--window: got (1.0, 2.0, 3.0); allowed: four numbers in mm"),
        (("tx200", "a.csv", "--window", "1,2,0,3"), "width and height above 0"),
    ],
)
def test_bad_input_is_refused_in_one_message(arguments: tuple[str, ...], words: str) -> None:
    outcome = run_here("identify", *arguments)
    assert outcome.code == 2
    assert words in outcome.err.replace("\n", " ")
    assert "Traceback" not in outcome.err


def test_another_robots_columns_and_one_angle(made_up: Path, tmp_path: Path) -> None:
    table = made_up / "synthetic_joint_twists.csv"
    outcome = run_here("identify", "xr701", table)
    assert outcome.code == 2
    assert "column q3_deg is not a joint coordinate of xr701" in outcome.err
    robot = load_robot("tx200")
    data = read_twists(table, robot)
    small = data.select((data.joint == 0) & (np.abs(data.q[:, 0] - data.q[0, 0]) < 1e-9))
    write_twists(small, tmp_path / "one.csv", robot)
    outcome = run_here("identify", "tx200", tmp_path / "one.csv", "--law", "fourier-1", "--out", tmp_path / "out")
    assert outcome.code == 2
    assert "law fourier-1 of joint j1: angles measured: got 1; allowed: 3 or more" in outcome.err.replace("\n", " ")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def part(made_up: Path, tmp_path: Path) -> Path:
    """Readings of joint 2 alone."""
    robot = load_robot("tx200")
    data = read_twists(made_up / "synthetic_joint_twists.csv", robot)
    write_twists(data.select(data.joint == 1), tmp_path / "j2.csv", robot)
    return tmp_path / "j2.csv"


def test_a_part_of_a_campaign_says_what_it_does_not_know(made_up: Path, part: Path, tmp_path: Path) -> None:
    outcome = run_here("identify", "tx200", part, "--law", "constant", "--json")
    assert outcome.code == 0, outcome.err
    found = outcome.json
    assert sum(d["status"] == "not identified" for d in found["laws"]) == 30
    assert "no readings of j1, j3, j4, j5, j6: their stiffnesses are not identified" in found["remarks"]
    # Gears alone, a map and a prediction would depend on stiffnesses that nobody has.
    assert found["at_flange"] is None
    assert found["map"] is None
    assert "it depends on stiffnesses that are not identified: j1.tx" in found["why_null"]["at_flange"]
    held_out(tmp_path / "flange.csv", made_up / "model.toml")
    outcome = run_here("identify", "tx200", part, "--holdout", tmp_path / "flange.csv")
    assert outcome.code == 2
    assert "it depends on stiffnesses that are not identified" in outcome.err


@pytest.mark.slow
def test_the_report_of_a_part_of_a_campaign(part: Path, tmp_path: Path) -> None:
    outcome = run_here("identify", "tx200", part, "--out", tmp_path / "out")
    assert outcome.code == 0, outcome.err
    report = (tmp_path / "out" / "report.html").read_text()
    assert "not identified" in report
    assert "a diagonal stiffness matrix per joint is enough at j2" in report
    assert not (tmp_path / "out" / "stiffness_map.csv").exists()
