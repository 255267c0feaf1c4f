"""Retracts of all languages: heights, tilted axes, tools, commands in their order, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses_each
from toolpath_cases import apt, gcode

from machining.toolpaths import Motions, ReadOptions, read_heidenhain
from machining.toolpaths.events import added, ordered
from machining.toolpaths.motions import Tool
from machining.toolpaths.recorder import Recorder
from machining.toolpaths.selection import select
from robots.arrays import Array

START = "G90 G54\nG0 X0 Y0 Z15\nG1 Z-5 F600\nX20\n"


def points(m: Motions) -> list[list[float]]:
    return np.round(m.points * 1e3, 9).tolist()


def klartext(tmp_path: Path, *lines: str, **options: object) -> Motions:
    path = tmp_path / "a.h"
    path.write_text("\n".join(["BEGIN PGM A MM", "TOOL CALL 1 Z S900", *lines, "END PGM A MM"]))
    return read_heidenhain(path, ReadOptions(**options))  # type: ignore[arg-type]


def test_each_move_has_the_line_and_the_place_of_its_own(tmp_path: Path) -> None:
    m = gcode(tmp_path, START + "G53 G0 Z0\nG0 X80 Y40\nX90\nG43 H1 Z5\nG1 Z-5\nM30\n")
    assert points(m)[2:] == [[20, 0, -5], [20, 0, 25], [80, 40, 25], [90, 40, 25], [90, 40, 5], [90, 40, -5]]
    assert m.line[3:].tolist() == [6, 7, 8, 9, 10]
    assert m.rapid[3:].tolist() == [True] * 4 + [False]
    assert np.isnan(m.feed[3:7]).all()
    (note,) = [n for n in m.notes if "retract" in n.text]
    assert (note.line, "25 mm" in note.text, "G53" in note.text) == (6, True, True)


@pytest.mark.parametrize(
    ("height", "wanted"),
    [
        (0.040, 40.0),
        (0.015, 15.0),
        # A rapid move at 50 is above it: the tool does not go down to go across.
        (0.020, 20.0),
    ],
)
def test_the_height_as_it_is_told(tmp_path: Path, height: float, wanted: float) -> None:
    m = gcode(tmp_path, START + "G53 G0 Z0\nG0 X80 Y40\nZ5\nM30\n", retract=height)
    assert points(m)[3:] == [[20, 0, wanted], [80, 40, wanted], [80, 40, 5]]
    high = gcode(tmp_path, "G0 X0 Y0 Z50\nG28 G91 Z0\nG90 G0 X80\nZ5\nM30\n", retract=0.020)
    assert points(high) == [[0, 0, 50], [0, 0, 50], [80, 0, 50], [80, 0, 5]]


def test_a_height_within_the_cut_is_refused(tmp_path: Path) -> None:
    # Feed begins at 15 here, and 15.001 is above it.
    refused = refuses_each("P004", "", gcode, tmp_path, START + "G53 G0 Z0\nG0 X80 Y40\nZ5\nM30\n", retract=0.0149)
    assert refused.errors[0].value == "14.9"
    assert "15" in str(refused.errors[0].allowed)
    # Without a retract it is no matter.
    assert gcode(tmp_path, START + "M30\n", retract=0.001).n == 3


def test_nothing_before_it_and_nothing_behind_it(tmp_path: Path) -> None:
    head = "G53 G0 Z0\nG28 G91 Z0\nG28 X0 Y0\nG90\n"
    m = gcode(tmp_path, head + "G0 X0 Y0\nG43 H1 Z15\nG1 Z-5 F600\nG0 G53 Z0\nG0 G53 X0 Y0\nM30\n")
    assert points(m) == [[0, 0, 15], [0, 0, -5], [0, 0, 25]]


@pytest.mark.parametrize("machine", ["G53 G0 Z0", "G28 G91 Z0", "G91 G30 P2 Z0", "G0 G153 Z0", "SUPA G0 Z300"])
def test_incremental_coordinates_behind_a_place_of_the_machine(tmp_path: Path, machine: str) -> None:
    """Across they count from where the tool was; the height is not known."""
    m = gcode(tmp_path, f"{START}{machine}\nG91 G0 X60 Y40\nG90 Z5\nG1 Z-5\nM30\n")
    assert points(m)[3:] == [[20, 0, 25], [80, 40, 25], [80, 40, 5], [80, 40, -5]]
    refuses_each("P016", "while Z is not known", gcode, tmp_path, f"{START}{machine}\nG91 G1 X60\nM30\n")
    refuses_each("P016", "while Z is not known", gcode, tmp_path, f"{START}{machine}\nG90 G2 X40 I10 J0\nM30\n")


def test_what_a_place_of_the_machine_is_not(tmp_path: Path) -> None:
    """G53 without axes moves nothing, nor do rotary axes alone."""
    assert points(gcode(tmp_path, START + "G53\nG0 Z15\nM30\n"))[3:] == [[20, 0, 15]]
    assert points(gcode(tmp_path, START + "G0 Z15\nG28 A0\nM30\n"))[3:] == [[20, 0, 15]]
    # Without X, Y nothing is across: the tool waits above.
    m = gcode(tmp_path, START + "G53 X0 Y0\nG0 X80\nG0 Z5\nG0 Y40\nM30\n")
    assert points(m)[3:] == [[20, 0, 25], [80, 40, 25], [80, 40, 5]]


def test_the_way_point_of_g28_is_in_the_part(tmp_path: Path) -> None:
    m = gcode(tmp_path, START + "G28 X10 Y10 Z5\nG0 X80 Y40 Z5\nM30\n")
    assert points(m)[3:] == [[10, 10, 5], [10, 10, 25], [80, 40, 25], [80, 40, 5]]


def test_origins_of_work_offsets_count(tmp_path: Path) -> None:
    text = START + "G53 G0 Z0\nG55\nG0 X0 Y0\nZ5\nM30\n"
    m = gcode(tmp_path, text, offsets={"G54": (0.0, 0.0, 0.1), "G55": (0.2, 0.3, 0.1)})
    assert points(m)[3:] == [[20, 0, 125], [200, 300, 125], [200, 300, 105]]


def test_commands_keep_their_places(tmp_path: Path) -> None:
    """Up with the old tool while nothing turns, the change, across and down with the new one."""
    text = (
        "T1 M6\nS900 M3\n" + START + "G53 G0 Z0 M5\nT2 M6\nS500 M3\nG0 X80 Y40\nG43 H2 Z5\nG1 Z-5\nG28 G91 Z0 M9\nM30\n"
    )
    m = gcode(tmp_path, text)
    assert [m.tools[i].number for i in m.tool] == [1] * 4 + [2] * 4
    np.testing.assert_allclose(m.spindle * 30 / np.pi, [900] * 3 + [0] + [500] * 4)
    assert not added(m)
    kinds = [(e.kind, e.move) for e in ordered(m) if e.kind in ("tool", "spindle")]
    assert kinds == [("tool", 0), ("spindle", 0), ("spindle", 3), ("tool", 4), ("spindle", 4), ("spindle", 8)]
    # Each tool's part of the file begins above its first place.
    second = select(m, tool_numbers=[2])
    assert points(second) == [[80, 40, 25], [80, 40, 5], [80, 40, -5], [80, 40, 25]]


def test_a_tool_that_is_changed_above_a_place_comes_to_it_by_itself(tmp_path: Path) -> None:
    m = gcode(tmp_path, "T1 M6\n" + START + "G53 G0 Z0\nG0 X80 Y40\nT2 M6\nG43 H2 Z5\nM30\n")
    assert points(m)[3:] == [[20, 0, 25], [80, 40, 25], [80, 40, 25], [80, 40, 5]]
    assert m.tool[3:].tolist() == [0, 0, 1, 1]


def test_heidenhain_goes_back_along_the_tool(tmp_path: Path) -> None:
    start = "L X+0 Y+0 Z+15 R0 FMAX", "L Z-5 F300", "L X+20"
    m = klartext(tmp_path, *start, "L M140 MB 30", "L Z+5 FMAX", "M140 MB MAX", "L X+80 FMAX", "L Z+5 FMAX")
    assert points(m)[3:] == [[20, 0, 25], [20, 0, 5], [20, 0, 35], [80, 0, 35], [80, 0, 5]]
    assert klartext(tmp_path, *start, "L M140 MB 30 F100").rapid.tolist() == [True, False, False, False]
    # A line that waits for a corner has coordinates that are not those of M91.
    m = klartext(tmp_path, *start, "L X+30 F300", "L Z-1 FMAX M91", "L Z+5 FMAX")
    assert points(m)[4:] == [[30, 0, 25], [30, 0, 5]]
    tilted = klartext(tmp_path, *start, "PLANE SPATIAL SPA+0 SPB+90 SPC+0 TURN", "L X-10 Y0 Z+30 FMAX", "M140 MB 5")
    np.testing.assert_allclose(tilted.points[-1] - tilted.points[-2], [0.005, 0, 0], atol=1e-12)
    for wrong in ("L M140", "L M140 MB MAX MB 3", "L X+5 M140 MB MAX", "L MB MAX", "L M140 MB -3"):
        refuses_each("P016 P021", "MB", klartext, tmp_path, *start, wrong)


def test_apt_home_with_a_point_and_words_behind_it(tmp_path: Path) -> None:
    start = "RAPID\nGOTO/0,0,15\nGOTO/0,0,-5\n"
    m = apt(tmp_path, f"{start}GOHOME/-50,0,200\nGODLTA/0,0,-195\nFINI\n")
    assert points(m)[2:] == [[0, 0, 25], [-50, 0, 25], [-50, 0, 5]]
    refuses_each(
        "P011",
        "an arc without a point before it",
        apt,
        tmp_path,
        f"{start}RETRCT\nMOVARC/0,0,0,0,0,1,RADIUS,5,ANGLE,90\nGOTO/0,5,0\n",
    )
    # The point has no place for the first move, which none comes before.
    assert points(apt(tmp_path, "GOHOME/0,0,100\nRAPID\nGOTO/0,0,5\nFINI\n")) == [[0, 0, 5]]


def unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1).map(unit)
places = st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=2, max_size=8)


@given(directions, directions, places, st.integers(0, 2**32 - 1))
def test_no_place_of_the_path_is_nearer_than_the_clearance(a: Array, b: Array, cut: list, seed: int) -> None:
    """Whatever the tool axes, away from its two ends a retract is above the path, and so is the tool itself."""
    recorder = Recorder("a", 1000)
    recorder.state(0.01, 0.0, Tool(), "")
    for point in cut:
        recorder.move(1, point, tuple(a), False)
    recorder.away(2, "M91")
    last = tuple(np.random.default_rng(seed).uniform(-0.1, 0.1, 3))
    recorder.move(3, last, tuple(b), True)
    m = recorder.motions()
    path = np.array([*cut, last])
    np.testing.assert_allclose(m.points[[0, -1]], path[[0, -1]])
    up, down = m.points[len(cut)] - cut[-1], m.points[-1] - m.points[-2]
    # Along the tool, up and down.
    assert up @ a == pytest.approx(np.linalg.norm(up))
    assert down @ b == pytest.approx(-np.linalg.norm(down))
    for i in range(len(cut), m.n - 2):
        # From each place on the way, or on the tool there, to the path.
        for share in np.linspace(0.0, 1.0, 5):
            tip = m.points[i] + share * (m.points[i + 1] - m.points[i])
            axis = unit(m.axes[i] + share * (m.axes[i + 1] - m.axes[i]))
            for along in (0.0, 0.05, 0.3):
                assert np.linalg.norm(path - (tip + along * axis), axis=1).min() > 0.9 * 10e-3


def test_a_turn_by_half_a_turn_goes_by_the_side() -> None:
    recorder = Recorder("a", 1000)
    recorder.state(0.01, 0.0, Tool(), "")
    recorder.move(1, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), True)
    recorder.move(1, (0.1, 0.1, 0.1), (0.0, 0.0, 1.0), False)
    recorder.away(2, "M91")
    recorder.move(3, (0.05, 0.05, 0.0), (0.0, 0.0, -1.0), True)
    m = recorder.motions()
    turns = np.einsum("ij,ij->i", m.axes[1:], m.axes[:-1])
    assert turns.min() > -1e-9
    assert (np.linalg.norm(np.diff(m.points, axis=0)[turns < 0.5], axis=1) < 1e-12).all()


def test_a_new_tool_comes_from_the_changer(tmp_path: Path) -> None:
    """A place of the machine behind the change: not up from where the other tool was, but to above its own place."""
    m = gcode(tmp_path, "T1 M6\n" + START + "G0 Z15\nT2 M6\nG53 G0 Z0\nG0 X80 Y40\nG43 H2 Z5\nM30\n")
    assert points(m)[3:] == [[20, 0, 15], [80, 40, 25], [80, 40, 5]]
    assert m.tool[3:].tolist() == [0, 1, 1]
    assert gcode(tmp_path, "T1 M6\n" + START + "G0 Z15\nT2 M6\nG53 G0 Z0\nM30\n").n == 4


def test_a_tool_that_is_changed_in_the_cut_leaves_it_upwards(tmp_path: Path) -> None:
    m = gcode(tmp_path, "T1 M6\n" + START + "T2 M6\nG0 X80 Y40\nG0 Z5\nM30\n")
    assert points(m)[2:] == [[20, 0, -5], [20, 0, 25], [80, 40, 25], [80, 40, -5], [80, 40, 5]]
    assert m.tool[2:].tolist() == [0, 0, 1, 1, 1]
    # The same tool once more is no change.
    assert points(gcode(tmp_path, "T1 M6\n" + START + "T1 M6\nG0 Z5\nM30\n"))[2:] == [[20, 0, -5], [20, 0, 5]]


def test_behind_g49_z_is_not_that_of_the_tip(tmp_path: Path) -> None:
    """What cancels the tool's length is a retract where it was on, and moves at feed of Z are refused."""
    start = "T1 M6\nG43 H1\n" + START
    m = gcode(tmp_path, start + "G49 G0 Z100\nX80 Y40\nG43 H1 Z5\nG1 Z0\nM30\n")
    assert points(m)[2:] == [[20, 0, -5], [20, 0, 25], [80, 40, 25], [80, 40, 5], [80, 40, 0]]
    refuses_each("P016", "line 8: a move of Z behind G49", gcode, tmp_path, start + "G49 G1 Z-6\nM30\n")
    # Where no length was ever on, as in the first line of many programs, it changes nothing.
    assert gcode(tmp_path, "G49 G40 G80\n" + START + "M30\n").n == 3


def test_axes_of_the_machine_in_a_turned_frame(tmp_path: Path) -> None:
    """In a plane turned about Y the machine's Z moves its x, too: with a head it does, with a table it does not."""
    head = "G90 G54\nG0 X0 Y0 Z50\nG68.2 X0 Y0 Z0 I90 J30 K-90\nG53.1\nG0 X1 Y2 Z5\nG1 Z0 F100\nG53 G0 Z0\n"
    refuses_each("P016", "while X is not known", gcode, tmp_path, head + "G0 Z5\nG1 Z0\nM30\n")
    m = gcode(tmp_path, head + "G0 X9\nZ5\nG1 Z0\nM30\n")
    steps = np.diff(m.points[-4:], axis=0)
    # Across to above (9, 2), down to 5 and to 0, all along the tool.
    assert abs(steps[0] @ m.axes[-1]) < 1e-12
    np.testing.assert_allclose(np.cross(steps[1:], m.axes[-1]), 0.0, atol=1e-15)
    np.testing.assert_allclose(steps[2], -0.005 * m.axes[-1], atol=1e-15)
