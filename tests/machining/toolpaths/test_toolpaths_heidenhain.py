"""Programs in Heidenhain's language: contours, polar coordinates, corners, cycles, labels, planes, faults."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from toolpath_cases import SAMPLES

from machining.toolpaths import Motions, ReadOptions, read_heidenhain, read_toolpath
from robots import InputErrors

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
    with pytest.raises(InputErrors, match=rf"program.h, line \d+: .*(?:{word})"):
        klartext(tmp_path, text)


def test_compensated_points_as_centres_when_asked(tmp_path: Path) -> None:
    m = klartext(tmp_path, "L X+10 RL F100", compensation="centre")
    np.testing.assert_allclose(ends(m)[-1], [10, 0, 0])


@pytest.mark.parametrize(
    "text", ["TOOL CALL 1 Z S1.2.3", "TOOL CALL 1 Z S500 F1,2,3", "CYCL DEF 7.0 NULLPUNKT\nCYCL DEF 7.1 X+1.2.3"]
)
def test_what_only_looks_like_a_number_is_refused_by_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputErrors, match=r"program.h, line \d+"):
        klartext(tmp_path, text)
