"""The loop of diagnosing and measuring: how sets end, what is counted, one foreign set run through it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from diagnosis_loop import STEPS, WAYS, at_step, end_of, forecasts, groups, page, run_set, sooner, summary
from worlds.screws import make

from benchmarks.diagnosis.study.scores import Row
from benchmarks.diagnosis.study.sets import study_sets

SINGLE = Row("one", "single", ("backlash:j2",), verdict="named", named=("backlash:j2",), found=("backlash:j2",))


@pytest.mark.parametrize(
    ("row", "end"),
    [
        (SINGLE, "right"),
        (replace(SINGLE, named=("backlash:j3",)), "right"),  # the family counts
        (replace(SINGLE, named=("hardening:j2",)), "wrong"),
        (replace(SINGLE, named=("backlash:j2", "payload")), "wrong"),
        (replace(SINGLE, verdict="ambiguous", named=()), "unsettled"),
        (replace(SINGLE, verdict="unknown", named=()), "unsettled"),
        (replace(SINGLE, verdict="ambiguous", named=("payload",)), "wrong"),
        (replace(SINGLE, kind="pair", hidden=("backlash:j2", "payload")), "partly"),
        (replace(SINGLE, kind="none", hidden=()), "wrong"),
        (replace(SINGLE, kind="none", hidden=(), verdict="none", named=()), "right"),
        (replace(SINGLE, kind="outside", hidden=("other:sag:base",)), "wrong"),
        (replace(SINGLE, kind="outside", hidden=("other:sag:base",), verdict="learned", named=()), "right"),
    ],
)
def test_how_a_set_ends(row: Row, end: str) -> None:
    assert end_of(row) == end


def steps(*ends: str) -> list[dict[str, Any]]:
    promise = {"now": 0.4, "after": 0.8, "right": 0.7, "wrong": 0.1, "set_ups": 3}
    return [{"end": end, "forecast": None if end in ("right", "wrong") else promise} for end in ends]


ROWS = [
    {
        "kind": "single",
        "detectable": True,
        "proposed": steps("unsettled", "right"),
        "random": steps("unsettled", "unsettled", "right"),
    },
    {
        "kind": "single",
        "detectable": True,
        "proposed": steps("unsettled", "unsettled", "wrong"),
        "random": steps("unsettled", "unsettled", "unsettled"),
    },
    {"kind": "single", "detectable": False, "proposed": steps("right"), "random": steps("right")},
    {"refused": "two poses"},
]


def test_what_is_counted() -> None:
    ran = ROWS[:3]
    assert at_step(ran[0]["proposed"], 3)["end"] == "right"  # type: ignore[arg-type]
    assert sooner(ran) == (1, 0)
    assert {name: len(some) for name, some in groups(ran).items()} == {
        "single": 3,
        "single, detectable": 2,
        "single, detectable and unsettled at first": 2,
    }
    f = forecasts(ran)
    assert f["proposals"] == 3
    assert (f["right"]["promised"], f["right"]["count"], f["wrong"]["count"]) == (2.1, 1, 1)
    found = summary(ROWS)
    assert (found["sets"], found["refused"], found["failed"]) == (4, 1, 0)
    last = found["groups"]["single"]["proposed"][-1]
    assert (last["right"]["count"], last["wrong"]["count"], last["unsettled"]["count"]) == (2, 1, 0)
    text = page(found)
    assert "right sooner in 1 sets, random ones in 0" in text
    assert "Of 3 proposals" in text


@pytest.mark.slow
def test_a_foreign_set_is_measured_on_until_something_is_named(tmp_path: Path) -> None:
    folders = make(tmp_path, 5, single=4, none=0, outside=0, pairs=0)
    few = min(folders, key=lambda folder: (folder / "readings.csv").stat().st_size)
    (one,) = [s for s in study_sets(tmp_path) if s.folder == few]
    r = run_set(one, steps=1)
    json.dumps(r)
    assert "failed" not in r, r
    for way in WAYS:
        assert 1 <= len(r[way]) <= 2 <= STEPS
        assert r[way][0]["verdict"] == "named" or len(r[way]) == 2 or r[way][0]["forecast"] is None
