"""Corners between lines and arcs, judged by what a rounding is: tangent to both sides, everywhere at its radius."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from machining.toolpaths import Motions, ReadOptions, read_toolpath
from robots.arrays import Array

# What stands at the corner (20, 0): coming from (0, 0) or so, going on. As (end, centre or None, sense):
# straight, or about a centre, 1 counter-clockwise.
INTO: dict[str, tuple[tuple[float, float], tuple[float, float] | None, int]] = {
    "line": ((0, 0), None, 0),
    "left": ((0, 0), (10, 9), 1),
    "right": ((0, 0), (10, -10), -1),
    "flat left": ((0, 0), (10, 3), 1),
}
OUT: dict[str, tuple[tuple[float, float], tuple[float, float] | None, int]] = {
    "line": ((38, 9), None, 0),
    "line up": ((18, 25), None, 0),
    "left": ((32, 18), (17, 15), 1),
    "right": ((35, 15), (35, 0), -1),
    "outside": ((30, 30), (25, 15), 1),
}
# The chords' tolerance of 2 um and the six decimals of the files, mm.
CHORDS = 2.1e-3


def program(ending: str, into: str, out: str, radius: float) -> str:
    """The corner in a language: Fanuc's ,R, Siemens' RND, Heidenhain's RND."""
    start, first, turn = INTO[into]
    end, second, then = OUT[out]
    texts = []
    for at, to, centre, sense in ((start, (20, 0), first, turn), ((20, 0), end, second, then)):
        x, y = to
        if ending == "h":
            texts.append(
                f"L X{x:+} Y{y:+}"
                if centre is None
                else f"CC X{centre[0]:+} Y{centre[1]:+}\nC X{x:+} Y{y:+} DR{'+' if sense > 0 else '-'}"
            )
        else:
            about = "" if centre is None else f" I{centre[0] - at[0]} J{centre[1] - at[1]}"
            texts.append(f"G{1 if centre is None else 3 if sense > 0 else 2} X{x} Y{y}{about}")
    if ending == "h":
        head = f"BEGIN PGM A MM\nTOOL CALL 1 Z S1000\nL X{start[0]:+} Y{start[1]:+} Z+0 FMAX\nL Z-1 F500\n"
        return f"{head}{texts[0]}\nRND R{radius}\n{texts[1]}\nL Z+5 FMAX\nEND PGM A MM\n"
    word = f",R{radius}" if ending == "nc" else f"RND={radius}"
    head = f"G21 G17 G90 G94\nG0 X{start[0]} Y{start[1]} Z0\nG1 Z-1 F500\n"
    return f"{head}{texts[0]} {word}\n{texts[1]}\nG0 Z5\nM30\n"


def read(folder: Path, ending: str, text: str) -> Motions:
    """The program as it is read."""
    file = folder / f"program.{ending}"
    file.write_text(text)
    return read_toolpath(file, kind="heidenhain" if ending == "h" else "gcode", options=ReadOptions())


def off(
    points: Array, start: tuple[float, float], end: tuple[float, float], centre: tuple[float, float] | None
) -> Array:
    """Distance mm of points (n, 2) from a line or a circle."""
    if centre is not None:
        return np.abs(np.hypot(*(points - centre).T) - math.dist(start, centre))
    (x, y), (u, v) = start, np.subtract(end, start) / math.dist(start, end)
    return np.abs((points[:, 0] - x) * v - (points[:, 1] - y) * u)


