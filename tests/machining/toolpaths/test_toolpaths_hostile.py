"""Tool path files with numbers, repeats and sizes that nobody meant: one clear error with the line, or the answer."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses, refuses_each

from machining.toolpaths import ReadOptions, read_toolpath
from robots import InputError

NINES = "9" * 400
START = "G21 G90 G0 X0 Y0 Z0\n"
HEAD = "UNITS/MM\nGOTO/0,0,0\n"
MOTIONS = (
    "# stiffarm motions 1\n{before}x_mm,y_mm,z_mm,tx,ty,tz,rapid,feed_mm_per_min,line,tool,spindle_rpm,dwell_s,"
    "operation\n{row}\n"
)
PATH = "x_mm,y_mm,z_mm,nx,ny,nz,feed_mm_per_min\n"
pytestmark = pytest.mark.filterwarnings("error")


def refused(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_toolpath(folder / name)
    assert len(str(caught.value)) < 3000
    return str(caught.value)


@pytest.mark.parametrize(
    "word", ["G", "M", "T", "N", "O", "X", "A", "F", "S", "P", "L", "G2 X1 I", "G2 X1 R", "G83 Z-1 R1 Q", "G81 R1 Z-"]
)
@pytest.mark.parametrize("digits", [NINES, "9" * 300, "9" * 25])
def test_words_of_many_digits_are_refused_with_their_line(tmp_path: Path, word: str, digits: str) -> None:
    message = refused(tmp_path, "p.nc", f"{START}G1 X1 F100\n{word}{digits}\nM30\n")
    assert "line 3: " in message
    assert "is no word of G-code" in message


@pytest.mark.parametrize("word", ["G1.04", "G43.45", "M3.5", "T1.5"])
def test_a_code_is_not_cut_to_another_one(tmp_path: Path, word: str) -> None:
    assert f"'{word}' is no word of G-code" in refused(tmp_path, "p.nc", f"{START}{word} X5\nM30\n")


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("G1 X10000001 F100", "coordinates, mm"),
        ("G1 X1 F60000001", "feed, mm/min"),
        ("G1 X1 F0.00001", "feed, mm/min"),
        ("S999999999 M3\nG1 X1 F100", "spindle speed"),
        ("G1 X1 F100\nG4 X9999999", "dwell"),
        ("G1 X1 F100\nG4 X900000\nG4 X900000", "dwell"),
        ("G2 X0 I900000000 F100", "an end or a centre beyond"),
        ("G1 X1 F0", "more than 0"),
        ("G83 X1 Y1 Z-5 R1 Q0 F100", "without its peck"),
        ("G83 X1 Y1 Z-5 R1 Q0.00000001 F100", "more than 10000 pecks"),
    ],
)
def test_numbers_that_cannot_be_are_refused_with_their_line(tmp_path: Path, block: str, message: str) -> None:
    found = refused(tmp_path, "p.nc", f"{START}{block}\nM30\n")
    assert message in found
    assert ", line " in found


@pytest.mark.parametrize("line", ["WHILE [#1 LT 1E9] DO1", "M98 P1000 L999999", "O100 REPEAT [1000000000]"])
def test_loops_and_subprograms_are_not_run(tmp_path: Path, line: str) -> None:
    assert "line 2" in refused(tmp_path, "p.nc", f"{START}{line}\nM30\n")


def test_repeated_cycles_are_refused_before_their_moves_are_made(tmp_path: Path) -> None:
    (tmp_path / "p.nc").write_text(f"{START}G91 G83 X1 Y1 Z-5 R1 Q0.0006 L9999 F100\nM30\n")
    started = time.perf_counter()
    refuses("P005", "number of moves", read_toolpath, tmp_path / "p.nc")
    # 300 million moves would take hours.
    assert time.perf_counter() - started < 60.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("GOTO/1e308,0,0", "where a number belongs"),
        ("GOTO/1e308,0,0\nCIRCLE/5,0,0,0,0,1,5\nGOTO/10,0,0", "where a number belongs"),
        ("GOTO/99999999,0,0", "coordinates, mm"),
        ("GOTO/1,0,0,1e308,1e308,1e308", "where a number belongs"),
        ("GOTO/1,0,0,1e-320,0,0", "tool axis"),
        ("FEDRAT/1e308,IPM\nGOTO/1,0,0", "FEDRAT"),
        ("FEDRAT/1e-320,MMPM\nGOTO/1,0,0", "feed, mm/min"),
        ("SPINDL/9e9,CLW\nFEDRAT/9e9,MMPR\nGOTO/1,0,0", "spindle speed"),
        ("DELAY/600000\nDELAY/600000", "dwell"),
        ("CIRCLE/5,0,0,1e200,1e200,1,5\nGOTO/10,0,0", "where a number belongs"),
        ("CIRCLE/5,0,0,0,0,1,5,TIMES,1e9\nGOTO/10,0,0", "TIMES"),
        ("GODLTA/1e308\nGODLTA/1e308", "where a number belongs"),
        ("CYCLE/DEEP,FEDTO,20,RAPTO,3,STEP,1e-12\nGOTO/1,0,0", "more than 10000 pecks"),
        ("COPY/1,TRANSL,1,0,0,1000000000", "sounds like a motion"),
    ],
)
def test_apt_with_such_numbers(tmp_path: Path, text: str, message: str) -> None:
    found = refused(tmp_path, "p.cls", f"{HEAD}{text}\nFINI\n")
    assert message in found
    assert ", line " in found


@pytest.mark.parametrize(
    ("before", "row", "message"),
    [
        ("", "0,0,0,0,0,1,0,100,1e300,0,,0,0", "column line"),
        ("", "0,0,0,0,0,1,0,100,1,1e300,,0,0", "column tool"),
        ("", "0,0,0,1e308,1e308,1e308,0,100,1,0,,0,0", "column tx"),
        ("", "1e300,0,0,0,0,1,0,100,1,0,,0,0", "column x_mm"),
        ("", "0,0,0,0,0,1,7,100,1,0,,0,0", "column rapid"),
        ("", "0,0,0,0,0,1,0,-1,1,0,,0,0", "column feed_mm_per_min"),
        ("", "0,0,0,0,0,1,0,100,1,0,1e308,0,0", "column spindle_rpm"),
        ("", "0,0,0,0,0,1,0,100,1,0,,1e300,0", "column dwell_s"),
        (f"#tool,{'9' * 5000},t,,,\n", "0,0,0,0,0,1,0,100,1,0,,0,0", "tool number"),
        (f"#tool,1,t,{NINES},,\n", "0,0,0,0,0,1,0,100,1,0,,0,0", "sizes of a tool"),
    ],
)
def test_motions_with_such_numbers(tmp_path: Path, before: str, row: str, message: str) -> None:
    assert message in refused(tmp_path, "m.csv", MOTIONS.format(before=before, row=row))


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("1e308,0,0,0,0,1,100", "column x_mm"),
        ("0,0,0,1e308,1e308,1e308,100", "column nx"),
        ("0,0,0,1e-320,0,0,100", "normal of length zero"),
        ("0,0,0,0,0,1,1e-320", "column feed_mm_per_min"),
        ("0,0,0,0,0,1,1e308", "column feed_mm_per_min"),
        (f"{NINES},0,0,0,0,1,100", "column x_mm"),
    ],
)
def test_paths_with_such_numbers(tmp_path: Path, row: str, message: str) -> None:
    assert message in refused(tmp_path, "p.csv", f"{PATH}{row}\n1,0,0,0,0,1,100\n")


def test_many_bad_rows_are_counted(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text(PATH + "a,b,c,d,e,f,g\n" * 5000)
    caught = refuses_each("P008", "35000 problem", read_toolpath, tmp_path / "p.csv")
    assert len(str(caught).splitlines()) == 22


def test_many_unknown_columns_are_counted(tmp_path: Path) -> None:
    message = refused(tmp_path, "p.csv", ",".join(f"c{i}" for i in range(200_000)) + "\n1\n2\n")
    assert "and 199988 more" in message


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p.nc", f"{START}G1 X5 F100\nM30\n"),
        ("p.nc", f"%\n{START}G1 X5 F100\nM30\n"),
        ("p.cls", "UNITS/MM\nGOTO/0,0,0\nGOTO/5,0,0\nFINI\n"),
        ("p.csv", PATH + "0,0,0,0,0,1,\n5,0,0,0,0,1,100\n"),
        ("p.csv", MOTIONS.format(before="", row="0,0,0,0,0,1,0,100,1,0,,0,0\n5,0,0,0,0,1,0,100,1,0,,0,0")),
    ],
)
def test_a_byte_order_mark_changes_nothing(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text("\ufeff" + text, encoding="utf-8")
    found = read_toolpath(tmp_path / name, options=ReadOptions(max_moves=10))
    np.testing.assert_array_equal(found.points, [[0.0, 0.0, 0.0], [0.005, 0.0, 0.0]])
    assert not any("not read" in str(note) for note in found.notes)
