"""What a diagnosis says is left to do: nothing only where nothing is open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.diagnosis.proposals.discrimination import Outcome
from doe.diagnosis.proposals.foresight import Rival
from doe.diagnosis.proposals.next_readings import NextReadings
from robots import InputError
from stiffarm.commands.diagnose import step
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.words import advice, next_sentence
from stiffarm.session import console


def named(still_open: dict[str, tuple[str, ...]], twins: dict[str, tuple[str, ...]], nothing: str = "") -> Any:
    """A diagnosis that named backlash at joint 2."""
    lines = [
        SimpleNamespace(code="backlash:j2", probability=0.9),
        SimpleNamespace(code="hardening:j2", probability=0.1),
    ]
    look = SimpleNamespace(hypotheses=lines, of=lambda code: next(h for h in lines if h.code == code))
    found = SimpleNamespace(
        verdict="named", same=(), effects=[SimpleNamespace(code="backlash:j2")], provisional=[], rankings=[look]
    )
    return SimpleNamespace(found=found, still_open=still_open, twins=twins, nothing_next=nothing, proposal=None)


def test_nothing_is_left_only_where_no_twin_is_open() -> None:
    assert next_sentence(named({}, {"backlash:j2": ()})).startswith("Nothing is left")
    twins = {"backlash:j2": ("hardening:j2",)}
    doubted = next_sentence(named(twins, twins))
    assert "backlash:j2 could still be hardening:j2 (10 %)" in doubted
    ruled_out = next_sentence(named({}, twins))
    assert "hardening:j2 could look like backlash:j2" in ruled_out
    for text in (doubted, ruled_out):
        assert "Nothing is left" not in text
    assert "no poses" in next_sentence(named(twins, twins, "no poses"))


def open_between(right: float, verdict: str = "ambiguous", hidden: float = 0.0, way: str = "") -> Any:
    """A diagnosis with two rivals and set-ups that settle it with a chance of ``right``."""
    rival = SimpleNamespace(code="backlash:j2", hidden=True, against_none=9.0, probability=hidden)
    proposal = SimpleNamespace(expected=SimpleNamespace(right=right), labels=("next 1", "next 2"), rivals=[rival])
    found = SimpleNamespace(verdict=verdict, same=(), effects=[], provisional=[])
    return SimpleNamespace(
        found=found,
        still_open={},
        twins={},
        nothing_next="",
        proposal=proposal,
        other_way=way,
        odd=[],
        rivals=("hardening:j2", "backlash:j2"),
    )


@pytest.mark.parametrize(
    ("d", "chance", "measure"),
    [
        (open_between(0.45), 0.45, True),
        (open_between(0.01), 0.01, False),
        (open_between(0.01, "unknown"), 0.01, False),
        (open_between(0.9, "none", hidden=0.03), 0.03, False),
        (open_between(0.01, "none", hidden=0.4), 0.4, True),
    ],
)
def test_set_ups_are_advised_with_their_chance_or_not_at_all(d: Any, chance: float, measure: bool) -> None:
    a = advice(d, "folder/next_readings.csv")
    assert (a.chance, a.measure) == (chance, measure)
    assert ("Measure the 2 set-ups of folder/next_readings.csv" in a.text) == measure
    assert f"chance {100.0 * chance:.0f} %" in a.text.replace("\u00a0", " ")


def test_another_way_to_measure_stands_in_the_advice() -> None:
    assert "loaded along X, Y and Z" in advice(open_between(0.3, way="loaded along X, Y and Z")).text
    assert advice(named({}, {"backlash:j2": ()})).chance is None


def test_work_says_how_far_it_is_where_no_bar_is_drawn(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(console, "SILENCE_S", 0.0)
    with console.progress("weighing") as bar:
        bar(3, 10)
    assert "weighing: 3 of 10" in capsys.readouterr().err
    with console.kept_messages() as kept, console.progress("weighing") as bar:
        bar(3, 10)
    assert kept == []
    monkeypatch.setattr(console, "SILENCE_S", 60.0)
    with console.progress("weighing") as bar:
        bar(3, 10)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("chances", "unknown", "kept", "tried"),
    [
        ((0.3, 0.9, 0.9), 0.0, "", 1),
        ((0.05, 0.1, 0.25), 0.0, "c", 3),
        ((0.05, None, 0.01), 0.0, "", 3),
        ((0.05, 0.25, 0.3), 0.9, "", 1),
        ((None, 0.25, 0.3), 0.0, "b", 2),
    ],
)
def test_where_set_ups_would_hardly_settle_it_others_are_tried(
    chances: tuple[float | None, ...], unknown: float, kept: str, tried: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def propose(*_: Any, way: str = "", **__: Any) -> NextReadings:
        asked.append(way)
        right = chances[len(asked) - 1]
        if right is None:
            raise InputError("set-ups", code="X004", value="none of 300 tried", remedy="turn it")
        now, then = Outcome(0.0, 0.0, 0.0), Outcome(right, right, 0.0)
        rival = [Rival(code, p, False, 0.0, now, then) for code, p in (("unknown", unknown), ("a", 1.0 - unknown))]
        some = np.zeros((1, 1))
        return NextReadings(some, some, Any, ("next 1",), 0, tuple(rival), 0.0, 1.0, now, then, then, ())  # type: ignore[arg-type]

    monkeypatch.setattr(step, "propose", propose)
    monkeypatch.setattr(step, "zone_of", lambda *_: None)
    monkeypatch.setattr(step, "ways_to_measure", lambda s: {way: {"way": way} for way in ("", "b", "c")})
    found: Any = SimpleNamespace(verdict="ambiguous", start=None)
    given: Any = SimpleNamespace(description=None)
    best, why, way = step._proposal(given, found, {}, DiagnoseRequest(), lambda text: None, None)
    assert (way, len(asked), why) == (kept, tried, "")
    assert best is not None
    assert best.expected.right == max(c for c in chances[:tried] if c is not None)
