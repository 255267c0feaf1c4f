"""Tables in a terminal of 80 characters: no word is broken or cut where another layout avoids it."""

from __future__ import annotations

import pytest
from rich.console import Console

from stiffarm.session import console


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch) -> Console:
    """What would go to a terminal of 80 characters, kept."""
    kept = Console(width=80, record=True, stderr=True)
    monkeypatch.setattr(console, "stderr", kept)
    return kept


def words(printed: str) -> set[str]:
    return set(printed.replace("│", " ").replace("┃", " ").split())


def test_no_word_is_broken_where_the_longest_of_each_column_fit(narrow: Console) -> None:
    columns = ["parameter", "value", "95 % interval", "unit", "status", "model had", "prior"]
    row = ["j2.stiffness", "at its bound: rigid fits best", "4.38 to 138", "1e6 N m/rad", "determined", "-", "-"]
    console.show_table("stage", columns, [row] * 7)
    assert words(" ".join([*columns, *row])) <= words(narrow.export_text())


def test_a_table_of_few_rows_that_is_too_wide_is_turned(narrow: Console) -> None:
    columns = [f"quantity{i}" for i in range(9)]
    console.show_table("turned", columns, [["recommended"] * 9, ["present"] * 9])
    printed = narrow.export_text()
    assert {"recommended", "present", *columns} <= words(printed)
    assert all(len(line) <= 80 for line in printed.splitlines())


def test_a_table_without_rows_and_one_with_a_giant_word_are_printed(narrow: Console) -> None:
    console.show_table("empty", ["x"], [])
    console.show_table("giant", ["name", "value"], [["a" * 200, "1"]])
    assert narrow.export_text().count("a" * 60) == 3
