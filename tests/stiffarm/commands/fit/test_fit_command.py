"""`stiffarm fit` and `query` as users run them: all quantities, formats, flags."""

from __future__ import annotations

import ast
import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import oracles
import pytest
from cli_runs import Command, Outcome, environment, run_here, tree
from shortened import blank_pictures, few_runs

from fem import build_model, compliance, directional_stiffness
from machining.stiffness.indices import evaluate
from robots import load_description
from robots.library.models import to_toml
from robots.schema.description import LogPolynomialLaw
from surrogate import load_surrogate

pytestmark = pytest.mark.usefixtures("quick_fit", "blank")

QUICK = ("--basis", "polynomial", "--degree", "3", "--runs", "300")
TWO = ("--inputs", "q2_deg,q3_deg")
UP = np.array([0.0, 0.0, 1.0])


def at(**degrees: float) -> np.ndarray:
    """One pose of the kr60-3 (1, 6) rad."""
    names = load_description("kr60-3").joint
    return np.radians([[degrees.get(joint.coordinate, 0.0) for joint in names]])


@pytest.fixture(scope="module")
def portable(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    """Written in all formats."""
    folder = tmp_path_factory.mktemp("portable") / "out"
    with blank_pictures():
        outcome = run_here(
            "fit", "kr60-3", *TWO, *QUICK, "--format", "onnx,c,python,javascript", "--json", "--out", folder
        )
    assert outcome.code == 0, outcome.err
    return folder, outcome


def test_all_formats_are_written_and_named(portable: tuple[Path, Outcome]) -> None:
    folder, outcome = portable
    files = {"surrogate.json", "surrogate.onnx", "surrogate.h", "surrogate_snippet.py", "surrogate.js"}
    assert files <= set(outcome.json["files"]) <= set(tree(folder))
    assert {"surrogate_polynomial.json", "fit.json", "report.html", "run.json"} <= set(tree(folder))


def test_the_onnx_file_says_what_the_surrogate_does(portable: tuple[Path, Outcome]) -> None:
    runtime = oracles.load("onnxruntime")
    folder, _ = portable
    learned = load_surrogate(folder / "surrogate.json")
    Q = np.random.default_rng(0).uniform(learned.lower, learned.upper, (50, 2))
    session = runtime.InferenceSession(str(folder / "surrogate.onnx"), providers=["CPUExecutionProvider"])
    (given,) = session.get_inputs()
    found = session.run(None, {given.name: Q})[0]
    from surrogate import predict

    # The exchange format is held to 1e-9 (the brief); doubles throughout.
    np.testing.assert_allclose(np.ravel(found), predict(learned, Q), rtol=1e-9)


def test_the_python_file_says_so_too_without_any_package(portable: tuple[Path, Outcome]) -> None:
    folder, _ = portable
    query = run_here("query", folder / "surrogate.json", "--pose", "q2_deg=-40,q3_deg=50", "--json").json
    (row,) = query["answers"]
    code = "import surrogate_snippet as s; print(repr(s.evaluate_deg((-40.0, 50.0))))"
    done = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-S", "-c", code], cwd=folder, env=environment(), capture_output=True, text=True, check=True
    )
    value = float(np.ravel(ast.literal_eval(done.stdout))[0])
    assert 1e-3 / value == pytest.approx(row["stiffness_N_per_mm"], rel=1e-5)  # six significant digits


def test_a_report_that_makes_the_choice_plain(portable: tuple[Path, Outcome]) -> None:
    folder, outcome = portable
    content = outcome.json
    (figures,) = content["surrogates"]
    assert content["best"] == figures["basis"] == "polynomial"
    assert figures["degree_or_order"] == 3
    assert figures["terms"] == 10
    assert (figures["runs_fitted"], figures["quantity"]) == (300, "compliance")
    for name in ("rms_relative_error", "max_relative_error", "condition_number", "coverage_of_95_percent_bars"):
        assert figures[name] > 0.0
    assert 0.9 < figures["coverage_of_95_percent_bars"] <= 1.0
    assert json.loads((folder / "fit.json").read_text(encoding="utf-8")) == content
    # Fixed coordinates that would matter are named.
    assert content["fixed_coordinates_would_change_it_by"]["q1_deg"] == 0.0
    assert content["fixed_coordinates_would_change_it_by"]["q5_deg"] > 0.01
    assert "q5_deg is fixed at 0 deg, but would change the compliance by up to" in outcome.err
    assert "q1_deg is fixed" not in outcome.err