@pytest.mark.parametrize("ending", ["nc", "mpf", "h"])
@pytest.mark.parametrize(("into", "out"), itertools.product(INTO, OUT))
def test_a_rounding_touches_both_sides_and_keeps_its_radius(ending: str, into: str, out: str, tmp_path: Path) -> None:
    radius = 1.5
    m = read(tmp_path, ending, program(ending, into, out, radius))
    points = 1e3 * m.points[2:-1, :2]
    (start, first, _), (end, second, _) = INTO[into], OUT[out]
    on_first = off(points, start, (20, 0), first) < 1e-5
    on_second = off(points, (20, 0), end, second) < 1e-5
    # The rounding is what is on neither side, with its two ends.
    inside = np.flatnonzero(~on_first & ~on_second)
    assert len(inside) >= 2
    assert (np.diff(inside) == 1).all()
    a, b = inside[0] - 1, inside[-1] + 1
    assert on_first[: a + 1].all()
    assert on_second[b:].all()
    assert math.dist(points[-1], end) < 1e-9
    # Its circle by three of its points, on which all others lie.
    p, q, r = points[[a, (a + b) // 2, b]]
    centre = np.linalg.solve(2.0 * np.array([q - p, r - p]), [q @ q - p @ p, r @ r - p @ p])
    np.testing.assert_allclose(np.hypot(*(points[a : b + 1] - centre).T), radius, atol=1e-6)
    # A circle tangent to a line is at its radius from it; to a circle, at the sum or difference of both radii.
    for one, other, about in ((start, (20, 0), first), ((20, 0), end, second)):
        if about is None:
            assert float(off(centre[None], one, other, None)[0]) == pytest.approx(radius, abs=1e-6)
        else:
            apart, size = math.dist(centre, about), math.dist(one, about)
            assert min(abs(apart - size - radius), abs(apart - abs(size - radius))) < 1e-6
    # No kink that a chord of the tolerance does not explain.
    way = np.diff(np.vstack([start, points]), axis=0)
    size = np.hypot(*way.T)
    turn = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(way[:, 1], way[:, 0])))))
    smallest = min([radius, *(math.dist(one, about) for one, about in ((start, first), (end, second)) if about)])
    widest = 4.0 * math.asin(math.sqrt(CHORDS / (2.0 * smallest)))
    assert turn[(size[1:] > 1e-6) & (size[:-1] > 1e-6)].max() < 1.01 * widest


@pytest.mark.parametrize(
    ("ending", "text", "why"),
    [
        ("nc", "G1 X20 ,C2\nG2 X30 Y-10 I10 J0", "controls differ"),
        ("mpf", "G3 X20 Y0 I10 J10 CHR=2\nG1 Y10", "controls differ"),
        ("nc", "G1 X20 ,R2\nG3 X20 Y20 I0 J10", "no corner"),
        ("nc", "G1 X20 ,R2\nG3 X30 Y10 Z-3 I10 J0", "not in the plane"),
        ("nc", "G1 X20 ,R300\nG2 X30 Y10 I10 J0", "too large"),
        ("nc", "G2 X20 Y0 I10 J0 ,R2\nG0 Y10", "without an element"),
        ("nc", "G1 X20 ,R2\nG18 G2 X30 Z10 I10 K0\nG17", "one plane"),
    ],
)
def test_a_corner_that_is_none_is_refused_by_line(ending: str, text: str, why: str, tmp_path: Path) -> None:
    refuses(
        "P021",
        rf"program.{ending}, line \d+: .*{why}",
        read,
        tmp_path,
        ending,
        f"G21 G17 G90 G94\nG0 X0 Y0 Z0\nG1 Z-1 F500\n{text}\nG0 Z5\nM30\n",
    )


def test_commands_of_the_second_side_come_behind_the_corner(tmp_path: Path) -> None:
    m = read(tmp_path, "nc", "G21 G90\nG0 X0 Y0 Z0\nG1 X20 F500 ,R5\nY20 M8 F200\nX0 M9\nM30\n")
    (on,) = (event.move for event in m.events if event.text == "flood")
    np.testing.assert_allclose(1e3 * m.points[[on - 1, on]], [[20, 5, 0], [20, 20, 0]], atol=1e-9)
    np.testing.assert_allclose(60e3 * m.feed[[on - 1, on]], [500, 200])
