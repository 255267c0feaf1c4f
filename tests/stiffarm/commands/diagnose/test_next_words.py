"""What a diagnosis says is left to do: nothing only where nothing is open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from stiffarm.commands.diagnose.next_words import next_sentence
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
    return SimpleNamespace(found=found, still_open=still_open, twins=twins, nothing_next=nothing)


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
