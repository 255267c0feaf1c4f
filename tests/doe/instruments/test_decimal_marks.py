"""Which mark is the decimal one: by cells that have one reading only, never by what looks likely."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from doe.instruments.figures import decimal_mark, figure, is_number
from doe.tables.workbook import Figure


def mark(*cells: str, asked: str | None = None) -> str:
    return decimal_mark(list(enumerate(cells, 1)), "f", asked)[0]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("1.5", "2"), "point"),
        (("1,5", "2"), "comma"),
        (("0,123", "5"), "comma"),
        (("1234,567",), "comma"),
        (("1.234",), "point"),
        (("12", "7"), "point"),
        (("1,234.5",), "point"),
        (("1.234,5", "1.234"), "comma"),
        (("1,234,567", "1,234"), "point"),
        (("-0,250",), "comma"),
        (("1500.25",), "point"),
        (("\u22121,5",), "comma"),
        (("1'234.5",), "point"),
        (("1 234,5",), "comma"),
        (("3,5e-3",), "comma"),
    ],
)
def test_numbers_that_settle_it(cells: tuple[str, ...], expected: str) -> None:
    assert mark(*cells) == expected


@pytest.mark.parametrize(
    "cells",
    [("1,234",), ("1,234", "12,500"), ("1.5", "2,5"), ("1500.25", "1,234"), ("1,5", "1.234"), ("1,234", "7")],
)
def test_numbers_that_do_not_settle_it_are_asked_about(cells: tuple[str, ...]) -> None:
    refused = refuses("I003", "", mark, *cells)
    assert "--decimal" in str(refused) or "one decimal mark" in str(refused)


def test_what_is_asked_for_is_taken() -> None:
    assert mark("1,234", asked="comma") == "comma"
    refuses("I003", "--decimal", mark, "1", asked="dot")


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [
        ("1,234.5", "point", 1234.5),
        ("1.234,5", "comma", 1234.5),
        ("1,234", "comma", 1.234),
        ("1,234", "point", 1234.0),
        ("\u22122,5", "comma", -2.5),
        ("1'234.5", "point", 1234.5),
        ("12 345,5", "comma", 12345.5),
        (".5", "point", 0.5),
        ("3,5e-3", "comma", 0.0035),
        ("+7", "comma", 7.0),
    ],
)
def test_figures(cell: str, decimal: str, value: float) -> None:
    assert figure(cell, decimal) == value  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("cell", "decimal"),
    [
        ("1,5", "point"),
        ("1.5", "comma"),
        ("1,23,456", "point"),
        ("12.05.2026", "point"),
        ("1e99", "point"),
        ("5 mm", "point"),
        ("", "point"),
        ("1,2,3", "comma"),
        ("0x10", "point"),
        ("1_000", "point"),
        ("inf", "point"),
        ("\u0661", "point"),
    ],
)
def test_what_is_no_number_is_refused(cell: str, decimal: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        figure(cell, decimal)  # type: ignore[arg-type]


def test_a_number_of_a_workbook_has_no_mark_to_find() -> None:
    assert mark(Figure("1.5"), "2,5") == "comma"
    assert figure(Figure("1.5"), "comma") == 1.5


@pytest.mark.parametrize("cell", ["12.05.2026", "10:22", "A1", "", "-", "1.2.3", "2026-05-12", "1,2,3,4"])
def test_dates_and_words_are_no_numbers(cell: str) -> None:
    assert not is_number(cell)


@given(st.floats(-1e6, 1e6), st.integers(0, 8))
def test_a_number_comes_back_in_both_marks(value: float, digits: int) -> None:
    text = f"{value:.{digits}f}"
    # Digits of a text with up to eight decimals: the same text gives the same number.
    assert figure(text, "point") == float(text) == figure(text.replace(".", ","), "comma")
    with_groups = f"{value:,.{digits}f}"
    assert figure(with_groups, "point") == float(text)
