"""Arcs as chords against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from machining.toolpaths import ArcError, Motions, ReadOptions, arc_points, read_toolpath
from machining.toolpaths.arcs import chord_count, sweep_about
from robots.arrays import Array

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


# ------------------------------------------------------------
# Splines of LinuxCNC against own evaluation: Bezier curves by their polynomials, NURBS by the recursion of Cox

HEAD = "G21 G17 G90 G94\nG0 X0 Y0 Z0\n"


def read(folder: Path, text: str, name: str = "program.ngc") -> Motions:
    """The program as it is read."""
    (folder / name).write_text(f"{HEAD}F500\n{text}\nM2\n")
    return read_toolpath(folder / name, options=ReadOptions())


def farthest(points: Array, curve: Array) -> float:
    """Farthest mm that a point of a densely sampled curve lies from the chords through ``points``."""
    ends, way = points[:-1], np.diff(points, axis=0)
    off = curve[:, None] - ends
    share = np.clip((off * way).sum(2) / np.maximum((way * way).sum(1), 1e-300), 0, 1)
    return float(np.linalg.norm(off - share[..., None] * way, axis=2).min(1).max())


def bezier(*control: tuple[float, float]) -> Array:
    """A Bezier curve of degree 2 or 3, by its polynomial."""
    t, p = np.linspace(0, 1, 3001)[:, None], np.array(control, dtype=float)
    if len(p) == 3:
        return (1 - t) ** 2 * p[0] + 2 * t * (1 - t) * p[1] + t**2 * p[2]
    return (1 - t) ** 3 * p[0] + 3 * t * (1 - t) ** 2 * p[1] + 3 * t**2 * (1 - t) * p[2] + t**3 * p[3]


def basis(i: int, k: int, u: float, knots: list[int]) -> float:
    """B-spline of order k by recursion."""
    if k == 1:
        return float(knots[i] <= u < knots[i + 1])
    left, right = knots[i + k - 1] - knots[i], knots[i + k] - knots[i + 1]
    out = (u - knots[i]) / left * basis(i, k - 1, u, knots) if left else 0.0
    return out + ((knots[i + k] - u) / right * basis(i + 1, k - 1, u, knots) if right else 0.0)


def nurbs(control: list[tuple[float, float]], weights: list[float], order: int) -> Array:
    """A NURBS with the knots that the manual has: 0, 1, 2, ..., the ends as often as the order."""
    spans = len(control) - order + 1
    knots = [0] * order + list(range(1, spans)) + [spans] * order
    out = []
    for u in np.linspace(0, spans - 1e-9, 2001):
        share = np.array([basis(i, order, u, knots) for i in range(len(control))]) * weights
        out.append(share @ np.array(control) / share.sum())
    return np.array(out)


@pytest.mark.parametrize(
    ("text", "curves"),
    [
        ("G5 X10 Y5 I0 J8 P-3 Q4", [bezier((0, 0), (0, 8), (7, 9), (10, 5))]),
        (
            "G5 X10 Y5 I0 J8 P-3 Q4\nX20 Y0 P0 Q6",
            [bezier((0, 0), (0, 8), (7, 9), (10, 5)), bezier((10, 5), (13, 1), (20, 6), (20, 0))],
        ),
        ("G5.1 X10 Y0 I5 J9", [bezier((0, 0), (5, 9), (10, 0))]),
        ("G91 G5.1 X10 Y0 J9\nG90", [bezier((0, 0), (0, 9), (10, 0))]),
        (
            "G5.2 P1 L3\nX0 Y1 P1\nX2 Y2 P1\nX2 Y0 P1\nX0 Y0 P2\nG5.3",
            [nurbs([(0, 0), (0, 1), (2, 2), (2, 0), (0, 0)], [1, 1, 1, 1, 2], 3)],
        ),
        (
            "G5.2 X4 Y6 P3 L4\nX8 Y-6 P.5\nX12 Y3\nX15 Y0 P2\nG5.3",
            [nurbs([(0, 0), (4, 6), (8, -6), (12, 3), (15, 0)], [1, 3, 0.5, 1, 2], 4)],
        ),
    ],
)
def test_splines_lie_on_their_curves(text: str, curves: list[Array], tmp_path: Path) -> None:
    m = read(tmp_path, text)
    points, curve = 1e3 * m.points[:, :2], np.vstack(curves)
    # Chords within 2 um of the curve, and their ends on it: samples are at most 0.02 mm apart.
    assert farthest(points, curve) < 2.1e-3
    assert farthest(curve, points) < 1e-4
    np.testing.assert_allclose(points[-1], curve[-1], atol=1e-7)
    np.testing.assert_allclose(60e3 * m.feed[1:], 500)


def test_a_curve_in_another_plane(tmp_path: Path) -> None:
    m = read(tmp_path, "G18 G5.2 L3\nZ0 X1\nZ2 X2\nZ2 X0\nG5.3\nG17")
    curve = nurbs([(0, 0), (0, 1), (2, 2), (2, 0)], [1, 1, 1, 1], 3)
    assert farthest(1e3 * m.points[:, [2, 0]], curve) < 2.1e-3
    assert not m.points[:, 1].any()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("G5 X10 Y5 P-3 Q4", "without its points"),
        ("G5 X10 Y5 I1 P-3 Q4", "without its points"),
        ("G5 X10 Y5 I0 J8", "without its points"),
        ("G5 X10 Y5 Z1 I0 J8 P-3 Q4", "out of X Y"),
        ("G18 G5.1 X10 Y0 I5 J9", "out of X Y"),
        ("G5.1 X10 Y0", "without its points"),
        ("G5.2 L3\nX1 P1\nG5.3", "both coordinates"),
        ("G5.2 L3\nX1 Y1 Z1 P1\nG5.3", "out of its plane"),
        ("G5.2 L3\nX1 Y1 P1\nG5.3", "order 3 by 2 points"),
        ("G5.2 L2\nX1 Y1 P-1\nG5.3", "weights above 0"),
        ("G5.2 L2\nX1 Y1\nG1 X5\nG5.3", "between G5.2 and G5.3"),
        ("G5.2 L2\nX1 Y1", "without G5.3"),
        ("G5.3", "both coordinates"),
        ("G5 X10 Y5 I0 J8 P-3 Q4 R2", "R has no meaning"),
    ],
)
def test_a_spline_that_is_none_is_refused_by_line(text: str, why: str, tmp_path: Path) -> None:
    refuses("P011 P020", rf"line \d+: .*{why}", read, tmp_path, text)


@pytest.mark.parametrize("name", ["program.nc", "program.mpf"])
def test_other_controls_may_mean_something_else(name: str, tmp_path: Path) -> None:
    refuses("P019", r"line 4: G5\.1: .*LinuxCNC", read, tmp_path, "G5.1 X10 Y0 I5 J9", name)
