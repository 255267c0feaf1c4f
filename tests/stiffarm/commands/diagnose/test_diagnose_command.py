"""`diagnose`: verdict, numbers, files that agree with one another, and what is refused."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from blind.sets import make, more
from blind.spec import SetSpec
from cli_runs import Command, run_here
from shortened import blank_pictures, quick_diagnosis

from doe import read_measurements
from doe.certainty.propagation import parameter_uncertainty, propagate
from doe.diagnosis.candidates import impossible
from doe.diagnosis.findings.laws import compliance_over, turn_on_bench
from doe.diagnosis.setting import setting_of
from doe.diagnosis.where import labels_of, load_labels, shares, without_history
from fem.effects import build_arm, build_plain, catalogue
from robots import load_description
from robots.robot import robot_from
from robots.schema.quantities import RotationalStiffness
from robots.schema.units import factor

SEED = 8
BACKLASH = SetSpec(effects=("backlash:j2",), poses=9, design="paper", repeats=1, name="backlash")
VERDICTS = ("named", "ambiguous", "unknown", "none")


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Readings with backlash hidden in joint 2, the model without it, and readings of the same arm elsewhere."""
    folder = tmp_path_factory.mktemp("sets")
    make(BACKLASH, SEED).write(folder, "")
    rows = ["pose,step,phase,q1_deg,q2_deg,q3real_deg,q4_deg,q5_deg,q6_deg,fz_N,dz_mm"]
    rows += [
        f"H{k},{load},loading,0,{q2},{q3},{q4},{q5},0,-{load},"
        for k, (q2, q3, q4, q5) in enumerate([(-20, 60, 90, 40), (20, 90, -60, -40), (35, 100, 30, 20)])
        for load in (150, 375, 650)
    ]
    (folder / "holdout.csv").write_text(more(BACKLASH, SEED, "\n".join(rows) + "\n"), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def found(sets: Path) -> Path:
    """The folder of a diagnosis."""
    out = sets / "out"
    given = sets / "backlash/model.toml", sets / "backlash/readings.csv", "--links", "rigid"
    with quick_diagnosis(), blank_pictures():
        outcome = run_here("diagnose", *given, "--holdout", sets / "holdout.csv", "--folds", "0", "--out", out)
    assert outcome.code == 0, outcome.err
    return out


def _results(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


# --- exact: shares ------------------------------------------------------------------------------------------


def test_shares_are_parts_of_what_is_beyond_the_expected() -> None:
    z = np.array([3.0, 1.0, 1.0, 0.5, 2.0, 2.0])
    first, second, third = shares(z, 0.1 * z, ["a", "a", "b", "b", "c", "c"])
    # Excesses: 10 - 2 = 8; 1.25 - 2 < 0 counts as none; 8 - 2 = 6.
    assert [first.share, second.share, third.share] == pytest.approx([8 / 14, 0.0, 6 / 14])
    assert (first.readings, first.mean_square) == (2, 5.0)
    assert first.mean == pytest.approx(0.2)


def test_without_any_excess_there_are_no_shares() -> None:
    assert all(np.isnan(g.share) for g in shares(np.array([0.5, 1.0]), np.zeros(2), ["a", "b"]))


def test_loads_that_hardly_differ_are_one_load() -> None:
    wrench = np.zeros((4, 6))
    wrench[:, 2] = [-650.0, -651.0, -150.0, 0.0]
    wrench[3, 3] = 20.0
    assert load_labels(wrench) == ["650 N", "650 N", "150 N", "20 N m"]


# --- exact: laws on a bench -----------------------------------------------------------------------------------


def test_friction_draws_its_loop() -> None:
    model = build_plain(load_description("xr701"), "rigid")
    c, share, slip = 1e-6, 0.8, 100.0
    placed = catalogue(model)["friction:j2"].placed({"share": share, "friction": slip})
    up = np.linspace(0.0, 600.0, 61)
    turn = turn_on_bench(placed, placed.values, np.concatenate([up, up[::-1]]), c, 0.0, 1)
    loading, unloading = turn[:61], turn[61:][::-1]
    # Beyond slipping the way up lags by share x slip, the way down leads by as much; round-off only.
    np.testing.assert_allclose(loading[up >= slip], c * (up - share * slip)[up >= slip], rtol=1e-12)
    freed = up <= 600.0 - 2.0 * slip
    np.testing.assert_allclose(unloading[freed], c * (up + share * slip)[freed], rtol=1e-12)


def test_a_compliance_over_the_angle_is_its_law() -> None:
    model = build_plain(load_description("xr701"), "rigid")
    q = np.zeros((5, 6))
    q[:, 1] = np.linspace(-0.5, 0.5, 5)
    numbers = {"cos1": 0.2, "sin1": -0.1, "cos2": 0.05, "sin2": 0.0}
    placed = catalogue(model)["angle-dependent-stiffness:j2"].placed(numbers)
    expected = 1e-6 * (1.0 + 0.2 * np.cos(q[:, 1]) - 0.1 * np.sin(q[:, 1]) + 0.05 * np.cos(2.0 * q[:, 1]))
    np.testing.assert_allclose(compliance_over(model, placed, placed.values, q, 1e-6, 1), expected, rtol=1e-12)


# --- a hidden backlash ----------------------------------------------------------------------------------------


def test_the_hidden_effect_is_named_with_its_numbers(found: Path) -> None:
    r = _results(found)
    assert (r["verdict"], [e["code"] for e in r["effects"]], r["provisional"]) == ("named", ["backlash:j2"], [])
    gap = r["effects"][0]["parameters"]["gap"]
    truth = json.loads((found.parent / "backlash/key.json").read_text(encoding="utf-8"))["effects"][0]["parameters"]
    assert gap["unit"] == "mrad"
    # The truth counts the gap from its middle. Its law is a kink, not a tanh, and noise is 3 %: three standard
    # deviations, and a tenth for the other law.
    whole = 2e3 * truth["gap_rad"]
    assert gap["value"] == pytest.approx(whole, abs=3.0 * gap["sd"] + 0.1 * whole)
    assert gap["interval95"][0] < gap["value"] < gap["interval95"][1]


def test_candidates_are_ranked_with_nothing_and_unknown_among_them(found: Path) -> None:
    r = _results(found)
    assert r["candidates"][0]["probability"] == r["stated_probability"]
    probabilities = [c["probability_before_checks"] for c in r["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert sum(probabilities) == pytest.approx(1.0, abs=1e-4)
    kinds = {c["code"]: c["kind"] for c in r["candidates"]}
    assert (kinds["none"], kinds["unknown"], kinds["backlash:j2"]) == ("none", "unknown", "effect")
    assert "backlash:j2" in r["set95"]
    assert set(kinds) & set(r["not_testable"]) <= set(kinds) - {"backlash:j2"}


def test_the_gap_shrinks_on_readings_it_has_not_seen(found: Path) -> None:
    r = _results(found)["gap"]
    assert r["held_out_by"] == "holdout.csv"
    before, after = r["before"], r["after"]
    assert after["holdout_rms_mm"] < 0.5 * before["holdout_rms_mm"]
    assert after["left_one_pose_out_rms_mm"] < 0.5 * before["left_one_pose_out_rms_mm"]
    # No springs can do better in the fit than the least squares of all.
    assert before["least_rms_of_any_springs_mm"] <= before["fit_rms_mm"] * (1.0 + 1e-6)


def test_the_gap_has_arrows_that_viewers_draw(found: Path) -> None:
    gap = pyvista.read(found / "gap.vtp").point_data
    assert all(np.isfinite(gap[name]).all() for name in gap if gap[name].dtype.kind == "f")
    # Only Z was read.
    np.testing.assert_array_equal(gap["was_read"], np.tile([0.0, 0.0, 1.0], (len(gap["was_read"]), 1)))
    assert not gap["measured_mm"][:, :2].any()
    assert gap["measured_mm"][:, 2].all()
    assert set(np.unique(gap["outlier"])) <= {0.0, 1.0}


def test_the_written_model_predicts_as_the_diagnosis_says(cli: Command, sets: Path, found: Path) -> None:
    gap = _results(found)["gap"]["after"]
    for table, key in (("backlash/readings.csv", "fit_rms_mm"), ("holdout.csv", "holdout_rms_mm")):
        simulated = cli("simulate", found / "model.toml", sets / table, "--json").json
        # Numbers of the file are written with nine digits or more.
        assert simulated["rms_mm"] == pytest.approx(gap[key], rel=1e-4)


def test_the_new_model_says_how_sure_its_numbers_are(found: Path) -> None:
    given, r = load_description(str(found / "model.toml")), _results(found)
    u = parameter_uncertainty(given)
    assert u is not None
    assert u.undetermined == ()
    assert u.names[-2:] == ("backlash:j2.gap", "backlash:j2.crossing")
    gap = given.effect[0].parameters["gap"]
    assert u.estimate[-2] == pytest.approx(gap.value * factor("angle", gap.unit), rel=1e-9)
    for name, c, sd in zip(u.names[:-2], u.estimate, u.sd, strict=False):
        # The lower end of the interval in the file's own words, to three digits.
        stiffness = next(j.stiffness for j in given.joint if name.startswith(f"{j.name}."))
        if isinstance(stiffness, RotationalStiffness):
            low = float(str(stiffness.note).split("interval ")[1].split(" to ")[0])
            assert 1.0 / (c + 1.96 * sd) == pytest.approx(low, rel=6e-3)
    # Effects' deviations are written beside their numbers, to two digits; the crossing's variable is a logarithm.
    numbers = given.effect[0].parameters
    assert u.variable[-2:] == ("value", "ln value")
    for name, sd in (("gap", u.sd[-2] / factor("angle", gap.unit)), ("crossing", u.sd[-1] * numbers["crossing"].value)):
        said = float(str(numbers[name].note).split("standard deviation ")[1].split()[0])
        assert sd == pytest.approx(said, rel=0.05)
    answer = propagate(build_arm(given, "rigid"), u, np.radians([[0.0, 10, 80, 0, 0, 0]]))
    assert answer.relative_sd[0] > 0.0
    # A gap adds no compliance.
    assert not answer.gradient[0, -2:].any()
    assert r["data_sha256"] in given.sources["calibrated"]


def test_the_new_model_says_where_it_came_from(found: Path, sets: Path) -> None:
    description, r = load_description(str(found / "model.toml")), _results(found)
    assert description.calibration is not None
    assert (description.calibration.scheme, description.calibration.data_sha256) == ("diagnosis", r["data_sha256"])
    assert [t.code for t in description.effect] == ["backlash:j2"]
    assert r["data_sha256"] in description.sources[description.effect[0].parameters["gap"].source]
    # The input stays as it was.
    assert not load_description(str(sets / "backlash/model.toml")).effect


def test_where_adds_up(found: Path) -> None:
    where = _results(found)["where"]
    assert set(where) == {"pose", "load", "direction", "phase"}
    for groups in where.values():
        assert sum(g["share"] for g in groups) == pytest.approx(1.0, abs=1e-3)
        assert sum(g["readings"] for g in groups) == 54
    # A gap closes at once: it is the same turn under small loads, where the noise is small.
    share = {g["load"]: g["share"] for g in where["load"]}
    assert share["150 N"] > share["650 N"]


def test_the_folder_is_complete_and_the_report_stands_by_itself(found: Path) -> None:
    page = (found / "report.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href)="(?!data:image/png;base64,|#|[\w-][\w./-]*")', page) == []
    pictures = {p.stem for p in (found / "figures").iterdir()}
    assert {"ladder", "poses", "ranking", "law_1", "gap", "residuals"} <= pictures
    run = json.loads((found / "run.json").read_text(encoding="utf-8"))
    assert {"model", "data", "holdout"} <= set(run["inputs_sha256"])
    assert "the gear of joint j2 has backlash" in page


# --- what readings cannot tell ------------------------------------------------------------------------------


def _plain(sets: Path) -> Path:
    """Loading only, without phase and step."""
    with (sets / "backlash/readings.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["phase"] == "loading"]
    for row in rows:
        del row["phase"], row["step"]
    with (sets / "plain.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return sets / "plain.csv"


def test_without_a_history_friction_and_drift_are_impossible_to_judge(sets: Path) -> None:
    description = load_description(str(sets / "backlash/model.toml"))
    data = read_measurements(_plain(sets), robot_from(description))
    s = setting_of(description, build_plain(description, "rigid"), data)
    assert "loading" in (impossible(s, s.known["friction:j2"]) or "")
    assert "order" in (impossible(s, s.known["drift"]) or "")
    assert impossible(s, s.known["hardening:j2"]) is None
    assert set(labels_of(s)["phase"]) == {"not told"}


def test_friction_is_not_judged_where_the_loads_chosen_cut_its_cycles(sets: Path) -> None:
    description = load_description(str(sets / "backlash/model.toml"))
    data = read_measurements(sets / "backlash/readings.csv", robot_from(description))
    s = setting_of(description, build_plain(description, "rigid"), data)
    assert impossible(s, s.known["friction:j2"]) is None
    assert impossible(without_history(s), s.known["friction:j2"]) is not None


@pytest.mark.slow
@pytest.mark.usefixtures("quick_diagnoses")
def test_without_a_history_friction_is_not_testable(cli: Command, sets: Path) -> None:
    r = cli(
        "diagnose",
        sets / "backlash/model.toml",
        _plain(sets),
        "--links",
        "rigid",
        "--next",
        "0",
        "--folds",
        "0",
        "--json",
    ).json
    assert r["verdict"] in VERDICTS
    assert all("loading" in r["not_testable"][f"friction:j{k}"] for k in (2, 3, 4, 5))
    assert "order" in r["not_testable"]["drift"]
    assert [g["phase"] for g in r["where"]["phase"]] == ["not told"]


# --- refused ------------------------------------------------------------------------------------------------

WRONG_UNIT = """
from fem.effects import Effect, EffectParameter
def effects(model):
    p = EffectParameter('slip', 'length', 'deg', 1e-6, 1e-4, 'assumed')
    return [Effect('slip', 'the flange slips', 'gauge', (p,), lambda d, s, v: d, 'slip')]
"""


def _one_pose(text: str) -> str:
    head, *rows = text.splitlines()
    return "\n".join([head, *(row for row in rows if row.split(",")[0] == rows[0].split(",")[0])])


@pytest.mark.parametrize(
    ("model", "change", "options", "said"),
    [
        ("backlash/model.toml", _one_pose, (), ("poses: got 1",)),
        ("backlash/model.toml", lambda t: re.sub(r",-(150|375|650),", ",0,", t), (), ("load is zero",)),
        ("backlash/model.toml", str, ("--holdout", "table.csv"), ("P01", "has not seen")),
        ("backlash/model.toml", str, ("--free", "j9"), ("--free",)),
        ("backlash/model.toml", str, ("--effect", "slip.py"), ("unit 'deg' is not a unit of length", "slip.py")),
        ("backlash/model.toml", str, ("--keep-out", "0,0,0:1,1,0"), ("--keep-out", "volume")),
        ("backlash/model.toml", str, ("--floor-mm", "low"), ("--floor-mm", "none")),
        ("backlash/model.toml", str, ("--loads", "-5"), ("--loads", "above 0 N")),
        ("kr60-3", str, (), ("q3real_deg",)),
    ],
    ids=["one pose", "no load", "held out twice", "no such joint", "unit", "flat box", "floor", "loads", "robot"],
)
def test_bad_input_is_refused(
    cli: Command,
    sets: Path,
    tmp_path: Path,
    model: str,
    change: Callable[[str], str],
    options: tuple[str, ...],
    said: tuple[str, ...],
) -> None:
    (tmp_path / "table.csv").write_text(change((sets / "backlash/readings.csv").read_text(encoding="utf-8")))
    (tmp_path / "slip.py").write_text(WRONG_UNIT, encoding="utf-8")
    given = model if "/" not in model else sets / model
    outcome = cli("diagnose", given, "table.csv", "--links", "rigid", *options)
    assert (outcome.code, outcome.out) == (2, "")
    assert all(text in " ".join(outcome.err.split()) for text in said), outcome.err
