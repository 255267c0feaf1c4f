"""A placement carried over to all moves of its source: axes travel on rapid moves, not while the tool plunges."""

from __future__ import annotations

import numpy as np

from machining.placement import Placement


def placement(moves: list[int], count: int, travel: list[float]) -> Placement:
    n = len(moves)
    return Placement(
        "kr60-3",
        "cell",
        ("rail",),
        np.array(travel)[:, None],
        0.0,
        np.zeros(n),
        ("q1_deg",),
        np.zeros((n, 1)),
        np.array(moves),
        count,
    )


def test_axes_travel_on_the_rapid_moves_between_two_cuts() -> None:
    """A cut to move 2, retract at feed, two rapid moves, a plunge to move 6 where the next cut begins."""
    found = placement([1, 2, 6, 7], 9, [0.0, 0.1, 0.5, 0.6])
    rapid = np.array([1, 0, 0, 0, 1, 1, 0, 0, 1]) > 0
    np.testing.assert_allclose(found.at_moves(rapid)[:, 0], [0, 0, 0.1, 0.1, 0.3, 0.5, 0.5, 0.6, 0.6])
    # Without a rapid move, or without knowing, all share.
    for unknown in (None, np.zeros(9, dtype=np.bool_)):
        np.testing.assert_allclose(found.at_moves(unknown)[:, 0], [0, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6])
    assert found.joints_at_moves(rapid).shape == (9, 1)
    np.testing.assert_array_equal(found.gamma_at_moves(rapid), np.zeros(9))


def test_a_cell_without_linear_axes_has_no_travels() -> None:
    found = placement([0, 1], 2, [0.0, 0.0])
    none = Placement(
        found.robot, found.cell, (), np.zeros((2, 0)), 0.0, found.gamma, found.joints, found.q, found.moves, 2
    )
    assert none.at_moves(np.ones(2, dtype=np.bool_)).shape == (2, 0)
