"""Flipped, shuffled and frozen readings at the command line: no number of an arm leaves in silence."""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command
from small_robot import write_readings, write_urdf

# Readings of the published table (mm), by row.
Change = Callable[[np.ndarray], np.ndarray]
FLIPPED: Change = lambda z: z * np.where(np.arange(len(z)) % 2 == 0, 1.0, -1.0)  # noqa: E731
SHUFFLED: Change = lambda z: np.random.default_rng(1).permutation(z)  # noqa: E731
ZERO: Change = lambda z: 0.0 * z  # noqa: E731
SAME: Change = lambda z: np.full(len(z), -0.37)  # noqa: E731
# Links as rods: the quickest model.
RIGID = ("--links", "rigid")
SPRINGS = ("--free", "j2.stiffness,j3.stiffness,j5.stiffness")


@pytest.fixture
def changed(tmp_path: Path, data_file: Path) -> Callable[[Change], Path]:
    """The published table with other readings."""

    def write(change: Change) -> Path:
        rows = list(csv.DictReader(io.StringIO(data_file.read_text(encoding="utf-8"))))
        read = change(np.array([float(row["dz_mm"]) for row in rows]))
        path = tmp_path / "readings.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows({**row, "dz_mm": f"{v:.4f}"} for row, v in zip(rows, read, strict=True))
        return path

    return write


COMMANDS = {
    "staged": ("calibrate", *RIGID, "--scheme", "staged", "--out", "out"),
    "free": ("calibrate", *RIGID, *SPRINGS, "--out", "out"),
    "plan": ("plan", *RIGID, "--poses", "2", "--candidates", "20", "--out", "out"),
    "run": ("run", "--out", "out"),
}


@pytest.mark.usefixtures("blank", "quick_diagnoses")
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("change", [FLIPPED, SHUFFLED], ids=["flipped", "shuffled"])
def test_no_number_is_made_of_readings_that_tell_nothing(
    cli: Command, changed: Callable[[Change], Path], change: Change, command: str
) -> None:
    name, *options = COMMANDS[command]
    outcome = cli(name, "xr701", changed(change), *options)
    assert outcome.code == 2, outcome.err
    assert "tell nothing about the arm" in outcome.err
    assert "To fix it" in outcome.err
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("change", "said"), [(ZERO, "every reading is 0"), (SAME, "column dz_mm reads the same in all 27 set-ups")]
)
@pytest.mark.parametrize("command", [*COMMANDS, "diagnose"])
def test_a_gauge_that_stood_still_is_refused(
    cli: Command, changed: Callable[[Change], Path], change: Change, said: str, command: str
) -> None:
    name, *options = COMMANDS.get(command, ("diagnose", *RIGID, "--out", "out"))
    outcome = cli(name, "xr701", changed(change), *options)
    assert outcome.code == 2, outcome.err
    assert said in outcome.err
    assert not Path("out").exists()


@pytest.mark.slow
def test_a_diagnosis_of_readings_that_tell_nothing_says_so(cli: Command, changed: Callable[[Change], Path]) -> None:
    outcome = cli("diagnose", "xr701", changed(FLIPPED), *RIGID, "--free", "j2,j3", "--json")
    found = outcome.json
    assert found["verdict"] == "uninformative"
    assert (found["effects"], found["provisional"], found["candidates"], found["set95"]) == ([], [], [], [])
    assert (found["springs"], found["next_readings"], found["steps"]) == ({}, [], [])
    assert "tell nothing about the arm" in outcome.err
    assert "fit better" in found["reason"]
    assert "is left is noise" not in outcome.err
    # The readings are 1.16 mm RMS; the noise was once said to be 12.2 mm.
    assert found["gap"]["before"]["noise_floor_mm"] < 1.17
    assert found["noise"]["source"] == "residual"
    assert all(g["share"] is None for groups in found["where"].values() for g in groups)


@pytest.mark.slow
def test_the_report_of_such_a_diagnosis_has_no_model(cli: Command, changed: Callable[[Change], Path]) -> None:
    outcome = cli("diagnose", "xr701", changed(FLIPPED), *RIGID, "--out", "out")
    assert outcome.code == 0, outcome.err
    assert {p.name for p in Path("out").iterdir()} >= {"report.html", "diagnosis.json", "run.json"}
    assert not Path("out/model.toml").exists()
    assert "readings tell nothing" in Path("out/report.html").read_text(encoding="utf-8")


def test_without_repeats_noise_is_called_the_residual(cli: Command, data_file: Path) -> None:
    outcome = cli("calibrate", "xr701", data_file, *RIGID, *SPRINGS, "--json")
    assert outcome.json["stages"][0]["noise"]["source"] == "residual"
    outcome = cli("plan", "xr701", data_file, *RIGID, "--poses", "2", "--candidates", "20", "--json")
    assert outcome.json["noise"]["source"] == "residual"


def test_with_repeats_it_is_noise(cli: Command, tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")
    data = write_readings(urdf, tmp_path / "readings.csv")
    outcome = cli("calibrate", urdf, data, "--free", "waist.stiffness,shoulder.stiffness", "--json")
    assert outcome.json["stages"][0]["noise"]["source"] == "repeats"


@pytest.mark.slow
def test_the_report_calls_it_so_too(cli: Command, data_file: Path) -> None:
    assert cli("calibrate", "xr701", data_file, *RIGID, *SPRINGS, "--out", "out").code == 0
    page = html.unescape(Path("out/report.html").read_text(encoding="utf-8"))
    assert "The model's residual, and whether the model holds" in page


def test_numbers_that_explain_little_are_remarked_on(cli: Command, data_file: Path) -> None:
    """The last spring alone: the readings tell of the arm, but hardly of it."""
    outcome = cli("calibrate", "xr701", data_file, *RIGID, "--free", "j4.stiffness", "--json")
    assert any("left unexplained" in text for text in outcome.json["remarks"])
    outcome = cli("calibrate", "xr701", data_file, *RIGID, *SPRINGS, "--json")
    assert not any("left unexplained" in text for text in outcome.json["remarks"])
