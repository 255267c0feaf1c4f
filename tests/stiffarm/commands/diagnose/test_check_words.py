"""Checks after the name as they are shown: on the screen, in diagnosis.json, on the page's first section."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import pandas as pd
import pytest
from cli_runs import Command

from doe.diagnosis.checks import FACTORS, Check, Code
from doe.diagnosis.where import Group
from robots.quantities import percent
from stiffarm.commands.diagnose.words import AGAINST, check_sentences, share_text


def checked(*made: Check, codes: tuple[str, ...] = ("backlash:j2",)) -> Any:
    return SimpleNamespace(found=[SimpleNamespace(code=code) for code in codes], checks=made)


GOOD = Check("stable", "backlash:j2", passed=True, evidence="log density +9", factor=1.0)
IDLE = Check("one-of-a-kind", "backlash:j2", passed=None, evidence="it is of no joint", factor=1.0)
BAD = Check("no-twin", "backlash:j2", passed=False, evidence="creep:j2 looks the same", factor=0.3)
DOUBT = Check("nothing-left", "", passed=True, evidence="the last look gives 30 % to something unknown", factor=1.0)


def test_every_check_has_its_words() -> None:
    assert set(AGAINST) == set(FACTORS) == set(get_args(Code))


def test_each_check_that_failed_has_a_line() -> None:
    left = Check("nothing-left", "", passed=False, evidence="70 % unknown", factor=0.4)
    lines = check_sentences(checked(GOOD, IDLE, BAD, left))
    assert lines == (
        "Against backlash:j2: another effect fits as well (creep:j2 looks the same).",
        "Against backlash:j2: something is left (70 % unknown).",
    )
    several = check_sentences(checked(left, codes=("backlash:j2", "payload")))
    assert several[0].startswith("Against all 2 effects together")


def test_all_passed_is_one_line() -> None:
    d = checked(GOOD, IDLE, DOUBT)
    assert check_sentences(d) == ("No check speaks against backlash:j2: 2 passed; 1 of 3 do not apply.",)
    assert check_sentences(checked(GOOD)) == ("No check speaks against backlash:j2: 1 passed.",)


def test_nothing_found_says_nothing() -> None:
    assert check_sentences(checked()) == ()


@pytest.mark.parametrize(
    ("share", "sd", "text"), [(0.31, 0.06, "31 ± 6 %"), (0.31, 0.004, "31 %"), (0.31, float("nan"), "31 %")]
)
def test_a_share_is_told_with_its_standard_deviation(share: float, sd: float, text: str) -> None:
    assert share_text(Group("650 N", 9, share, 4.0, 1e-4, sd)) == text


@pytest.mark.usefixtures("blank")
def test_a_diagnosis_shows_its_checks(cli: Command, tmp_path: Path) -> None:
    """The path of the XR701's load is named, and an angle-dependent stiffness would look the same."""
    asked = ("diagnose", "xr701", "--loads", "650", "--load-path", "serial", "--folds", "0", "--next", "0")
    assert "Against load-path: another effect fits as well" in cli(*asked, "--out", tmp_path / "out").err
    r = json.loads((tmp_path / "out/diagnosis.json").read_text(encoding="utf-8"))
    assert (r["verdict"], [e["code"] for e in r["effects"]]) == ("named", ["load-path"])
    assert {c["code"] for c in r["checks"]} == set(FACTORS)
    assert all(set(c) == {"code", "effect", "passed", "evidence", "factor"} for c in r["checks"])
    failed = [c for c in r["checks"] if c["passed"] is False]
    assert [(c["code"], c["effect"]) for c in failed] == [("no-twin", "load-path")]
    assert any(c["effect"] is None for c in r["checks"])
    assert any(c["passed"] is None for c in r["checks"])
    assert 0.0 < r["stated_probability"] < r["effects"][0]["probability"]
    assert all(g["share_sd"] > 0.0 for g in r["where"]["pose"])

    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    first = html.unescape(page[page.index("<main") : page.index("Poses with the largest error</h2>")])
    assert "Against load-path: another effect fits as well" in first
    assert re.search(r"<details.*All checks after the name", first, re.DOTALL)
    # The card, the sentence, the table, JSON and the frame say the same of the name.
    frame = pd.read_csv(tmp_path / "out/diagnosis.csv").set_index("code")
    assert frame.loc["load-path", "probability"] == r["candidates"][0]["probability"] == r["stated_probability"]
    assert frame.loc["load-path", "probability_before_checks"] == r["effects"][0]["probability"]
    now, then = percent(r["stated_probability"]), percent(r["effects"][0]["probability"])
    assert f"load-path {now} ({then} before)" in first.replace("\u00a0", " ")
    row = re.search(r"\+ load-path.*?</tr>", first, re.DOTALL)
    assert row is not None
    assert [then, now] == re.findall(r">([^<>]*%)<", row[0].replace("\u00a0", " "))[:2]
