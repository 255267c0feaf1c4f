"""Checks of single arguments: what passes, and what is said of the rest."""

from __future__ import annotations

import math

import pytest
from refusals import refuses

from robots import require_at_least, require_one_of, require_positive


def test_a_known_word_passes_and_another_is_refused_with_all_of_them() -> None:
    require_one_of("aim", "mean", ("mean", "worst"), code="X004")
    error = refuses(
        "X004", "", require_one_of, "aim", "wurst", {"mean": 1, "worst": 2}, code="X004", remedy="choose one"
    )
    assert (error.what, error.value) == ("aim", "wurst")
    assert (error.allowed, error.remedy) == ("mean, worst", "choose one")
    assert "Did you mean worst?" in str(error)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_number_that_is_not_above_zero_is_refused(value: float) -> None:
    refuses(
        "X004", r"tolerance: got .*; allowed: greater than 0 m$", require_positive, "tolerance", value, "m", code="X004"
    )


@pytest.mark.parametrize("value", [1, -math.inf, math.nan, math.inf])
def test_a_number_below_the_least_is_refused(value: float) -> None:
    refuses(
        "X004",
        r"steps: got .*; allowed: 2 or more. To fix it: take more",
        require_at_least,
        "steps",
        value,
        2,
        code="X004",
        remedy="take more",
    )


def test_numbers_within_pass_and_so_does_what_is_not_given() -> None:
    for value in (1e-300, 1e300, None):
        require_positive("scale", value, code="X004")
    for value in (0.0, 1e300, None):
        require_at_least("safety", value, 0.0, "m", code="X004")
