"""Where the table stands in a file: lines above it, units below the names, headings, rows that are none, sheets."""

from __future__ import annotations

from pathlib import Path

import pytest
from openpyxl import Workbook
from refusals import refuses

from doe.instruments.cells import read_grids
from doe.instruments.convert import convert
from doe.instruments.layout import Table, find_table
from doe.instruments.mapping_file import Settings


def table(tmp_path: Path, text: str, **more: object) -> Table | None:
    file = tmp_path / "f.csv"
    file.write_text(text, encoding="utf-8")
    return find_table(read_grids(file)[0], **more)  # type: ignore[arg-type]


def test_lines_above_the_table_and_units_below_its_names(tmp_path: Path) -> None:
    made = table(tmp_path, "Report;;\nLength unit: mm;;\n\nPose;X;A1\n-;[um];deg\nP1;1.5;2\nP2;2.5;3\n")
    assert made is not None
    assert (made.header, made.units) == (("Pose", "X", "A1"), ("", "um", "deg"))
    assert (made.lines, made.stated) == ((6, 7), ("mm",))


@pytest.mark.parametrize(
    ("line", "units"),
    [
        ("Units: mm, deg", ("mm", "deg")),
        ("Length unit = Millimeters", ("mm",)),
        ("Einheit mm", ("mm",)),
        ("Unit no: 3 in cell 4", ()),
        ("Units: mm Angle: deg", ()),
        ("no unit at all", ()),
        ("Units: inch (decimal)", ("inch",)),
    ],
)
def test_units_that_a_file_states(tmp_path: Path, line: str, units: tuple[str, ...]) -> None:
    made = table(tmp_path, f'"{line}"\n\nPose;X;Y\nP1;1.5;2\nP2;2.5;3\n')
    assert made is not None
    assert made.stated == units


def test_headings_tell_names_apart_that_stand_there_twice(tmp_path: Path) -> None:
    made = table(tmp_path, "Test;;;;\n;before;;after;\nPose;X;Y;X;Y\nP1;1;2;3;4\nP2;1;2;3;4\n")
    assert made is not None
    assert made.header == ("Pose", "before X", "before Y", "after X", "after Y")


def test_names_in_a_comment(tmp_path: Path) -> None:
    made = table(tmp_path, "// made by hand\n// x_mm,y_mm,z_mm\n1,2,3\n4,5,6\n")
    assert made is not None
    assert made.header == ("x_mm", "y_mm", "z_mm")


def test_names_that_are_given(tmp_path: Path) -> None:
    refuses("I002", r"--names", table, tmp_path, "P1,1,2\nP2,3,4\n")
    made = table(tmp_path, "P1,1,2\nP2,3,4\n", columns=("pose", "x_mm", "y_mm"))
    assert made is not None
    assert (made.header, made.lines) == (("pose", "x_mm", "y_mm"), (1, 2))
    refuses("I009", "does not fit", table, tmp_path, "P1,1,2\nP2,3,4\n", columns=("pose", "x_mm"))


def test_the_line_of_names_and_the_rows_that_are_asked_for(tmp_path: Path) -> None:
    text = "a,b,c\nP1,,\nP2,3,4\nP3,5,6\nMean,4,5\n"
    refuses("I002", r"--header LINE", table, tmp_path, text, rows=(3, 4))
    made = table(tmp_path, text, header=1, rows=(2, 4))
    assert made is not None
    assert made.lines == (2, 3, 4)
    made = table(tmp_path, text, header=1)
    assert made is not None
    assert made.lines == (2, 3, 4, 5), "no row below the names is passed over in silence"
    refuses("I002", r"--header", table, tmp_path, text, header=99, rows=(3, 4))


def test_names_that_stand_there_again_are_left_out_and_said(tmp_path: Path) -> None:
    made = table(tmp_path, "p,x,y\nA,1,2\np,x,y\nB,3,4\n")
    assert made is not None
    assert made.lines == (2, 4)
    assert any("line 3" in words for words in made.how)


@pytest.mark.parametrize(
    "text",
    ["p,x,y\nA,1,2\nB,3\n", "p,x,y\nA,1,2\nB,3,4,5\n", "x,y\n1,5,2,5\n3,5,4,5\n", "p,x,x\nA,1,2\n", "p,,x\nA,1,2\n"],
)
def test_rows_and_names_that_do_not_fit_are_refused(tmp_path: Path, text: str) -> None:
    refuses("I002 I009", r"--rows|--names", table, tmp_path, text)


def workbook(tmp_path: Path, sheets: dict[str, list[list[object]]], merged: str = "", on: str = "") -> Path:
    book = Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
        if name == on and merged:
            sheet.merge_cells(merged)
    book.save(tmp_path / "f.xlsx")
    return tmp_path / "f.xlsx"


HEAD = ["pose", "q1_deg", "q2_deg", "fz_N", "dz_mm"]
DAY1 = [HEAD, ["A", 0, 10, -100, -0.25], ["B", 5, 20, -100, -0.5]]
DAY2 = [HEAD, ["A", 0, 10, -100, -0.26], ["C", 5, 30, "-100", "-0,5"]]


def test_the_sheet_with_readings_is_found_behind_a_cover_sheet(tmp_path: Path) -> None:
    file = workbook(tmp_path, {"Cover": [["Report"], ["Load", 100]], "Readings": DAY1})
    made = convert([file])
    assert [row[0] for row in made.rows] == ["A", "B"]
    assert any("Cover" in words for how in made.files.values() for words in how)


def test_several_sheets_with_readings_are_asked_about_and_become_sessions(tmp_path: Path) -> None:
    file = workbook(tmp_path, {"Day 1": DAY1, "Day 2": DAY2})
    refuses("I002", r'--sheet "Day 1" --sheet "Day 2"', convert, [file])
    made = convert([file], Settings(sheets=("Day 1", "Day 2")))
    cells = [dict(zip(made.header, row, strict=True)) for row in made.rows]
    assert [cell["session"] for cell in cells] == ["Day 1", "Day 1", "Day 2", "Day 2"]
    assert [cell["dz_mm"] for cell in cells] == ["-0.25", "-0.5", "-0.26", "-0.5"]
    refuses("T010", "Day 3", convert, [file], Settings(sheets=("Day 3",)))


def test_merged_cells_are_headings_and_no_readings(tmp_path: Path) -> None:
    rows: list[list[object]] = [
        [None, None, None, None, "z before", None],
        ["pose", "q1_deg", "q2_deg", "fz_N", "dz_mm", "note"],
        ["A", 0, 10, -100, -0.25, "x"],
        ["A", 0, 10, -200, -0.5, "y"],
    ]
    assert convert([workbook(tmp_path, {"s": rows}, "E1:F1", "s")]).rows
    refuses("I002", "A3:A4", convert, [workbook(tmp_path, {"s": rows}, "A3:A4", "s")])


def test_options_of_texts_do_not_go_with_workbooks(tmp_path: Path) -> None:
    file = workbook(tmp_path, {"s": DAY1})
    refuses("I002", r"--encoding", convert, [file], Settings(encoding="utf-8"))
    text = tmp_path / "f.csv"
    text.write_text("a,b\n1,2\n", encoding="utf-8")
    refuses("I002", r"--sheet", convert, [text], Settings(sheets=("s",)))