@pytest.mark.slow
def test_an_index_is_learned_and_answered_in_its_own_unit(cli: Command) -> None:
    options = ("--quantity", "k_fs", "--normal", "0,0,1", "--runs", "400", "--basis", "trigonometric")
    outcome = cli("fit", "kr60-3", *TWO, *options, "--json", "--out", "out")
    assert outcome.code == 0, outcome.err
    assert outcome.json["quantity"] == "k_fs"
    stated = outcome.json["surrogates"][0]["max_relative_error"]
    answer = cli("query", "out/surrogate.json", "--pose", "q2_deg=-40,q3_deg=50", "--json")
    (row,) = answer.json["answers"]
    C = compliance(build_model(load_description("kr60-3")), at(q2_deg=-40.0, q3_deg=50.0))[:, :3, :3]
    exact = 1e-3 * evaluate("k_fs", C, UP, None)[0]
    # What the surrogate states, and six significant digits.
    assert row["k_fs_N_per_mm"] == pytest.approx(exact, rel=2.0 * stated + 1e-5)
    low, high = row["k_fs_interval95_N_per_mm"]
    assert low < row["k_fs_N_per_mm"] < high
    assert "stiffness_N_per_mm" not in row
    refused = cli("map", "joints", "kr60-3", "--surrogate", "out/surrogate.json", "--points", "2", "--out", "map")
    assert refused.code == 2
    assert "stiffarm: " in refused.err


def test_what_cannot_be_fitted_among_others_is_said(cli: Command) -> None:
    outcome = cli("fit", "kr60-3", "--degree", "12", "--runs", "100", "--json", "--out", "out")
    assert outcome.code == 0
    assert outcome.json["best"] == "factored"
    assert set(outcome.json["not_fitted"]) == {"polynomial", "trigonometric"}
    assert "polynomial not fitted: fit: the basis has 1820 terms, but there are 100 runs" in outcome.err


# --- query ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A factored surrogate of the kr60-3, exact to round-off."""
    folder = tmp_path_factory.mktemp("exact") / "out"
    with few_runs(), blank_pictures():
        assert run_here("fit", "kr60-3", "--basis", "factored", "--out", folder).code == 0
    return folder / "surrogate.json"


POSE = "q2_deg=-40,q3_deg=50,q4_deg=20,q5_deg=60"
Q = {"q2_deg": -40.0, "q3_deg": 50.0, "q4_deg": 20.0, "q5_deg": 60.0}


def answered(*arguments: str | Path) -> dict[str, Any]:
    outcome = run_here("query", *arguments, "--json")
    assert outcome.code == 0, outcome.err
    (row,) = outcome.json["answers"]
    return dict(row)


def test_the_matrix_and_any_direction(exact: Path) -> None:
    row = answered(exact, "--pose", POSE, "--matrix", "--direction", "1,0,0")
    model = build_model(load_description("kr60-3"))
    C = compliance(model, at(**Q))[0]
    axes = ("x", "y", "z", "rx", "ry", "rz")
    found = {(a, b): row[f"c_{a}_{b}"] for i, a in enumerate(axes) for b in axes[i:]}
    size = np.sqrt(np.diag(C))
    for (a, b), value in found.items():
        i, j = axes.index(a), axes.index(b)
        assert value == pytest.approx(C[i, j], rel=1e-5, abs=1e-6 * size[i] * size[j])  # six significant digits
    along = directional_stiffness(model, at(**Q), np.array([1.0, 0.0, 0.0]))[0]
    assert row["stiffness_N_per_mm"] == pytest.approx(1e-3 * along, rel=1e-5)
    outcome = run_here("query", exact, "--pose", POSE, "--direction", "2,0,0", "--json")
    assert outcome.json["load_direction"] == [1.0, 0.0, 0.0] or np.allclose(outcome.json["load_direction"], [1, 0, 0])
    (turned,) = outcome.json["answers"]
    assert turned["relative_error95"] is turned["stiffness_interval95_N_per_mm"] is None
    assert "no error bar for this load direction" in turned["flags"]


@pytest.mark.parametrize("option", [("--matrix",), ("--direction", "1,0,0")])
def test_a_surrogate_of_one_number_knows_neither(portable: tuple[Path, Outcome], option: tuple[str, ...]) -> None:
    outcome = run_here("query", portable[0] / "surrogate.json", "--pose", "q2_deg=-40,q3_deg=50", *option)
    assert (outcome.code, outcome.out) == (2, "")
    assert "--basis factored" in outcome.err


