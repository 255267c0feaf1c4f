"""APT and CLSF files: every word, samples in the form of each CAM system."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses, refuses_each
from toolpath_cases import SAMPLES, apt

from machining.toolpaths import Tool, read_apt

MM_PER_MIN = 1e-3 / 60
RPM = 2 * math.pi / 60


def test_siemens_nx() -> None:
    m = read_apt(SAMPLES / "nx.cls")
    assert m.operations == ("CONTOUR_A", "HOLES")
    assert (m.tools[0].number, m.tools[0].name, m.tools[1].number, m.tools[1].name) == (3, "EM10", 4, "DR6")
    np.testing.assert_allclose(
        [[t.diameter, t.corner_radius, t.length] for t in m.tools], [[0.01, 0.001, 0.075], [0.006, 0, 0.09]]
    )
    arc = m.line == 20
    # The corner arc of NX turns clockwise about its vector: a quarter turn below the centre, not three quarters.
    np.testing.assert_allclose(np.linalg.norm(m.points[arc][:, :2], axis=1), 0.01, atol=1e-15)
    assert (m.points[arc][:, :2] <= 1e-12).all()
    np.testing.assert_array_equal(m.points[arc][-1], [0, -0.01, -0.002])
    np.testing.assert_allclose(m.feed[m.line == 17], 250 * MM_PER_MIN)
    np.testing.assert_allclose(m.feed[arc], 900 * MM_PER_MIN)
    assert m.rapid[np.isin(m.line, [12, 14, 24])].all()
    assert np.isnan(m.feed[m.rapid]).all()
    np.testing.assert_allclose(m.spindle[m.operation == 0], 6000 * RPM)
    hole = np.isin(m.line, [35, 36])
    # Above the first hole already: down to 3, drilled to -12, out to 3 and 20; across at 20 to the next hole.
    np.testing.assert_allclose(m.points[hole][:, 2] * 1e3, [3, -12, 3, 20, 20, 3, -12, 3, 20], atol=1e-12)
    assert m.rapid[hole].tolist() == [True, False, True, True, True, True, False, True, True]
    np.testing.assert_allclose(m.feed[hole][~m.rapid[hole]], 180 * MM_PER_MIN)
    np.testing.assert_allclose(m.dwell[hole], [0, 0.5, 0, 0, 0, 0, 0.5, 0, 0])
    assert [e.word for e in m.events if e.word == "COOLNT"] == ["COOLNT"]
    assert [str(n) for n in m.notes] == ["line 16: no UNITS in the file: taken as mm from the feed unit MMPM"]


def test_catia() -> None:
    m = read_apt(SAMPLES / "catia.aptsource")
    assert m.operations == ("Profile Contouring.1",)
    assert m.tools[0].number == 7
    np.testing.assert_allclose([m.tools[0].diameter, m.tools[0].corner_radius, m.tools[0].length], [0.016, 0.002, 0.05])
    arc = m.line == 19
    np.testing.assert_allclose(np.linalg.norm(m.points[arc], axis=1), 0.005, atol=1e-15)
    np.testing.assert_allclose(m.points[arc][-1], [0, 0.005, 0], atol=1e-15)
    # The last chord of a quarter turn that starts upwards ends leftwards.
    assert (m.points[arc][:, :2] >= -1e-12).all()
    np.testing.assert_allclose(m.axes[arc], [[0, 0.6, 0.8]] * arc.sum(), atol=1e-12)
    assert m.dwell[m.line == 22] == 1.5
    assert (m.spindle == -1200 * RPM).all()


def test_creo() -> None:
    m = read_apt(SAMPLES / "creo.ncl")
    inch = 0.0254
    helix = m.line == 16
    turns = np.unwrap(np.arctan2(m.points[helix][:, 1], m.points[helix][:, 0]))
    # Right hand: counter-clockwise, a full turn, rising from -0.1 to -0.05 inch in step with the angle.
    assert turns[-1] - turns[0] == pytest.approx(2 * math.pi * (1 - 1 / helix.sum()), rel=1e-9)
    fraction = np.arange(1, helix.sum() + 1) / helix.sum()
    np.testing.assert_allclose(m.points[helix][:, 2], (-0.1 + 0.05 * fraction) * inch, atol=1e-15)
    np.testing.assert_allclose(m.feed[helix], 8 * inch / 60)
    assert m.feed[-1] == pytest.approx(0.004 * inch * 1500 / 60)
    assert m.points[-1][0] == 2 * inch


def test_autodesk() -> None:
    m = read_apt(SAMPLES / "autodesk.apt")
    assert m.rapid[[0, 1, -1]].all()
    np.testing.assert_array_equal(m.points[0], [0, 0, 0.1])
    angle = np.unwrap(np.arctan2(m.points[m.line == 14][:, 1], m.points[m.line == 14][:, 0]))
    assert angle[-1] - math.pi / 2 == pytest.approx(1.5 * math.pi)
    # GOHOME: up to 10 above FROM, and across to above its point.
    home = [[0.02, 0, 0.11], [0, 0, 0.11]]
    np.testing.assert_allclose(m.points[-4:], [[0.02, 0, 0.015], [0.02, 0, 0.02], *home], atol=1e-15)


def test_a_goto_without_axis_keeps_the_last_one_and_makes_it_a_unit_vector(tmp_path: Path) -> None:
    m = apt(tmp_path, "GOTO/0,0,0\nGOTO/1,0,0,0,3,4\nGOTO/2,0,0\nTLAXIS/1,0,0\nGOTO/3,0,0\n")
    np.testing.assert_allclose(m.axes, [[0, 0, 1], [0, 0.6, 0.8], [0, 0.6, 0.8], [1, 0, 0]])
    assert any("differ from length 1" in n.text and n.line == 3 for n in m.notes)


@pytest.mark.parametrize("off", [5e-4, 2e-3])
def test_axes_off_unit_length_are_remarked_on_from_a_thousandth(tmp_path: Path, off: float) -> None:
    m = apt(tmp_path, f"GOTO/0,0,0,0,0,{1 + off}\nFINI\n")
    assert any("length 1" in n.text for n in m.notes) == (off > 1e-3)


def test_rapid_holds_for_one_motion(tmp_path: Path) -> None:
    text = "FEDRAT/600,MMPM\nGOTO/0,0,0\nRAPID\nPPRINT/between\nGOTO/1,0,0\nGOTO/2,0,0\nRAPID\n"
    m = apt(tmp_path, text + "CIRCLE/2,1,0,0,0,1,1\nGOTO/2,2,0\nGODLTA/0,0,1\n")
    arc = m.line == 10
    assert m.rapid.tolist() == [False, True, False, *[True] * arc.sum(), False]
    assert np.isnan(m.feed[m.rapid]).all()
    np.testing.assert_allclose(m.feed[~m.rapid], 600 * MM_PER_MIN)


@pytest.mark.parametrize(
    ("words", "speed"),
    [
        ("600,MMPM", 600 * MM_PER_MIN),
        ("MMPM,600", 600 * MM_PER_MIN),
        ("PERMIN,600", 600 * MM_PER_MIN),
        ("600", 600 * MM_PER_MIN),
        ("24,IPM", 24 * 0.0254 / 60),
        ("MMPR,0.1", 0.1e-3 * 1200 / 60),
        ("0.004,IPR", 0.004 * 0.0254 * 1200 / 60),
        ("1.2D+02,MMPM", 120 * MM_PER_MIN),
    ],
)
def test_feeds(tmp_path: Path, words: str, speed: float) -> None:
    m = apt(tmp_path, f"FEDRAT/{words}\nSPINDL/RPM,1200,CLW\nGOTO/0,0,0\n")
    assert m.feed[0] == pytest.approx(speed, rel=1e-12)


def test_a_feed_per_turn_follows_the_spindle_and_is_unknown_without_one(tmp_path: Path) -> None:
    text = (
        "FEDRAT/0.1,MMPR\nGOTO/0,0,0\nSPINDL/600,RPM,CLW\nGOTO/1,0,0\nSPINDL/1200\nGOTO/2,0,0\nSPINDL/OFF\nGOTO/3,0,0\n"
    )
    m = apt(tmp_path, text)
    np.testing.assert_allclose(m.feed, [np.nan, 1e-3, 2e-3, np.nan])
    np.testing.assert_allclose(m.spindle, [0, 600 * RPM, 1200 * RPM, 0])
    assert any("without a feed that is known" in n.text for n in m.notes)


@pytest.mark.parametrize(
    ("words", "speed"),
    [("RPM,100,CLW", 100), ("100,RPM,CCLW", -100), ("100", 100), ("100,CCLW", -100), ("OFF", 0), ("ON", math.nan)],
)
def test_spindle(tmp_path: Path, words: str, speed: float) -> None:
    m = apt(tmp_path, f"SPINDL/{words}\nGOTO/0,0,0\n")
    np.testing.assert_allclose(m.spindle, [speed * RPM])


def test_inch_scales_points_radii_and_tools(tmp_path: Path) -> None:
    text = "CUTTER/0.5,0.125\nLOADTL/9\nGOTO/1,0,0\nCIRCLE/0,0,0,0,0,1,1\nGOTO/0,1,0\n"
    m = apt(tmp_path, text, head="UNITS/INCHES\n")
    np.testing.assert_allclose(np.linalg.norm(m.points, axis=1), 0.0254, rtol=1e-12)
    assert m.tools[0] == pytest.approx(Tool(9, "", 0.0127, 0.003175)) or m.tools[0].diameter == pytest.approx(0.0127)
    assert m.tools[0].corner_radius == pytest.approx(0.003175)


def test_the_unit_must_be_known_and_stay(tmp_path: Path) -> None:
    refuses_each("P003", "no unit of length", apt, tmp_path, "GOTO/0,0,0\n", head="")
    assert apt(tmp_path, "GOTO/25.4,0,0\n", head="", units="mm").points[0, 0] == pytest.approx(0.0254)
    assert apt(tmp_path, "GOTO/1,0,0\n", head="", units="inch").points[0, 0] == pytest.approx(0.0254)
    # What the file says counts, not the option.
    assert apt(tmp_path, "GOTO/1,0,0\n", units="inch").points[0, 0] == pytest.approx(0.001)
    refuses_each("P003", "changes", apt, tmp_path, "GOTO/1,0,0\nUNITS/INCHES\nGOTO/1,0,0\n")
    refuses_each("P003", "unit of length 'PARSEC'", apt, tmp_path, "GOTO/1,0,0\n", head="UNITS/PARSEC\n", units="mm")


def test_continuation_comments_and_spaces(tmp_path: Path) -> None:
    text = "GOTO  / 1.0,  $ rest of the line is a comment\n  2.0,$\n   3.0 $$ done\n$$ GOTO/9,9,9\n"
    text += "  goto/4,5,6\nPPRINT costs $5 a piece\n"
    m = apt(tmp_path, text)
    np.testing.assert_allclose(m.points * 1e3, [[1, 2, 3], [4, 5, 6]])
    assert m.line.tolist() == [2, 6]
    assert [e.text for e in m.events if e.word == "PPRINT"] == ["costs $5 a piece"]


def test_windows_and_old_mac_line_ends_and_a_byte_order_mark_in_text(tmp_path: Path) -> None:
    for end in ("\r\n", "\r", "\n"):
        m = apt(tmp_path, f"PARTNO caf\xe9 {end}GOTO/1,2,3{end}GOTO/4,5,6{end}FINI{end}", head=f"UNITS/MM{end}")
        assert m.line.tolist() == [3, 4]
        assert m.events[0].text == "caf\xe9"


def test_dwell_units(tmp_path: Path) -> None:
    m = apt(tmp_path, "SPINDL/RPM,60,CLW\nGOTO/0,0,0\nDELAY/2\nDWELL/0.5\nGOTO/1,0,0\nDELAY/REV,3\nGOTO/2,0,0\n")
    np.testing.assert_allclose(m.dwell, [2.5, 3.0, 0])


def test_gohome_without_a_point_is_said_and_forgets_where_the_tool_is(tmp_path: Path) -> None:
    m = apt(tmp_path, "GOTO/0,0,0\nGOHOME\nGOTO/1,0,0\nFINI\n")
    np.testing.assert_allclose(m.points * 1e3, [[0, 0, 0], [0, 0, 10], [1, 0, 10], [1, 0, 0]])
    assert m.rapid.tolist() == [False, True, True, False]
    assert any("GOHOME" in n.text for n in m.notes)
    refuses_each("P011", "GODLTA without a point", apt, tmp_path, "GOTO/0,0,0\nGOHOME\nGODLTA/1\n")


def test_kept_words_are_events_in_order_with_the_move_they_come_before(tmp_path: Path) -> None:
    text = "COOLNT/FLOOD\nGOTO/0,0,0\nSTOP\nOPSTOP\nRETRCT\nPAINT/COLOR,3\nSELECT/TOOL,5\n"
    text += "GOTO/1,0,0\nCUTCOM/LEFT\nINSERT/note\nFINI\n"
    m = apt(tmp_path, text)
    got = [(e.word, e.move, e.line) for e in m.events]
    assert got == [
        ("COOLNT", 0, 2),
        ("STOP", 1, 4),
        ("OPSTOP", 1, 5),
        ("RETRCT", 1, 6),
        # Up for RETRCT, across and down behind it.
        ("SELECT", 2, 8),
        ("CUTCOM", 4, 10),
        ("INSERT", 4, 11),
        ("FINI", 4, 12),
        # The end of a program ends the coolant.
        ("FINI", 4, 12),
    ]
    assert sum("CUTCOM" in n.text or "RETRCT" in n.text for n in m.notes) == 2


@pytest.mark.parametrize(("cutter", "refused"), [("CUTTER/0,0,0\n", True), ("CUTTER/10,0,0\n", False), ("", False)])
def test_compensation_of_a_cutter_without_width_is_refused(tmp_path: Path, cutter: str, refused: bool) -> None:
    text = f"{cutter}GOTO/0,0,0\nCUTCOM/LEFT\nGOTO/1,0,0\nCUTCOM/OFF\nFINI\n"
    if refused:
        refuses_each("P015", "diameter 0", apt, tmp_path, text)
    m = apt(tmp_path, text, compensation="centre")
    np.testing.assert_allclose(m.points * 1e3, [[0, 0, 0], [1, 0, 0]])


def test_data_of_a_tool_do_not_stay_on_the_next(tmp_path: Path) -> None:
    m = apt(tmp_path, "CUTTER/10,1\nLOADTL/1\nGOTO/0,0,0\nLOADTL/2\nGOTO/1,0,0\nLOADTL/2\nGOTO/2,0,0\n")
    assert m.tool.tolist() == [0, 1, 1]
    assert math.isnan(m.tools[1].diameter)


def test_frames(tmp_path: Path) -> None:
    turned = "MSYS/100,0,0,0,1,0,-1,0,0\n"
    text = "GOTO/1,2,3,1,0,0\n" + turned + "GOTO/1,2,3\n"
    info = refuses_each("P013", "second frame", apt, tmp_path, text)
    assert "frames=written" in str(info)
    np.testing.assert_allclose(apt(tmp_path, text, frames="written").points * 1e3, [[1, 2, 3]] * 2)
    m = apt(tmp_path, text, frames="absolute")
    # x axis of the system along y, y axis along -x.
    np.testing.assert_allclose(m.points * 1e3, [[1, 2, 3], [98, 1, 3]], atol=1e-12)
    np.testing.assert_allclose(apt(tmp_path, turned + "GOTO/1,2,3\n").points * 1e3, [[1, 2, 3]])
    m = apt(tmp_path, turned + "GOTO/1,2,3,1,0,0\nCIRCLE/0,2,3,0,0,1,1\nGOTO/-1,2,3\n", frames="absolute")
    np.testing.assert_allclose(m.axes, [[0, 1, 0]] * m.n, atol=1e-12)
    np.testing.assert_allclose(m.points[-1] * 1e3, [98, -1, 3], atol=1e-12)
    m = apt(tmp_path, "TRANS/1,2,3\nORIGIN/10,0,0\nGOTO/0,0,0\n", frames="absolute")
    np.testing.assert_allclose(m.points * 1e3, [[-9, 2, 3]])


@pytest.mark.parametrize("frame", ["MSYS/0,0,0,1,0,0,1,0,0", "MSYS/0,0,0,2,0,0,0,1,0", "TRANS/1,2", "CSYS/1,2,3"])
def test_frames_that_are_none_are_refused(tmp_path: Path, frame: str) -> None:
    refuses_each("P013 P020", "line 2", apt, tmp_path, frame + "\nGOTO/0,0,0\n")


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("GOTO/1,2\n", 2, "2 numbers"),
        ("GOTO/1,2,3,4\n", 2, "4 numbers"),
        ("GOTO/1,2,P1\n", 2, "P1"),
        ("GOTO/1,2,nan\n", 2, "finite"),
        ("GOTO/1,2,inf\n", 2, "finite"),
        ("GOTO/1,2,1e999\n", 2, "finite"),
        ("GOTO/1_0,2,3\n", 2, "1_0"),
        ("GOTO/1,2,3,0,0,0\n", 2, "tool axis"),
        ("GOTO/1,2,$\n", 2, "ends within a statement"),
        ("GOTO/0,0,0\nCIRCLE/0,1,0,0,0,1,1\n", 3, "without its GOTO"),
        ("GOTO/0,0,0\nCIRCLE/0,1,0,0,0,1,1\nCIRCLE/0,1,0,0,0,1,1\nGOTO/0,2,0\n", 4, "without its GOTO"),
        ("CIRCLE/0,1,0,0,0,1,1\nGOTO/0,2,0\n", 3, "without a point before"),
        ("GOTO/0,0,0\nCIRCLE/0,1,0,0,0,1,1\nGOTO/0,2.5,0\n", 4, "1.5 mm at the end"),
        ("GOTO/0,0,0\nCIRCLE/0,1,0,0,0,1,7\nGOTO/0,2,0\n", 4, "7 mm stated"),
        ("GOTO/0,0,0\nCIRCLE/0,1,0\nGOTO/0,2,0\n", 3, "3 numbers"),
        ("GOTO/0,0,0\nMOVARC/0,1,0,0,0,1,1,ANGLE,90\nGOTO/0,2,0\n", 4, "does not lead"),
        ("GOTO/0,0,0\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,1,0,1),ON,(LINE/0,1,0,0,2,0)\n", 4, "tangent"),
        ("GOTO/0,0,0\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,1,0,1),ON,(LINE/0,1,0,-1,1,0)\n", 4, "first"),
        ("GODLTA/1\n", 2, "without a point"),
        ("FEDRAT/-3\nGOTO/0,0,0\n", 2, "feed"),
        ("FEDRAT/3,FURLONG\nGOTO/0,0,0\n", 2, "FURLONG"),
        ("SPINDL/-3\nGOTO/0,0,0\n", 2, "spindle"),
        ("GOTO/0,0,0\nDELAY/-1\n", 3, "dwell"),
        ("1.0, 2.0, 3.0\nGOTO/0,0,0\n", 2, "numbers without a word"),
        ("/1.0,2.0,3.0\nGOTO/0,0,0\n", 2, "numbers without a word"),
    ],
)
def test_faults_come_with_their_line(tmp_path: Path, text: str, line: int, word: str) -> None:
    refuses_each("P004 P011 P020", f"line {line}: .*{word}", apt, tmp_path, text)


@pytest.mark.parametrize(
    "word",
    ["GORGT/X", "GOLFT/A,B", "TLLFT,GOFWD/C1", "NURBS/", "COPY/1,5", "CALL/HOLE,X=3", "ARC/1,2", "N20 GOTO/1,2,3"],
)
def test_words_that_sound_like_motion_are_faults_unless_asked(tmp_path: Path, word: str) -> None:
    text = f"GOTO/0,0,0\n{word}\nGOTO/1,0,0\n"
    refuses_each("P019", r"line 3: .*sounds like a motion", apt, tmp_path, text)
    m = apt(tmp_path, text, unknown_motion="report")
    assert m.n == 2
    assert any("left out, as asked" in n.text for n in m.notes)


def test_words_that_are_not_known_are_refused_or_left_out_as_asked(tmp_path: Path) -> None:
    text = "RAPID\nGOTO/0,0,0\nWIBBLE/7\nWIBBLE/8\nFINI\n"
    refuses_each("P019", "line 4: WIBBLE: may change the path", apt, tmp_path, text)
    m = apt(tmp_path, text, unknown_motion="report")
    assert [(e.word, e.text) for e in m.events][:2] == [("WIBBLE", "7"), ("WIBBLE", "8")]
    assert [(n.line, n.count) for n in m.notes] == [(4, 2)]


def test_all_faults_come_at_once_and_only_twenty_are_shown(tmp_path: Path) -> None:
    info = refuses_each("P020", "", apt, tmp_path, "GOTO/0,0\n" * 50)
    assert (str(info).count("  - "), info.count) == (20, 50)
    assert "and 30 more" in str(info)


def test_a_file_cut_short_is_said(tmp_path: Path) -> None:
    assert any("cut short" in n.text for n in apt(tmp_path, "RAPID\nGOTO/0,0,0\n").notes)
    assert not apt(tmp_path, "RAPID\nGOTO/0,0,0\nFINI\n").notes
    refuses_each("P002", "no motion", apt, tmp_path, "FINI\n")


def test_arcs_of_several_points_and_of_several_turns(tmp_path: Path) -> None:
    text = "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1,1\nGOTO/0,1,0,-1,0,0,0,-1,0\n"
    m = apt(tmp_path, text)
    assert m.points[-1][1] == -1e-3
    assert np.unwrap(np.arctan2(m.points[:, 1], m.points[:, 0]))[-1] == pytest.approx(1.5 * math.pi)
    m = apt(tmp_path, "GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1,1,TIMES,3\nGOTO/1,0,6\n")
    assert np.unwrap(np.arctan2(m.points[:, 1], m.points[:, 0]))[-1] == pytest.approx(6 * math.pi)


@pytest.mark.parametrize(
    ("numbers", "hand", "quarter"),
    [(7, "auto", True), (11, "auto", False), (7, "left", False), (11, "right", True)],
)
def test_the_hand_of_a_circle(tmp_path: Path, numbers: int, hand: str, quarter: bool) -> None:
    rest = ",0.06,0.5,10,0" if numbers == 11 else ""
    m = apt(tmp_path, f"GOTO/1,0,0\nCIRCLE/0,0,0,0,0,1,1{rest}\nGOTO/0,1,0\n", circle_axis=hand)
    angle = np.unwrap(np.arctan2(m.points[:, 1], m.points[:, 0]))[-1]
    assert angle == pytest.approx(math.pi / 2 if quarter else -1.5 * math.pi)


def test_catia_arcs_in_any_plane_and_past_half_a_turn(tmp_path: Path) -> None:
    text = "GOTO/5,0,0\nINDIRV/0,0,1\nTLON,GOFWD/(CIRCLE/0,0,0,5),ON,2,INTOF,(LINE/0,0,0,0,0,-5)\n"
    m = apt(tmp_path, text)
    angle = np.unwrap(np.arctan2(m.points[:, 2], m.points[:, 0]))
    assert angle[-1] == pytest.approx(1.5 * math.pi)
    cylinder = (
        "GOTO/5,0,0\nINDIRV/0,0,-1\nTLON,GOFWD/(CYLNDR/0,0,0,0,1,0,5),ON,$\n(PLANE/PERPTO,(PLANE/(POINT/0,0,0),PERPTO,"
        "(VECTOR/0,1,0)),(POINT/0,0,0),$\n(POINT/0,0,-5))\n"
    )
    m = apt(tmp_path, cylinder)
    angle = np.unwrap(np.arctan2(m.points[:, 2], m.points[:, 0]))
    assert angle[-1] == pytest.approx(-math.pi / 2)


def test_options_out_of_range() -> None:
    from machining.toolpaths import ReadOptions

    for bad in ({"units": "m"}, {"chord_tolerance": 0.0}, {"rotary": "table-XY"}, {"max_bytes": 0}, {"start": (0, 0)}):
        refuses("P007", "option", ReadOptions, **bad)
