"""G-code programs: modes, arcs in all planes, rotary axes, faults."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from toolpath_cases import SAMPLES, gcode

from machining.toolpaths import read_gcode, tool_axis
from robots import InputErrors

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
    with pytest.raises(InputErrors, match="--rotary table-AC"):
        read_gcode(path)
    with pytest.raises(InputErrors, match="rotary axis A"):
        read_gcode(path, ReadOptions(rotary="table-BC"))


def test_rotary_axes_without_the_tip_programmed_are_refused_with_a_remedy(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z50 B0 C0\nG1 X1 B30 C10 F100\nM30\n"
    with pytest.raises(InputErrors, match=r"without tool centre point control.*--tcp"):
        gcode(tmp_path, program, rotary="head-BC")
    m = gcode(tmp_path, program, rotary="head-BC", tcp=True)
    b, c = math.radians(30), math.radians(10)
    expected = [math.sin(b) * math.cos(c), math.sin(b) * math.sin(c), math.cos(b)]
    np.testing.assert_allclose(m.axes[-1], expected, atol=1e-15)
    for on, off in (("TRAORI", "TRAFOOF"), ("G43.4 H1", "G49"), ("G234", "G49")):
        assert gcode(tmp_path, f"{on}\n{program}", rotary="head-BC").n == 2
        with pytest.raises(InputErrors, match="without tool centre point"):
            gcode(tmp_path, f"{on}\n{off}\n{program}", rotary="head-BC")
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
    with pytest.raises(InputErrors, match="inverse time without F"):
        gcode(tmp_path, "G0 X0 Y0 Z0\nG93 G1 X1 F2\nX2\nM30\n")


def test_words_without_spaces_with_spaces_and_in_small_letters(tmp_path: Path) -> None:
    m = gcode(tmp_path, "n10g0x1.5y-.5z+2(go)\n/N20 g1 X 3. y 4 z5 f 100 ; on\n%\nO7\nm30\n")
    np.testing.assert_allclose(m.points * 1e3, [[1.5, -0.5, 2], [3, 4, 5]])
    assert [e.text for e in m.events if e.word == "comment"] == ["go", "on"]
    assert any("skip_deleted" in n.text for n in m.notes)
    assert gcode(tmp_path, "G0 X0Y0Z0\n/G0 X9\n/3 G0 X8\nM30\n", skip_deleted=True).n == 1


def test_the_end_of_the_program(tmp_path: Path) -> None:
    assert gcode(tmp_path, "%\nG21 G0 X0 Y0 Z0\nM30\n%\n\x1a", head="").n == 1
    for behind in ("M30\nG0 X1\n", "M30\n%\nO2\nG0 X1\nM30\n", "%\nG0 X1\n", "M30\nS500\n"):
        with pytest.raises(InputErrors, match=r"line \d: a block behind the end"):
            gcode(tmp_path, "G0 X0 Y0 Z0\n" + behind)
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
    with pytest.raises(InputErrors, match=r"line 4: a move at feed while Z is not known.*start="):
        gcode(tmp_path, "G0 X0 Y0 Z5\nG28 Z5\nG1 X1 F100\nM30\n")
    with pytest.raises(InputErrors, match="while Y, Z is not known"):
        gcode(tmp_path, "G1 X1 F100\nM30\n")
    assert gcode(tmp_path, "G1 X1 F100\nM30\n", start=(0.0, 0.0, 0.1)).points[0].tolist() == [0.001, 0, 0.1]


def test_work_offsets(tmp_path: Path) -> None:
    program = "G54\nG0 X1 Y1 Z1\nG55\nG0 X1 Y1 Z1\nM30\n"
    with pytest.raises(InputErrors, match=r"line 5: motion in G55.*--read G54=X,Y,Z --read G55=X,Y,Z"):
        gcode(tmp_path, program)
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
    with pytest.raises(InputErrors, match=f"line 3: (?s:.*)({word})"):
        gcode(tmp_path, f"G0 X0 Y0 Z0\n{block}\nM30\n")


def test_coordinates_need_a_motion_code_and_a_unit(tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match="without a motion code"):
        gcode(tmp_path, "G0 X0 Y0 Z0\nG80\nX5\nM30\n")
    with pytest.raises(InputErrors, match="unit of length"):
        gcode(tmp_path, "G0 X0 Y0 Z0\nM30\n", head="")
    assert gcode(tmp_path, "G0 X1 Y0 Z0\nM30\n", head="", units="inch").points[0, 0] == 0.0254


def test_codes_left_out_when_asked_make_the_position_unknown(tmp_path: Path) -> None:
    program = "G0 X0 Y0 Z0\nG33 Z-5 K1\nG0 Z3\nM30\n"
    # The tool is taken up from where it was left, and comes down where it is known again.
    m = gcode(tmp_path, program, unknown_motion="report")
    np.testing.assert_allclose(m.points[:, 2] * 1e3, [0, 13, 3])
    with pytest.raises(InputErrors, match="Z is not known"):
        gcode(tmp_path, "G0 X0 Y0 Z0\nG33 Z-5 K1\nG1 X3 F100\nM30\n", unknown_motion="report")


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
