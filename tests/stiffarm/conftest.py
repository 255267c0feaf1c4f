"""What the tests of the command line share: some results to work on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from cli_runs import HOSTILE_NOTE, HOSTILE_TITLE, Command, FullRun, run_here
from shortened import blank_pictures, few_runs, quick_diagnosis

from doe import bundled_data
from robots import load_description
from robots.library.models import to_toml
from stiffarm.pages import pose_pictures, rendering


@pytest.fixture(scope="session", autouse=True)
def _coarse_pictures() -> Iterator[None]:
    """Scenes are drawn with few pixels, which are most of a picture's time: nobody looks at these."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "FINENESS", 0.5)
        patch.setattr(pose_pictures, "FINENESS", 1)
        yield


@pytest.fixture
def quick_diagnoses() -> Iterator[None]:
    """Every diagnosis of a test is a quick one."""
    with quick_diagnosis():
        yield


@pytest.fixture
def blank() -> Iterator[None]:
    """No picture of a test is drawn."""
    with blank_pictures():
        yield


@pytest.fixture
def quick_fit() -> Iterator[None]:
    """Every `fit` of a test judges by few runs."""
    with few_runs():
        yield


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Run a command in an empty folder: ``cli("robots", "xr701", "--json")``."""
    monkeypatch.chdir(tmp_path)
    return run_here


@pytest.fixture(scope="session")
def data_file() -> Path:
    """The published measurements."""
    return bundled_data("xr701")


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory, data_file: Path) -> Path:
    """The folder of a calibration with constant springs."""
    folder = tmp_path_factory.mktemp("calibrated") / "out"
    with blank_pictures():
        outcome = run_here("calibrate", "xr701", data_file, "--scheme", "global", "--out", folder)
    assert outcome.code == 0, outcome.err
    return folder


@pytest.fixture(scope="session")
def fitted(tmp_path_factory: pytest.TempPathFactory, calibrated: Path) -> Path:
    """The folder of a surrogate of the calibrated model."""
    folder = tmp_path_factory.mktemp("fitted") / "out"
    with few_runs(), blank_pictures():
        outcome = run_here("fit", calibrated / "model.toml", "--runs", "1400", "--out", folder)
    assert outcome.code == 0, outcome.err
    return folder


@pytest.fixture(scope="session")
def hostile_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The xr701 with a title and notes that would run in a browser if they were not escaped."""
    description = load_description("xr701")
    file = tmp_path_factory.mktemp("hostile") / "model.toml"
    notes = (*description.notes, HOSTILE_NOTE)
    file.write_text(to_toml(description.model_copy(update={"title": HOSTILE_TITLE, "notes": notes})), encoding="utf-8")
    return file


@pytest.fixture(scope="session")
def full_run(tmp_path_factory: pytest.TempPathFactory, hostile_model: Path) -> FullRun:
    """The whole chain on the published data, with a coarse map and a hostile title."""
    folder = tmp_path_factory.mktemp("run") / "deep" / "out"
    with quick_diagnosis(), few_runs():
        return FullRun(run_here("run", hostile_model, "--out", folder, "--points", "4"), folder)
