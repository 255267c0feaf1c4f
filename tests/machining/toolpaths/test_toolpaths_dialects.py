"""Dialects of G-code and APT: TRAORI vectors, tilted planes, modal cycles, variables, subprograms, set-ups."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses_each
from toolpath_cases import SAMPLES, apt, gcode

from machining.toolpaths import Motions, ReadOptions, read_heidenhain, read_toolpath


def test_sinumerik_vectors_swivels_and_modal_cycles() -> None:
    m = read_toolpath(SAMPLES / "sinumerik.mpf")
    at = {line: m.points[m.line == line] * 1e3 for line in set(m.line.tolist())}
    assert [t.name for t in m.tools] == ["MILL_10"]
    np.testing.assert_allclose(at[11], [[10, 20, 0]])
    np.testing.assert_allclose(m.axes[m.line == 11], [[0.6, 0, 0.8]])
    np.testing.assert_allclose(at[12], [[15, 7, 0]])
    # Swivelled by 90 deg about Y at (10, 20, 30): its z is the part's x, its x the part's -z.
    # Up along (0.6, 0, 0.8) to 102, 10 above (20, 10, 100) at 92; it turns where x is 30, too, and goes down along x.
    away = [15 + 93 * 0.6, 7, 93 * 0.8]
    corner = [30, 0.5 * (7 + 22), (102 - 30 * 0.6) / 0.8]
    np.testing.assert_allclose(at[14], [away], atol=1e-9)
    np.testing.assert_allclose(at[15], [corner, corner, [30, 22, 29], [10 + 3, 20 + 2, 30 - 1]], atol=1e-9)
    np.testing.assert_allclose(at[16], [[10, 22, 29]], atol=1e-9)
    np.testing.assert_allclose(m.axes[m.line == 16], [[1, 0, 0]], atol=1e-12)
    # The first peck goes to 5 below the reference, the second 5 deeper.
    assert np.round(at[20][at[20][:, 2] < 0][:, 2], 3).tolist() == [-5, -4.746, -10]
    np.testing.assert_allclose(at[20][-1], [10, 10, 20])
    np.testing.assert_allclose(at[21][-1], [20, 10, 20])
    np.testing.assert_allclose(at[23], [[20, 10, 100]])


def swivel(
    mode: int,
    angles: tuple[str | float, ...],
    origin: tuple[float, ...] = (0, 0, 50),
    behind: tuple[float, ...] = (0, 0, 0),
    status: int = 200000,
    direction: int = 1,
) -> str:
    numbers = ",".join(map(str, (status, mode, *origin, *angles, *behind, direction)))
    return f'CYCLE800(2,"TABLE",{numbers},,1)'


@pytest.mark.parametrize(
    ("mode", "angles", "zxz"),
    [
        # The mode names the axes in two bits each; the same planes by the Euler angles about z, x, z that G68.2 takes.
        (57, (-15, 0, 0), (0, -15, 0)),
        (54, (7, 0, 0), (90, 7, -90)),
        (39, (-45, 54.365, 0), (-45, 54.365, 0)),
        (39, (45, 54.365, 0), (45, 54.365, 0)),
        (27, (13, 0, 0), (13, 0, 0)),
        (30, (13, 0, 0), (90, 13, -90)),
        (45, (13, 0, 0), (0, 13, 0)),
        (57, ("R1", 0, 0), (0, 20, 0)),
    ],
)
def test_a_swivel_is_the_plane_of_its_euler_angles(
    tmp_path: Path, mode: int, angles: tuple[str | float, ...], zxz: tuple[float, ...]
) -> None:
    def read(on: str) -> Motions:
        return gcode(tmp_path, f"R1=20\n{on}\nG1 X1 Y2 Z3 F100\nX4 Y-5 Z6\nM30\n")

    siemens = read(swivel(mode, angles))
    fanuc = read("G68.2 X0 Y0 Z50 I{} J{} K{}\nG53.1".format(*zxz))
    np.testing.assert_allclose(siemens.points, fanuc.points, atol=1e-12)
    np.testing.assert_allclose(siemens.axes, fanuc.axes, atol=1e-12)


def test_a_swivel_may_add_to_the_one_before(tmp_path: Path) -> None:
    first = swivel(57, (-15, 0, 0), behind=(0, 10, 0), direction=0)
    second = swivel(54, (7, 0, 0), (35, -24, 0), status=200001)
    m = gcode(tmp_path, f"{first}\n{second}\nG1 X0 Y0 Z0 F100\nM30\n")
    # By hand: 10 - 24 mm along the y axis that the first one has tilted, then a turn by 7 deg about that axis.
    c, s, c7, s7 = *(f(np.radians(15)) for f in (np.cos, np.sin)), *(f(np.radians(7)) for f in (np.cos, np.sin))
    np.testing.assert_allclose(m.points * 1e3, [[35, -14 * c, 50 + 14 * s]], atol=1e-9)
    np.testing.assert_allclose(m.axes, [[s7, s * c7, c * c7]], atol=1e-12)


def test_a_refused_line_draws_no_faults_of_lines_behind_it(tmp_path: Path) -> None:
    refused = refuses_each("P015", "", gcode, tmp_path, "G0 X0 Y0 Z0\nG1 X15 F100 G41 D5\nY8\nG3 X10 Y13 R5\nM30\n")
    assert "1 problem(s)" in str(refused)


def test_tilted_plane_subprogram_and_variables() -> None:
    m = read_toolpath(SAMPLES / "tilted.nc")
    ends = np.round(m.points * 1e3, 9)
    # Twice 5 mm by the subprogram.
    assert [5, 0, 50] in ends.tolist()
    assert [10, 0, 50] in ends.tolist()
    # Rx(90): its y is the part's z, its z the part's -y.
    np.testing.assert_allclose(m.points[m.line == 12][-1] * 1e3, [11, -3, 2], atol=1e-9)
    np.testing.assert_allclose(m.points[m.line == 13] * 1e3, [[11, 12.5, 2]], atol=1e-9)
    np.testing.assert_allclose(m.feed[m.line == 13], 500e-3 / 60)
    np.testing.assert_allclose(m.axes[m.line == 13], [[0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(m.axes[-1], [0, 0, 1])


def test_set_ups_of_coordinates_in_the_part_tell_the_tool_axis() -> None:
    m = read_toolpath(SAMPLES / "solidworks.apt")
    np.testing.assert_allclose(m.points * 1e3, [[30, 0, 5], [10, 0, 5], [0, 0, 30], [0, 0, 10]])
    # Without a tool axis in GOTO it is that of the set-up, not that of the set-up before.
    np.testing.assert_allclose(m.axes, [[1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 1]])


def test_a_second_set_up_without_coordinates_in_the_part_is_refused(tmp_path: Path) -> None:
    text = (SAMPLES / "solidworks.apt").read_text().replace("TRNTYP/WORLD,0,0,0\n", "")
    refuses_each("P013", r"second frame.*--read frames=written", apt, tmp_path, text, head="")


def test_words_of_creo_in_comments_run_over_lines(tmp_path: Path) -> None:
    m = apt(
        tmp_path, "$$-> CSYS / 1.0, 0.0, 0.0, 0.0, $\n 0.0, 1.0, 0.0, 0.0, $\n 0.0, 0.0, 1.0, 0.0\nGOTO/1,2,3\nFINI\n"
    )
    np.testing.assert_allclose(m.points * 1e3, [[1, 2, 3]])


@pytest.mark.parametrize("word", ["G41 D1", "G42 D1"])
def test_cutter_compensation_is_refused_unless_points_are_centres(tmp_path: Path, word: str) -> None:
    program = f"G0 X0 Y0 Z0\n{word}\nG1 X10 F100\nG40\nM30\n"
    refuses_each("P015", r"line 3.*--read compensation=centre", gcode, tmp_path, program)
    m = gcode(tmp_path, program, compensation="centre")
    np.testing.assert_allclose(m.points[-1] * 1e3, [10, 0, 0])
    assert any("as asked" in note.text for note in m.notes)


def test_rotary_axes_that_turn_the_other_way(tmp_path: Path) -> None:
    program = "G43.4 H1\nG0 X0 Y0 Z5 A30 C90\nM30\n"
    as_iso = gcode(tmp_path, program, rotary="table-AC").axes[-1]
    other = gcode(tmp_path, program, rotary="table-AC", rotary_reversed="C").axes[-1]
    np.testing.assert_allclose(other, as_iso * [-1, -1, 1], atol=1e-12)


def test_a_motion_code_holds_beside_the_end_of_a_cycle(tmp_path: Path) -> None:
    for words in ("G0 G80", "G80 G0"):
        m = gcode(tmp_path, f"G0 X0 Y0 Z5\nG81 X1 Z-2 R1 F100\n{words} X20\nM30\n")
        np.testing.assert_allclose(m.points[-1] * 1e3, [20, 0, 5])


def test_a_table_that_turns_the_part_without_the_tip_programmed(tmp_path: Path) -> None:
    # A point of the part at (10, 20, 0), a table of A and C whose axes meet at (0, 0, -50).
    pivot, q = np.array([0, 0, -50]), np.array([10, 20, 0])
    a, c = np.radians(30), np.radians(40)
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Rz = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    x, y, z = pivot + (Rz @ Rx).T @ (q - pivot)
    program = f"G0 X10 Y20 Z0 A0 C0\nG1 X{x:.9f} Y{y:.9f} Z{z:.9f} A30 C40 F100\nM30\n"
    refuses_each("P014", r"--read pivot=X,Y,Z", gcode, tmp_path, program, rotary="table-AC")
    table = {"rotary": "table-AC", "pivot": (0.0, 0.0, -0.05)}
    refuses_each("P022", r"--read rotary_feed=linear", gcode, tmp_path, program, **table)
    straight = float(np.linalg.norm([x - 10, y - 20, z]))
    ways = {"linear": straight, "vector": float(np.hypot(straight, 40.0))}
    for way, length in ways.items():
        m = gcode(tmp_path, program, **table, rotary_feed=way)
        parts = np.linalg.norm(np.diff(m.points, axis=0), axis=1)
        assert float((parts / m.feed[1:]).sum()) == pytest.approx(60.0 * length / 100.0, rel=1e-9)
    m = gcode(tmp_path, program.replace("G1", "G93 G1").replace("F100", "F2"), **table)
    assert float((parts / m.feed[1:]).sum()) == pytest.approx(30.0, rel=1e-9)
    np.testing.assert_allclose(m.points[[0, -1]] * 1e3, [q, q], atol=1e-6)
    np.testing.assert_allclose(m.axes[-1], Rz @ Rx @ [0, 0, 1], atol=1e-12)
    # The tip leaves the point on the way: it is followed in chords.
    assert m.n > 10
    refuses_each(
        "P014", "without tool centre point control", gcode, tmp_path, program, rotary="head-AC", pivot=(0.0, 0.0, -0.05)
    )


def test_arcs_on_a_turned_table_lie_in_the_part(tmp_path: Path) -> None:
    program = "G0 X10 Y0 Z0 A90 C0\nG2 X0 Y-10 I-10 J0 F100\nM30\n"
    m = gcode(tmp_path, program, rotary="table-AC", pivot=(0.0, 0.0, 0.0))
    # Rx(90): y becomes z.
    np.testing.assert_allclose(m.points[-1] * 1e3, [0, 0, -10], atol=1e-9)
    np.testing.assert_allclose(np.hypot(m.points[:, 0], m.points[:, 2]) * 1e3, 10, atol=1e-9)
    refuses_each(
        "P011",
        "while the table turns",
        gcode,
        tmp_path,
        program.replace("G2 X0", "G2 A0 X0"),
        rotary="table-AC",
        pivot=(0.0, 0.0, 0.0),
    )


def test_variables_that_a_program_declares(tmp_path: Path) -> None:
    program = "DEF REAL DEPTH = 2 * 3, WIDTH\nG0 X0 Y0 Z0\nG1 Z=-DEPTH F100\nWIDTH = DEPTH + 1\nG1 X=WIDTH\nM30\n"
    np.testing.assert_allclose(gcode(tmp_path, program).points[-1] * 1e3, [7, 0, -6])
    refuses_each("P018", "HEIGHT is no function", gcode, tmp_path, program.replace("X=WIDTH", "X=HEIGHT"))
    refuses_each("P017", r"line 2: .*macro", gcode, tmp_path, "DEF FRAME A_FRAME\nG0 X0 Y0 Z0\nM30\n")


# ------------------------------------------------------------
# Programs in Heidenhain's language: contours, polar coordinates, corners, cycles, labels, planes, faults

HEAD = "BEGIN PGM T MM\nTOOL CALL 1 Z S1000\nL X+0 Y+0 Z+0 FMAX M3\n"


def klartext(tmp_path: Path, text: str, **options: object) -> Motions:
    path = tmp_path / "program.h"
    path.write_text(f"{HEAD}{text}\nEND PGM T MM\n")
    return read_heidenhain(path, ReadOptions(**options))  # type: ignore[arg-type]


def ends(m: Motions) -> list[list[float]]:
    """Last point mm of each line of the file."""
    return [np.round(m.points[m.line == line][-1] * 1e3, 6).tolist() for line in dict.fromkeys(m.line.tolist())]


def test_a_whole_program() -> None:
    m = read_toolpath(SAMPLES / "klartext.h")
    assert [(t.number, t.name) for t in m.tools] == [(5, ""), (None, "DRILL_6")]
    at = {line: m.points[m.line == line] * 1e3 for line in set(m.line.tolist())}
    # A rounding of 10 mm at (40, 0) begins at (30, 0) and ends at (40, 10); a chamfer of 4 mm at (40, 30).
    np.testing.assert_allclose(at[8][-1], [30, 0, -5], atol=1e-9)
    np.testing.assert_allclose(np.hypot(at[9][:, 0] - 30, at[9][:, 1] - 10), 10, atol=1e-9)
    np.testing.assert_allclose(at[10], [[40, 26, -5]], atol=1e-9)
    np.testing.assert_allclose(at[11], [[36, 30, -5]], atol=1e-9)
    np.testing.assert_allclose(at[12], [[10, 30, -5]], atol=1e-9)
    # Half a circle about (10, 20) to the left, then a quarter about (20, 10), to the right.
    np.testing.assert_allclose(np.hypot(at[14][:, 0] - 10, at[14][:, 1] - 20), 10, atol=1e-9)
    # To the chord's tolerance of 2 um.
    assert at[14][:, 0].min() < 2.1e-3
    np.testing.assert_allclose(np.hypot(at[15][:, 0] - 10, at[15][:, 1]), 10, atol=1e-9)
    np.testing.assert_allclose(at[18][-1], [30, 20, -5], atol=1e-9)
    np.testing.assert_allclose(at[19][-1], [50, 0, -5], atol=1e-9)
    np.testing.assert_allclose(at[20], [[50, 0, 5]], atol=1e-9)
    assert m.rapid[m.line == 20].all()
    np.testing.assert_allclose(m.feed[m.line == 8], 600e-3 / 60)
    # Holes at X 20 and, three times 15 mm on, at 35, 50 and 65; each to -12 in pecks of 5.
    holes = m.points[(m.points[:, 2] < -11.9e-3)] * 1e3
    np.testing.assert_allclose(holes, [[x, 60, -12] for x in (20, 35, 50, 65)], atol=1e-9)
    np.testing.assert_allclose(m.feed[m.points[:, 2] < -11.9e-3], 150e-3 / 60)
    # Rz(90) Ry(30) z.
    plane = [0.0, math.sin(math.pi / 6), math.cos(math.pi / 6)]
    line = m.line.tolist().index(39)
    np.testing.assert_allclose(m.axes[line - 1], plane, atol=1e-12)
    np.testing.assert_allclose(at[38][-1] / 50, plane, atol=1e-12)
    np.testing.assert_allclose(m.axes[m.line == 43], [[0.6, 0, 0.8]], atol=1e-12)
    np.testing.assert_allclose(at[43], [[1, 2, 3]])
    assert not any("cut short" in note.text for note in m.notes)


def test_the_breaks_of_cycle_203_come_before_each_withdrawal() -> None:
    m = read_toolpath(SAMPLES / "klartext.h")
    heights = np.round(m.points[m.line == 32][:, 2] * 1e3, 3).tolist()
    # One break at -5, one withdrawal to 2 at -10 and back to 2 above it, the bottom, the second clearance.
    assert heights == [5, 2, -5, -4.746, -10, 2, -8, -12, 2, 20]


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("CC X+10 Y+0\nCP IPA+90 DR+ F100", [10, -10, 0]),
        ("CC X+10 Z+0\nCP IPA-90 DR- F100", [10, 0, -10]),
        ("CC Y+10 Z+0\nCP IPA+90 DR+ F100", [0, 10, -10]),
        ("CC X+0 Y-5\nLP PR+5 PA+0 F100", [5, -5, 0]),
        ("CC X+0 Y-5\nLP PR+5 PA+0 F100\nLP IPA+90", [0, 0, 0]),
        ("CC X+0 Y-5\nLP PR+5 PA+0 F100\nLP IPR+5", [10, -5, 0]),
        ("CYCL DEF 7.0 DATUM\nCYCL DEF 7.1 X+100\nL X+1 F100", [101, 0, 0]),
        ("CYCL DEF 7.0 DATUM\nCYCL DEF 7.1 X+100\nCYCL DEF 7.0 DATUM\nCYCL DEF 7.1 X+0\nL X+1 F100", [1, 0, 0]),
        ("CYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+90\nL X+10 Y+0 F100", [0, 10, 0]),
        ("Q5 = +3 * SIN 30\nL X-Q5 F100", [-1.5, 0, 0]),
        ("FN 0: Q1 = +7\nFN 2: Q2 = -2 - Q1\nL X+Q2 F100", [-9, 0, 0]),
        ("FN 4: Q1 = +7 DIV +2\nL IX+Q1 F100", [3.5, 0, 0]),
        ("L X10,5 F100", [10.5, 0, 0]),
        ("CALL LBL 1\nM30\nLBL 1\nL IX+5 F100\nLBL 0", [5, 0, 0]),
        ("L X+10 F100\nCT X+20 Y+10", [20, 10, 0]),
    ],
)
def test_statements(tmp_path: Path, text: str, end: list[float]) -> None:
    np.testing.assert_allclose(ends(klartext(tmp_path, text))[-1], end, atol=1e-9)


def test_an_arc_without_an_end_is_a_full_circle(tmp_path: Path) -> None:
    m = klartext(tmp_path, "CC X+10 Y+0\nC DR+ F100")
    on = m.points[m.line == 5] * 1e3
    np.testing.assert_allclose(on[:, 0].max(), 20, atol=1e-2)
    np.testing.assert_allclose(np.hypot(on[:, 0] - 10, on[:, 1]), 10, atol=1e-9)


def test_inches_and_their_feeds(tmp_path: Path) -> None:
    path = tmp_path / "inch.h"
    path.write_text("BEGIN PGM A INCH\nTOOL CALL 1 Z S1000\nL X+0 Y+0 Z+0 FMAX\nL X+1 F100\nEND PGM A INCH\n")
    m = read_toolpath(path)
    np.testing.assert_allclose(m.points[-1], [25.4e-3, 0, 0])
    np.testing.assert_allclose(m.feed[-1], 10 * 25.4e-3 / 60)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("L X+10 RL F100", "--read compensation=centre"),
        ("CALL PGM OTHER", "not read"),
        ("CYCL DEF 251 POCKET ~ Q215=+0", "cycle 251"),
        ("FN 9: IF +Q1 EQU +3 GOTO LBL 5", "FN 9"),
        ("APPR LCT X+10 Y+10 R5 RL F100", "APPR"),
        ("C X+10 Y+0 F100", "DR"),
        ("CR X+10 Y+0 R+2 DR+ F100", "radius"),
        ("L X+Q77 F100", "Q77 has no value"),
        ("CC X+5 Y+0\nRND R2", "RND"),
        ("L X+10 F100\nRND R20\nL Y+10", "too large"),
        ("L X+10 F100\nRND R2\nM8\nL X+20 Y+5", "without an element behind it"),
        ("CC X+15 Y+0\nL X+10 F100\nCHF 2\nC X+20 Y+0 DR+", "controls differ"),
        ("CC X+15 Y+0\nL X+10 F100\nRND R21\nC X+20 Y+0 DR+", "too large"),
        ("PLANE AXIAL A+30", "PLANE AXIAL"),
        ("L FMAX M99", "no cycle|none is defined"),
        ("CALL LBL 7", "no such label"),
        ("L X+10 A+30 F100", "rotary axis A"),
        ("L Z+10 FMAX M91\nL X+10 F100", "Z is not known"),
        ("L X+10 F100 HUGO", "no word"),
        ("CC X+5 R3", "R means nothing with CC"),
        # The line before waits for a corner: the fault is its own, here and at the end of the file.
        ("LN X+5 Y+2 TX0 TY0 TZ1 F100\nTOOL CALL 3 Z S100", "A3, B3, C3 without TRAORI"),
        ("LN X+5 Y+2 TX0 TY0 TZ1 F100", "A3, B3, C3 without TRAORI"),
    ],
)
def test_faults_come_with_their_line(tmp_path: Path, text: str, word: str) -> None:
    refuses_each(
        "P011 P012 P013 P014 P015 P016 P017 P018 P019 P020 P021",
        rf"program.h, line \d+: .*(?:{word})",
        klartext,
        tmp_path,
        text,
    )


def test_compensated_points_as_centres_when_asked(tmp_path: Path) -> None:
    m = klartext(tmp_path, "L X+10 RL F100", compensation="centre")
    np.testing.assert_allclose(ends(m)[-1], [10, 0, 0])


@pytest.mark.parametrize(
    "text", ["TOOL CALL 1 Z S1.2.3", "TOOL CALL 1 Z S500 F1,2,3", "CYCL DEF 7.0 NULLPUNKT\nCYCL DEF 7.1 X+1.2.3"]
)
def test_what_only_looks_like_a_number_is_refused_by_line(tmp_path: Path, text: str) -> None:
    refuses_each("P018", r"program.h, line \d+", klartext, tmp_path, text)
