"""G-code programs: modes, arcs in all planes, rotary axes, faults."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses_each
from toolpath_cases import SAMPLES, apt, gcode

from machining.toolpaths import Cycle, Motions, read_gcode, tool_axis
from machining.toolpaths.cycles import PECK_GAP
from machining.toolpaths.recorder import StatementError

MM_PER_MIN = 1e-3 / 60
RPM = 2 * math.pi / 60
LETTERS = {17: "XY", 18: "ZX", 19: "YZ"}


def test_three_axes() -> None:
    m = read_gcode(SAMPLES / "mill.nc")
    # The first G0 has no Z yet: it is an event, not a move from nowhere.
    assert m.line[0] == 6
    assert [e.text for e in m.events if e.word == "G0"] == ["X0 Y0 S3000"]
    assert [t.number for t in m.tools] == [5, 6]
    arc = m.points[m.line == 9][:, :2] * 1e3
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 10, arc[:, 1]), 10, atol=1e-12)
    assert (arc[:, 1] > 0).all()
    by_radius = m.points[m.line == 10][:, :2] * 1e3
    np.testing.assert_allclose(np.hypot(by_radius[:, 0] - 10, by_radius[:, 1] - 20), 10, atol=1e-9)
    np.testing.assert_allclose(m.points[m.line == 12] * 1e3, [[35, 25, -1]])
    np.testing.assert_allclose(m.feed[m.line == 8], 120 * MM_PER_MIN)
    np.testing.assert_allclose(m.feed[m.line == 12], 600 * MM_PER_MIN)
    # The spindle stops before the way point of G28, and the retract behind it.
    np.testing.assert_allclose(m.spindle[m.tool == 1], [1200 * RPM] * (np.sum(m.tool == 1) - 2) + [0, 0])
    assert m.dwell[m.line == 17].tolist()[-1] == 1.5
    words = [e.word for e in m.events]
    assert words.count("LOADTL") == 2
    assert words.count("COOLNT") == 2
    assert "G54" in words
    assert "END" in words
    assert any("G54" in n.text for n in m.notes)
    assert any("G28" in n.text for n in m.notes)
    assert not any("cut short" in n.text for n in m.notes)


def test_five_axes_with_the_tip_programmed() -> None:
    path = SAMPLES / "five_axis.nc"
    from machining.toolpaths import ReadOptions

    m = read_gcode(path, ReadOptions(rotary="table-AC"))
    s, c = math.sin(math.radians(30)), math.cos(math.radians(30))
    # Rz(90) Rx(30) z = (sin 30, 0, cos 30); Rz(180) Rx(45) z = (0, sin 45, cos 45).
    np.testing.assert_allclose(m.axes[1:3], [[s, 0, c], [0, math.sqrt(0.5), math.sqrt(0.5)]], atol=1e-15)
    np.testing.assert_allclose(m.points[1:3] * 1e3, [[10, 0, 0], [20, 5, 1]])
    assert any("more than 10 deg" in n.text for n in m.notes)
    refuses_each("P014", "--rotary table-AC", read_gcode, path)
    refuses_each("P014", "rotary axis A", read_gcode, path, ReadOptions(rotary="table-BC"))


def test_rotary_axes_without_the_tip_programmed_are_refused_with_a_remedy(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z50 B0 C0\nG1 X1 B30 C10 F100\nM30\n"
    refuses_each("P014", r"without tool centre point control.*--tcp", gcode, tmp_path, program, rotary="head-BC")
    m = gcode(tmp_path, program, rotary="head-BC", tcp=True)
    b, c = math.radians(30), math.radians(10)
    expected = [math.sin(b) * math.cos(c), math.sin(b) * math.sin(c), math.cos(b)]
    np.testing.assert_allclose(m.axes[-1], expected, atol=1e-15)
    for on, off in (("TRAORI", "TRAFOOF"), ("G43.4 H1", "G49"), ("G234", "G49")):
        assert gcode(tmp_path, f"{on}\n{program}", rotary="head-BC").n == 2
        refuses_each("P014", "without tool centre point", gcode, tmp_path, f"{on}\n{off}\n{program}", rotary="head-BC")
    # Zero angles are no turn.
    assert gcode(tmp_path, "G0 X0 Y0 Z5 A0\nM30\n").n == 1


@pytest.mark.parametrize("tilt", "AB")
@pytest.mark.parametrize("kind", ["table", "head", "mixed"])
def test_tool_axis_is_the_product_of_two_rotations(kind: str, tilt: str) -> None:
    a, c = 0.4, -1.1
    Rz = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    Rx = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    Ry = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    angles = {"A": 0.0, "B": 0.0, "C": c} | {tilt: a}
    expected = Rz @ (Rx if tilt == "A" else Ry) @ [0, 0, 1]
    np.testing.assert_allclose(tool_axis(f"{kind}-{tilt}C", angles), expected, atol=1e-15)


@pytest.mark.parametrize("plane", [17, 18, 19])
@pytest.mark.parametrize("code", [2, 3])
@pytest.mark.parametrize("form", ["relative", "absolute", "short", "long"])
@pytest.mark.parametrize("rise", [0.0, 4.0])
def test_arcs_in_all_planes_both_ways(tmp_path: Path, plane: int, code: int, form: str, rise: float) -> None:
    u, v = LETTERS[plane]
    w = next(letter for letter in "XYZ" if letter not in u + v)
    offset = {"X": "I", "Y": "J", "Z": "K"}
    # Centre (3, -2), radius 5, from 0 to 90 deg: a quarter turn with G3, three quarters with G2.
    center = {u: 3.0, v: -2.0}
    words = {
        "relative": f"{offset[u]}-5 {offset[v]}0",
        "absolute": f"{offset[u]}3 {offset[v]}-2",
        "short": "R5",
        "long": "R-5",
    }[form]
    mode = "G90.1 " if form == "absolute" else ""
    program = f"G{plane} {mode}G0 X0 Y0 Z0\nG1 {u}8 {v}-2 F100\nG{code} {u}3 {v}3 {w}{rise} {words}\nM30\n"
    m = gcode(tmp_path, program)
    arc = m.points[1:] * 1e3
    iu, iv, iw = ("XYZ".index(letter) for letter in (u, v, w))
    turns = np.unwrap(np.arctan2(arc[:, iv] - center[v], arc[:, iu] - center[u]))
    if form in ("short", "long"):
        # R alone: a quarter turn for R > 0 whichever way; the centre is then on either side.
        expected_length = (math.pi / 2 if form == "short" else 1.5 * math.pi) * 5
    else:
        sweep = math.pi / 2 if code == 3 else -1.5 * math.pi
        np.testing.assert_allclose(turns[-1] - turns[0], sweep, atol=1e-12)
        np.testing.assert_allclose(np.hypot(arc[:, iv] + 2, arc[:, iu] - 3), 5, atol=1e-12)
        expected_length = abs(sweep) * 5
    np.testing.assert_allclose(arc[-1][[iu, iv, iw]], [3, 3, rise], atol=1e-12)
    flat = arc.copy()
    flat[:, iw] = 0
    length = np.linalg.norm(np.diff(flat, axis=0), axis=1).sum()
    # Chords within 2 um of a 5 mm arc are short by 2/3 of 2e-3 / 5 at most.
    assert length == pytest.approx(expected_length, rel=3e-4)
    if rise:
        np.testing.assert_allclose(arc[1:, iw], rise * np.arange(1, len(arc)) / (len(arc) - 1), atol=1e-12)
    if form == "short":
        # Turning sense from three points: the normal of G3 looks along +w.
        a, b = arc[1] - arc[0], arc[2] - arc[1]
        assert math.copysign(1, a[iu] * b[iv] - a[iv] * b[iu]) == (1 if code == 3 else -1)


@pytest.mark.parametrize(("code", "sense"), [(2, -1), (3, 1)])
def test_full_circles_and_turns(tmp_path: Path, code: int, sense: int) -> None:
    m = gcode(tmp_path, f"G0 X5 Y0 Z0\nG{code} I-5 F100\nM30\n")
    angle = np.unwrap(np.arctan2(m.points[:, 1], m.points[:, 0]))
    assert angle[-1] == pytest.approx(sense * 2 * math.pi)
    m = gcode(tmp_path, f"G0 X5 Y0 Z0\nG{code} X5 Y0 Z3 I-5 J0 P3 F100\nM30\n")
    angle = np.unwrap(np.arctan2(m.points[:, 1], m.points[:, 0]))
    assert angle[-1] == pytest.approx(sense * 6 * math.pi)
    np.testing.assert_array_equal(m.points[-1], np.array([5, 0, 3]) * 1e-3)


def test_incremental_absolute_inch_and_modal_motion(tmp_path: Path) -> None:
    program = "G90 G0 X1 Y1 Z1\nG91 X1\nY-1 Z2\nG90 G1 X0 F10\nG21 M3 X10\nY10 F600\nM30\n"
    m = gcode(tmp_path, program, head="G20\n")
    inch = 25.4
    np.testing.assert_allclose(
        m.points * 1e3,
        [
            [inch, inch, inch],
            [2 * inch, inch, inch],
            [2 * inch, 0, 3 * inch],
            [0, 0, 3 * inch],
            [10, 0, 3 * inch],
            [10, 10, 3 * inch],
        ],
        atol=1e-12,
    )
    assert m.rapid.tolist() == [True, True, True, False, False, False]
    # The feed in inches stays what it is when millimetres begin.
    np.testing.assert_allclose(m.feed[3:], [10 * 0.0254 / 60, 10 * 0.0254 / 60, 0.01])


def test_feed_modes(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z0\nS600 M3\nG95 G1 X10 F0.2\nG93 X20 F2\nG94 X30 F300\nM5\nG95 X40 F0.2\nM30\n"
    m = gcode(tmp_path, program)
    np.testing.assert_allclose(m.feed[1:], [0.2e-3 * 10, 0.01 * 2 / 60, 300 * MM_PER_MIN, np.nan])
    np.testing.assert_allclose(m.spindle, np.array([0, 600, 600, 600, 0]) * RPM)
    arc = gcode(tmp_path, "G0 X5 Y0 Z0\nG93 G3 X-5 I-5 F4\nM30\n")
    # Half a turn of 5 mm in a quarter of a minute.
    assert arc.feed[-1] == pytest.approx(math.pi * 5e-3 * 4 / 60, rel=2e-4)
    refuses_each("P022", "inverse time without F", gcode, tmp_path, "G0 X0 Y0 Z0\nG93 G1 X1 F2\nX2\nM30\n")


def test_words_without_spaces_with_spaces_and_in_small_letters(tmp_path: Path) -> None:
    m = gcode(tmp_path, "n10g0x1.5y-.5z+2(go)\n/N20 g1 X 3. y 4 z5 f 100 ; on\n%\nO7\nm30\n")
    np.testing.assert_allclose(m.points * 1e3, [[1.5, -0.5, 2], [3, 4, 5]])
    assert [e.text for e in m.events if e.word == "comment"] == ["go", "on"]
    assert any("skip_deleted" in n.text for n in m.notes)
    assert gcode(tmp_path, "G0 X0Y0Z0\n/G0 X9\n/3 G0 X8\nM30\n", skip_deleted=True).n == 1


def test_the_end_of_the_program(tmp_path: Path) -> None:
    assert gcode(tmp_path, "%\nG21 G0 X0 Y0 Z0\nM30\n%\n\x1a", head="").n == 1
    for behind in ("M30\nG0 X1\n", "M30\n%\nO2\nG0 X1\nM30\n", "%\nG0 X1\n", "M30\nS500\n"):
        refuses_each("P020", r"line \d: a block behind the end", gcode, tmp_path, "G0 X0 Y0 Z0\n" + behind)
    # The retract is made before the end.
    m = gcode(tmp_path, "G0 X0 Y0 Z0\nG91 G28 Z0 M30\n")
    np.testing.assert_allclose(m.points * 1e3, [[0, 0, 0], [0, 0, 10]])


def test_places_of_the_machine_are_not_in_the_part(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z5\nG91 G28 Z0\nG90 G0 X50 Y50\nG0 Z5\nG53 G0 Z0\nG0 Z7\nG30 X60 Y60\nG0 X1 Y2\nM30\n"
    m = gcode(tmp_path, program)
    # G28 Z0 in G91 has no way point; G30 goes by X60 Y60; 17 is 10 above the highest point.
    wanted = [[0, 0, 5], [0, 0, 17], [50, 50, 17], [50, 50, 5], [50, 50, 17], [50, 50, 7]]
    wanted += [[60, 60, 7], [60, 60, 17], [1, 2, 17], [1, 2, 7]]
    np.testing.assert_allclose(m.points * 1e3, wanted)
    refuses_each(
        "P016",
        r"line 4: a move at feed while Z is not known.*start=",
        gcode,
        tmp_path,
        "G0 X0 Y0 Z5\nG28 Z5\nG1 X1 F100\nM30\n",
    )
    refuses_each("P016", "while Y, Z is not known", gcode, tmp_path, "G1 X1 F100\nM30\n")
    assert gcode(tmp_path, "G1 X1 F100\nM30\n", start=(0.0, 0.0, 0.1)).points[0].tolist() == [0.001, 0, 0.1]


def test_work_offsets(tmp_path: Path) -> None:
    program = "G54\nG0 X1 Y1 Z1\nG55\nG0 X1 Y1 Z1\nM30\n"
    refuses_each("P013", r"line 5: motion in G55.*--read G54=X,Y,Z --read G55=X,Y,Z", gcode, tmp_path, program)
    m = gcode(tmp_path, program, offsets={"G54": (0.1, 0, 0), "G55": (0, 0.2, 0)})
    np.testing.assert_allclose(m.points, [[0.101, 0.001, 0.001], [0.001, 0.201, 0.001]])
    assert gcode(tmp_path, program, frames="written").n == 2
    # With known offsets the tool stays where it is when the offset changes.
    m = gcode(tmp_path, "G54\nG0 X1 Y1 Z1\nG55\nG0 Z5\nM30\n", offsets={"G54": (0.1, 0, 0), "G55": (0, 0.2, 0)})
    np.testing.assert_allclose(m.points[-1], [0.101, 0.001, 0.005])
    arc = gcode(tmp_path, "G54\nG0 X5 Y0 Z0\nG3 I-5 F100\nM30\n", offsets={"G54": (0.1, 0, 0)})
    np.testing.assert_allclose(np.hypot(arc.points[:, 0] - 0.1, arc.points[:, 1]), 0.005, atol=1e-15)


@pytest.mark.parametrize(("word", "option", "seconds"), [("P2.5", "s", 2.5), ("P500", "ms", 0.5), ("X3.", "ms", 3.0)])
def test_dwell(tmp_path: Path, word: str, option: str, seconds: float) -> None:
    assert gcode(tmp_path, f"G0 X0 Y0 Z0\nG4 {word}\nM30\n", dwell_unit=option).dwell[0] == seconds


def test_a_whole_dwell_that_looks_like_milliseconds_is_remarked_on(tmp_path: Path) -> None:
    m = gcode(tmp_path, "G0 X0 Y0 Z0\nG4 P500\nM30\n")
    assert any("dwell_unit=ms" in n.text for n in m.notes)


@pytest.mark.parametrize(
    ("block", "word"),
    [
        ("#1=#2", "#2 has no value"),
        ("#3000=1", "control itself"),
        ("G1 X[1/0]", "finite"),
        ("G1 X[1+]", "number is expected"),
        ("G1 X[1", "missing"),
        ("G1 X FIX[-1.5]", "controls differ"),
        ("G1 X#1", "#1 has no value"),
        ("FOO=5", "not known"),
        ("G1 X=R1", "R1 has no value"),
        ("WHILE [#1 LT 5] DO1", "macro program"),
        ("o100 sub", "macro program"),
        ("IF [#1 EQ 1] GOTO 10", "macro program"),
        ("M98 P100", "subprogram"),
        ("G65 P9000 X1", "macro call"),
        ("L100", "subprogram"),
        ("CYCLE86(10,0,2,-20)", "is not read"),
        ("MCALL CYCLE86(10,0,2,-20)", "is not read"),
        ("MCALL POCKET3(10,0,2,-20)", "is not read"),
        ("CYCLE81(10,0,2)", "depth"),
        ("CYCLE83(10,0,2,-20,,,5,1,0,0,1,1)", "smaller"),
        ("CYCLE84(10,0,2,-20)", "pitch"),
        ("G5.2 X1 Y1 P1", "NURBS|spline"),
        ("G5.1 X1 Y1 I1 J1", "spline"),
        ("G33 Z-5 K1", "threading"),
        ("G38.2 Z-5", "probing"),
        ("G68 X0 Y0", "angle"),
        ("G68.2 P2 Q1 X0 Y0 Z0", "other angles or points"),
        ("CYCLE800(1,,0,192,0,0,0,0,90,0,0,0,0,-1)", "CYCLE800 of mode 192"),
        ("CYCLE800(NaN,,NaN,)", "CYCLE800 with 'NAN'"),
        ('CYCLE800(,"",,7,1e990,,,1)', "CYCLE800 with '1E990'"),
        (f"X#{'9' * 400}", "an expression without a finite value"),
        ("G51 X0 Y0 P2", "scaling"),
        ("G16", "polar"),
        ("G999 X5", "not known"),
        ("G1 U5", "U, V, W"),
        ("G1 X1 X2", "X twice"),
        ("G1 X1 @5", "no word"),
        ("G1 X1 F0", "feed"),
        ("G1 X1 F-5", "feed"),
        ("S-5", "spindle"),
        ("G2 X1", "without centre"),
        ("G2 X1 I1 R1", "with R and"),
        ("G2 I0 R5", "with R and|full turn"),
        ("G2 R5 X0 Y0", "full turn"),
        ("G2 X20 R5", "radius of at least 10 mm"),
        ("G2 X10 Y0 I4", "one circle"),
        ("G90.1 G2 X10 I5", "one coordinate"),
        ("G4", "dwell"),
    ],
)
def test_faults_come_with_their_line(tmp_path: Path, block: str, word: str) -> None:
    refuses_each(
        "P004 P011 P012 P013 P014 P017 P018 P019 P020 P022",
        f"line 3: (?s:.*)({word})",
        gcode,
        tmp_path,
        f"G0 X0 Y0 Z0\n{block}\nM30\n",
    )


def test_coordinates_need_a_motion_code_and_a_unit(tmp_path: Path) -> None:
    refuses_each("P016", "without a motion code", gcode, tmp_path, "G0 X0 Y0 Z0\nG80\nX5\nM30\n")
    refuses_each("P003", "unit of length", gcode, tmp_path, "G0 X0 Y0 Z0\nM30\n", head="")
    assert gcode(tmp_path, "G0 X1 Y0 Z0\nM30\n", head="", units="inch").points[0, 0] == 0.0254


def test_codes_left_out_when_asked_make_the_position_unknown(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z0\nG33 Z-5 K1\nG0 Z3\nM30\n"
    # The tool is taken up from where it was left, and comes down where it is known again.
    m = gcode(tmp_path, program, unknown_motion="report")
    np.testing.assert_allclose(m.points[:, 2] * 1e3, [0, 13, 3])
    refuses_each(
        "P016", "Z is not known", gcode, tmp_path, "G0 X0 Y0 Z0\nG33 Z-5 K1\nG1 X3 F100\nM30\n", unknown_motion="report"
    )


def test_codes_that_change_nothing_here_are_kept(tmp_path: Path) -> None:
    m = gcode(
        tmp_path, "G17 G40 G49 G64 P0.01\nG5.1 Q1\nG0 X0 Y0 Z0\nG41 D1\nM10\nG1 X1 F1\nM5\nM30\n", compensation="centre"
    )
    words = [e.word for e in m.events]
    assert {"G40", "G49", "G64", "G5.1", "G41", "M10"} <= set(words)
    assert any("G41" in n.text for n in m.notes)


def test_absolute_centres_as_an_option(tmp_path: Path) -> None:
    m = gcode(tmp_path, "G0 X10 Y0 Z0\nG3 X0 Y10 I0 J0 F100\nM30\n", arc_absolute=True)
    np.testing.assert_allclose(np.hypot(m.points[:, 0], m.points[:, 1]), 0.01, atol=1e-15)


# ------------------------------------------------------------
# Drill cycles of APT and G-code as strokes

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
    refuses_each("P012", f"line 6: .*{what}", apt, tmp_path, HEAD + f"CYCLE/{words}\nGOTO/0,0,0\nCYCLE/OFF\n")


def test_a_tool_change_with_the_cycle_on_is_a_fault(tmp_path: Path) -> None:
    refuses_each(
        "P012",
        r"line 8: .*cycle is on",
        apt,
        tmp_path,
        HEAD + "CYCLE/DRILL,RAPTO,3,FEDTO,-10\nGOTO/0,0,0\nLOADTL/5\nGOTO/0,0,9\n",
    )


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
    refuses_each("P012", rf"line \d+: CYCLE: {what}", apt, tmp_path, HEAD + f"CYCLE/{words}\nGOTO/0,0,0\n")


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
        refuses_each("P012", "not along the normal", gcode, tmp_path, program)


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
    refuses_each("P012 P019", f"line 3: .*{what}", gcode, tmp_path, f"G0 X0 Y0 Z20\n{block}\nM30\n")


def test_a_cycle_knows_its_heights() -> None:
    assert Cycle(start=0.002, depth=0.01).height_back == 0.002
    assert Cycle(start=0.002, depth=0.01, back=0.001).height_back == 0.002
    with pytest.raises(StatementError, match="not finite"):
        Cycle(start=0.002, depth=0.01, back=math.inf).checked("numbers that make a hole")


def test_a_tool_below_the_start_height_rises_before_it_crosses(tmp_path: Path) -> None:
    m = apt(tmp_path, "RAPID\nGOTO/0,0,1\nCYCLE/DRILL,RAPTO,5,FEDTO,-10,MMPM,50\nGOTO/10,0,0\nCYCLE/OFF\n")
    np.testing.assert_allclose(m.points * 1e3, [[0, 0, 1], [0, 0, 5], [10, 0, 5], [10, 0, -10], [10, 0, 5]], atol=1e-12)
