"""Arcs as chords against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from machining.toolpaths import ArcError, arc_points
from machining.toolpaths.arcs import chord_count, sweep_about

TOL = {"chord_tolerance": 2e-6, "arc_tolerance": 1e-5}


@pytest.mark.parametrize("radius", [1e-4, 1e-3, 0.01, 0.3, 5.0])
@pytest.mark.parametrize("tolerance", [1e-7, 2e-6, 1e-4])
def test_chords_stay_within_the_tolerance_and_use_it(radius: float, tolerance: float) -> None:
    count = chord_count(2 * math.pi, radius, tolerance)

    def sagitta(n: float) -> float:
        return radius * (1 - math.cos(math.pi / n))

    # 1e-9 of slack in the count, and rounding of 1 - cos.
    assert sagitta(count) <= tolerance * (1 + 1e-6) + 1e-15
    assert count == 8 or sagitta(count - 1) > tolerance * (1 - 1e-6)


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3), [[1.0, 1.0, 1.0]], [[0.0, -3.0, 4.0]]]).tolist())
@pytest.mark.parametrize("sweep", [0.01, 1.0, math.pi, 4.0, 6.28, 2 * math.pi])
def test_points_of_an_arc_and_a_helix_are_those_of_the_closed_form(axis: list[float], sweep: float) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    e1 = np.cross(unit, [0.3, 0.5, -0.7])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(unit, e1)
    c, r, rise = np.array([0.1, -0.2, 0.3]), 0.05, 0.013
    # The exact end: at a full turn cos and sin leave 1e-17, which must not count as another full turn.
    end = c + r * (math.cos(sweep) * e1 + math.sin(sweep) * e2) + rise * unit
    if sweep == 2 * math.pi:
        end = c + r * e1 + rise * unit
    fraction, points = arc_points(c + r * e1, end, c, axis, **TOL)
    angle = sweep * fraction[:, None]
    expected = c + r * (np.cos(angle) * e1 + np.sin(angle) * e2) + rise * fraction[:, None] * unit
    # Rounding of coordinates of 0.3 m through a handful of products.
    np.testing.assert_allclose(points, expected, atol=1e-14)
    assert (points[-1] == end).all()
    assert fraction[-1] == 1.0


def test_more_turns_make_a_longer_helix() -> None:
    _, one = arc_points([0.01, 0, 0], [0.01, 0, 0.004], [0, 0, 0], [0, 0, 1], **TOL)
    _, four = arc_points([0.01, 0, 0], [0.01, 0, 0.004], [0, 0, 0], [0, 0, 1], turns=4, **TOL)
    chain = np.vstack([[0.01, 0, 0], four])
    length = np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()
    assert len(four) == pytest.approx(4 * len(one), abs=4)
    # The chords fall short of the helix by tolerance / radius, 2e-4, at most.
    assert length == pytest.approx(math.hypot(4 * 2 * math.pi * 0.01, 0.004), rel=2e-4)


def test_radii_that_differ_within_the_tolerance_are_blended() -> None:
    _, points = arc_points([0.01, 0, 0], [0, 0.010008, 0], [0, 0, 0], [0, 0, 1], **TOL)
    radii = np.linalg.norm(points, axis=1)
    assert (np.diff(radii) > 0).all()
    assert radii[-1] == pytest.approx(0.010008, abs=1e-15)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"end": [0, 0.0101, 0]}, "one circle"),
        ({"radius": 0.0102}, "one circle"),
        ({"center": [0.01, 0, 0]}, "centre"),
        ({"axis": [0, 0, 0]}, "axis"),
        ({"end": [0, math.nan, 0]}, "arc"),
        ({"end": [0, 1e300, 0]}, "arc"),
        ({"limit": 10}, "chords|arc"),
    ],
)
def test_arcs_that_do_not_exist_are_refused(change: dict[str, object], word: str) -> None:
    arc: dict[str, object] = {"start": [0.01, 0, 0], "end": [0, 0.01, 0], "center": [0, 0, 0], "axis": [0, 0, 1]}
    with pytest.raises(ArcError, match=word):
        arc_points(**(arc | TOL | change))  # type: ignore[arg-type]


@settings(max_examples=60, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(1e-2, 2 * math.pi - 1e-2), st.floats(1e-4, 10.0), st.integers(0, 2))
def test_sweep_and_its_reverse_make_a_full_turn(first: float, sweep: float, radius: float, plane: int) -> None:
    # Chords of at least 1 um: shorter ones than CLOSED are full turns.
    u, v = np.eye(3)[(plane + 1) % 3], np.eye(3)[(plane + 2) % 3]
    start = radius * (math.cos(first) * u + math.sin(first) * v)
    end = radius * (math.cos(first + sweep) * u + math.sin(first + sweep) * v)
    there = sweep_about(start, end, np.zeros(3), np.eye(3)[plane])
    back = sweep_about(start, end, np.zeros(3), -np.eye(3)[plane])
    assert there == pytest.approx(sweep, abs=1e-9)
    assert there + back == pytest.approx(2 * math.pi, abs=1e-9)
