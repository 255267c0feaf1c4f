"""Traps: each word in the middle of a contour gives the right path, worked out by hand, or is refused by its line."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
import tool_path_random as random_programs
from refusals import refuses, refuses_each
from toolpath_cases import SAMPLES, apt

from machining.toolpaths import Motions, ReadOptions, read_toolpath

HEAD = "BEGIN PGM T MM\nTOOL CALL 1 Z S1000 F700\nL X+0 Y+0 Z+0 FMAX M3\nL X+10 F300\n"
# Behind each trap; its ends (10, 10, 0) are where the tool stands at Y 10.
TAIL = "\nL Y+10 R0\nEND PGM T MM\n"
RIGHT = 10, 10, 0
Step = tuple[float, ...]

# Statements between L X+10 F300 and L Y+10, and the ends (x, y, z[, feed]) that follow (10, 0, 0); an empty list: only
# L Y+10 at 300 mm/min; None: refused.
KLARTEXT: dict[str, list[Step] | None] = {
    # Certain to change nothing.
    "M126": [],
    "M127": [],
    "M90": [],
    "M94 C": None,
    "M97": [],
    "M98": [],
    "M101": [],
    "M107": [],
    "M116": [],
    "M117": [],
    "M118 X1 Y1 Z2": [],
    "M120 LA5": [],
    "M134": [],
    "M137": [],
    "M145": [],
    "M148": [],
    "M150": [],
    "M8": [],
    "M10": [],
    "M128 F1000": [],
    "M129": [],
    "TOOL DEF 7 L+10 R+3": [],
    "* - HEADING": [],
    "; L X+99": [],
    "FN 16: F-PRINT A.A / A.TXT": [],
    "BLK FORM 0.1 Z X+0 Y+0 Z-9": [],
    "CYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T0.05\nCYCL DEF 32.2 HSC-MODE:0 TA0.5": [],
    "CYCL DEF 332 TUNING ~\nQ240=1 ;MODE": [],
    "CYCL DEF 358 TUNING": [],
    "CYCL DEF 392 ATC~\n Q240=0 ;MODE~\n Q241=1 ;WEIGHT": [],
    "CYCL DEF 8.0 MIRROR IMAGE\nCYCL DEF 8.1": [],
    "CYCL DEF 11.0 SCALING\nCYCL DEF 11.1 SCL1.0": [],
    "CYCL DEF 10.1 ROT+0": [],
    "CYCL DEF 26.0 SCALING\nCYCL DEF 26.1 X1 Y1 CCX+5": [],
    "CYCL DEF 19.0 PLANE\nCYCL DEF 19.1 A+0 B+0 C+0": [],
    "CYCL DEF 13.0 ORIENTATION\nCYCL DEF 13.1 ANGLE 90": [],
    "FUNCTION MODE MILL": [],
    "TOOL CALL S2000": [],
    "TOOL CALL 1 Z S900 DL+0 DR+0": [(*RIGHT, 300)],
    "TOOL CALL 1 Z S900 DR+0.5": [(*RIGHT, 300)],
    "FUNCTION RESET TCPM": [],
    "PLANE RESET STAY": [],
    "LBL 4": [],
    "Q5 = 3 ;Q5 = 4": [],
    "TRANS DATUM RESET": [],
    # Feeds.
    "M136": None,
    "M103 F0.5": None,
    "M109": None,
    "M110": None,
    "L X+20 F MAX\nL X+30": [(20, 0, 0, 0), (30, 0, 0, 300), (30, 10, 0, 300)],
    "L X+20 FAUTO": [(20, 0, 0, 700), (20, 10, 0, 700)],
    "L X+20 F100 M128 F900": [(20, 0, 0, 100), (20, 10, 0, 100)],
    "L X+20 FZ0.1": None,
    "L X+20 FU0.1": None,
    "L X+20 FT2": None,
    "L X+20 F100 FMAX": None,
    "C X+10 Y+10 DR+ FMAX": None,
    "L X+20\nRND R2 F50\nL Y+5": [(18, 0, 0, 300), (20, 2, 0, 50), (20, 5, 0, 300), (20, 10, 0, 300)],
    "L X+20\nCHF 2 F50\nL Y+5": [(18, 0, 0, 300), (20, 2, 0, 50), (20, 5, 0, 300), (20, 10, 0, 300)],
    # Words that other controls have, or that have no meaning here.
    "L X+20 R5": None,
    "L X+20 I5 J5": None,
    "L X+20 PR+5": None,
    "L X+20 NX+1 NY+0 NZ+0": None,
    "L X+20 DR+": None,
    "L X+20 HUGO": None,
    "L X+20 X+30": None,
    "L X+20 IX+30": None,
    "L XY5": None,
    "L X1E2": None,
    "L X+20 (Y+5)": None,
    "L X+20 (NOTE": [(20, 0, 0), (20, 10, 0)],
    "L X+20 (Y+5) Z+3": None,
    "CC X+1 Y+2 Z+3": None,
    "CC X+10 Y+5 F100": None,
    "CC X+10 Y+5 M3": None,
    "CR X+20 Y+0 R+9 PA+5 DR+": None,
    "CC X+10 Y+5\nC X+10 Y+10 R+5 DR+": None,
    "CC X+0 Y+0\nLP PR+20 PA+0 X+5": None,
    "CC X+0 Y+0\nLP PR+20": None,
    "LN X+20 TX+0 TZ+1": None,
    "M128\nLN X+20 Y+0 Z+0 TX+0 TZ+1": None,
    "L X+20 R+": None,
    "L X+20 RL": None,
    "APPR LT X+20 Y+0 LEN5": None,
    "DEP LCT X+20 Y+0 R5": None,
    "FPOL X+0 Y+0": None,
    "FL X+20": None,
    "G1 X+20": None,
    "M777": None,
    "M25": None,
    # What moves coordinates.
    "M130": None,
    "M138 A C": None,
    "M114": None,
    "M124 T0.1": None,
    "M112 T0.01 A10": None,
    "M142": None,
    "M143": None,
    "M144": None,
    "M197": None,
    "CYCL DEF 8.1 X": None,
    "CYCL DEF 11.1 SCL0.99": None,
    "CYCL DEF 26.1 X1.01": None,
    "CYCL DEF 19.1 A+30 C+0": None,
    "CYCL DEF 7.1 #5": None,
    "CYCL DEF 7.1 X+5": [(10, 10, 0, 300)],
    "CYCL DEF 7.1 A+5": None,
    "CYCL DEF 7.0 SHIFT X+5": None,
    "CYCL DEF 7.2 Y+5": [(10, 15, 0, 300)],
    "CYCL DEF 10.1 ROT+90\nCYCL DEF 7.1 X+5": None,
    "CYCL DEF 10.1 ROT+90 X+5": None,
    "TRANS DATUM AXIS X+0 Y+5": [(10, 15, 0, 300)],
    "TRANS DATUM TABLE TABLINE 3": None,
    "TRANS MIRROR AXIS X": None,
    "CYCL DEF 247 DATUM SETTING ~\nQ339=+2": None,
    "CYCL DEF 247 DATUM SETTING ~\nQ339=+2 ~\nQ340=+1": None,
    "TOOL CALL 2 Z S900 DL+0.1": None,
    "TOOL CALL 2 X S900": None,
    "TOOL CALL 2 Z S900 XYZ": None,
    "PLANE AXIAL A+30 STAY": None,
    "PLANE EULER EULPR+0 STAY": None,
    "PLANE SPATIAL SPA+30 STAY": None,
    "PLANE SPATIAL SPA+30 SPB+0 SPC+0 TURN HUGO": None,
    "PLANE RELATIV SPB+5 TURN": None,
    "FUNCTION TCPM F CONT AXIS POS": None,
    "FUNCTION TCPM F TCP AXIS POS REFPNT CENTER-CENTER": None,
    "FUNCTION PARAXMODE X Y W": None,
    # What is left out.
    "CALL PGM ABC": None,
    "SEL PGM ABC": None,
    "CALL LBL 9": None,
    "CYCL CALL": None,
    "CYCL CALL PAT": None,
    "CYCL DEF 12.1 PGM ABC": None,
    "FN 9: IF +1 EQU +1 GOTO LBL 4": None,
    "FN 14: ERROR= 1000": None,
    "FN 18: SYSREAD Q1 = ID20 NR1": None,
    "FN 20: WAIT FOR": None,
    "SEL TABLE ABC.D": None,
    "TCH PROBE 400": None,
    "CYCL DEF 251 POCKET ~\nQ215=+0": None,
    "L X+20 M99": None,
    "END PGM T MM\nL X+20": None,
    "Q1 = MAX": None,
    "L X+Q120": None,
    "L A+Q120": None,
    "Q1 = -2 ^ 2": None,
    # A drill cycle at (10, 0): down to 2 above, to -5 and out.
    "CYCL DEF 200 D ~\nQ200=2 ~\nQ201=-5 ~\nQ206=90 ~\nQ202=9 ~\nQ210=0 ~\nQ203=0 ~\nQ204=2 ~\nQ211=0\nCYCL CALL": [
        (10, 0, 2, 0),
        (10, 0, -5, 90),
        (10, 0, 2, 0),
        (10, 10, 2, 300),
    ],
    "CYCL DEF 201 R ~\nQ200=2 ~\nQ201=-5 ~\nQ206=90 ~\nQ208=40 ~\nQ203=0 ~\nQ204=2 ~\nQ211=0\nCYCL CALL": [
        (10, 0, 2, 0),
        (10, 0, -5, 90),
        (10, 0, 2, 40),
        (10, 10, 2, 300),
    ],
    "CYCL DEF 200 D ~\nQ200=2 ~\nQ201=-5 ~\nQ206=90 ~\nQ202=9 ~\nQ203=0 ~\nQ204=2 ~\nQ395=1\nCYCL CALL": None,
    "CYCL DEF 200 D ~\nQ200=2 ~\nQ201=-5 ~\nQ206=90 ~\nQ202=9 ~\nQ203=0 ~\nQ204=2 ~\nQ333=1\nCYCL CALL": None,
    "CYCL DEF 200 D ~\nQ200=2 HUGO ~\nQ201=-5 ~\nQ206=90 ~\nQ202=9 ~\nQ203=0 ~\nQ204=2\nCYCL CALL": None,
    # Arcs.
    "L X+20\nCC X+20 Y+10\nC X+30 Y+10 DR+\nCT X+20 Y+20": [(20, 0, 0), (30, 10, 0), (20, 20, 0), (20, 10, 0)],
    "CC X+10 Y+10\nC DR+\nCT X+20 Y+10": [(10, 0, 0), (20, 10, 0), (20, 10, 0)],
    "CC X+10 Y+10\nCTP PR+10 PA+0": [(20, 10, 0), (20, 10, 0)],
    "CR X+20 Y+10 R+10 DR+": [(20, 10, 0), (20, 10, 0)],
    "CC X+10 Y+10\nCP IPA+90 IZ-2 DR+": [(20, 10, -2), (20, 10, -2)],
    "CC X+10 Y+10\nCP IPA+90 DR-": None,
    "CC Y+0 Z+5\nL X+20\nRND R2\nL Y+5\nLP PR+5 PA+0": [(18, 0, 0), (20, 2, 0), (20, 5, 0), (20, 5, 5), (20, 10, 5)],
}

ALWAYS = "\nGOTO/10,10,0\n"
APT: dict[str, list[Step] | None] = {
    # Certain to change nothing.
    "PPRINT/GOTO/1,2,3": [],
    "INSERT/STOCK SIZE X40. Y267. Z40.": [],
    "INSERT/(G0 X5)": [],
    "INSERT/M8": [],
    "INSERT/N10 M9": [],
    "PREFUN/64": [],
    "AUXFUN/8": [],
    "CUTCOM/LEFT": [],
    "CUTCOM/OFF": [],
    "MULTAX/ON": [],
    "LOADTL/1,ADJUST,1": [],
    "SELECT/TOOL,3": [],
    "INTOL/0.01": [],
    "CLAMP/AUTO": [],
    "COOLNT/ON": [],
    "PIVOTZ/200": [],
    "HEAD/1": [],
    "MACHIN/MILL,3": [],
    "LEADER/50": [],
    "OPSKIP/OFF": [],
    "MODE/MILL": [],
    "SPINDL/RPM,900,CLW,RANGE,2": [],
    "SPINDL/900,RPM,MAXRPM,4000": [],
    "$$ GOTO/1,2,3": [],
    "MAXDPM/100": [],
    "TRNTYP/WORLD": [],
    # What moves or turns coordinates.
    "ROTABL/CLW,90": None,
    "ROTATE/BAXIS,ABSOL,90": None,
    "ROTHED/AAXIS,45": None,
    "TRACUT/LAST": None,
    "COPY/1,XYROT,90,2": None,
    "TRANS/5,0,0": None,
    "ORIGIN/5,0,0": None,
    "MSYS/5,0,0,1,0,0,0,1,0": None,
    "CSYS/1,0,0,5,0,1,0,0,0,0,1,0": None,
    "TRNTYP/WORLD,5,0,0": None,
    "TRNTYP/MATRX": None,
    "PREFUN/54": None,
    "PREFUN/91": None,
    "PREFUN/68": None,
    "AUXFUN/77": None,
    "OFSTNO/2": None,
    "MIRROR/XAXIS": None,
    "SCALE/2": None,
    "SYN/X,GOTO": None,
    "MODE/INCR": None,
    "MODE/TURN": None,
    "TURRET/2": None,
    "CUTCOM/NORMDS": None,
    "CUTCOM/CONTCT": None,
    "LOADTL/2,MODIFY": None,
    "LOADTL/2,XOFF,5": None,
    "SETOOL/1,2,3": None,
    "UNITS/INCHES": None,
    "SET/MODE,INCR": None,
    "MCSYS/NUM,2,POINT,5,0,0,VECTOR,1,0,0,VECTOR,0,1,0": None,
    # What moves the tool, or is left out.
    "INSERT/G0 G53 Z0": None,
    "INSERT/M98 P100": None,
    "INSERT/X5": None,
    "INSERT/CALL LBL 5": None,
    "INSERT/CYCLE800()": None,
    "INSERT/L Z+0 R0 FMAX M91": None,
    "INSERT/TRANS X10": None,
    "RAPID/ZAXIS": None,
    "RAPID/FROM,1": None,
    "GOTO/5,5,0,FED": None,
    "CALL/SUB": None,
    "MACRO/A": None,
    "TERMAC": None,
    "JUMPTO/A": None,
    "P1 = POINT/1,2,3": None,
    "OPSKIP/ON": None,
    "CLEARP/XYPLAN,50": None,
    "CLRSRF/5": None,
    "SAFETY/10": None,
    "THREAD/TURN,5": None,
    "PROBE/X,5": None,
    "FINI": None,
    "WIBBLE": None,
    "GODLTA/1,2": None,
    "NURBS/": None,
    "INDEX/3": None,
    "PPFUN/5,3": None,
    "APPLY/LASER": None,
    "THICK/0.5": None,
    "POCKET/5": None,
    # Feeds.
    "FEDRAT/INVERS,5": None,
    "FEDRAT/FPT,0.1": None,
    "FEDRAT/RAPID": None,
    "FEDRAT/100,MMPM,AUTO": None,
    "FEDRAT/100,200": None,
    "FEDRAT/SCALE,50": None,
    "FEDRAT/100": [(*RIGHT, 100)],
    "FEDRAT/MMPR,0.1": [(*RIGHT, 100)],
    "SPINDL/500,600": None,
    "SPINDL/500,HUGO": None,
    # Motion.
    "GODLTA/5": [(10, 0, 5), (10, 10, 0)],
    "GODLTA/5,1,0": [(15, 1, 0), (10, 10, 0)],
    "RAPID\nGOTO/20,0,0": [(20, 0, 0, 0), (*RIGHT, 300)],
    "CIRCLE/10,5,0,0,0,1,5": [(10, 10, 0)],
    "CIRCLE/10,5,0,0,0,1,5\nCYCLE/OFF": None,
    "FROM/5,5,5": [(5, 5, 5, 0), (*RIGHT, 300)],
    "CYCLE/DRILL,FEDTO,5,RAPTO,2\nGOTO/10,0,0\nCYCLE/OFF": [
        (10, 0, 2, 0),
        (10, 0, -5, 300),
        (10, 0, 2, 0),
        (*RIGHT, 300),
    ],
    "CYCLE/DRILL,FEDTO,5,RAPTO,2,SLOWFD,3": None,
    "CYCLE/DRILL,FEDTO,5,RAPTO,2,MMPM": None,
    "CYCLE/DRILL,FEDTO,5,RAPTO,2,STEP,1": None,
    "CYCLE/DRILL,FEDTO,5,RAPTO,2,IPM,3,MMPM,80": None,
    "CYCLE/BORE,FEDTO,5,RAPTO,2,ORIENT,90": None,
}


def steps(m: Motions, from_move: int) -> list[tuple[float, ...]]:
    """Ends mm of each line's moves one by one, arcs by their last point alone, and the feed mm/min (0: rapid)."""
    out: list[tuple[float, ...]] = []
    for k in range(from_move, m.n):
        if (
            k + 1 < m.n
            and m.line[k + 1] == m.line[k]
            and not m.rapid[k]
            and np.linalg.norm(m.points[k + 1] - m.points[k]) < 1e-3
        ):
            continue
        x, y, z = np.round(m.points[k] * 1e3, 6).tolist()
        out.append((x, y, z, 0.0 if m.rapid[k] else round(float(m.feed[k]) * 6e4, 6)))
    return out


