"""CSV that a spreadsheet opens: no text becomes a formula, and all of it comes back."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.files.csv_text import as_read, cell, columns_text, records_text, rows_text

FORMULAS = ("=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", " =1", "\uff1d1", "=HYPERLINK(A1)", "-", "'=1")
NUMBERS = ("-5", "+5", "-1.5e-3", "-.5", "1", "")


@pytest.mark.parametrize("text", FORMULAS)
def test_a_formula_becomes_a_text(text: str) -> None:
    assert cell(text) == f"'{text}"
    assert as_read(cell(text)) == text


@pytest.mark.parametrize("text", [*NUMBERS, "pose 1", "'quoted'", "a=b", "'"])
def test_what_is_none_stays(text: str) -> None:
    assert cell(text) == text
    assert as_read(text) == text


def test_a_quoted_number_stays_a_text() -> None:
    # Somebody's '-5 is no reading: what cell never writes is not unwrapped.
    assert as_read("'-5") == "'-5"


@given(st.text(alphabet=st.sampled_from("'=+-@\t\r\n 1a.e"), max_size=6))
def test_every_text_comes_back(text: str) -> None:
    rows = list(csv.reader(io.StringIO(rows_text([[text, "x"]]), newline="")))
    assert [as_read(v) for v in rows[0]] == [text, "x"]
    assert cell(text)[:1] not in "=+-@\t\r" or cell(text) == "" or float(cell(text)) == float(text)


def test_numbers_keep_all_their_digits() -> None:
    values = (1, 0.1, -1e-300, np.float64(1 / 3), np.int64(-4), float("nan"), None, True, float("-inf"))
    assert rows_text([values]) == "1,0.1,-1e-300,0.3333333333333333,-4,,,True,-inf\n"


def test_records_and_columns() -> None:
    assert records_text([{"a": 1, "b": "=x"}, {"b": None, "c": 2.5}]) == "a,b,c\n1,'=x,\n,,2.5\n"
    assert columns_text({"=n": ["-a", "b"], "x": np.array([1 / 3, np.nan])}, digits=3) == "'=n,x\n'-a,0.333\nb,\n"


def test_nothing_else_writes_csv() -> None:
    root = Path(__file__).parents[3]
    packages = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
    files = [file for name in packages for file in (root / name).rglob("*.py") if file.name != "csv_text.py"]
    assert len(files) > 300
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert not any(word in text for word in ("csv.writer", "csv.DictWriter", "to_csv(", "to_excel(")), file
