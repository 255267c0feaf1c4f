"""Where the table stands in a file: lines above it, units below the names, headings, rows that are none, sheets."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from openpyxl import Workbook
from refusals import refuses

from doe.instruments.cells import SEPARATORS, read_grids
from doe.instruments.convert import convert
from doe.instruments.decoded import decoded
from doe.instruments.figures import decimal_mark, figure, is_number
from doe.instruments.layout import Table, find_table
from doe.instruments.mapping_file import Settings
from doe.tables.workbook import Figure


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


# ------------------------------------------------------------
# Text in any encoding and with any separator gives the same cells; what is no text is refused

TEXT = "Pr\u00fcfpunkt;X [\u00b5m];Y [\u00b0]\nA;1,5;2,25\nB;3,5;4,75\n"


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("utf-8", "utf-8"),
        ("utf-8-sig", "utf-8"),
        ("utf-16", "utf-16"),
        ("utf-16-le", "utf-16-le"),
        ("utf-16-be", "utf-16-be"),
        ("cp1252", "windows-1252"),
        ("latin-1", "windows-1252"),
    ],
)
def test_the_encoding_is_found(encoding: str, name: str) -> None:
    assert decoded(TEXT.encode(encoding), "f") == (TEXT, name)


def test_an_encoding_that_is_asked_for_is_taken() -> None:
    text = "\u0442\u043e\u0447\u043a\u0430;1\n"
    assert decoded(text.encode("cp1251"), "f", "windows-1251") == (text, "windows-1251")
    for encoding in ("ebcdic", "utf-8"):
        refuses("I001", r"--encoding|not text in utf-8", decoded, text.encode("cp1251"), "f", encoding)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"PK\x03\x04rest", "workbook"),
        (b"\xd0\xcf\x11\xe0rest", "old workbook"),
        (bytes(range(1, 256)) * 3, "not text"),
        (b"a\x00b" * 10, "not text"),
    ],
)
def test_what_is_no_text_is_refused(data: bytes, says: str) -> None:
    refuses("I001", says, decoded, data, "f")


@pytest.mark.parametrize("name", SEPARATORS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_separator_is_found(tmp_path: Path, name: str, end: str) -> None:
    rows = [["pose", "x_mm", "y_mm", "z_mm"], ["A", "1.5", "2.5", "-3"], ["B", "1.25", "2", "-3.5"]]
    file = tmp_path / "f.txt"
    file.write_bytes(end.join(SEPARATORS[name].join(row) for row in rows).encode())
    (grid,) = read_grids(file)
    assert [list(row) for row in grid.rows] == rows
    assert grid.lines == (1, 2, 3)


def test_words_with_blanks_and_their_units_stay_together(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text('Name X [mm] Y (mm)\nA 1 2\n"B C" 3 4\n', encoding="utf-8")
    (grid,) = read_grids(file)
    assert grid.rows[0] == ("Name", "X [mm]", "Y (mm)")
    assert grid.rows[2] == ("B C", "3", "4")


def test_comments_are_set_apart_and_numbered_rows_are_none(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text("// units: mm\n# made by hand\nid,x,y\n#1,2,3\n#2,4,5\n", encoding="utf-8")
    (grid,) = read_grids(file)
    assert grid.comments == ((1, "units: mm"), (2, "made by hand"))
    assert grid.rows[-1] == ("#2", "4", "5")


def test_the_first_line_of_a_spreadsheet_names_the_separator(tmp_path: Path) -> None:
    file = tmp_path / "f.csv"
    file.write_text("sep=;\na;b\n1,5;2,5\n", encoding="utf-8")
    assert read_grids(file)[0].rows[-1] == ("1,5", "2,5")


@pytest.mark.parametrize("content", ["", "  \n \n", "// nothing\n", "one word\nanother\n"])
def test_a_file_without_readings_is_refused(tmp_path: Path, content: str) -> None:
    file = tmp_path / "f.txt"
    file.write_text(content, encoding="utf-8")
    refuses("I002", r"empty|no line|no separator", read_grids, file)


def test_two_separators_that_make_other_tables_are_asked_about(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text("1;2|3\n4;5|6\n", encoding="utf-8")
    refuses("I002", "--separator", read_grids, file)
    assert read_grids(file, separator="bar")[0].rows[0] == ("1;2", "3")


# ------------------------------------------------------------
# Which mark is the decimal one: by cells that have one reading only, never by what looks likely


def mark(*cells: str, asked: str | None = None) -> str:
    return decimal_mark(list(enumerate(cells, 1)), "f", asked)[0]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (("1.5", "2"), "point"),
        (("1,5", "2"), "comma"),
        (("0,123", "5"), "comma"),
        (("1234,567",), "comma"),
        (("1.234",), "point"),
        (("12", "7"), "point"),
        (("1,234.5",), "point"),
        (("1.234,5", "1.234"), "comma"),
        (("1,234,567", "1,234"), "point"),
        (("-0,250",), "comma"),
        (("1500.25",), "point"),
        (("\u22121,5",), "comma"),
        (("1'234.5",), "point"),
        (("1 234,5",), "comma"),
        (("3,5e-3",), "comma"),
    ],
)
def test_numbers_that_settle_it(cells: tuple[str, ...], expected: str) -> None:
    assert mark(*cells) == expected


@pytest.mark.parametrize(
    "cells",
    [("1,234",), ("1,234", "12,500"), ("1.5", "2,5"), ("1500.25", "1,234"), ("1,5", "1.234"), ("1,234", "7")],
)
def test_numbers_that_do_not_settle_it_are_asked_about(cells: tuple[str, ...]) -> None:
    refused = refuses("I003", "", mark, *cells)
    assert "--decimal" in str(refused) or "one decimal mark" in str(refused)


def test_what_is_asked_for_is_taken() -> None:
    assert mark("1,234", asked="comma") == "comma"
    refuses("I003", "--decimal", mark, "1", asked="dot")


@pytest.mark.parametrize(
    ("cell", "decimal", "value"),
    [
        ("1,234.5", "point", 1234.5),
        ("1.234,5", "comma", 1234.5),
        ("1,234", "comma", 1.234),
        ("1,234", "point", 1234.0),
        ("\u22122,5", "comma", -2.5),
        ("1'234.5", "point", 1234.5),
        ("12 345,5", "comma", 12345.5),
        (".5", "point", 0.5),
        ("3,5e-3", "comma", 0.0035),
        ("+7", "comma", 7.0),
    ],
)
def test_figures(cell: str, decimal: str, value: float) -> None:
    assert figure(cell, decimal) == value  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("cell", "decimal"),
    [
        ("1,5", "point"),
        ("1.5", "comma"),
        ("1,23,456", "point"),
        ("12.05.2026", "point"),
        ("1e99", "point"),
        ("5 mm", "point"),
        ("", "point"),
        ("1,2,3", "comma"),
        ("0x10", "point"),
        ("1_000", "point"),
        ("inf", "point"),
        ("\u0661", "point"),
    ],
)
def test_what_is_no_number_is_refused(cell: str, decimal: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        figure(cell, decimal)  # type: ignore[arg-type]


def test_a_number_of_a_workbook_has_no_mark_to_find() -> None:
    assert mark(Figure("1.5"), "2,5") == "comma"
    assert figure(Figure("1.5"), "comma") == 1.5


@pytest.mark.parametrize("cell", ["12.05.2026", "10:22", "A1", "", "-", "1.2.3", "2026-05-12", "1,2,3,4"])
def test_dates_and_words_are_no_numbers(cell: str) -> None:
    assert not is_number(cell)


@given(st.floats(-1e6, 1e6), st.integers(0, 8))
def test_a_number_comes_back_in_both_marks(value: float, digits: int) -> None:
    text = f"{value:.{digits}f}"
    # Digits of a text with up to eight decimals: the same text gives the same number.
    assert figure(text, "point") == float(text) == figure(text.replace(".", ","), "comma")
    with_groups = f"{value:,.{digits}f}"
    assert figure(with_groups, "point") == float(text)
