"""Corrections fade in before a cut and out behind it, and are whole within it."""

from __future__ import annotations

import numpy as np
import pytest

from machining.programs.compensation import ramped

FULL = np.array([0.6e-3, 0.0, 0.0])


def line(*x_mm: float) -> np.ndarray:
    return np.stack([np.array(x_mm) * 1e-3, np.zeros(len(x_mm)), np.zeros(len(x_mm))], axis=1)


def test_a_correction_fades_over_the_length_on_both_sides() -> None:
    points = line(0, 6, 8, 10, 20, 30, 31, 34, 40)
    milled = np.array([0, 0, 0, 0, 1, 1, 0, 0, 0]) > 0
    moved = np.where(milled[:, None], FULL, 0.0)
    found = ramped(moved, milled, points, 5e-3)
    # The cut begins at 10 mm: whole there, and 1 - d/5 mm before; it ends at 30 mm.
    np.testing.assert_allclose(found[:, 0] / FULL[0], [0, 0.2, 0.6, 1, 1, 1, 0.8, 0.2, 0], atol=1e-12)
    np.testing.assert_array_equal(ramped(moved, milled, points, 0.0), moved)


def test_two_cuts_that_are_near_share_the_way_between_them() -> None:
    points = line(0, 10, 12, 14, 24)
    milled = np.array([0, 1, 0, 0, 1]) > 0
    moved = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 1, 0]]) * 1e-3
    found = ramped(moved, milled, points, 5e-3) * 1e3
    # At 12 mm: 2 mm behind the first cut (0.6) and 2 mm before the second (0.6), so half of each.
    np.testing.assert_allclose(found[2], [0.5, 0.5, 0.0])
    # At 14 mm, where the second begins: 0.2 and 1, together 1.
    np.testing.assert_allclose(found[3], [0.2 / 1.2, 1.0 / 1.2, 0.0])
    # At no point more than the larger of the two: weights never add up to more than 1.
    assert np.linalg.norm(found, axis=1).max() <= 1.0 + 1e-12


@pytest.mark.parametrize("milled", [[True] * 3, [False] * 3])
def test_nothing_but_cuts_and_no_cut(milled: list[bool]) -> None:
    moved = np.ones((3, 3))
    found = ramped(moved, np.array(milled), line(0, 1, 2), 5e-3)
    np.testing.assert_array_equal(found, moved * np.array(milled)[:, None])
