"""K_sf (eq. 4 of the TX200 paper): closed form, units, weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from machining.stiffness.criterion import Criterion


def test_the_published_formula_by_hand() -> None:
    """Three points of 100, 200, 300 N/mm: sum k^2 = 140000, mean^4 = 200^4."""
    terms = Criterion(1e-4, 1e-9).terms(np.array([1e5, 2e5, 3e5]))
    assert terms.squares == pytest.approx(14.0, rel=1e-14)
    assert terms.mean == pytest.approx(1.6, rel=1e-14)
    assert terms.value == pytest.approx(15.6, rel=1e-14)


def test_comparable_weights_make_both_terms_one() -> None:
    criterion = Criterion.comparable(7.3e5, 40)
    terms = criterion.terms(np.full((2, 40), 7.3e5))
    np.testing.assert_allclose(terms.squares, 1.0, rtol=1e-14)
    np.testing.assert_allclose(terms.mean, 1.0, rtol=1e-14)
    # mm^2/N^2 and mm^4/N^4 for 730 N/mm.
    assert criterion.alpha == pytest.approx(1.0 / (40 * 730.0**2))
    assert criterion.beta == pytest.approx(1.0 / 730.0**4)


@given(st.lists(st.floats(1e4, 1e7), min_size=1, max_size=20))
def test_points_taken_twice_double_the_sum_only(stiffness: list[float]) -> None:
    criterion, k = Criterion(1e-6, 1e-12), np.array(stiffness)
    once, twice = criterion.terms(k), criterion.terms(np.repeat(k, 2))
    np.testing.assert_allclose(twice.squares, 2.0 * once.squares, rtol=1e-12)
    np.testing.assert_allclose(twice.mean, once.mean, rtol=1e-12)


def test_shares_undo_dense_sampling() -> None:
    """A stretch sampled ten times as densely counts the same by length."""
    criterion = Criterion(1e-6, 1e-12)
    even = np.array([1e5, 5e5])
    dense = np.array([1e5] * 10 + [5e5])
    share = np.array([0.05] * 10 + [0.5])
    expected = criterion.value(even)
    assert criterion.value(dense, share, 2) == pytest.approx(expected, rel=1e-12)
    assert abs(float(criterion.value(dense)) - float(expected)) > 0.1 * float(expected)


def test_even_shares_are_the_paper_s_sum() -> None:
    criterion, k = Criterion(2e-6, 3e-12), np.array([1e5, 2e5, 4e5])
    assert criterion.value(k, np.full(3, 1.0 / 3.0)) == pytest.approx(float(criterion.value(k)), rel=1e-14)


def test_the_slope_is_the_derivative() -> None:
    criterion = Criterion(0.0, 1e-12)
    step = 1.0  # N/m
    up, down = (float(criterion.terms(np.array([4e5 + s])).mean) for s in (step, -step))
    # Per N/mm; central difference, error of order (step / k)^2.
    assert criterion.slope(4e5) == pytest.approx((up - down) / (2e-3 * step), rel=1e-8)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Criterion(-1.0, 1.0), "weight alpha of K_sf: got -1.0; allowed: 0 or more"),
        (lambda: Criterion(1.0, float("nan")), "weight beta"),
        (lambda: Criterion(0.0, 0.0), "both 0"),
        (lambda: Criterion.comparable(0.0, 3), "stiffness of reference"),
        (lambda: Criterion.comparable(1e5, 0), "points of the path"),
        (lambda: Criterion(1.0, 1.0).value(np.array([1e5, -1.0])), "stiffness along the path"),
        (lambda: Criterion(1.0, 1.0).value(np.zeros(0)), "stiffness along the path"),
        (lambda: Criterion(1.0, 1.0).value(np.array([1e5, 1e5]), np.array([0.5, 0.6])), "adding up to 1"),
    ],
)
def test_bad_input(make: object, words: str) -> None:
    refuses("G004", words, make)
