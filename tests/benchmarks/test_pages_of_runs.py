"""Pages and results files of the studies whose rows are kept: what their scripts make of these rows."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import power_study
import protocol
import pytest
import run_summaries

from doe.power.chances import Chance

PAGES = Path(__file__).resolve().parents[2] / "docs" / "validation"


def test_the_summaries_are_those_of_the_rows() -> None:
    assert run_summaries.RESULTS.read_text(encoding="utf-8") == run_summaries.text()


def test_the_page_of_the_study_is_what_the_protocol_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "save_png", lambda *_: None)
    page, folder = tmp_path / "page.md", run_summaries.RUNS / "a3d97a58"
    shutil.copy(PAGES / "diagnosis_study.md", page)
    protocol.page(folder, list(protocol.kept(folder / "rows.jsonl")), page)
    assert page.read_text(encoding="utf-8") == (PAGES / "diagnosis_study.md").read_text(encoding="utf-8")


def cells(of: dict[str, Any]) -> list[power_study.Cell]:
    chances = ("stated_found", "stated_named")
    return [power_study.Cell(**{**c, **{name: Chance(**c[name]) for name in chances}}) for c in of["cells"]]


def test_the_page_of_the_power_study_is_what_its_script_writes() -> None:
    known = json.loads(power_study.KEPT.read_text(encoding="utf-8"))
    page = power_study.PAGE.read_text(encoding="utf-8")
    assert power_study.words(cells(known["check"]), cells(known["tune"]), known["check"]["seed"], page) == page
