"""One way of writing numbers on every page and picture."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from figure_texts import texts

from robots.quantities import known_to, ranged, significant
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.numbers import typeset, typeset_cell
from stiffarm.pages.style import save_png


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("1e-06 mm", "10⁻⁶ mm"),
        ("1.50e+05 N m/rad", "1.5·10⁵ N m/rad"),
        ("2e-15", "2·10⁻¹⁵"),
        ("1.35e+03 um/kN", "1,350 µm/kN"),
        ("10^5 and 10^-3, kg/m^3", "10⁵ and 10⁻³, kg/m³"),
        ("5328 to 80564 N/mm", "5,328 to 80,564 N/mm"),
        ("44717 N/mm +- 90 %", "44,717 N/mm ± 90 %"),
        ("-3 um, (-90 to 90)", "−3 µm, (−90 to 90)"),
        (">= 0.5", "≥ 0.5"),
        # What looks alike and is none.
        ("q2_deg=-70", "q2_deg=-70"),
        ("0,0,-1", "0,0,-1"),
        ("2026-11-23", "2026-11-23"),
        ("ISO 9283", "ISO 9283"),
        ("2b25cffc494d, 12e45678ab", "2b25cffc494d, 12e45678ab"),
        ("pose 1234 of 2008", "pose 1234 of 2008"),
    ],
)
def test_numbers_in_texts(given: str, shown: str) -> None:
    assert typeset(given) == shown
    assert typeset(shown) == shown, "once is enough"


def test_a_cell_is_a_number_without_a_unit() -> None:
    assert [typeset_cell(v) for v in ("12500", "-1234.5", "999", "abc1234")] == ["12,500", "−1,234.5", "999", "abc1234"]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (12345.0, "12,300"),
        (999.6, "1,000"),
        (0.01234, "0.0123"),
        (-4.5, "−4.50"),
        (2e-15, "2·10⁻¹⁵"),
        (0.0, "0"),
        (math.nan, "–"),
        (math.inf, "∞"),
    ],
)
def test_significant_digits(value: float, shown: str) -> None:
    assert significant(value) == shown


def test_digits_that_the_interval_leaves() -> None:
    assert known_to(44717.0, 20000.0, 90000.0) == "45,000"
    assert known_to(1234.5, 1200.0, 1260.0) == "1,230"
    assert (known_to(495.9, 491.5, 500.3), ranged(491.5, 500.3)) == ("496", "492 to 500")
    assert known_to(44717.0, math.nan, math.nan) == "45,000"
    assert ranged(228.4, 331.2, "N/mm") == "230 to 330 N/mm"
    assert ranged(0.823, 4.91) == "0.82 to 4.9"
    assert ranged(230.1, 230.4) == "230.10 to 230.40"
    assert ranged(55.0, math.inf, "N/mm") == "at least 55 N/mm"


def test_pictures_write_as_pages_do(tmp_path: Path) -> None:
    with drawing("2e-05 at -3 um", "single") as (figure, (ax,)):
        ax.plot([-20000.0, 20000.0], [0.0, 3.0])
    save_png(figure, tmp_path / "one.png")
    seen = [one.text for one in texts(figure)]
    assert "2·10⁻⁵ at −3 µm" in seen
    assert {"−20,000", "10,000"} <= set(seen)