def held(found: list[tuple[float, ...]], expected: list[Step]) -> None:
    assert len(found) == len(expected)
    for got, wanted in zip(found, expected, strict=True):
        np.testing.assert_allclose(got[: len(wanted)], wanted, atol=1e-6)


@pytest.mark.parametrize("text", KLARTEXT)
def test_words_of_heidenhain_programs(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.h"
    path.write_text(HEAD + text + TAIL)
    expected = KLARTEXT[text]
    if expected is None:
        last = 5 + text.count("\n")
        info = refuses_each("P011 P012 P013 P014 P015 P016 P017 P018 P019 P020 P021", "", read_toolpath, path)
        lines = [int(str(e).split("line ")[1].split(":")[0]) for e in info.errors]
        # A fault of what has to follow (a corner, a move in another frame) may have the line behind it.
        assert 5 <= min(lines) <= last + 1
        return
    held(steps(read_toolpath(path), 2), expected or [(*RIGHT, 300)])


@pytest.mark.parametrize("text", APT)
def test_words_of_apt_files(tmp_path: Path, text: str) -> None:
    head = "SPINDL/1000,RPM,CLW\nFEDRAT/300,MMPM\nRAPID\nGOTO/0,0,0,0,0,1\nGOTO/10,0,0\n"
    expected = APT[text]
    if expected is None:
        info = refuses_each("P003 P004 P011 P012 P013 P019 P020", "", apt, tmp_path, head + text + ALWAYS)
        lines = [int(str(e).split("line ")[1].split(":")[0]) for e in info.errors]
        assert 7 <= min(lines) <= 8 + text.count("\n")
        return
    held(steps(apt(tmp_path, head + text + ALWAYS), 2), expected or [(*RIGHT, 300)])


def test_a_feed_or_a_point_that_m_functions_change_is_never_left_out(tmp_path: Path) -> None:
    path = tmp_path / "t.h"
    path.write_text(HEAD + "L X+20 M25" + TAIL)
    assert read_toolpath(path, options=ReadOptions(unknown_motion="report")).n == 4
    path.write_text(HEAD + "L X+20 F0.2 M136" + TAIL)
    refuses_each("P019", "line 5: M136", read_toolpath, path, options=ReadOptions(unknown_motion="report"))


def test_programs_as_hypermill_writes_them() -> None:
    """Tuning cycles, Q120 to Q122 behind PLANE, cycle 7 before PLANE RESET, a slash before a block number."""
    m = read_toolpath(SAMPLES / "hypermill.h")
    # Rz(90) Rx(90) z is the part's x; the plane's X and Y are the part's Y and Z, from the datum (150, 0, -25).
    np.testing.assert_allclose(m.axes, np.tile([1.0, 0.0, 0.0], (m.n, 1)), atol=1e-12)
    bottoms = m.points[(~m.rapid)] * 1e3
    np.testing.assert_allclose(bottoms, [[143.75, 10, -30], [143.75, -22, -26]], atol=1e-9)
    np.testing.assert_allclose(m.feed[~m.rapid], 50e-3 / 60)


def test_a_plane_with_its_axes_as_numbers_needs_the_machine(tmp_path: Path) -> None:
    path = tmp_path / "t.h"
    turned = "PLANE SPATIAL SPA+0 SPB+45 SPC+0 STAY\nL {} R0 FMAX\nL X+0 Y+0 Z+10 FMAX\nL Z+0 F100"
    path.write_text(HEAD + turned.format("B+45 C+0") + "\nEND PGM T MM\n")
    m = read_toolpath(path, options=ReadOptions(rotary="table-BC"))
    np.testing.assert_allclose(m.points[-1], [0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(m.axes[-1], [np.sqrt(0.5), 0, np.sqrt(0.5)], atol=1e-12)
    for words, rotary in (("B+45 C+0", "none"), ("B+40 C+0", "table-BC"), ("B+45", "head-AC")):
        path.write_text(HEAD + turned.format(words) + "\nEND PGM T MM\n")
        refuses_each("P013 P014", "line 6: rotary ax", read_toolpath, path, options=ReadOptions(rotary=rotary))


def test_spatial_angles_of_tcpm(tmp_path: Path) -> None:
    path = tmp_path / "t.h"
    path.write_text(HEAD + "FUNCTION TCPM F TCP AXIS SPAT PATHCTRL AXIS\nL X+20 A+0 B+45 C+90\nL A+0 B+0 C+0" + TAIL)
    m = read_toolpath(path)
    # Rz(90) Ry(45) z, then upright at the same place.
    np.testing.assert_allclose(m.axes[2:4], [[0, np.sqrt(0.5), np.sqrt(0.5)], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(m.points[2:4] * 1e3, [[20, 0, 0], [20, 0, 0]], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "language"),
    [
        ("mill.ls", "FANUC"),
        ("mill.jbi", "Yaskawa"),
        ("mill.mod", "ABB"),
        ("mill.src", "KUKA"),
        ("mill.script", "Universal"),
    ],
)
@pytest.mark.parametrize("suffix", ["", ".nc"])
def test_robot_programs_are_named(tmp_path: Path, name: str, language: str, suffix: str) -> None:
    path = tmp_path / (name + suffix)
    path.write_bytes((SAMPLES / "robot_programs" / name).read_bytes())
    refuses("P023", f"a robot program of {language}.*no tool path.*stiffarm post", read_toolpath, path)


@pytest.mark.parametrize("language", ["heidenhain", "apt"])
def test_random_programs_as_a_second_interpreter_reads_them(language: str) -> None:
    """Some of those of benchmarks/toolpaths/tool_path_random.py."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = [random_programs.judged(seed, language, folder) for seed in range(10**6, 10**6 + 200)]
    assert [what for outcome, what in found if outcome == "wrong"] == []
    assert sum(outcome == "equal" for outcome, _ in found) > 100
    assert sum(outcome == "refused" for outcome, _ in found) > 20
