"""What `calibrate` says: laws, refuted models, sigmas of one's own, set-ups, several tables, odd signs."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import Command, Outcome
from small_robot import STIFFNESS, write_readings

SPRINGS = ",".join(f"{name}.stiffness" for name in STIFFNESS)
LAW = """schema = "stiffarm-calibration/1"
robot = "small"
title = "a shoulder over its angle"
[[parameter]]
name = "waist.stiffness"
[[parameter]]
name = "elbow.stiffness"
[[parameter]]
name = "wrist.stiffness"
[[law]]
kind = "fourier"
joint = "shoulder"
input = "shoulder_deg"
order = 1
"""


def _rows(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]


def _write(path: Path, rows: list[list[str]]) -> Path:
    path.write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def _page(folder: Path) -> str:
    return re.sub(r'src="[^"]*"', "", (folder / "report.html").read_text(encoding="utf-8"))


def _stage(outcome: Outcome) -> Any:
    assert outcome.code == 0, outcome.err
    return outcome.json["stages"][0]


def _spring(angle: float) -> float:
    return 4e5 * math.exp(0.4 * math.cos(angle) + 0.3 * math.sin(angle))


# --- laws --------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_law_is_found_and_drawn_over_its_angle(cli: Command, small: Path, tmp_path: Path) -> None:
    write_readings(small / "small.urdf", tmp_path / "law.csv", 12, shoulder=_spring)
    (tmp_path / "law.toml").write_text(LAW, encoding="utf-8")
    outcome = cli("calibrate", small / "small.urdf", "law.csv", "--campaign", "law.toml", "--out", "out")
    assert outcome.code == 0, outcome.err
    (stage,) = json.loads((tmp_path / "out" / "calibration.json").read_text(encoding="utf-8"))["stages"]
    (law,) = stage["laws"]
    assert (law["joint"], law["law"], law["inputs"]) == ("shoulder", "Fourier series of order 1", ["shoulder_deg"])
    rows = law["at_the_angles_read"]
    assert len(rows) == 12
    truth = np.array([_spring(math.radians(row["shoulder_deg"])) for row in rows])
    # The gauge's 10 um are the least noise, and 2 um were made: the bands are wide, errors far inside.
    np.testing.assert_allclose([row["k_Nm_per_rad"] for row in rows], truth, rtol=0.02)
    assert all(row["interval95"][0] < k < row["interval95"][1] for row, k in zip(rows, truth, strict=True))
    assert (tmp_path / "out" / "laws.png").is_file()
    assert "Springs over their angles" in _page(tmp_path / "out")


# --- whether the model holds -------------------------------------------------------------------------------


def test_a_model_that_misses_by_more_than_replicates_scatter_is_refuted(cli: Command, small: Path) -> None:
    # One spring cannot stand for four; four poses cannot blame scatter between set-ups.
    stage = _stage(
        cli("calibrate", small / "small.urdf", small / "others.csv", "--free", "shoulder.stiffness", "--json")
    )
    assert stage["verdict"] == "refuted"
    assert stage["lack_of_fit"]["p_value"] < 1e-6
    # Replicates were made with 2 um.
    assert stage["lack_of_fit"]["pure_error_mm"] == pytest.approx(0.002, rel=0.3)
    fits = _stage(cli("calibrate", small / "small.urdf", small / "others.csv", "--free", SPRINGS, "--json"))
    assert fits["verdict"] == "not refuted"


@pytest.mark.parametrize(("sigma_mm", "verdict"), [(0.002, "not refuted"), (0.0002, "refuted")])
def test_sigmas_of_ones_own_are_the_noise_and_are_tested(
    cli: Command, small: Path, tmp_path: Path, sigma_mm: float, verdict: str
) -> None:
    # No replicates: chi-square alone can tell. The second says the gauge were ten times better than it is.
    head, *rows = _rows(small / "others.csv")
    once = [[*row, str(sigma_mm)] for row in rows if row[-1] == "1"]
    _write(tmp_path / "own.csv", [[*head, "sigma_mm"], *once])
    outcome = cli("calibrate", small / "small.urdf", "own.csv", "--free", SPRINGS, "--json")
    stage = _stage(outcome)
    assert stage["verdict"] == verdict
    assert "chi-square" in stage["verdict_in_words"]
    ends = [n["value_interval95"] for n in outcome.json["parameters"]]
    if verdict == "not refuted":
        # Noise of 2 um on some 0.1 mm, over 48 numbers; with the gauge's 10 um the widest is 0.5.
        assert max(math.log(high / low) for low, high in ends) < 0.15


def test_sigmas_far_too_small_do_not_make_outliers_of_half_the_readings(
    cli: Command, small: Path, tmp_path: Path
) -> None:
    head, *rows = _rows(small / "readings.csv")
    _write(tmp_path / "own.csv", [[*head, "sigma_mm"], *([*row, "0.0002"] for row in rows if row[-1] == "1")])
    stage = _stage(cli("calibrate", small / "small.urdf", "own.csv", "--json"))
    assert stage["verdict"] == "refuted"
    assert "too many to be outliers: these sigmas are too small" in stage["verdict_in_words"]


def test_sigmas_with_several_readings_of_each_set_up(cli: Command, small: Path, tmp_path: Path) -> None:
    # Nothing but the set-ups' scatter is left to be estimated then: no white term, few readings.
    head, *rows = _rows(small / "readings.csv")
    down = [[*row[:8], "", "", row[10], row[11], "0.002"] for row in rows if row[7] == "-100.0"]
    _write(tmp_path / "own.csv", [[*head, "sigma_mm"], *down[:14]])
    outcome = cli(
        "calibrate", small / "small.urdf", "own.csv", "--free", "shoulder.stiffness,elbow.stiffness", "--json"
    )
    stage = _stage(outcome)
    assert stage["noise"]["set_up_share"] is not None
    assert all(n["status"] in ("determined", "one-sided", "at bound") for n in outcome.json["parameters"])


@pytest.fixture
def scattered(small: Path, tmp_path: Path) -> Path:
    """The readings with set-ups that scatter by 10 %."""
    head, *rows = _rows(small / "readings.csv")
    rng = np.random.default_rng(0)
    shift = {pose: 1.0 + 0.1 * rng.normal() for pose in dict.fromkeys(row[0] for row in rows)}
    for row in rows:
        row[8:11] = [f"{float(c) * shift[row[0]]:.5f}" for c in row[8:11]]
    return _write(tmp_path / "setups.csv", [head, *rows])


def test_set_ups_that_scatter_are_not_called_noise_of_a_reading(cli: Command, small: Path, scattered: Path) -> None:
    stage = _stage(cli("calibrate", small / "small.urdf", scattered, "--json"))
    assert "so they are not independent" in stage["noise_in_words"]
    found = re.search(
        r"left out of the noise, intervals would wrongly be ([\d.]+) times narrower", stage["noise_in_words"]
    )
    # Eight readings of each component share a set-up's scatter: as if independent they would be worth the root of
    # eight at most, and a share of the deflection as noise of a reading takes up some of it.
    assert found is not None
    assert 1.1 < float(found.group(1)) < 2.83
    assert "the scatter between set-ups found above" in stage["verdict_in_words"]


def test_white_noise_said_by_sigmas_is_not_believed_against_the_readings(
    cli: Command, small: Path, tmp_path: Path, scattered: Path
) -> None:
    # Sigmas say 2 um and no more; the set-ups' scatter is found all the same.
    head, *rows = _rows(scattered)
    _write(tmp_path / "white.csv", [[*head, "sigma_mm"], *([*row, "0.002"] for row in rows)])
    stage = _stage(cli("calibrate", small / "small.urdf", "white.csv", "--json"))
    assert stage["noise"]["set_up_share"] == pytest.approx(0.1, abs=0.06)
    assert "times narrower" in stage["noise_in_words"]


# --- several tables ----------------------------------------------------------------------------------------


@pytest.fixture
def halves(small: Path, tmp_path: Path) -> tuple[Path, Path]:
    """The readings in two tables, the second with labels of the first and an outlier in its line 6."""
    head, *rows = _rows(small / "readings.csv")
    middle = len(rows) // 2
    first, second = rows[:middle], [list(row) for row in rows[middle:]]
    names = dict(zip(dict.fromkeys(r[0] for r in second), dict.fromkeys(r[0] for r in first), strict=True))
    for row in second:
        row[0] = names[row[0]]
    second[4][10] = f"{float(second[4][10]) + 0.5:.5f}"
    return _write(tmp_path / "one.csv", [head, *first]), _write(tmp_path / "two.csv", [head, *second])


@pytest.mark.usefixtures("blank", "halves")
def test_two_tables_are_one_with_their_set_ups_apart(cli: Command, small: Path, tmp_path: Path) -> None:
    outcome = cli("calibrate", small / "small.urdf", "one.csv", "two.csv", "--out", "o", "--json")
    stage, content = _stage(outcome), outcome.json
    assert stage["poses"] == [*(f"S0-{k}" for k in range(4)), *(f"S0-{k} (two.csv)" for k in range(4))]
    assert [(o["file"], o["line"], o["component"]) for o in content["outliers"]] == [("two.csv", "6", "dz_mm")]
    assert {row["file"] for row in content["poses"]} == {"one.csv", "two.csv"}
    for number in content["parameters"]:
        assert number["value"] == pytest.approx(STIFFNESS[number["name"].split(".")[0]], rel=0.03)
    assert "Tables, as one" in _page(tmp_path / "o")
    run = json.loads((tmp_path / "o" / "run.json").read_text(encoding="utf-8"))
    assert {"data", "data_2"} <= set(run["inputs_sha256"])


def test_tables_that_contradict_one_another_are_refused(
    cli: Command, small: Path, tmp_path: Path, halves: tuple[Path, Path]
) -> None:
    head, *rows = _rows(halves[0])
    rows[3][10] = "-5"
    _write(tmp_path / "again.csv", [head, rows[3], rows[0]])
    outcome = cli("calibrate", small / "small.urdf", "one.csv", "again.csv")
    assert outcome.code == 2
    assert "again.csv, row 2, the reading contradicts that of row 5 of one.csv" in outcome.err
    assert "again.csv, row 3, the reading repeats that of row 2 of one.csv" in outcome.err
    twice = cli("calibrate", small / "small.urdf", "one.csv", "one.csv")
    assert twice.code == 2
    assert "are the same" in twice.err


def test_units_of_one_table_do_not_hide_behind_another(
    cli: Command, small: Path, tmp_path: Path, halves: tuple[Path, Path]
) -> None:
    head, *rows = _rows(halves[1])
    _write(tmp_path / "two.csv", [head, *([*r[:8], *(str(float(c) * 1e3) for c in r[8:11]), *r[11:]] for r in rows)])
    outcome = cli("calibrate", small / "small.urdf", "one.csv", "two.csv")
    assert outcome.code == 2
    assert "two.csv: these look like deflections in" in outcome.err
    assert "micrometres" in outcome.err


def test_the_robots_own_table_goes_with_another(cli: Command, tmp_path: Path, data_file: Path) -> None:
    head, *rows = _rows(data_file)
    pose = head.index("pose")
    new = [[*rows[0]], [*rows[1]]]
    for row in new:
        row[head.index("q2_deg")], row[pose] = "12", f"new {row[pose]}"
    _write(tmp_path / "new.csv", [head, *new])
    outcome = cli("calibrate", "xr701", "bundled", "new.csv", "--scheme", "global", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["readings"] == len(rows) + 2


# --- odd signs ---------------------------------------------------------------------------------------------


def test_a_few_readings_against_their_load_are_pointed_at(cli: Command, small: Path, tmp_path: Path) -> None:
    head, *rows = _rows(small / "readings.csv")
    for row in rows[8:10]:
        row[5:8] = [str(-float(c)) for c in row[5:8]]
    _write(tmp_path / "odd.csv", [head, *rows])
    outcome = cli("calibrate", small / "small.urdf", "odd.csv", "--json")
    assert outcome.code == 0
    assert "2 of 64 readings move against their load: the sign? Rows 10, 11" in outcome.err
