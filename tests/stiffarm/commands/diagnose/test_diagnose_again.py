"""`diagnose` goes on: with a filled-in sheet, from its own model, with effects of a user's, on the real readings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from blind.sets import make, more
from blind.spec import SetSpec
from cli_runs import ROOT, Command
from shortened import quick_diagnosis

from robots import load_description

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("quick_diagnoses")]

SEED = 5
FRICTION = SetSpec(robot="kr60-3", effects=("friction:j2",), poses=12, repeats=1, name="friction")
NOTHING = SetSpec(poses=9, design="paper", repeats=1, name="nothing")


def _results(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def test_the_model_found_is_missing_nothing_more(cli: Command, tmp_path: Path) -> None:
    made = make(FRICTION, SEED)
    made.write(tmp_path, "")
    data, first, again = tmp_path / "friction/readings.csv", tmp_path / "first", tmp_path / "again"
    outcome = cli("diagnose", tmp_path / "friction/model.toml", data, "--links", "rigid", "--out", first)
    assert outcome.code == 0, outcome.err
    assert [e["code"] for e in _results(first)["effects"]] == ["friction:j2"]
    outcome = cli("diagnose", first / "model.toml", data, "--next", "0", "--out", again)
    assert outcome.code == 0, outcome.err
    r = _results(again)
    assert (r["verdict"], r["effects"]) == ("none", [])
    assert any("has these effects already" in one for one in r["remarks"])
    # The same numbers fitted again from where they stood; the noise may differ a little.
    before, after = (load_description(str(f / "model.toml")).effect[0].parameters for f in (first, again))
    for name, number in before.items():
        assert after[name].value == pytest.approx(number.value, rel=0.02)


def test_a_filled_in_sheet_goes_beside_the_table(cli: Command, tmp_path: Path) -> None:
    made = make(NOTHING, SEED)
    made.write(tmp_path, "")
    model, data, out = tmp_path / "nothing/model.toml", tmp_path / "nothing/readings.csv", tmp_path / "out"
    outcome = cli("diagnose", model, data, "--links", "rigid", "--next", "2", "--out", out)
    assert outcome.code == 0, outcome.err
    r = _results(out)
    assert r["verdict"] == "none"
    assert len(r["next_readings"]) == 2
    sheet = (out / "next_readings.csv").read_text(encoding="utf-8")
    filled = tmp_path / "filled.csv"
    filled.write_text(more(NOTHING, SEED, sheet), encoding="utf-8")
    outcome = cli("diagnose", model, data, filled, "--links", "rigid", "--next", "0", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["poses"] == r["poses"] + 2
    assert outcome.json["data"] == "readings.csv + filled.csv"


def test_a_users_own_effect_is_a_candidate(cli: Command, tmp_path: Path) -> None:
    text = (ROOT / "docs" / "how-to" / "own_effect.md").read_text(encoding="utf-8")
    (tmp_path / "settling.py").write_text(text.split("```python")[1].split("```")[0], encoding="utf-8")
    made = make(NOTHING, SEED)
    made.write(tmp_path, "")
    given = tmp_path / "nothing/model.toml", tmp_path / "nothing/readings.csv", "--links", "rigid"
    with quick_diagnosis("flange-settling"):
        r = cli("diagnose", *given, "--effect", tmp_path / "settling.py", "--next", "0", "--json").json
    assert "flange-settling" in {c["code"] for c in r["candidates"]} | set(r["not_testable"])


@pytest.mark.parametrize("loads", ["650", "all"])
def test_the_real_readings_are_told_about_whatever_they_say(cli: Command, tmp_path: Path, loads: str) -> None:
    out = tmp_path / "out"
    outcome = cli("diagnose", "xr701", "--load-path", "serial", "--loads", loads, "--links", "beam", "--out", out)
    assert outcome.code == 0, outcome.err
    r = _results(out)
    assert r["readings"] == (9 if loads == "650" else 27)
    # Z alone, averages, no history: these readings cannot tell friction, drift, or anything about a vertical axis.
    assert {"friction:j2", "drift", "joint-compliance:j1"} <= set(r["not_testable"])
    gap = r["gap"]
    assert gap["after"]["holdout_rms_mm"] <= gap["before"]["holdout_rms_mm"] * (1.0 + 1e-9)
    if loads == "650":
        # Known from the calibration of the serial chain with constant springs: 0.098 mm, the most of it at pose 41.
        assert gap["before"]["least_rms_of_any_springs_mm"] == pytest.approx(0.098, abs=0.003)
        largest = max(r["where"]["pose"], key=lambda g: g["mean_square"])
        assert largest["pose"] == "41"
    assert load_description(str(out / "model.toml")).load_path == "serial"
