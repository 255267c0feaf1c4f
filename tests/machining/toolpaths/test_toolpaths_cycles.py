"""Drill cycles of APT and G-code as strokes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from toolpath_cases import apt, gcode

from machining.toolpaths import Cycle, Motions
from machining.toolpaths.cycles import PECK_GAP
from machining.toolpaths.recorder import StatementError
from robots import InputErrors

GAP = PECK_GAP * 1e3
HEAD = "SPINDL/600,RPM,CLW\nFEDRAT/100,MMPM\nRAPID\nGOTO/0,0,20,0,0,1\n"


def heights(m: Motions) -> list[float]:
    return (m.points[1:, 2] * 1e3).round(9).tolist()


@pytest.mark.parametrize(
    ("words", "expected", "rapid"),
    [
        ("DRILL,RAPTO,3,FEDTO,-10,MMPM,50", [3, -10, 3], "101"),
        # Depth positive (SolidWorks CAM) or negative (NX) leads into the part.
        ("DRILL,FEDTO,10,MMPM,50,RAPTO,3,RTRCTO,25", [3, -10, 3, 25], "1011"),
        # Creo: CLEAR above the point, RAPTO from there on.
        ("DRILL,DEPTH,10,MMPM,50,CLEAR,5,RAPTO,2,RETURN,7", [3, -10, 3, 7], "1011"),
        ("DRILL,DEPTH,10,IPM,2,CLEAR,5", [5, -10, 5], "101"),
        (
            "DEEP,DEPTH,10,STEP,5,MMPM,50,CLEAR,2",
            [2, -3, 2, -3 + GAP, -8, 2, -8 + GAP, -10, 2],
            "101101101",
        ),
        ("DRILL,DEEP,FEDTO,-10,STEP1,8,MMPM,50,RAPTO,2", [2, -6, 2, -6 + GAP, -10, 2], "101101"),
        (
            "DEEP2,FEDTO,10,1STPECK,6,SUBPECK,3,MMPM,50,RAPTO,2",
            [2, -4, 2, -4 + GAP, -7, 2, -7 + GAP, -10, 2],
            "101101101",
        ),
        ("BRKCHP,DEPTH,10,STEP,6,MMPM,50,CLEAR,2", [2, -4, -4 + GAP, -10, 2], "10101"),
        ("BORE,DEPTH,10,MMPM,50,CLEAR,2", [2, -10, 2], "100"),
        ("TAP,DEPTH,10,MMPR,1,CLEAR,2", [2, -10, 2], "100"),
    ],
)
def test_strokes(tmp_path: Path, words: str, expected: list[float], rapid: str) -> None:
    m = apt(tmp_path, HEAD + f"CYCLE/{words}\nGOTO/0,0,0\nCYCLE/OFF\n")
    np.testing.assert_allclose(heights(m), expected, atol=1e-9)
    assert "".join("1" if r else "0" for r in m.rapid[1:]) == rapid


def test_feed_dwell_and_spindle_of_cycles(tmp_path: Path) -> None:
    text = "CYCLE/TAP,DEPTH,10,MMPR,1.5,CLEAR,2,DWELL,0.25\nGOTO/0,0,0\nCYCLE/OFF\nGOTO/9,9,9\n"
    m = apt(tmp_path, HEAD + text)
    np.testing.assert_allclose(m.feed[2:4], 1.5e-3 * 10)
    np.testing.assert_allclose(m.spindle[2:4], np.array([1, -1]) * 600 * 2 * math.pi / 60)
    assert m.dwell.tolist() == [0, 0, 0.25, 0, 0]
    # Behind the cycle the feed of FEDRAT and the sense of the spindle are back.
    assert m.feed[-1] == pytest.approx(0.1 / 60)
    assert m.spindle[-1] > 0
    without = apt(tmp_path, HEAD + "CYCLE/DRILL,DEPTH,10,CLEAR,2\nGOTO/0,0,0\n")
    assert without.feed[2] == pytest.approx(0.1 / 60)
    tpi = apt(tmp_path, HEAD + "CYCLE/TAP,DEPTH,10,TPI,20,CLEAR,2\nGOTO/0,0,0\n")
    assert tpi.feed[2] == pytest.approx(0.0254 / 20 * 10)


def test_holes_along_a_tilted_tool_axis_rise_before_they_cross(tmp_path: Path) -> None:
    text = "RAPID\nGOTO/0,0,0,0,0.6,0.8\nCYCLE/DRILL,RAPTO,5,FEDTO,-10,MMPM,50\n"
    text += "GOTO/0,0,0\nGOTO/10,0,0\nCYCLE/OFF\nGOTO/0,0,50\n"
    m = apt(tmp_path, text)
    axis = np.array([0, 0.6, 0.8])
    along = m.points @ axis * 1e3
    np.testing.assert_allclose(along[:7], [0, 5, -10, 5, 5, -10, 5], atol=1e-12)
    np.testing.assert_allclose(
        m.points[:7] * 1e3 - along[:7, None] * axis, [[0] * 3] * 4 + [[10, 0, 0]] * 3, atol=1e-12
    )
    np.testing.assert_allclose(m.points[-1] * 1e3, [0, 0, 50])


def test_cycle_on_returns_the_last_one_and_off_makes_plain_points(tmp_path: Path) -> None:
    text = "CYCLE/DRILL,RAPTO,3,FEDTO,-10,MMPM,50\nGOTO/0,0,0\nCYCLE/OFF\nGOTO/5,0,30\nCYCLE/ON\nGOTO/5,0,0\n"
    m = apt(tmp_path, HEAD + text)
    np.testing.assert_allclose(heights(m), [3, -10, 3, 30, 3, -10, 3])


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ("DRILL,126.0,85.0,1.0,MMPR", "without its word"),
        ("DRILL,RAPTO,3,MMPM,50", "without its depth"),
        ("", "without its kind"),
        ("BORE,NODRAG,FEDTO,3", "NODRAG"),
        ("MILL,FEDTO,3", "MILL"),
        ("DRILL,FEDTO,3,MMPM,-5,RAPTO,1", "feed"),
        ("DRILL,FEDTO,3,RAPTO,-5", "above the height"),
        ("DEEP,FEDTO,1000,STEP,0.00001,RAPTO,1", "pecks"),
        ("DRILL,FEDTO,3,DWELL,-1", "dwell"),
    ],
)
def test_cycles_that_are_not_read_are_faults(tmp_path: Path, words: str, what: str) -> None:
    with pytest.raises(InputErrors, match=f"line 6: .*{what}"):
        apt(tmp_path, HEAD + f"CYCLE/{words}\nGOTO/0,0,0\nCYCLE/OFF\n")


def test_a_tool_change_with_the_cycle_on_is_a_fault(tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match=r"line 8: .*cycle is on"):
        apt(tmp_path, HEAD + "CYCLE/DRILL,RAPTO,3,FEDTO,-10\nGOTO/0,0,0\nLOADTL/5\nGOTO/0,0,9\n")


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ("DEEP,FEDTO,10,WIBBLE,3,RAPTO,1", "WIBBLE,3"),
        ("BRKCHP,FEDTO,10,RAPTO,1", "BRKCHP without its steps"),
        ("DRILL,FEDTO,10,RAPTO,1,STEP,2", "DRILL with steps"),
        ("DRILL,FEDTO,10,FEDTO,12,RAPTO,1", "FEDTO of a cycle twice"),
        ("DRILL,FEDTO,10,DEPTH,12,RAPTO,1", "FEDTO and DEPTH"),
    ],
)
def test_words_of_a_cycle_that_are_not_read_are_refused(tmp_path: Path, words: str, what: str) -> None:
    with pytest.raises(InputErrors, match=rf"line \d+: CYCLE: {what}"):
        apt(tmp_path, HEAD + f"CYCLE/{words}\nGOTO/0,0,0\n")


@pytest.mark.parametrize(
    ("block", "expected", "rapid"),
    [
        ("G98 G81 X0 Y0 Z-10 R2 F100", [2, -10, 2, 20], "1011"),
        ("G99 G81 X0 Y0 Z-10 R2 F100", [2, -10, 2], "101"),
        ("G99 G82 X0 Y0 Z-10 R2 P0.5 F100", [2, -10, 2], "101"),
        ("G99 G83 X0 Y0 Z-10 R2 Q7 F100", [2, -5, 2, -5 + GAP, -10, 2], "101101"),
        ("G99 G73 X0 Y0 Z-10 R2 Q7 F100", [2, -5, -5 + GAP, -10, 2], "10101"),
        ("G99 G84 X0 Y0 Z-10 R2 F100", [2, -10, 2], "100"),
        ("G99 G85 X0 Y0 Z-10 R2 F100", [2, -10, 2], "100"),
        ("G99 G86 X0 Y0 Z-10 R2 F100", [2, -10, 2], "101"),
        ("G99 G91 G81 X0 Y0 Z-12 R-18 F100", [2, -10, 2], "101"),
    ],
)
def test_cycles_of_gcode(tmp_path: Path, block: str, expected: list[float], rapid: str) -> None:
    m = gcode(tmp_path, f"G90 G94 S600 M3\nG0 X0 Y0 Z20\n{block}\nG80\nM30\n")
    np.testing.assert_allclose(heights(m), expected, atol=1e-9)
    assert "".join("1" if r else "0" for r in m.rapid[1:]) == rapid
    if "G82" in block:
        assert m.dwell[2] == 0.5
    if "G84" in block:
        assert (m.spindle[1:] < 0).tolist() == [False, False, True]


def test_cycles_keep_their_words_and_return_to_the_first_height(tmp_path: Path) -> None:
    m = gcode(tmp_path, "G0 X0 Y0 Z20\nG98 G81 X1 Y1 Z-10 R2 F100\nX5\nG99 Y7 Z-5\nG98 X9\nG80\nG0 X0\nM30\n")
    np.testing.assert_allclose(
        m.points[1:] * 1e3,
        [
            *([1, 1, z] for z in (20, 2, -10, 2, 20)),
            *([5, 1, z] for z in (20, 2, -10, 2, 20)),
            *([5, 7, z] for z in (20, 2, -5, 2)),
            *([9, 7, z] for z in (2, -5, 2, 20)),
            [0, 7, 20],
        ],
        atol=1e-9,
    )


def test_repeats_walk_on_in_incremental_mode(tmp_path: Path) -> None:
    m = gcode(tmp_path, "G0 X0 Y0 Z20\nG99 G91 G81 X10 Y0 R-18 Z-5 L3 F100\nG80\nM30\n")
    bottoms = m.points[~m.rapid] * 1e3
    # G99 leaves the tool at R, yet R counts from the height before the cycle.
    np.testing.assert_allclose(bottoms, [[10, 0, -3], [20, 0, -3], [30, 0, -3]], atol=1e-9)


@pytest.mark.parametrize("plane", [17, 18, 19])
def test_cycles_work_along_the_normal_of_the_plane_or_are_refused(tmp_path: Path, plane: int) -> None:
    block = {17: "X1 Y1 Z-10", 18: "X1 Z1 Y-10", 19: "Y1 Z1 X-10"}[plane]
    program = f"G{plane}\nG0 X20 Y20 Z20\nG99 G81 {block} R2 F100\nG80\nM30\n"
    if plane == 17:
        assert gcode(tmp_path, program).points[3, 2] == pytest.approx(-0.01)
    else:
        # The tool of a three-axis mill stands along Z.
        with pytest.raises(InputErrors, match="not along the normal"):
            gcode(tmp_path, program)


@pytest.mark.parametrize(
    ("block", "what"),
    [
        ("G81 X0 Z-10 F100", "without Z or R"),
        ("G83 X0 Z-10 R2 F100", "peck"),
        ("G81 X0 Z10 R2 F100", "above"),
        ("G81 X0 Z-10 R2 K3", "repeats"),
        ("G76 X0 Z-10 R2", "G76"),
    ],
)
def test_faults_of_gcode_cycles(tmp_path: Path, block: str, what: str) -> None:
    with pytest.raises(InputErrors, match=f"line 3: .*{what}"):
        gcode(tmp_path, f"G0 X0 Y0 Z20\n{block}\nM30\n")


def test_a_cycle_knows_its_heights() -> None:
    assert Cycle(start=0.002, depth=0.01).height_back == 0.002
    assert Cycle(start=0.002, depth=0.01, back=0.001).height_back == 0.002
    with pytest.raises(StatementError, match="not finite"):
        Cycle(start=0.002, depth=0.01, back=math.inf).checked("numbers that make a hole")


def test_a_tool_below_the_start_height_rises_before_it_crosses(tmp_path: Path) -> None:
    m = apt(tmp_path, "RAPID\nGOTO/0,0,1\nCYCLE/DRILL,RAPTO,5,FEDTO,-10,MMPM,50\nGOTO/10,0,0\nCYCLE/OFF\n")
    np.testing.assert_allclose(m.points * 1e3, [[0, 0, 1], [0, 0, 5], [10, 0, 5], [10, 0, -10], [10, 0, 5]], atol=1e-12)
