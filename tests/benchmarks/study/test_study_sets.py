"""`python -m benchmarks.diagnosis.study`: sets that anybody made, diagnosed blind and scored."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[2] / "stiffarm"))  # a diagnosis among few families

from shortened import quick_diagnosis

from benchmarks.diagnosis.study import report, step
from benchmarks.diagnosis.study.__main__ import main
from benchmarks.diagnosis.study.report import write_report
from benchmarks.diagnosis.study.scores import Row
from benchmarks.diagnosis.study.sets import study_sets
from benchmarks.diagnosis.study.step import rows_of
from stiffarm.session.outputs import OutputFolder
from tests.blind.sets import make, unseen
from tests.blind.spec import SetSpec

FEW: dict[str, Any] = {"robot": "kr60-3", "poses": 9, "repeats": 2}


Printed = pytest.CaptureFixture[str]


def scored(capsys: Printed, *arguments: object) -> Any:
    """The JSON of a study."""
    assert main([str(a) for a in (*arguments, "--json")]) == 0
    return json.loads(capsys.readouterr().out)


def made(folder: Path, name: str, seed: int, *effects: str) -> None:
    spec = SetSpec(**FEW, effects=effects, name=name, group="single" if effects else "none")
    make(spec, seed).write(folder, unseen(spec, seed, 6))


@pytest.mark.slow
def test_a_set_is_diagnosed_blind_and_scored(tmp_path: Path, capsys: Printed) -> None:
    made(tmp_path, "a", 3, "gauge-zero")
    with quick_diagnosis("gauge-zero"):
        result = scored(capsys, tmp_path, "--jobs", 1)
    (row,) = result["rows"]
    assert (row["verdict"], row["named"], row["right"]) == ("named", ["gauge-zero"], True)
    assert row["after_mm"] < row["before_mm"]


@pytest.mark.slow
def test_a_folder_of_sets_is_scored(tmp_path: Path, capsys: Printed) -> None:
    made(tmp_path / "sets", "a", 3, "gauge-zero")
    made(tmp_path / "sets", "b", 4)
    # The key of this one speaks of what no catalogue has.
    made(tmp_path / "sets" / "more", "c", 5, "warming-springs")
    result = scored(capsys, tmp_path / "sets", "--jobs", 2, "--out", tmp_path / "out")
    assert result["kinds"] == {"single": 1, "none": 1, "outside": 1}
    assert [r["set"] for r in result["rows"]] == ["a", "b", "more/c"]
    assert result["rows"][0]["verdict"] == "named"
    assert result["rows"][0]["after_mm"] < result["rows"][0]["before_mm"]
    assert {"study.json", "rows.csv", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_readings_that_are_refused_are_counted(tmp_path: Path, capsys: Printed) -> None:
    made(tmp_path, "a", 3, "gauge-zero")
    lines = (tmp_path / "a" / "readings.csv").read_text().splitlines()
    (tmp_path / "a" / "readings.csv").write_text("\n".join(lines[:2]) + "\n")
    (row,) = scored(capsys, tmp_path, "--jobs", 1)["rows"]
    assert row["verdict"] == "refused"
    assert not row["right"]
    assert row["reason"]


@pytest.mark.slow
def test_every_set_is_done_though_workers_are_renewed(tmp_path: Path) -> None:
    names = [f"set{k}" for k in range(5)]
    for k, name in enumerate(names):
        made(tmp_path, name, k)
        lines = (tmp_path / name / "readings.csv").read_text().splitlines()
        (tmp_path / name / "readings.csv").write_text("\n".join(lines[:2]) + "\n")
    rows = list(rows_of(study_sets(tmp_path), jobs=2, each=1))
    assert sorted(r.name for r in rows) == names
    assert {r.verdict for r in rows} == {"refused"}


def test_a_fault_in_one_set_does_not_cost_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made(tmp_path, "a", 3)
    made(tmp_path, "b", 4)
    sets = study_sets(tmp_path)

    def faulty(*_: object, **__: object) -> None:
        raise IndexError("no such row")

    monkeypatch.setattr(step, "diagnosed", faulty)
    rows = step.study(sets, 1)
    assert [(r.verdict, r.is_right, r.reason) for r in rows] == [("failed", False, "IndexError: no such row")] * 2
    assert "failed on 2 sets" in " ".join(report.summary(rows))


@pytest.mark.parametrize(
    ("file", "text", "named"),
    [
        ("key.json", None, "no key.json"),
        ("readings.csv", None, "no readings.csv"),
        ("set.json", '{"schema": "stiffarm-study-set/1"}', "model"),
        ("set.json", '{"schema": "stiffarm-study-set/1", "model": "../model.toml"}', "../model.toml"),
        ("set.json", '{"schema": "x", "model": "kr60-3"}', "schema"),
        ("set.json", '{"schema": "stiffarm-study-set/1", "model": "kr60-3", "seed": 1}', "seed"),
        ("key.json", '{"schema": "stiffarm-study-key/1"}', "effects"),
        ("key.json", '{"schema": "stiffarm-study-key/1", "effects": [{"code": ""}]}', "code"),
        ("key.json", '{"schema": "stiffarm-study-key/1", "effects": [{"code": "a", "axis": ["x"]}]}', "axis"),
        ("key.json", '{"schema": "stiffarm-study-key/1", "effects": [], "excess_chi2": -1}', "excess_chi2"),
        ("key.json", "{", "JSON"),
    ],
)
def test_sets_that_do_not_fit_are_named(
    tmp_path: Path, capsys: Printed, file: str, text: str | None, named: str
) -> None:
    made(tmp_path, "a", 3)
    path = tmp_path / "a" / file
    if text is None:
        path.unlink()
    else:
        path.write_text(text)
    assert main([str(tmp_path)]) == 2
    assert named in capsys.readouterr().err.replace("\n", " ")


def test_folders_without_sets_are_refused(tmp_path: Path, capsys: Printed) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        assert main([str(folder)]) == 2
        assert "FOLDER" in capsys.readouterr().err


def test_the_key_stays_out_of_what_is_diagnosed(tmp_path: Path) -> None:
    """A set's model and readings are all that a diagnosis sees: neither may speak of what is hidden."""
    made(tmp_path, "a", 3, "friction:j2")
    (one,) = study_sets(tmp_path)
    for path in (Path(one.model), one.readings):
        assert "friction" not in path.read_text()


@pytest.mark.slow
def test_the_page_of_a_study_of_every_kind(tmp_path: Path) -> None:
    right = Row("s", "single", ("backlash:j2",), excess=200.0, tags={"reads": "z"}, before_mm=0.2, after_mm=0.02)
    right = replace(right, verdict="named", named=("backlash:j2",), found=("backlash:j2",), probability=0.97)
    rows = [
        right,
        replace(right, kind="none", hidden=(), verdict="none", named=(), found=(), tags={"reads": "xyz"}),
        replace(right, kind="outside", hidden=("other:x",), verdict="unknown", named=()),
        replace(right, kind="pair", hidden=("payload", "drift"), each=(90.0, 80.0)),
        replace(right, verdict="refused", named=(), found=(), reason="no pose"),
    ]
    with OutputFolder(tmp_path / "out", ["stiffarm", "study"], {}, None) as folder:
        write_report(rows, "sets", folder)
    page = (tmp_path / "out" / "report.html").read_text()
    for text in ("how often is the diagnosis right?", "a wrong name, all sets", "Set by set", "refused"):
        assert text in page
