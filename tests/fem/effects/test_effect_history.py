"""The play operator over load cycles against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from fem.effects import History, plain_history


def test_play_against_its_closed_form_up_and_down() -> None:
    x = np.array([1.0, 3.0, 6.0, 3.0, 1.0, 0.0])
    h = History(np.zeros(6, dtype=np.intp), np.arange(6), np.full(6, np.nan), is_known=True)
    r = 2.0
    # Up: x - r above zero; down: the largest until x + r falls below it.
    np.testing.assert_allclose(h.play(x, r), [0.0, 1.0, 4.0, 4.0, 3.0, 2.0])


def test_cycles_do_not_know_one_another() -> None:
    x = np.array([5.0, 1.0, 5.0, 1.0])
    apart = History(np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]), np.full(4, np.nan), is_known=True)
    np.testing.assert_allclose(apart.play(x, 1.0), [4.0, 0.0, 4.0, 2.0])


def test_rows_in_any_order_give_the_same(rng: np.random.Generator) -> None:
    x, cycle, order = rng.normal(size=40), np.repeat(np.arange(5), 8), np.tile(np.arange(8), 5)
    whole = History(cycle, order, np.full(40, np.nan), is_known=True)
    mixed = rng.permutation(40)
    shuffled = History(cycle[mixed], order[mixed], np.full(40, np.nan), is_known=True)
    np.testing.assert_array_equal(whole.play(x, 0.3)[mixed], shuffled.play(x[mixed], 0.3))


def test_play_is_odd_and_scales(rng: np.random.Generator) -> None:
    x = rng.normal(size=30)
    h = History(np.zeros(30, dtype=np.intp), np.arange(30), np.full(30, np.nan), is_known=True)
    y = h.play(x, 0.4)
    np.testing.assert_allclose(h.play(-x, 0.4), -y)
    np.testing.assert_allclose(h.play(3.0 * x, 1.2), 3.0 * y, rtol=1e-12)
    assert np.abs(x - y).max() <= 0.4 + 1e-15


def test_plain_history_is_a_dead_zone() -> None:
    x = np.array([-3.0, -0.5, 0.5, 2.0])
    np.testing.assert_allclose(plain_history(4).play(x, 1.0), [-2.0, 0.0, 0.0, 1.0])


def test_whole_cycles_taken_out_keep_what_they_remember() -> None:
    x = np.array([4.0, 1.0, 7.0, 2.0])
    h = History(np.array([3, 3, 8, 8]), np.array([0, 1, 0, 1]), np.linspace(0.0, 1.0, 4), is_known=True)
    rows = np.array([2, 3])
    assert h.take(rows).play(x[rows], 1.0) == pytest.approx(h.play(x, 1.0)[rows])
    np.testing.assert_array_equal(h.take(rows).clock, h.clock[rows])