def test_the_same_model_is_accepted(exact: Path) -> None:
    assert answered(exact, "--pose", POSE, "--model", "kr60-3")["inside_domain"]


def test_a_table_with_rows_outside_is_answered_row_by_row(exact: Path, cli: Command, tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text(
        "pose,q2_deg,q3_deg,q4_deg,q5_deg\nin,-40,50,20,60\nout,100,50,20,60\nstraight,-40,50,20,0\n", encoding="utf-8"
    )
    outcome = cli("query", exact, "poses.csv", "--json", "--out", "answers")
    assert outcome.code == 0, outcome.err
    assert "1 of 3 poses lie outside the fitted range and have no value" in outcome.err
    inside, outside, straight = outcome.json["answers"]
    assert inside["flags"] == ""
    assert inside["near_singular"] is False
    assert inside["beyond_small_displacements"] is False
    low, high = inside["stiffness_interval95_N_per_mm"]
    assert low <= inside["stiffness_N_per_mm"] <= high
    for name in ("stiffness_N_per_mm", "stiffness_interval95_N_per_mm", "relative_error95"):
        assert outside[name] is None
    assert (outside["inside_domain"], outside["reachable"]) == (False, True)
    assert outside["flags"].startswith("not answered: q2_deg = 100 deg (allowed -135 to 35 deg)")
    assert straight["near_singular"] is True
    assert straight["flags"].startswith("near a singularity (")
    with Path("answers/query.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["pose"] for row in rows] == ["in", "out", "straight"]
    assert rows[1]["stiffness_N_per_mm"] == ""
    assert float(rows[0]["stiffness_N_per_mm"]) == inside["stiffness_N_per_mm"]


def test_the_matrix_of_a_row_without_a_value_is_empty(exact: Path, cli: Command, tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text(
        "pose,q2_deg,q3_deg,q4_deg,q5_deg\nin,-40,50,20,60\nout,1e9,50,20,60\n", encoding="utf-8"
    )
    inside, outside = cli("query", exact, "poses.csv", "--matrix", "--json").json["answers"]
    assert inside["c_x_x"] > 0.0
    assert outside["c_x_x"] is None


def test_the_matrix_beside_a_row_at_which_it_would_overflow(cli: Command, tmp_path: Path) -> None:
    """A law of the sixth degree in the exponent is not asked where it has no meaning."""
    description = load_description("kr60-3")
    law = LogPolynomialLaw(
        kind="log-polynomial",
        inputs=("q2_deg",),
        centre_deg=(0.0,),
        half_range_deg=(90.0,),
        exponents=((0,), (6,)),
        coefficients=(13.0, -0.1),
        source="assumed",
    )
    joints = tuple(j.model_copy(update={"stiffness": law}) if j.name == "j2" else j for j in description.joint)
    (tmp_path / "model.toml").write_text(to_toml(description.model_copy(update={"joint": joints})), encoding="utf-8")
    assert cli("fit", "model.toml", *TWO, "--basis", "factored", "--out", "out").code == 0
    (tmp_path / "poses.csv").write_text("pose,q2_deg,q3_deg\nin,-40,50\nout,1e9,50\n", encoding="utf-8")
    inside, outside = cli("query", "out/surrogate.json", "poses.csv", "--matrix", "--json").json["answers"]
    assert inside["c_x_x"] > 0.0
    assert outside["c_x_x"] is None


def test_the_calibrations_part_of_the_error_bar(fitted: Path) -> None:
    """The model of the fixture was calibrated: its springs are known so well and no better."""
    row = answered(fitted / "surrogate.json", "--pose", "q2_deg=5,q3real_deg=80,q4_deg=0,q5_deg=30")
    errors = json.loads((fitted / "fit.json").read_text(encoding="utf-8"))
    known = errors["calibration_uncertainty"]
    assert known["parameters"]
    own, part = row["relative_error95_surrogate"], row["relative_error95_calibration"]
    assert part > 0.0
    # Six significant digits.
    assert row["relative_error95"] == pytest.approx(np.hypot(own, part), rel=1e-5)
    # It is the compliance that is off by that share.
    low, high = row["stiffness_interval95_N_per_mm"]
    assert high == pytest.approx(row["stiffness_N_per_mm"] / (1.0 - row["relative_error95"]), rel=1e-4)
    assert low == pytest.approx(row["stiffness_N_per_mm"] / (1.0 + row["relative_error95"]), rel=1e-5)
